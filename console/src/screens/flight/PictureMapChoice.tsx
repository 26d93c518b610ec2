import { useTranslation } from "react-i18next";

/** Whether the pictures that look down lie on the map, and how strongly. */
export function PictureMapChoice({ count, opacity, change }: {
  count: number;
  opacity: number | null;
  change: (opacity: number | null) => void;
}) {
  const { t } = useTranslation();
  return (
    <div className="picture-map">
      <label>
        <input
          type="checkbox"
          checked={opacity !== null}
          onChange={(event) => change(event.target.checked ? 1 : null)}
        />
        <span>{t("flights.pictures_on_map", { count })}</span>
      </label>
      {opacity !== null && (
        <input
          type="range"
          min={0.1}
          max={1}
          step={0.05}
          value={opacity}
          aria-label={t("flights.pictures_opacity")}
          onChange={(event) => change(Number(event.target.value))}
        />
      )}
    </div>
  );
}

import { useTranslation } from "react-i18next";
import { Button } from "../controls/Button";
import { NumberField } from "../controls/NumberField";
import type { Corner } from "../planning/outline";

/** Place of the corner or the entry that is selected, in degrees. */
export function CornerForm({ title, corner, move, remove, removeText, canRemove = true }: {
  title: string;
  corner: Corner;
  move: (corner: Corner) => void;
  remove: () => void;
  removeText: string;
  canRemove?: boolean;
}) {
  const { t } = useTranslation();
  const [latitude, longitude] = corner;
  const field = (label: string, value: number, limit: number, set: (degrees: number) => void) => (
    <NumberField
      label={label}
      value={value}
      shown={String(value)}
      enter={(degrees) => {
        if (degrees === null || Number.isNaN(degrees)) return value;
        if (Math.abs(degrees) > limit) return NaN; // Not taken: the field shows the present place again
        set(degrees);
        return degrees;
      }}
    />
  );
  return (
    <fieldset className="corner-form">
      <legend>{title}</legend>
      <div className="form-line">
        {field(t("parameter.latitude"), latitude, 90, (degrees) => move([degrees, longitude]))}
        {field(t("parameter.longitude"), longitude, 180, (degrees) => move([latitude, degrees]))}
        <Button icon="remove" disabled={!canRemove} onClick={remove}>{removeText}</Button>
      </div>
    </fieldset>
  );
}

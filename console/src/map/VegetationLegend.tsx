import { useTranslation } from "react-i18next";

/** What the colours of a vegetation index mean. */
export function VegetationLegend() {
  const { t } = useTranslation();
  return (
    <figure className="vegetation-legend">
      <i />
      <figcaption>
        <span>0</span>
        <span>{t("map.vegetation_index")}</span>
        <span>1</span>
      </figcaption>
    </figure>
  );
}

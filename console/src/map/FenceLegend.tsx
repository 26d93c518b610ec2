import { useTranslation } from "react-i18next";
import { useUnits } from "../app/preferences";
import type { Fence } from "../planning/fence";

/** What the lines of fences mean, and below which heights their plans fly. */
export function FenceLegend({ fences }: { fences: readonly Fence[] }) {
  const { t } = useTranslation();
  const units = useUnits();
  const heights = fences.flatMap(({ highest_m }) => (typeof highest_m === "number" ? [highest_m] : []));
  const texts = [...new Set(heights.map((highest_m) => units.height(highest_m)))];
  const hasExclusion = fences.some(({ exclusion }) => exclusion.length > 0);
  const hasInclusion = fences.some(({ inclusion }) => inclusion.length > 0);
  return (
    <ul className="fence-legend">
      {hasInclusion && <li data-kind="inclusion">{t("fence.inclusion")}</li>}
      {hasExclusion && <li data-kind="exclusion">{t("fence.exclusion")}</li>}
      {texts.length > 0 && <li>{t("fence.highest", { height: texts.join(", ") })}</li>}
    </ul>
  );
}

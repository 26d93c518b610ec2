import { useTranslation } from "react-i18next";
import type { PlannedSurvey } from "../api/types";
import { useUnits } from "../app/preferences";

/** What a survey takes, as the edge server has planned it. */
export function SurveyFigures({ survey, isLoading }: { survey: PlannedSurvey | null; isLoading: boolean }) {
  const { t } = useTranslation();
  const units = useUnits();
  const figures: [string, string][] = [
    ["area", units.area(survey?.area_m2)],
    ["lines", units.count(survey?.lines)],
    ["pictures", units.count(survey?.pictures)],
    ["time", survey === null ? "–" : units.duration(survey.duration_s * 1000)],
    ["batteries", units.count(survey?.flights)],
    ["distance", units.distance(survey?.length_m)],
  ];
  return (
    <section className="survey-preview" aria-label={t("survey.preview")} aria-busy={isLoading}>
      <dl className="survey-figures">
        {figures.map(([name, text]) => (
          <div key={name}>
            <dt>{t(`survey.${name}`)}</dt>
            <dd>{text}</dd>
          </div>
        ))}
      </dl>
      <p className="visually-hidden" role="status">{isLoading ? t("survey.calculating") : ""}</p>
    </section>
  );
}

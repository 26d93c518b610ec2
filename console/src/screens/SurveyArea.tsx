import { useTranslation } from "react-i18next";
import { useUnits } from "../app/preferences";
import { Button } from "../controls/Button";
import { FEWEST_CORNERS, fieldArea_m2, type Outline, type Ring } from "../planning/outline";
import { CornerForm } from "./CornerForm";
import { StepButtons } from "./EditingState";
import type { Corners } from "./use_corners";
import type { Steps } from "./use_steps";

/** The part of the field that is covered: its chosen corner, and the way back to the whole field. */
export function SurveyArea<State>({ ring, field, isWhole, corners, steps, takeWhole }: {
  ring: Ring;
  field: Outline;
  isWhole: boolean;
  corners: Corners;
  steps: Steps<State>;
  takeWhole: () => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const { selected } = corners;
  const corner = selected === null ? undefined : ring[selected];
  return (
    <section className="survey-area" aria-label={t("survey.part")}>
      <p role="status">
        <strong>
          {isWhole ? t("survey.covers_whole") : t("survey.covers_part", { whole: units.area(fieldArea_m2(field)) })}
        </strong>
      </p>
      <p className="muted small">{t("survey.part_hint")}</p>
      <div className="actions">
        <StepButtons editing={steps} />
        {!isWhole && (
          <Button icon="fit" onClick={takeWhole}>{t("survey.take_whole")}</Button>
        )}
      </div>
      {corner !== undefined && selected !== null && (
        <CornerForm
          title={t("fields.corner", { number: selected + 1 })}
          corner={corner}
          move={(to) => corners.move(selected, to)}
          remove={() => corners.remove(selected)}
          removeText={t("fields.remove_corner")}
          canRemove={ring.length > FEWEST_CORNERS}
        />
      )}
    </section>
  );
}

import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { createSurvey, dispatchPlan } from "../api/resources";
import type { PlannedSurvey, StoredField, SurveyOrder } from "../api/types";
import { go } from "../app/route";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { Segments } from "../controls/fields";
import { HoldButton } from "../controls/HoldButton";
import { Icon } from "../controls/Icon";
import { ErrorNotice, Notice } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { asRequestError } from "../live/use_resource";
import { departing, withDepartures, type Departure } from "../planning/survey";
import { exclusionsElsewhere, fenceOfField } from "../planning/fence";
import { Checks } from "./Checklist";

/** The checklist of each vehicle of a survey, and whether it flies now or waits. */
export function SurveyDeparture({ field, fields, survey, order, keyFor, close }: {
  field: StoredField;
  /** All of the farm: their no-fly areas are looked at too. */
  fields: readonly StoredField[];
  survey: PlannedSurvey;
  order: SurveyOrder;
  /** The idempotency key of an order: the same order again makes no second survey. */
  keyFor: (order: SurveyOrder) => string;
  close: () => void;
}) {
  const { t } = useTranslation();
  const [held, setHeld] = useState<ReadonlySet<number>>(new Set());
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  const [stored, setStored] = useState<string | null>(null);
  const first = survey.plans[0]?.missions ?? [];
  const later = survey.flights - first.length;
  const departureOf = (id: number): Departure => (held.has(id) ? "hold" : "now");
  const fence = fenceOfField(field);
  const elsewhere = exclusionsElsewhere(fields, field.id);
  const fly = async () => {
    const wanted = withDepartures(order, first.map((one) => departureOf(one.vehicle_id)));
    const { plans } = await createSurvey(wanted, keyFor(wanted));
    const flown = departing(plans, (id) => departureOf(id) === "now");
    const ids = flown.flatMap(({ id }) => (id === undefined ? [] : [id]));
    setStored(ids.length === 1 ? `plans/${ids[0]}` : "plans");
    for (const id of ids) await dispatchPlan(id);
    go(ids.length === 1 ? `plans/${ids[0]}` : "plans");
  };
  const act = () => {
    setBusy(true);
    setError(null);
    fly()
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  return (
    <Dialog title={t("survey.fly_title")} close={close}>
      {first.map((mission) => (
        <section key={mission.vehicle_id} className="checklist">
          {first.length === 1 ? (
            <h3>{t("vehicle.name", { id: mission.vehicle_id })}</h3>
          ) : (
            <Segments
              label={t("survey.fly_choice", { id: mission.vehicle_id })}
              options={[["now", t("survey.fly_now")], ["hold", t("survey.fly_hold")]]}
              value={departureOf(mission.vehicle_id)}
              choose={(chosen) =>
                setHeld((present) => {
                  const next = new Set(present);
                  if (chosen === "hold") next.add(mission.vehicle_id);
                  else next.delete(mission.vehicle_id);
                  return next;
                })
              }
            />
          )}
          {departureOf(mission.vehicle_id) === "now" && (
            <Checks
              mission={mission}
              fence={fence}
              elsewhere={elsewhere}
              {...(order.endurance === undefined ? {} : { endurance_s: order.endurance })}
            />
          )}
        </section>
      ))}
      {later > 0 && <p className="muted small">{t("survey.fly_rest", { count: later })}</p>}
      {error !== null && stored === null && <ErrorNotice error={error} />}
      {error !== null && stored !== null && (
        <Notice kind="error">
          <p>{t("survey.fly_stored")} {describeError(error, t)}</p>
          <Button icon="plan" onClick={() => go(stored)}>{t("survey.fly_open")}</Button>
        </Notice>
      )}
      <p>{t("survey.fly_text")}</p>
      <HoldButton
        className="hold-home"
        hint={t("stop.hold")}
        disabled={isBusy || first.every((one) => departureOf(one.vehicle_id) === "hold")}
        act={act}
      >
        <Icon name="flight" size={26} /> {t("survey.fly")}
      </HoldButton>
    </Dialog>
  );
}

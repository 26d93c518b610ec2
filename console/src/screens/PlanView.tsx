import { Suspense, useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { createPlan, deletePlan, dispatchPlan, getTaggedPlan, listFields } from "../api/resources";
import type { Command, Mission, Plan } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo } from "../app/route";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { Icon } from "../controls/Icon";
import { ErrorNotice, Notice, Unloaded } from "../controls/states";
import { Pill, StatusPill } from "../controls/StatusPill";
import { useReportText } from "../i18n/use_report_text";
import { useLive } from "../live/use_live";
import { useOrderedSpeed, type OrderedSpeed } from "../live/use_ordered_speed";
import { usePlanFlights, type MissionFlight } from "../live/use_plan_flights";
import { isInFlight, startOf, withLive } from "../live/use_plans";
import { asRequestError, useResource } from "../live/use_resource";
import { extentOf } from "../map/extent";
import { collection, fieldFeatures, placeOf, routeFeatures } from "../map/features";
import { FarmMap } from "../map/map_part";
import { heightOf_m } from "../planning/command_forms";
import { fenceOf } from "../planning/fence";
import { documentOf, newMissionId, renumberedFrom } from "../planning/plan_document";
import { CommandTimes } from "./CommandTimes";
import { DispatchDialog } from "./DispatchDialog";
import { DownloadDialog } from "./DownloadDialog";
import { LivePicture } from "./LivePicture";
import { MissionFlightNotes } from "./MissionFlightNotes";
import { PlanLife } from "./PlanLife";
import { PlanState } from "./Plans";
import { SpeedForm } from "./SpeedForm";
import { useFleetSymbols } from "./use_fleet_symbols";
import { usePlanFence } from "./use_plan_fence";
import { isInQueue, PlanQueues } from "./WaitingPlans";

/** A plan: its route on the map, and each step with its live status. */
export default function PlanView({ reference }: { reference: string }) {
  const { t } = useTranslation();
  const version = useLive((state) => state.missionChanges);
  const missions = useLive((state) => state.missions);
  const resource = useResource(() => getTaggedPlan(reference), version);
  const plan = useMemo(
    () => (resource.value === null ? null : withLive(resource.value.value, missions)),
    [resource.value, missions],
  );
  const units = useUnits();
  const reportText = useReportText();
  const highest_m = fenceOf(plan?.geofence)?.highest_m;
  if (plan === null) {
    return (
      <Unloaded title={t("plans.title")} error={resource.error} retry={resource.reload} />
    );
  }
  return (
    <div className="split">
      <div className="split-map">
        <PlanMap plan={plan} />
      </div>
      <section className="split-side" aria-label={t("plans.timeline")}>
        <a className="back-link" {...linkTo("plans")}>
          <Icon name="back" /> {t("plans.title")}
        </a>
        <header className="screen-head">
          <h1>{plan.name ?? t("plans.unnamed", { id: plan.id })}</h1>
          <PlanState plan={plan} />
        </header>
        {typeof highest_m === "number" && (
          <p className="muted small">{t("fence.highest", { height: units.height(highest_m) })}</p>
        )}
        <PlanActions plan={plan} tag={resource.value?.tag ?? ""} reload={resource.reload} />
        {isInQueue(plan) && <PlanQueues plan={plan} />}
        <PlanLife plan={plan} />
        {plan.warnings.length > 0 && (
          <Notice kind="info">
            <strong>{t("plans.warnings")}</strong>
            <ul>
              {plan.warnings.map((warning, index) => (
                <li key={index}>{warning.message === undefined ? warning.path : reportText(warning.message)}</li>
              ))}
            </ul>
          </Notice>
        )}
        <Timelines plan={plan} />
      </section>
    </div>
  );
}

function PlanMap({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  const fields = useResource(listFields);
  const homes = useLive((state) => state.homes);
  const symbols = useFleetSymbols(fields.value ?? [], null, () => go(""));
  const fence = usePlanFence(plan.geofence);
  const layers = useMemo(
    () => ({
      fields: fieldFeatures(fields.value ?? []),
      fences: fence.features,
      routes: collection(
        plan.missions.flatMap((mission) =>
          routeFeatures(mission.command_array, startOf(mission, homes)),
        ),
      ),
    }),
    [fields.value, fence, plan, homes],
  );
  const extent = useMemo(
    () =>
      extentOf([
        ...fence.places,
        ...plan.missions.flatMap((mission) =>
          mission.command_array.map(placeOf).filter((place) => place !== null),
        ),
      ]),
    [plan, fence],
  );
  return (
    <Suspense fallback={<div className="farm-map" />}>
      <FarmMap
        layers={layers}
        symbols={symbols}
        extent={extent}
        legend={fence.legend}
        label={t("map.label")}
      />
    </Suspense>
  );
}

/** What a person is asked, about the plan as it was then: it may change behind the dialog. */
interface Question {
  kind: "dispatch" | "cancel" | "download";
  plan: Plan;
  /** Of that version: no other one is dispatched or cancelled. */
  tag: string;
}

function PlanActions({ plan, tag, reload }: {
  plan: Plan;
  tag: string;
  reload: () => void;
}) {
  const { t } = useTranslation();
  const isOperator = useIsOperator();
  const [question, setQuestion] = useState<Question | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const [isCopying, setCopying] = useState(false);
  const ask = (kind: Question["kind"]) => setQuestion({ kind, plan, tag });
  const isHeld = plan.missions.some((mission) => mission.dispatch_state === "held");
  const isWaiting = plan.missions.some((mission) =>
    ["held", "queued"].includes(mission.dispatch_state),
  );
  const isOpen = plan.missions.every((mission) => ["held", "queued"].includes(mission.dispatch_state));

  const act = (work: () => Promise<unknown>, then: () => void) => {
    setQuestion(null);
    setError(null);
    work()
      .then(then)
      .catch((reason: unknown) => setError(asRequestError(reason)));
  };
  const again = () => {
    setError(null);
    reload();
  };
  const copy = async () => {
    const document = renumberedFrom(documentOf(plan), newMissionId(Date.now()));
    const name = t("conflict.copy_of", { name: plan.name ?? t("plans.unnamed", { id: plan.id }) });
    setCopying(true);
    try {
      const { id } = await createPlan({ ...document, name });
      go(`plans/${id}/edit`);
    } finally {
      setCopying(false);
    }
  };
  return (
    <>
      {error && <ErrorNotice error={error} {...(error.status === 412 ? { retry: again } : {})} />}
      {!isOperator && isWaiting && <Notice kind="info">{t("plans.operator_only")}</Notice>}
      <div className="actions">
        {isHeld && isOperator && (
          <Button kind="primary" icon="flight" onClick={() => ask("dispatch")}>
            {t("plans.dispatch")}
          </Button>
        )}
        {isOpen && (
          <Button icon="settings" onClick={() => go(`plans/${plan.id}/edit`)}>
            {t("action.edit")}
          </Button>
        )}
        <Button icon="copy" isBusy={isCopying} onClick={() => act(copy, () => undefined)}>
          {t("plans.duplicate")}
        </Button>
        <Button icon="download" onClick={() => ask("download")}>
          {t("plans.download")}
        </Button>
        {isOperator && isWaiting && (
          <Button kind="danger" icon="remove" onClick={() => ask("cancel")}>
            {t("plans.cancel")}
          </Button>
        )}
      </div>
      {question?.kind === "download" && <DownloadDialog plan={question.plan} close={() => setQuestion(null)} />}
      {question?.kind === "dispatch" && (
        <DispatchDialog
          plan={question.plan}
          dispatch={() => act(() => dispatchPlan(plan.id, question.tag), reload)}
          close={() => setQuestion(null)}
        />
      )}
      {question?.kind === "cancel" && (
        <Dialog title={t("plans.cancel")} close={() => setQuestion(null)}>
          <p>{t("plans.cancel_text")}</p>
          <div className="dialog-actions">
            <Button onClick={() => setQuestion(null)}>{t("action.back")}</Button>
            <Button
              kind="danger"
              icon="remove"
              onClick={() => act(() => deletePlan(plan.id, question.tag), () => go("plans"))}
            >
              {t("plans.cancel")}
            </Button>
          </div>
        </Dialog>
      )}
    </>
  );
}

function Timelines({ plan }: { plan: Plan }) {
  const flights = usePlanFlights(plan);
  return (
    <>
      {plan.missions.map((mission) => (
        <MissionTimeline key={mission.mission_id} mission={mission} flight={flights.get(mission.mission_id)} />
      ))}
    </>
  );
}

/** The steps of a mission in their order; the status of each changes while it flies. */
function MissionTimeline({ mission, flight }: { mission: Mission; flight: MissionFlight | undefined }) {
  const { t } = useTranslation();
  const isOperator = useIsOperator();
  const reportText = useReportText();
  const units = useUnits();
  const [ordered, lookAgain] = useOrderedSpeed(flight);
  const heightText = (command: Command) => {
    const height_m = heightOf_m(command);
    return height_m === null ? "" : units.height(height_m);
  };
  return (
    <div className="card">
      <div className="card-body">
        <header className="screen-head">
          <h2>{t("vehicle.name", { id: mission.vehicle_id })}</h2>
          <MissionSpeed planned_m_s={mission.maximum_speed ?? null} ordered={ordered} />
          <Pill tone="neutral">{t(`dispatch.${mission.dispatch_state}`)}</Pill>
        </header>
        {mission.waiting && <Notice kind="info">{t("plans.waiting", { reason: reportText(mission.waiting) })}</Notice>}
        {mission.message && <Notice kind="info">{reportText(mission.message)}</Notice>}
        <MissionFlightNotes mission={mission} flight={flight} />
        {isInFlight(mission) && isOperator && <SpeedForm mission={mission} done={lookAgain} />}
        {isInFlight(mission) && <LivePicture vehicleId={mission.vehicle_id} />}
        <ol className="timeline">
          {mission.command_array.map((command, index) => (
            <li key={command.command_id} data-status={command.command_status_id}>
              <span className="timeline-number">{index + 1}</span>
              <span>
                <strong>{t(`command.${command.command_type_id}`)}</strong>
                <br />
                <span className="muted small">
                  {command.message ? reportText(command.message) : heightText(command)}
                </span>
                <FlownTimes flight={flight} commandId={command.command_id} />
              </span>
              <StatusPill status={command.command_status_id} />
            </li>
          ))}
        </ol>
      </div>
    </div>
  );
}

/** The planned speed, and the one that was ordered in flight in its place. */
function MissionSpeed({ planned_m_s, ordered }: { planned_m_s: number | null; ordered: OrderedSpeed | null }) {
  const { t } = useTranslation();
  const units = useUnits();
  const planned = planned_m_s === null ? null : units.exactSpeed(planned_m_s);
  if (ordered !== null) {
    const order = { speed: units.exactSpeed(ordered.speed_m_s), time: units.clock(ordered.at) };
    return (
      <span className="ordered-speed small">
        <strong>{t("plans.ordered_speed", order)}</strong>
        {planned !== null && <span className="muted"> {t("plans.planned_speed", { speed: planned })}</span>}
      </span>
    );
  }
  return planned === null ? null : <span className="muted small">{`${t("plans.maximum_speed")}: ${planned}`}</span>;
}

function FlownTimes({ flight, commandId }: { flight: MissionFlight | undefined; commandId: number }) {
  const flown = flight?.command_array.find((one) => one.command_id === commandId);
  if (!flown?.started_at) return null;
  return (
    <span className="muted small flown-times">
      <CommandTimes command={flown} />
    </span>
  );
}

import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { Plan } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo } from "../app/route";
import { Button } from "../controls/Button";
import { TextField } from "../controls/fields";
import { MoreRows } from "../controls/MoreRows";
import { Empty, Loaded } from "../controls/states";
import { Pill, StatusPill } from "../controls/StatusPill";
import { usePlans } from "../live/use_plans";
import { matches } from "../planning/library";
import { UploadDialog } from "./UploadDialog";

/** The library of plans: those of the last weeks, or all, the newest first. */
export default function Plans() {
  const { t } = useTranslation();
  const [withOld, setWithOld] = useState(false);
  const plans = usePlans(withOld);
  const [isUploading, setUploading] = useState(false);
  const [typed, setTyped] = useState("");
  const textsOf = usePlanTexts();
  return (
    <div className="screen">
      <header className="screen-head">
        <h1>{t("plans.title")}</h1>
        <Button icon="upload" onClick={() => setUploading(true)}>
          {t("plans.upload")}
        </Button>
        <Button kind="primary" icon="add" onClick={() => go("plans/new")}>
          {t("plans.new")}
        </Button>
      </header>
      <TextField label={t("plans.search")} type="search" value={typed} onChange={(event) => setTyped(event.target.value)} />
      <div className="card">
        <Loaded
          resource={plans}
          empty={<Empty icon="plan" title={t("plans.empty_title")} text={t("plans.empty_text")} />}
        >
          {(rows) => {
            const found = rows.filter((plan) => matches(typed, Object.values(textsOf(plan))));
            return found.length > 0
              ? <MoreRows key={typed} rows={found}>{(plan) => <PlanRow key={plan.id} plan={plan} />}</MoreRows>
              : <Empty icon="plan" title={t("plans.none_found")} />;
          }}
        </Loaded>
      </div>
      {!withOld && plans.value !== null && (
        <div className="actions">
          <Button icon="down" onClick={() => setWithOld(true)}>{t("plans.show_old")}</Button>
        </div>
      )}
      {isUploading && <UploadDialog close={() => setUploading(false)} />}
    </div>
  );
}

/** What a person reads of a plan in the list, and finds it by. */
function usePlanTexts() {
  const { t } = useTranslation();
  const units = useUnits();
  return (plan: Plan) => {
    const steps = plan.missions.reduce((sum, mission) => sum + mission.command_array.length, 0);
    return {
      name: plan.name ?? t("plans.unnamed", { id: plan.id }),
      drones: plan.missions.map((mission) => t("vehicle.name", { id: mission.vehicle_id })).join(", "),
      steps: t("plans.steps", { count: steps }),
      received: units.time(plan.received_at),
    };
  };
}

function PlanRow({ plan }: { plan: Plan }) {
  const { name, drones, steps, received } = usePlanTexts()(plan);
  return (
    <li>
      <a className="row-main" {...linkTo(`plans/${plan.id}`)}>
        <strong>{name}</strong>
        <span>{[drones, steps, received].join(" · ")}</span>
      </a>
      <PlanState plan={plan} />
    </li>
  );
}

/** A draft or waiting plan by where it is, any other by its status. */
export function PlanState({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  const states = plan.missions.map((mission) => mission.dispatch_state);
  if (states.includes("held")) return <Pill tone="neutral">{t("dispatch.held")}</Pill>;
  if (plan.plan_status_id === 1 && states.includes("queued")) {
    return <Pill tone="warning">{t("dispatch.queued")}</Pill>;
  }
  return <StatusPill status={plan.plan_status_id} />;
}

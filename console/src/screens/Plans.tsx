import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { Plan } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo } from "../app/route";
import { Button } from "../controls/Button";
import { MoreRows } from "../controls/MoreRows";
import { Empty, Loaded } from "../controls/states";
import { Pill, StatusPill } from "../controls/StatusPill";
import { usePlans } from "../live/use_plans";
import { UploadDialog } from "./UploadDialog";

/** Every plan of the last weeks, the newest first. */
export default function Plans() {
  const { t } = useTranslation();
  const plans = usePlans();
  const [isUploading, setUploading] = useState(false);
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
      <div className="card">
        <Loaded
          resource={plans}
          empty={<Empty icon="plan" title={t("plans.empty_title")} text={t("plans.empty_text")} />}
        >
          {(rows) => (
            <MoreRows rows={rows}>{(plan) => <PlanRow key={plan.id} plan={plan} />}</MoreRows>
          )}
        </Loaded>
      </div>
      {isUploading && <UploadDialog close={() => setUploading(false)} />}
    </div>
  );
}

function PlanRow({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  const units = useUnits();
  const steps = plan.missions.reduce((sum, mission) => sum + mission.command_array.length, 0);
  const drones = plan.missions.map((mission) => t("vehicle.name", { id: mission.vehicle_id }));
  return (
    <li>
      <a className="row-main" {...linkTo(`plans/${plan.id}`)}>
        <strong>{plan.name ?? t("plans.unnamed", { id: plan.id })}</strong>
        <span>
          {[drones.join(", "), t("plans.steps", { count: steps }), units.time(plan.received_at)].join(" · ")}
        </span>
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

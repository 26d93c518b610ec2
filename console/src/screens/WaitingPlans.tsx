import { useMemo } from "react";
import { useTranslation } from "react-i18next";
import type { Plan } from "../api/types";
import { linkTo } from "../app/route";
import { Notice } from "../controls/states";
import { isWaiting, placeInQueue, waitingMissions, type Waiting } from "../live/queue";
import { useLive } from "../live/use_live";
import { isInFlight, runningMissions, usePlans } from "../live/use_plans";

/** The plans that wait for a vehicle, the next one first. */
export function WaitingPlans({ vehicleId, waiting }: { vehicleId: number; waiting: readonly Waiting[] }) {
  const { t } = useTranslation();
  if (waiting.length === 0) return null;
  const label = t("queue.title", { id: vehicleId });
  return (
    <section className="waiting-plans" aria-label={label}>
      <h3>{label}</h3>
      <ol>
        {waiting.map(({ plan, mission }) => (
          <li key={`${plan.id}-${mission.mission_id}`}>
            <PlanLink plan={plan} />
          </li>
        ))}
      </ol>
    </section>
  );
}

function PlanLink({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  return <a {...linkTo(`plans/${plan.id}`)}>{plan.name ?? t("plans.unnamed", { id: plan.id })}</a>;
}

/** Whether the queues of a plan's vehicles matter to it. */
export function isInQueue(plan: Plan): boolean {
  return plan.missions.some((mission) => isWaiting(mission) || isInFlight(mission));
}

/** What a plan waits behind, and what waits behind a plan in flight, for each of its vehicles. */
export function PlanQueues({ plan }: { plan: Plan }) {
  const { t } = useTranslation();
  const plans = usePlans();
  const live = useLive((state) => state.missions);
  const running = useMemo(() => runningMissions(plans.value ?? []), [plans.value]);
  const waiting = useMemo(() => waitingMissions(plans.value ?? [], live), [plans.value, live]);
  return (
    <>
      {plan.missions.map((mission) => {
        const queue = waiting.get(mission.vehicle_id) ?? [];
        if (isInFlight(mission)) {
          return <WaitingPlans key={mission.mission_id} vehicleId={mission.vehicle_id} waiting={queue} />;
        }
        const place = placeInQueue(plan, mission, queue, running.get(mission.vehicle_id));
        if (place === null) return null;
        const values = { id: mission.vehicle_id, position: place.position };
        return (
          <Notice key={mission.mission_id} kind="info">
            <p>
              {place.behind === null ? (
                t("queue.next", values)
              ) : (
                <>
                  {t("queue.behind", values)} <PlanLink plan={place.behind} />
                </>
              )}
            </p>
          </Notice>
        );
      })}
    </>
  );
}

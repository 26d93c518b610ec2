/** Missions that wait for their vehicle, in the order in which it flies them. Pure. */

import type { Mission, Plan } from "../api/types";
import { missionKey, type LiveState } from "./state";
import type { Running } from "./use_plans";

/** A mission that waits, and its plan. */
export interface Waiting {
  plan: Plan;
  mission: Mission;
}

/** Where a mission is in the queue of its vehicle. */
export interface QueuePlace {
  /** The first one is 1. */
  position: number;
  /** The plan that comes just before; null: nothing does. */
  behind: Plan | null;
}

export function isWaiting(mission: Mission): boolean {
  return mission.dispatch_state === "queued" && mission.mission_status_id === 1;
}

/** Gives what waits for each vehicle, the next one first, by the vehicle's number.
 *
 * The order is that of the dispatch, which the live feed numbers; without it that of the plans.
 */
export function waitingMissions(
  plans: readonly Plan[], live: LiveState["missions"],
): Map<number, Waiting[]> {
  const found = new Map<number, Waiting[]>();
  for (const plan of plans) {
    for (const mission of plan.missions) {
      if (!isWaiting(mission)) continue;
      found.set(mission.vehicle_id, [...(found.get(mission.vehicle_id) ?? []), { plan, mission }]);
    }
  }
  const numberOf = ({ plan, mission }: Waiting) =>
    live.get(missionKey({ plan_id: plan.plan_id, mission_id: mission.mission_id }))?.id ?? Infinity;
  const before = (one: Waiting, other: Waiting) => {
    const [first, second] = [numberOf(one), numberOf(other)];
    if (first !== second) return first < second ? -1 : 1;
    return one.plan.id - other.plan.id;
  };
  for (const queue of found.values()) queue.sort(before);
  return found;
}

/** The place of a mission of a plan; null if it does not wait. */
export function placeInQueue(
  { id }: Plan, { mission_id }: Mission, queue: readonly Waiting[], running: Running | undefined,
): QueuePlace | null {
  const index = queue.findIndex(({ plan, mission }) => plan.id === id && mission.mission_id === mission_id);
  if (index < 0) return null;
  return { position: index + 1, behind: queue[index - 1]?.plan ?? running?.plan ?? null };
}

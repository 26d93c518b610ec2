/** The stored plans with their live statuses. */

import { useMemo } from "react";
import { listPlans } from "../api/resources";
import type { Mission, Plan, StatusId } from "../api/types";
import type { Fix } from "./motion";
import { missionKey, type LiveState } from "./state";
import { useLive } from "./use_live";
import { useResource, type Resource } from "./use_resource";

const DAYS = 30;
const DAY_MS = 86_400_000;

/** Loads the plans of the last weeks, or all, the newest first; again when a mission has changed. */
export function usePlans(withOld = false): Resource<Plan[]> {
  const missions = useLive((state) => state.missions);
  const version = useLive((state) => state.missionChanges);
  const resource = useResource(
    () => listPlans(withOld ? new Date(0) : new Date(Date.now() - DAYS * DAY_MS)).then((plans) => plans.reverse()),
    `${version} ${withOld}`,
  );
  // The same array until a plan or a mission changes: screens redraw the map when it is another
  const value = useMemo(
    () => resource.value?.map((plan) => withLive(plan, missions)) ?? null,
    [resource.value, missions],
  );
  return { ...resource, value };
}

/** Gives the plan with the statuses of the live feed, which are newer than the list. */
export function withLive(plan: Plan, missions: LiveState["missions"]): Plan {
  return { ...plan, missions: plan.missions.map((mission) => merge(plan, mission, missions)) };
}

function merge(plan: Plan, mission: Mission, missions: LiveState["missions"]): Mission {
  const live = missions.get(missionKey({ plan_id: plan.plan_id, mission_id: mission.mission_id }));
  if (live === undefined) return mission;
  const statuses = new Map<number, StatusId>(
    live.command_array?.map((one) => [one.command_id, one.command_status_id]),
  );
  return {
    ...mission,
    mission_status_id: Math.max(live.mission_status_id, mission.mission_status_id) as StatusId,
    command_array: mission.command_array.map((command) => ({
      ...command,
      command_status_id: Math.max(
        statuses.get(command.command_id) ?? 1,
        command.command_status_id,
      ) as StatusId,
    })),
  };
}

/** Whether a mission is with its vehicle and has not ended. */
export function isInFlight(mission: Mission): boolean {
  return mission.dispatch_state === "accepted" && mission.mission_status_id <= 2;
}

/** Where a mission begins; of one that has ended the vehicle's home may be another by now. */
export function startOf(mission: Mission, homes: LiveState["homes"]): Fix | null {
  const hasEnded = mission.mission_status_id > 2;
  return hasEnded ? null : (homes.get(mission.vehicle_id) ?? null);
}

/** A mission in flight, and its plan. */
export interface Running {
  plan: Plan;
  mission: Mission;
}

/** Gives the mission in flight of each vehicle that has one, by the vehicle's number. */
export function runningMissions(plans: readonly Plan[]): Map<number, Running> {
  const found = new Map<number, Running>();
  for (const plan of plans) {
    for (const mission of plan.missions) {
      if (isInFlight(mission) && !found.has(mission.vehicle_id)) {
        found.set(mission.vehicle_id, { plan, mission });
      }
    }
  }
  return found;
}

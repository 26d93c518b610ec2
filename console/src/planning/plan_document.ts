/** A plan as a document: what a person has made, without what the edge server adds. Pure. */

import type { Command, Mission, Plan, PlanDocument } from "../api/types";

/** The document of a stored plan; held, so that nothing flies because a file was sent. */
export function documentOf(plan: Plan): PlanDocument {
  return {
    ...given("name", plan.name),
    ...given("sequence_number", plan.sequence_number),
    ...given("field_id", plan.field_id),
    ...given("profile", plan.profile),
    ...given("geofence", plan.geofence),
    ...given("rally_points", plan.rally_points),
    dispatch: false,
    missions: plan.missions.map(missionOf),
  };
}

function missionOf(mission: Mission): PlanDocument["missions"][number] {
  return {
    ...given("sequence_number", mission.sequence_number),
    mission_id: mission.mission_id,
    vehicle_id: mission.vehicle_id,
    ...given("maximum_speed", mission.maximum_speed),
    command_array: mission.command_array.map(bare),
  };
}

/** A command as it is sent: without its status. */
export function bare({ command_id, command_type_id, parameters }: Command): Command {
  return { command_id, command_type_id, parameters };
}

/** The same plan under mission numbers of its own, so that it can be stored beside the first. */
export function renumberedFrom(document: PlanDocument, firstMissionId: number): PlanDocument {
  return {
    ...document,
    missions: document.missions.map((one, index) => ({ ...one, mission_id: firstMissionId + index })),
  };
}

/** The same plan without what belongs to one sending of it: its number and its times. */
export function withoutTimes(document: PlanDocument): PlanDocument {
  const { plan_id: _id, created_at: _created, expires_at: _expires, ...rest } = document;
  return rest;
}

/** A mission number that is probably free: the edge server refuses one that is not. */
export function newMissionId(nowMs: number): number {
  return Math.floor(nowMs / 1000) % 2_000_000_000;
}

function given<Name extends string, Value>(name: Name, value: Value | null | undefined): { [one in Name]?: Value } {
  return (value === null || value === undefined ? {} : { [name]: value }) as { [one in Name]?: Value };
}

import { expect, test } from "vitest";
import type { Plan, StatusId } from "../src/api/types";
import { missionKey, type LiveState } from "../src/live/state";
import { isInFlight, runningMissions, startOf, withLive } from "../src/live/use_plans";
import { storedPlan, waypoint } from "./plans";

const HOME = { latitude_deg: 40, longitude_deg: -3, altitude_m: 650, time_ms: 0 };
const plan = storedPlan([waypoint(-3), waypoint(-3.1)]);
const mission = plan.missions[0]!;

/** The plan whose mission has this status, and whose commands have these. */
function withStatus(status: StatusId, commands: StatusId[] = []): Plan {
  const flown = mission.command_array.map((command, index) =>
    ({ ...command, command_status_id: commands[index] ?? command.command_status_id }));
  const one = { ...mission, mission_status_id: status, command_array: flown };
  return { ...plan, missions: [{ ...one, dispatch_state: "accepted" }] };
}

/** What the live stream has of the mission. */
function live(status: StatusId, commands: StatusId[]): LiveState["missions"] {
  const one = {
    plan_id: plan.plan_id, mission_id: mission.mission_id, mission_status_id: status,
    command_array: commands.map((command_status_id, index) => ({ command_id: index + 1, command_status_id })),
  };
  return new Map([[missionKey(one), one]]) as unknown as LiveState["missions"];
}

const statuses = (of: Plan) => [
  of.missions[0]!.mission_status_id, ...of.missions[0]!.command_array.map((one) => one.command_status_id),
];

test("the live stream is ahead of a list that was loaded before", () => {
  expect(statuses(withLive(withStatus(1), live(2, [3, 2])))).toEqual([2, 3, 2]);
});

test("a list that was loaded later is ahead of the live stream", () => {
  expect(statuses(withLive(withStatus(3, [3, 3]), live(2, [3, 2])))).toEqual([3, 3, 3]);
});

test("a mission that the live stream does not know stays as it is", () => {
  expect(withLive(withStatus(2), new Map())).toEqual(withStatus(2));
});

test("a mission is in flight from its acceptance to its end", () => {
  expect(isInFlight(mission)).toBe(false);
  const inFlight = ([1, 2, 3, 4, 5] as StatusId[]).map((status) => isInFlight(withStatus(status).missions[0]!));
  expect(inFlight).toEqual([true, true, false, false, false]);
});

test("a vehicle shows the newest of its missions in flight", () => {
  const newest = { ...withStatus(2), name: "South" };
  const running = runningMissions([withStatus(3), newest, withStatus(2)]);
  expect([...running.keys()]).toEqual([mission.vehicle_id]);
  expect(running.get(mission.vehicle_id)?.plan.name).toBe("South");
});

test("a route begins at the vehicle's home until its mission has ended", () => {
  const homes = new Map([[mission.vehicle_id, HOME]]);
  const start = (status: StatusId) => startOf(withStatus(status).missions[0]!, homes);
  expect([1, 2].map((status) => start(status as StatusId))).toEqual([HOME, HOME]);
  expect([3, 4, 5].map((status) => start(status as StatusId))).toEqual([null, null, null]);
  expect(startOf(mission, new Map())).toBeNull();
});

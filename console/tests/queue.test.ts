import { expect, test } from "vitest";
import type { Mission, MissionChange, Plan } from "../src/api/types";
import { placeInQueue, waitingMissions } from "../src/live/queue";
import { missionKey } from "../src/live/state";
import { runningMissions } from "../src/live/use_plans";
import { storedPlan, waypoint } from "./plans";

const plan = (id: number, state: Mission["dispatch_state"], part: Partial<Mission> = {}): Plan => {
  const stored = storedPlan([waypoint(-3)], { id, plan_id: `plan-${id}`, name: `Plan ${id}` });
  const missions = stored.missions.map((mission) => ({ ...mission, dispatch_state: state, ...part }));
  return { ...stored, missions };
};
const live = (...order: Plan[]) =>
  new Map(order.map(({ plan_id }, index): [string, MissionChange] => [
    missionKey({ plan_id, mission_id: 3 }),
    { id: index + 1, plan_id, mission_id: 3, vehicle_id: 1, mission_status_id: 1, command_array: [] },
  ]));
const names = (found: ReturnType<typeof waitingMissions>, vehicleId = 1) =>
  (found.get(vehicleId) ?? []).map(({ plan: { name } }) => name);

const FLOWN = plan(1, "accepted", { mission_status_id: 2 });
const FIRST = plan(2, "queued");
const SECOND = plan(3, "queued");

test("only dispatched missions that have not begun wait, each for its vehicle", () => {
  const other = plan(4, "queued", { vehicle_id: 2 });
  const ended = plan(6, "queued", { mission_status_id: 5 });
  const found = waitingMissions([FLOWN, FIRST, other, plan(5, "held"), ended], new Map());
  expect([names(found), names(found, 2)]).toEqual([["Plan 2"], ["Plan 4"]]);
});

test("they are in the order of their dispatch", () => {
  // The list of plans has the newest first
  expect(names(waitingMissions([SECOND, FIRST], live(SECOND, FIRST)))).toEqual(["Plan 3", "Plan 2"]);
  expect(names(waitingMissions([SECOND, FIRST], new Map()))).toEqual(["Plan 2", "Plan 3"]);
  expect(names(waitingMissions([FIRST, SECOND], live(SECOND)))).toEqual(["Plan 3", "Plan 2"]);
});

test("a waiting plan has a position behind another one", () => {
  const queue = waitingMissions([SECOND, FIRST, FLOWN], new Map()).get(1) ?? [];
  const running = runningMissions([SECOND, FIRST, FLOWN]).get(1);
  const place = (one: Plan) => placeInQueue(one, one.missions[0] as Mission, queue, running);
  expect(place(FIRST)).toEqual({ position: 1, behind: FLOWN });
  expect(place(SECOND)).toEqual({ position: 2, behind: FIRST });
  expect(placeInQueue(FIRST, FIRST.missions[0] as Mission, queue, undefined)).toEqual({ position: 1, behind: null });
  expect(place(FLOWN)).toBeNull();
});

import { expect, test } from "vitest";
import type { StoredField } from "../src/api/types";
import { fieldChanges, isSame, isSamePlan, planChanges } from "../src/planning/changes";
import { storedPlan, waypoint } from "./plans";

const BASE = storedPlan([waypoint(1), waypoint(2), waypoint(3)]);

test("members may be in any order, items may not", () => {
  expect(isSame({ a: 1, b: { c: 2, d: 3 } }, { b: { d: 3, c: 2 }, a: 1 })).toBe(true);
  expect(isSame([1, 2], [2, 1])).toBe(false);
});

test("each difference of a plan is named, with the new value or how many steps", () => {
  const theirs = storedPlan([waypoint(1), waypoint(2.5)], { name: "South" });
  theirs.missions[0] = { ...theirs.missions[0]!, vehicle_id: 2, maximum_speed: 8 };
  expect(planChanges(BASE, theirs)).toEqual([
    { name: "name", text: "South" },
    { name: "vehicle", text: "2" },
    { name: "speed", text: "8" },
    { name: "steps_changed", count: 1 },
    { name: "steps_removed", count: 1 },
  ]);
});

test("of a plan of several drones each difference is named", () => {
  const [mission] = BASE.missions;
  const other = { ...mission!, mission_id: 4, vehicle_id: 2 };
  const pair = { ...BASE, missions: [mission!, other] };
  expect(planChanges(pair, { ...BASE, missions: [mission!, { ...other, vehicle_id: 3 }] }))
    .toEqual([{ name: "vehicle", text: "3" }]);
  expect(planChanges(pair, BASE)).toEqual([{ name: "missions" }]);
  expect(planChanges(pair, { ...BASE, missions: [other] })).toEqual([{ name: "missions" }]);
  const shorter = { ...other, command_array: other.command_array.slice(1) };
  expect(planChanges(pair, { ...BASE, missions: [mission!, shorter] }).map(({ name }) => name))
    .toEqual(["steps_changed", "steps_removed"]);
});

test("a fence and a dispatch are differences, a live status and a warning are none", () => {
  const geofence = { inclusion: [] };
  expect(planChanges(BASE, { ...BASE, geofence })).toEqual([{ name: "rest" }]);
  const queued = { ...BASE, missions: [{ ...BASE.missions[0]!, dispatch_state: "queued" as const }] };
  expect(planChanges(BASE, queued)).toEqual([{ name: "dispatched" }]);
  const waiting = { ...BASE, missions: [{ ...BASE.missions[0]!, waiting: "drone 1 waits" }] };
  expect(isSamePlan(BASE, { ...waiting, warnings: [{ message: "low" }] })).toBe(true);
});

test("each part of a field that is different is named", () => {
  const field = { id: 1, name: "A", boundary: [[0, 0], [0, 1], [1, 1]], holes: [], exclusions: [] } as unknown as StoredField;
  expect(fieldChanges(field, { ...field, updated_at: "later" } as StoredField)).toEqual([]);
  const theirs = { ...field, name: null, exclusions: [[[0, 0], [0, 1], [1, 1]]] } as unknown as StoredField;
  expect(fieldChanges(field, theirs)).toEqual([{ name: "name", text: "" }, { name: "exclusions" }]);
});

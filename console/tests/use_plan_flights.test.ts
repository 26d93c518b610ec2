import { expect, test } from "vitest";
import type { Flight } from "../src/api/types";
import { lastFlights } from "../src/live/use_plan_flights";
import { storedPlan, waypoint } from "./plans";

const plan = storedPlan([waypoint(-3)]);
const flight = (id: number, part: Partial<Flight> = {}): Flight => ({
  id, vehicle_id: 1, mission_id: 3, plan_id: plan.plan_id, plan_name: null, started_at: "2026-05-01T08:10:00Z", ended_at: null,
  mission_status_id: 2, distance_m: 0, pictures: 0, alarms: 0, ...part,
});

test("a mission has the last of its flights", () => {
  expect(lastFlights([flight(1), flight(2)], plan).map(({ id }) => id)).toEqual([2]);
});

test("flights of another plan, mission or vehicle are not its own", () => {
  // A copy of a plan has the same numbers of missions, a flight by hand has none
  const others = [flight(1, { plan_id: "other" }), flight(2, { mission_id: 4 }), flight(3, { vehicle_id: 2 }),
    flight(4, { plan_id: null, mission_id: null })];
  expect(lastFlights(others, plan)).toEqual([]);
});

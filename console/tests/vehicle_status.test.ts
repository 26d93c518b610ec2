import { expect, test } from "vitest";
import type { Vehicle } from "../src/api/types";
import { statusOf } from "../src/live/vehicle_status";

const flying = (values: Partial<Vehicle>) =>
  statusOf({ vehicle_id: 1, link_state: "connected", armed: true, altitude: 20, mission_id: 4, held: null, ...values } as Vehicle);

test.each([
  [{ activity: "mission" }, "on_mission"],
  [{ activity: "hold" }, "holding"],
  [{ activity: "hold", mission_id: null }, "holding"],
  [{ activity: "hold", altitude: 0 }, "on_mission"],
  [{ activity: "paused" }, "paused"],
  [{ activity: "manual" }, "manual"],
  [{ activity: "return_or_land" }, "return_or_land"],
  [{ activity: "hold", link_state: "lost" }, "lost"],
  [{ activity: "guided", mission_id: null }, "flying"],
] as const)("what a flying vehicle does: %o", (values, status) => {
  expect(flying(values as Partial<Vehicle>)).toBe(status);
});

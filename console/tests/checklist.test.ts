import { expect, test } from "vitest";
import type { Mission, Vehicle } from "../src/api/types";
import { checklist } from "../src/planning/checklist";

const PLACE = { latitude: 40.4434, longitude: -3.7382 };
const mission = (hold_time: number): Mission => ({
  mission_id: 1, vehicle_id: 1, dispatch_state: "held", mission_status_id: 1,
  command_array: [
    { command_id: 1, command_type_id: 1, command_status_id: 1, parameters: { ...PLACE, altitude: 10 } },
    { command_id: 2, command_type_id: 3, command_status_id: 1, parameters: { ...PLACE, altitude: 10, hold_time } },
  ],
});
const vehicle = (values: Partial<Vehicle> = {}): Vehicle =>
  ({
    vehicle_id: 1, link_state: "connected", armed: false, held: null, gps_fix: "3d",
    battery_percentage: 0.9, ...PLACE, ...values,
  }) as Vehicle;
const states = (of: Mission, one: Vehicle | undefined) =>
  Object.fromEntries(checklist(of, one).map(({ name, state }) => [name, state]));

test("a charged vehicle at the place of the takeoff is ready", () => {
  expect(states(mission(10), vehicle())).toEqual({
    ready: "good", battery: "good", gps: "good", place: "good",
  });
});

test("a vehicle that is away, held or in the air is not", () => {
  expect(states(mission(10), undefined)["ready"]).toBe("bad");
  expect(states(mission(10), vehicle({ link_state: "lost" }))["ready"]).toBe("bad");
  expect(states(mission(10), vehicle({ armed: true }))["ready"]).toBe("warning");
});

test("the charge has to last for the plan", () => {
  expect(states(mission(700), vehicle())["battery"]).toBe("warning");
  expect(states(mission(10), vehicle({ battery_percentage: 0.2 }))["battery"]).toBe("bad");
});

test("a vehicle without a fix or far from the takeoff is shown", () => {
  expect(states(mission(10), vehicle({ gps_fix: "2d" }))["gps"]).toBe("bad");
  expect(states(mission(10), vehicle({ latitude: 40.4444 }))["place"]).toBe("warning");
});

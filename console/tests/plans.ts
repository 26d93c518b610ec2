/** Plans as the edge server shows them, for tests. */
import type { Command, Plan } from "../src/api/types";

export const waypoint = (longitude: number, altitude = 15): [number, Command["parameters"]] =>
  [3, { latitude: 40, longitude, altitude }];

/** A draft of one mission with these steps. */
export function storedPlan(steps: [number, Command["parameters"]][], part: Partial<Plan> = {}): Plan {
  return {
    id: 7,
    plan_id: "01J00000000000000000000000",
    name: "North",
    received_at: "2026-05-01T08:00:00Z",
    expires_at: "2026-05-02T08:00:00Z",
    plan_status_id: 1,
    warnings: [],
    missions: [{
      mission_id: 3, vehicle_id: 1, maximum_speed: 5, dispatch_state: "held", mission_status_id: 1,
      command_array: steps.map(([type, parameters], index) => ({
        command_id: index + 1, command_type_id: type, command_status_id: 1, parameters,
      })),
    }],
    ...part,
  };
}

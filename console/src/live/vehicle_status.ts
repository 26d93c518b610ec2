/** What a vehicle is doing, as one of a few states that everybody understands. */

import type { Vehicle } from "../api/types";

export type VehicleStatus =
  | "lost" | "stale" | "held" | "ready" | "armed" | "flying"
  | "on_mission" | "paused" | "holding" | "return_or_land" | "failsafe" | "manual";

const AIRBORNE_M = 1.0;
const LOW_BATTERY = 0.25;

/** Chooses the state that matters most to an operator. */
export function statusOf(vehicle: Vehicle): VehicleStatus {
  if (vehicle.link_state === "lost") return "lost";
  if (vehicle.link_state === "stale") return "stale";
  if (vehicle.armed) {
    const activity = vehicle.activity;
    if (activity === "paused" || activity === "failsafe" || activity === "manual") return activity;
    if (activity === "return_or_land" && isAirborne(vehicle)) return activity;
    // Also where a ground station holds it in the middle of a mission
    if (activity === "hold" && isAirborne(vehicle)) return "holding";
    if (vehicle.mission_id !== null && vehicle.mission_id !== undefined) return "on_mission";
    return isAirborne(vehicle) ? "flying" : "armed";
  }
  return vehicle.held === null ? "ready" : "held";
}

export function isAirborne(vehicle: Vehicle): boolean {
  return Boolean(vehicle.armed) && (vehicle.altitude ?? 0) > AIRBORNE_M;
}

export function isBatteryLow(vehicle: Vehicle): boolean {
  return typeof vehicle.battery_percentage === "number" && vehicle.battery_percentage < LOW_BATTERY;
}

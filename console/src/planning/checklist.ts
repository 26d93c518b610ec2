/** What a person should look at before a mission is dispatched. Pure. */

import type { Mission, Vehicle } from "../api/types";
import { heightProfile, lengthOf, metresBetween } from "./height_profile";
import { TAKEOFF } from "./command_forms";

export type CheckState = "good" | "warning" | "bad";

/** One line of the checklist; `name` is a key of the texts. */
export interface Check {
  name: "ready" | "battery" | "gps" | "place";
  state: CheckState;
}

const CHARGE_FOR_EVERY_FLIGHT = 0.3;
/** Of the charge, for each second of flight: a battery lasts 15 minutes. */
const CHARGE_PER_S = 1 / 900;
const USUAL_SPEED_M_S = 5;
const NEAR_M = 50;

/** The checks of a mission for the vehicle as it is now; undefined: it is not known. */
export function checklist(mission: Mission, vehicle: Vehicle | undefined): Check[] {
  return [
    { name: "ready", state: readiness(vehicle) },
    { name: "battery", state: charge(mission, vehicle) },
    { name: "gps", state: fix(vehicle) },
    { name: "place", state: place(mission, vehicle) },
  ];
}

function readiness(vehicle: Vehicle | undefined): CheckState {
  if (vehicle === undefined || vehicle.link_state !== "connected" || vehicle.held) return "bad";
  return vehicle.armed ? "warning" : "good";
}

/** Whether the charge lasts for the plan's length and holds, and a reserve is left. */
function charge(mission: Mission, vehicle: Vehicle | undefined): CheckState {
  const present = vehicle?.battery_percentage;
  if (typeof present !== "number") return "warning";
  const holds_s = mission.command_array
    .map((one) => one.parameters["hold_time"])
    .reduce<number>((sum, one) => sum + (typeof one === "number" ? one : 0), 0);
  const speed_m_s = mission.maximum_speed || USUAL_SPEED_M_S;
  const flight_s = lengthOf(heightProfile(mission.command_array)) / speed_m_s + holds_s;
  if (present < CHARGE_FOR_EVERY_FLIGHT) return "bad";
  return present < CHARGE_FOR_EVERY_FLIGHT + flight_s * CHARGE_PER_S ? "warning" : "good";
}

function fix(vehicle: Vehicle | undefined): CheckState {
  if (!vehicle?.gps_fix) return "warning";
  return vehicle.gps_fix === "none" || vehicle.gps_fix === "2d" ? "bad" : "good";
}

/** Whether the vehicle stands where the plan takes off. */
function place(mission: Mission, vehicle: Vehicle | undefined): CheckState {
  const start = mission.command_array.find((one) => one.command_type_id === TAKEOFF)?.parameters;
  const { latitude, longitude } = vehicle ?? {};
  if (typeof latitude !== "number" || typeof longitude !== "number") return "warning";
  if (typeof start?.["latitude"] !== "number" || typeof start["longitude"] !== "number") return "warning";
  const there = { latitude: start["latitude"], longitude: start["longitude"] };
  return metresBetween({ latitude, longitude }, there) <= NEAR_M ? "good" : "warning";
}

/** What a person should look at before a mission is dispatched. Pure. */

import type { Mission, Vehicle } from "../api/types";
import { allows, crosses, type Fence } from "./fence";
import { heightProfile, lengthOf, metresBetween } from "./height_profile";
import { HOME, TAKEOFF } from "./command_forms";
import { windState, type Wind } from "./wind";

/** "look": nothing measures it, a person has to look. */
export type CheckState = "good" | "warning" | "bad" | "look";

/** One line of the checklist; `name` is a key of the texts. */
export interface Check {
  name: "ready" | "battery" | "gps" | "place" | "home" | "fence" | "wind";
  state: CheckState;
}

const CHARGE_FOR_EVERY_FLIGHT = 0.3;
/** How long a battery lasts where nobody has said it. */
const USUAL_ENDURANCE_S = 900;
/** Time that a picture takes, and slowing down and speeding up at a place. */
const PICTURE_S = 1.5;
const STOP_S = 2;
const PICTURE = 4;
const USUAL_SPEED_M_S = 5;
const NEAR_M = 50;
const FAR_M = 1000;

/** What is known beside the mission and the vehicle. */
export interface Circumstances {
  /** Where the mission may fly; null: nobody has drawn it. */
  fence: Fence | null;
  /** Where the vehicle was last seen standing: it may be in the air by now. */
  home?: { latitude: number; longitude: number } | null;
  /** How long a battery lasts. */
  endurance_s?: number;
  /** The wind that was measured last, and the time now by the same clock. */
  wind?: Wind | null;
  now_ms?: number;
}

/** The checks of a mission for the vehicle as it is now; undefined: it is not known. */
export function checklist(
  mission: Mission, vehicle: Vehicle | undefined, { fence, home, endurance_s, wind, now_ms }: Circumstances,
): Check[] {
  return [
    { name: "ready", state: readiness(vehicle) },
    { name: "battery", state: charge(mission, vehicle, endurance_s ?? USUAL_ENDURANCE_S) },
    { name: "gps", state: fix(vehicle) },
    { name: "place", state: place(mission, vehicle, NEAR_M) },
    { name: "home", state: place(mission, vehicle, FAR_M) },
    { name: "fence", state: inside(mission, home ?? vehicle, fence) },
    { name: "wind", state: windState(wind ?? null, now_ms ?? 0) },
  ];
}

/** Whether every place of the mission is where it may fly, and no path to, between or back from them leads through a no-fly area. */
function inside(mission: Mission, start: { latitude?: unknown; longitude?: unknown } | undefined, fence: Fence | null): CheckState {
  if (fence === null) return "warning";
  const places = mission.command_array.flatMap(({ parameters }) => placesOf(parameters));
  const home = placesOf(start ?? {});
  const returns = mission.command_array.some((one) => one.command_type_id === HOME);
  const flown = [...home, ...places, ...(returns ? home : [])];
  const isAround = flown.every((place, index) => index === 0 || !crosses(fence, flown[index - 1] ?? place, place));
  return isAround && places.every((place) => allows(fence, place)) ? "good" : "bad";
}

function placesOf({ latitude, longitude }: { latitude?: unknown; longitude?: unknown }): [number, number][] {
  return typeof latitude === "number" && typeof longitude === "number" ? [[latitude, longitude]] : [];
}

function readiness(vehicle: Vehicle | undefined): CheckState {
  if (vehicle === undefined || vehicle.link_state !== "connected" || vehicle.held) return "bad";
  return vehicle.armed ? "warning" : "good";
}

/** Whether the charge lasts for the plan's length and holds, and a reserve is left. */
function charge(mission: Mission, vehicle: Vehicle | undefined, endurance_s: number): CheckState {
  const present = vehicle?.battery_percentage;
  if (typeof present !== "number") return "warning";
  const holds_s = mission.command_array
    .map((one) => one.parameters["hold_time"])
    .reduce<number>((sum, one) => sum + (typeof one === "number" ? one : 0), 0);
  const speed_m_s = mission.maximum_speed || USUAL_SPEED_M_S;
  const pictures = mission.command_array.filter((one) => one.command_type_id === PICTURE).length;
  const stops_s = pictures * (PICTURE_S + STOP_S);
  const flight_s = lengthOf(heightProfile(mission.command_array)) / speed_m_s + holds_s + stops_s;
  if (present < CHARGE_FOR_EVERY_FLIGHT) return "bad";
  return present < CHARGE_FOR_EVERY_FLIGHT + flight_s / endurance_s ? "warning" : "good";
}

function fix(vehicle: Vehicle | undefined): CheckState {
  if (!vehicle?.gps_fix) return "warning";
  return vehicle.gps_fix === "none" || vehicle.gps_fix === "2d" ? "bad" : "good";
}

/** Whether the vehicle stands so near to where the plan takes off: it returns to where it stands. */
function place(mission: Mission, vehicle: Vehicle | undefined, farthest_m: number): CheckState {
  const start = mission.command_array.find((one) => one.command_type_id === TAKEOFF)?.parameters;
  const { latitude, longitude } = vehicle ?? {};
  if (typeof latitude !== "number" || typeof longitude !== "number") return "warning";
  if (typeof start?.["latitude"] !== "number" || typeof start["longitude"] !== "number") return "warning";
  const there = { latitude: start["latitude"], longitude: start["longitude"] };
  return metresBetween({ latitude, longitude }, there) <= farthest_m ? "good" : "warning";
}

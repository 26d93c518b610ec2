/** What a person should look at before a mission is dispatched. Pure. */

import type { Command, Mission, Vehicle } from "../api/types";
import { CIRCLE, HOME, PICTURE, TAKEOFF } from "./command_types";
import { allows, crosses, type Fence, type Rings } from "./fence";
import { bearing_deg, circleAround, metresBetween, type GroundPlace } from "./ground";
import { heightProfile, lengthOf } from "./height_profile";
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
const USUAL_SPEED_M_S = 5;
const NEAR_M = 50;
const FAR_M = 1000;

/** Bearings of a circle's first place from its middle, by its start point; at any other number the nearest place. */
const CIRCLE_STARTS_DEG: Record<number, number> = { 0: 0, 1: 180, 2: 270, 3: 90 };

/** What is known beside the mission and the vehicle. */
export interface Circumstances {
  /** Where the mission may fly; null: nobody has drawn it. */
  fence: Fence | null;
  /** No-fly areas of other fields; one around the place from which the vehicle starts is none for it. */
  elsewhere?: Rings;
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
  mission: Mission, vehicle: Vehicle | undefined, { fence, elsewhere, home, endurance_s, wind, now_ms }: Circumstances,
): Check[] {
  return [
    { name: "ready", state: readiness(vehicle) },
    { name: "battery", state: charge(mission, vehicle, endurance_s ?? USUAL_ENDURANCE_S) },
    { name: "gps", state: fix(vehicle) },
    { name: "place", state: place(mission, vehicle, NEAR_M) },
    { name: "home", state: place(mission, vehicle, FAR_M) },
    { name: "fence", state: inside(mission, home ?? vehicle, fence, elsewhere ?? []) },
    { name: "wind", state: windState(wind ?? null, now_ms ?? 0) },
  ];
}

/** Whether every place and circle of the mission is where it may fly, and no path to, between or back from them leads through a no-fly area. */
function inside(mission: Mission, start: Partial<Vehicle> | { latitude: number; longitude: number } | undefined, fence: Fence | null, elsewhere: Rings): CheckState {
  if (fence === null) return "warning";
  const home = placeOf(start ?? {});
  const path = pathOf(mission.command_array, home);
  const places = path.filter(({ isTakeoff }) => !isTakeoff).map(({ place }) => place);
  const meets = (one: Fence) => path.some(({ place }, index) => {
    const before = path[index - 1]?.place;
    return !allows({ ...one, inclusion: [] }, place) || (before !== undefined && crosses(one, before, place));
  });
  if (meets(fence) || !places.every((place) => allows(fence, place))) return "bad";
  const others = elsewhere.filter((ring) => home === null || allows({ inclusion: [], exclusion: [ring] }, home));
  return meets({ inclusion: [], exclusion: others }) ? "warning" : "good";
}

/** A place that is flown to; a vehicle takes off where it stands, which may lie beside its field. */
interface PathPlace {
  place: GroundPlace;
  isTakeoff: boolean;
}

/** The places of a mission in the order of flight, from home and, where it returns, back. */
function pathOf(commands: readonly Command[], home: GroundPlace | null): PathPlace[] {
  const path: PathPlace[] = home === null ? [] : [{ place: home, isTakeoff: true }];
  for (const { command_type_id: type, parameters } of commands) {
    const place = type === HOME ? home : placeOf(parameters);
    if (place === null) continue;
    const isTakeoff = type === TAKEOFF || type === HOME;
    const flown = type === CIRCLE ? circleFrom(place, parameters, path.at(-1)?.place ?? place) : [place];
    path.push(...flown.map((one) => ({ place: one, isTakeoff })));
  }
  return path;
}

/** The line of a circle from where it is entered. */
function circleFrom(centre: GroundPlace, parameters: Command["parameters"], from: GroundPlace): GroundPlace[] {
  const { radius, start_point } = parameters;
  const start_deg = CIRCLE_STARTS_DEG[Number(start_point ?? NaN)] ?? bearing_deg(centre, from);
  return circleAround(centre, Number(radius ?? 0), start_deg);
}

function placeOf({ latitude, longitude }: { latitude?: unknown; longitude?: unknown }): GroundPlace | null {
  return typeof latitude === "number" && typeof longitude === "number" ? [latitude, longitude] : null;
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
  const takeoff = mission.command_array.find((one) => one.command_type_id === TAKEOFF);
  const [here, there] = [placeOf(vehicle ?? {}), placeOf(takeoff?.parameters ?? {})];
  if (here === null || there === null) return "warning";
  return metresBetween(here, there) <= farthest_m ? "good" : "warning";
}

/** The heights of a plan over the distance that it flies. Pure. */

import type { Command } from "../api/types";
import { heightOf_m } from "./command_forms";
import { HOME, LAND, TAKEOFF } from "./command_types";
import { metresBetween, type GroundPlace } from "./ground";

/** A place of the plan: distance flown and height above home, in metres. */
export interface ProfilePoint {
  /** Place of the command in the plan, from 0. */
  index: number;
  distance_m: number;
  height_m: number;
}


/** The points between which a plan climbs and descends; none for a plan without a takeoff. */
export function heightProfile(commands: readonly Command[]): ProfilePoint[] {
  const points: ProfilePoint[] = [];
  let distance_m = 0;
  let before: GroundPlace | null = null;
  let start: GroundPlace | null = null;
  commands.forEach((command, index) => {
    const { latitude, longitude } = command.parameters;
    const type = command.command_type_id;
    const height_m = heightOf_m(command);
    let place: GroundPlace | null = null;
    if (typeof latitude === "number" && typeof longitude === "number") place = [latitude, longitude];
    if (type === HOME) place = start;
    if (type === TAKEOFF) {
      start = place;
      points.push({ index, distance_m, height_m: 0 });
    }
    if (place !== null && before !== null) distance_m += metresBetween(before, place);
    if (place !== null) before = place;
    const last = points.at(-1);
    if (last === undefined) return;
    if (type === HOME || type === LAND) {
      points.push({ index, distance_m, height_m: last.height_m }, { index, distance_m, height_m: 0 });
    } else if (height_m !== null && place !== null) {
      points.push({ index, distance_m, height_m });
    }
  });
  return points;
}

/** The length of the path over ground, in metres. */
export function lengthOf(profile: readonly ProfilePoint[]): number {
  return profile.at(-1)?.distance_m ?? 0;
}

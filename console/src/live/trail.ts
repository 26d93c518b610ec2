/** Where a vehicle has been, in few places: forty fixes on a line need two. Pure. */

import { distanceM, offsetM, type Fix, type Offset } from "./motion";

export type Place = [longitude: number, latitude: number];

/** What has been flown, as corners of a line, and the present part of it, which is straight. */
export interface Trail {
  /** The oldest first. */
  corners: readonly Place[];
  /** The corner at which the present part begins, and the fixes since. */
  straight: readonly Fix[];
  /** The newest fix; also that of a vehicle that rests. */
  last: Fix;
}

/** No kept fix lies further from the trail that is drawn than this. */
export const TOLERANCE_M = 0.5;
/** A fix nearer to the one before is not kept: the position of a vehicle that rests wanders. */
const STEP_M = 1;
const CORNERS_AT_MOST = 500;
/** Fixes of a straight part that are compared with the next one. */
const STRAIGHT_AT_MOST = 40;

export function beginTrail(fix: Fix): Trail {
  return { corners: [], straight: [fix], last: fix };
}

/** Gives the trail with one more fix. */
export function extendTrail(trail: Trail, fix: Fix): Trail {
  const { corners, straight } = trail;
  const [corner] = straight;
  const newest = straight.at(-1);
  if (corner === undefined || newest === undefined) return beginTrail(fix);
  // A vehicle that rests moves the time, not the trail
  if (distanceM(newest, fix) < STEP_M) return { ...trail, last: fix };
  if (straight.length < STRAIGHT_AT_MOST && isStraight(corner, straight, fix)) {
    return { corners, straight: [...straight, fix], last: fix };
  }
  const kept = [...corners.slice(1 - CORNERS_AT_MOST), placeOfFix(corner)];
  return { corners: kept, straight: [newest, fix], last: fix };
}

/** The line to draw, as [longitude, latitude]; of one place before the vehicle has moved. */
export function trailPlaces({ corners, straight }: Trail): Place[] {
  const ends = straight.length > 1 ? [straight[0], straight.at(-1)] : straight;
  return [...corners, ...ends.flatMap((fix) => (fix === undefined ? [] : [placeOfFix(fix)]))];
}

export function placeOfFix(fix: Fix): Place {
  return [fix.longitude_deg, fix.latitude_deg];
}

function isStraight(corner: Fix, between: readonly Fix[], end: Fix): boolean {
  const line = offsetM(corner, end);
  return between.every((fix) => distanceToLineM(offsetM(corner, fix), line) <= TOLERANCE_M);
}

/** Distance of a place from the line between the origin and `end` [m]. */
function distanceToLineM(place: Offset, end: Offset): number {
  const squared = end.north_m ** 2 + end.east_m ** 2;
  const along = place.north_m * end.north_m + place.east_m * end.east_m;
  const share = squared === 0 ? 0 : Math.min(1, Math.max(0, along / squared));
  return Math.hypot(place.north_m - share * end.north_m, place.east_m - share * end.east_m);
}

/** Areas in which a plan may fly. Pure. */

import type { StoredField } from "../api/types";
import { distanceToSide_m, type GroundPlace } from "./ground";

const EDGE_M = 0.1;

/** Each a list of corners as [latitude, longitude]. */
export type Rings = readonly (readonly (readonly number[])[])[];

/** Rings of [latitude, longitude]: inside one inclusion if there are any, outside every exclusion. */
export interface Fence {
  inclusion: Rings;
  exclusion: Rings;
  /** Above home; none: no limit of its own. */
  highest_m?: number | null;
}

/** Where a plan for a field may fly that has no fence of its own. */
export function fenceOfField({ boundary, holes, exclusions }: Pick<StoredField, "boundary" | "holes" | "exclusions">): Fence {
  return { inclusion: [boundary], exclusion: [...holes, ...exclusions] };
}

/** The no-fly areas of all fields but one. */
export function exclusionsElsewhere(fields: readonly StoredField[], but: number | null): Rings {
  return fields.flatMap(({ id, exclusions }) => (id === but ? [] : exclusions));
}

/** The fence of a plan document; null without one. */
export function fenceOf(geofence: object | null | undefined): Fence | null {
  if (!geofence) return null;
  const { inclusion = [], exclusion = [], max_altitude } = geofence as Partial<Fence> & { max_altitude?: number | null };
  return { inclusion, exclusion, highest_m: max_altitude ?? null };
}

export function allows(fence: Fence, place: GroundPlace): boolean {
  const isIncluded = fence.inclusion.length === 0 || fence.inclusion.some((ring) => contains(ring, place) || isOnEdge(ring, place));
  return isIncluded && !fence.exclusion.some((ring) => contains(ring, place));
}

/** Whether the straight path between two places crosses an exclusion. */
export function crosses({ exclusion }: Fence, from: GroundPlace, to: GroundPlace): boolean {
  return exclusion.some((ring) =>
    ring.some((corner, index) => {
      const next = ring[(index + 1) % ring.length] ?? corner;
      const [one, other] = [placeOf(corner), placeOf(next)];
      return sideOf(from, to, one) !== sideOf(from, to, other) && sideOf(one, other, from) !== sideOf(one, other, to);
    }),
  );
}

function placeOf([latitude = 0, longitude = 0]: readonly number[]): GroundPlace {
  return [latitude, longitude];
}

/** On which side of a line through two places a third one lies: 1 or -1, 0 on it. */
function sideOf(from: GroundPlace, to: GroundPlace, place: GroundPlace): number {
  return Math.sign((to[1] - from[1]) * (place[0] - from[0]) - (to[0] - from[0]) * (place[1] - from[1]));
}

/** A place on the edge of a field is rounded to either side of it. */
function isOnEdge(ring: readonly (readonly number[])[], place: GroundPlace): boolean {
  return ring.some((corner, index) => distanceToSide_m(place, placeOf(corner), placeOf(ring[(index + 1) % ring.length] ?? corner)) <= EDGE_M);
}

/** Counts the edges that are crossed to the east. */
function contains(ring: readonly (readonly number[])[], [latitude, longitude]: GroundPlace): boolean {
  let isInside = false;
  ring.forEach(([fromLatitude = 0, fromLongitude = 0], index) => {
    const [toLatitude = 0, toLongitude = 0] = ring[(index + 1) % ring.length] ?? [];
    if (fromLatitude > latitude === toLatitude > latitude) return;
    const part = (latitude - fromLatitude) / (toLatitude - fromLatitude);
    if (fromLongitude + part * (toLongitude - fromLongitude) > longitude) isInside = !isInside;
  });
  return isInside;
}

/** Areas in which a plan may fly. Pure. */

import type { StoredField } from "../api/types";

/** Rings of [latitude, longitude]: inside one inclusion if there are any, outside every exclusion. */
export interface Fence {
  inclusion: readonly (readonly (readonly number[])[])[];
  exclusion: readonly (readonly (readonly number[])[])[];
  /** Above home; none: no limit of its own. */
  highest_m?: number | null;
}

type Place = readonly [latitude: number, longitude: number];

/** Where a plan for a field may fly that has no fence of its own. */
export function fenceOfField({ boundary, holes, exclusions }: Pick<StoredField, "boundary" | "holes" | "exclusions">): Fence {
  return { inclusion: [boundary], exclusion: [...holes, ...exclusions] };
}

/** The fence of a plan document; null without one. */
export function fenceOf(geofence: object | null | undefined): Fence | null {
  if (!geofence) return null;
  const { inclusion = [], exclusion = [], max_altitude } = geofence as Partial<Fence> & { max_altitude?: number | null };
  return { inclusion, exclusion, highest_m: max_altitude ?? null };
}

export function allows(fence: Fence, place: Place): boolean {
  const isIncluded = fence.inclusion.length === 0 || fence.inclusion.some((ring) => contains(ring, place));
  return isIncluded && !fence.exclusion.some((ring) => contains(ring, place));
}

/** Whether the straight path between two places crosses an exclusion. */
export function crosses({ exclusion }: Fence, from: Place, to: Place): boolean {
  return exclusion.some((ring) =>
    ring.some((corner, index) => {
      const next = ring[(index + 1) % ring.length] ?? corner;
      const [one, other] = [placeOf(corner), placeOf(next)];
      return sideOf(from, to, one) !== sideOf(from, to, other) && sideOf(one, other, from) !== sideOf(one, other, to);
    }),
  );
}

function placeOf([latitude = 0, longitude = 0]: readonly number[]): Place {
  return [latitude, longitude];
}

/** On which side of a line through two places a third one lies: 1 or -1, 0 on it. */
function sideOf(from: Place, to: Place, place: Place): number {
  return Math.sign((to[1] - from[1]) * (place[0] - from[0]) - (to[0] - from[0]) * (place[1] - from[1]));
}

/** Counts the edges that are crossed to the east. */
function contains(ring: readonly (readonly number[])[], [latitude, longitude]: Place): boolean {
  let isInside = false;
  ring.forEach(([fromLatitude = 0, fromLongitude = 0], index) => {
    const [toLatitude = 0, toLongitude = 0] = ring[(index + 1) % ring.length] ?? [];
    if (fromLatitude > latitude === toLatitude > latitude) return;
    const part = (latitude - fromLatitude) / (toLatitude - fromLatitude);
    if (fromLongitude + part * (toLongitude - fromLongitude) > longitude) isInside = !isInside;
  });
  return isInside;
}

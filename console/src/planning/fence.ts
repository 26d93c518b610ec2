/** Areas in which a plan may fly. Pure. */

import type { StoredField } from "../api/types";

/** Rings of [latitude, longitude]: inside one inclusion if there are any, outside every exclusion. */
export interface Fence {
  inclusion: readonly (readonly (readonly number[])[])[];
  exclusion: readonly (readonly (readonly number[])[])[];
  /** Above home; none: no limit of its own. */
  highest_m?: number | null;
}

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

export function allows(fence: Fence, place: readonly [latitude: number, longitude: number]): boolean {
  const isIncluded = fence.inclusion.length === 0 || fence.inclusion.some((ring) => contains(ring, place));
  return isIncluded && !fence.exclusion.some((ring) => contains(ring, place));
}

/** Counts the edges that are crossed to the east. */
function contains(ring: readonly (readonly number[])[], [latitude, longitude]: readonly [number, number]): boolean {
  let isInside = false;
  ring.forEach(([fromLatitude = 0, fromLongitude = 0], index) => {
    const [toLatitude = 0, toLongitude = 0] = ring[(index + 1) % ring.length] ?? [];
    if (fromLatitude > latitude === toLatitude > latitude) return;
    const part = (latitude - fromLatitude) / (toLatitude - fromLatitude);
    if (fromLongitude + part * (toLongitude - fromLongitude) > longitude) isInside = !isInside;
  });
  return isInside;
}

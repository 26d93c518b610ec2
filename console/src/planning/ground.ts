/** Distances on a flat earth: plans are a few kilometres long at most. Pure. */

/** Length of a degree of latitude. */
export const M_PER_DEG = 111_195;
const RAD = Math.PI / 180;
const CIRCLE_SIDES = 48;

/** [latitude, longitude] in degrees. */
export type GroundPlace = readonly [latitude_deg: number, longitude_deg: number];

/** Length of a degree of longitude. */
export function eastMPerDeg(latitude_deg: number): number {
  return M_PER_DEG * Math.cos(latitude_deg * RAD);
}

/** A place some metres north and east of another one. */
export function shifted([latitude, longitude]: GroundPlace, north_m: number, east_m: number): [number, number] {
  return [latitude + north_m / M_PER_DEG, longitude + east_m / eastMPerDeg(latitude)];
}

export function metresBetween(one: GroundPlace, other: GroundPlace): number {
  return Math.hypot((other[0] - one[0]) * M_PER_DEG, (other[1] - one[1]) * eastMPerDeg(one[0]));
}

/** Distance of a place from the straight line between two others. */
export function distanceToSide_m(place: GroundPlace, from: GroundPlace, to: GroundPlace): number {
  const [x, y] = [(place[1] - from[1]) * eastMPerDeg(from[0]), (place[0] - from[0]) * M_PER_DEG];
  const [east, north] = [(to[1] - from[1]) * eastMPerDeg(from[0]), (to[0] - from[0]) * M_PER_DEG];
  const squared = east * east + north * north;
  const share = squared === 0 ? 0 : Math.min(1, Math.max(0, (x * east + y * north) / squared));
  return Math.hypot(x - share * east, y - share * north);
}

/** A closed line around a place, clockwise from a bearing. */
export function circleAround(centre: GroundPlace, radius_m: number, from_deg = 0): [number, number][] {
  return Array.from({ length: CIRCLE_SIDES + 1 }, (_, index) => {
    const angle = from_deg * RAD + (index / CIRCLE_SIDES) * 2 * Math.PI;
    return shifted(centre, Math.cos(angle) * radius_m, Math.sin(angle) * radius_m);
  });
}

/** The bearing from one place to another, clockwise from north. */
export function bearing_deg(from: GroundPlace, to: GroundPlace): number {
  return Math.atan2((to[1] - from[1]) * eastMPerDeg(from[0]), (to[0] - from[0]) * M_PER_DEG) / RAD;
}

/** Heading and speed over ground from two positions, for vehicles that do not report them. */

const EARTH_RADIUS_M = 6_371_000;
const RAD = Math.PI / 180;

/** A place and the time at which the vehicle was there. */
export interface Fix {
  latitude_deg: number;
  longitude_deg: number;
  altitude_m: number | null;
  time_ms: number;
}

export interface Motion {
  heading_deg: number | null;
  speed_m_s: number | null;
}

export interface Offset {
  north_m: number;
  east_m: number;
}

/** From one place to another, over ground; flat, good for some kilometres. */
export function offsetM(one: Fix, other: Fix): Offset {
  const scale = Math.cos(one.latitude_deg * RAD) * EARTH_RADIUS_M;
  return {
    north_m: (other.latitude_deg - one.latitude_deg) * RAD * EARTH_RADIUS_M,
    east_m: (other.longitude_deg - one.longitude_deg) * RAD * scale,
  };
}

/** Distance over ground between two places [m]. */
export function distanceM(one: Fix, other: Fix): number {
  const { north_m, east_m } = offsetM(one, other);
  return Math.hypot(north_m, east_m);
}

/** Motion from one fix to the next; a vehicle that rests keeps its last heading. */
export function motionBetween(before: Fix, now: Fix, last: Motion): Motion {
  const seconds = (now.time_ms - before.time_ms) / 1000;
  if (seconds <= 0) return last;
  const { north_m, east_m } = offsetM(before, now);
  const speed_m_s = Math.hypot(north_m, east_m) / seconds;
  // Below this the noise of the position decides, not the motion
  if (speed_m_s < 0.3) return { heading_deg: last.heading_deg, speed_m_s: 0 };
  const heading = Math.atan2(east_m, north_m) / RAD;
  return { heading_deg: (heading + 360) % 360, speed_m_s };
}

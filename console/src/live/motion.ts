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

/** Distance over ground between two places [m]; flat, good for some kilometres. */
export function distanceM(one: Fix, other: Fix): number {
  const north = (other.latitude_deg - one.latitude_deg) * RAD * EARTH_RADIUS_M;
  return Math.hypot(north, eastM(one, other));
}

function eastM(one: Fix, other: Fix): number {
  const scale = Math.cos(one.latitude_deg * RAD) * EARTH_RADIUS_M;
  return (other.longitude_deg - one.longitude_deg) * RAD * scale;
}

/** Motion from one fix to the next; a vehicle that rests keeps its last heading. */
export function motionBetween(before: Fix, now: Fix, last: Motion): Motion {
  const seconds = (now.time_ms - before.time_ms) / 1000;
  if (seconds <= 0) return last;
  const metres = distanceM(before, now);
  const speed_m_s = metres / seconds;
  // Below this the noise of the position decides, not the motion
  if (speed_m_s < 0.3) return { heading_deg: last.heading_deg, speed_m_s: 0 };
  const north = (now.latitude_deg - before.latitude_deg) * RAD * EARTH_RADIUS_M;
  const heading = Math.atan2(eastM(before, now), north) / RAD;
  return { heading_deg: (heading + 360) % 360, speed_m_s };
}

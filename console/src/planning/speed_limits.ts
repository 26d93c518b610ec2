/** Speeds that the edge server lets a mission fly. Pure. */

/** `SLOWEST_M_S` and `maximum_speed_m_s` of the edge server (afarcloud/flyable.py). */
export const SLOWEST_M_S = 0.1;
export const FASTEST_M_S = 12;
/** A limit that was entered in another unit comes back with an error of rounding. */
const ROUNDING_M_S = 0.005;

/** The speed to order; null for one that no mission may have. */
export function orderedSpeed(entered_m_s: number | null): number | null {
  if (entered_m_s === null) return null;
  if (entered_m_s < SLOWEST_M_S - ROUNDING_M_S || entered_m_s > FASTEST_M_S + ROUNDING_M_S) return null;
  return Math.min(Math.max(entered_m_s, SLOWEST_M_S), FASTEST_M_S);
}

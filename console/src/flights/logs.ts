/** Whether a log of a flight may still arrive: drones send their own after the landing. */

import type { Flight, FlightLog } from "../api/types";

/** A drone's log may take so long to arrive. */
const EXPECTED_MS = 15 * 60_000;

/** Whether a log is being received, or may yet come, so that it is worth asking again. */
export function awaitsLog(flight: Flight, logs: readonly FlightLog[], now_ms: number): boolean {
  if (flight.ended_at === null) return false;
  if (logs.some((log) => log.url === null)) return true;
  const hasOwn = logs.some((log) => log.format !== "tlog");
  return !hasOwn && now_ms - Date.parse(flight.ended_at) < EXPECTED_MS;
}

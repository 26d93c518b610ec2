/** The wind that the farm's drones have measured last. */

import { listFlightsSince, listObservations } from "../api/resources";
import { serverAheadMs } from "../api/server_clock";
import { newestWind, WIND_EXPIRES_MS, type Wind } from "../planning/wind";
import { useResource } from "./use_resource";

/** A flight that began earlier has landed before a measurement that has not expired. */
const LONGEST_FLIGHT_MS = 60 * 60_000;
/** The newest flights are enough: each drone measures the same wind. */
const MOST_FLIGHTS = 4;

/** Gives the newest measurement; null while there is none. */
export function useWind(): Wind | null {
  return useResource(readWind).value;
}

async function readWind(): Promise<Wind | null> {
  const now_ms = Date.now() + serverAheadMs();
  const flights = await listFlightsSince(new Date(now_ms - WIND_EXPIRES_MS - LONGEST_FLIGHT_MS));
  const newest = flights.slice(-MOST_FLIGHTS);
  const lists = await Promise.all(newest.map(({ id }) => listObservations(id)));
  return newestWind(lists.flat(), now_ms);
}

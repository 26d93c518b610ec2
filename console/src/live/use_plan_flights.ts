/** The flights of a plan, with the times of its commands. */

import { useMemo } from "react";
import { getFlight, listFlightAlarms, listFlightsSince } from "../api/resources";
import type { Alarm, Flight, FlownCommand, Mission, Plan } from "../api/types";
import { useLive } from "./use_live";
import { useResource } from "./use_resource";

const DAY_MS = 86_400_000;

/** A flight of a mission with what it has reported. */
export interface MissionFlight extends Flight {
  command_array: FlownCommand[];
  alarms_raised: Alarm[];
}

/** Gives the last flight of each mission of a plan by the mission's number, again whenever one changes. */
export function usePlanFlights(plan: Plan): ReadonlyMap<number, MissionFlight> {
  const alarms = useLive((state) => state.alarms.size);
  const progress = plan.missions
    .flatMap((mission) => [mission.mission_status_id, ...mission.command_array.map((one) => one.command_status_id)])
    .join();
  const hasFlown = plan.missions.some((mission) => mission.mission_status_id > 1);
  const flights = useResource(
    async () => (hasFlown ? readFlights(plan) : []),
    `${plan.id}-${progress}-${alarms}`,
  );
  return useMemo(() => new Map(flights.value?.map((flight) => [flight.mission_id ?? 0, flight])), [flights.value]);
}

async function readFlights(plan: Plan): Promise<MissionFlight[]> {
  // Clocks of vehicles differ from that of the edge server
  const since = new Date(Date.parse(plan.received_at) - DAY_MS);
  const found = await listFlightsSince(since);
  return Promise.all(
    lastFlights(found, plan).map(async (flight) => {
      const [whole, alarms_raised] = await Promise.all([getFlight(flight.id), listFlightAlarms(flight)]);
      return { ...whole, alarms_raised };
    }),
  );
}

/** Of flights with the oldest first, the last one of each mission of a plan. Pure. */
export function lastFlights(flights: readonly Flight[], plan: Plan): Flight[] {
  const own = flights.filter(({ plan_id }) => plan_id === plan.plan_id);
  return plan.missions.flatMap(({ mission_id, vehicle_id }: Mission) => {
    const last = own.filter((one) => one.mission_id === mission_id && one.vehicle_id === vehicle_id).at(-1);
    return last === undefined ? [] : [last];
  });
}

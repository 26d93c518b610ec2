/** An order to fly at another speed, and what becomes of it. */

import { useCallback, useEffect, useRef, useState } from "react";
import { changeSpeed, listEvents, listFlightsSince } from "../api/resources";
import { serverAheadMs } from "../api/server_clock";
import type { StoredEvent } from "../api/types";
import { speedsDone } from "../live/use_ordered_speed";
import { giveOrder, type Outcome } from "../live/order";
import { useResource } from "../live/use_resource";

export interface SpeedOrder extends Outcome {
  speed_m_s: number;
}

/** Gives the last order and a function that sends one; it is sent once and never repeated. */
export function useSpeedOrder(vehicleId: number): [SpeedOrder | null, (speed_m_s: number) => void] {
  const [order, setOrder] = useState<SpeedOrder | null>(null);
  /** Number of the last order: news of an older one is dropped, and of any after the end. */
  const last = useRef(0);
  useEffect(() => () => {
    last.current += 1;
  }, []);
  const send = useCallback((speed_m_s: number) => {
    last.current += 1;
    const number = last.current;
    const isLast = () => last.current === number;
    setOrder({ speed_m_s, state: "sending", reason: "" });
    const update = (change: Outcome) =>
      setOrder((present) => (present !== null && isLast() ? { ...present, ...change } : present));
    void giveOrder(vehicleId, (marked) => changeSpeed(vehicleId, speed_m_s, marked), update, isLast);
  }, [vehicleId]);
  return [order, send];
}

/** Longer than any flight. */
const LONGEST_FLIGHT_MS = 24 * 3_600_000;

/** What a broker's clock may be ahead; an order of the flight before may lie within it. */
const CLOCK_MARGIN_MS = 5 * 60_000;

/** The speed that was ordered last in the flight of a vehicle [m/s]: null without one, undefined at first. */
export function useLastSpeed(vehicleId: number): number | null | undefined {
  const last = useResource(() => readLastSpeed(vehicleId));
  return last.value?.speed_m_s ?? (last.isLoading ? undefined : null);
}

async function readLastSpeed(vehicleId: number): Promise<{ speed_m_s: number | null }> {
  const now_ms = Date.now() + serverAheadMs();
  const flights = await listFlightsSince(new Date(now_ms - LONGEST_FLIGHT_MS));
  const flight = flights.filter((one) => one.vehicle_id === vehicleId && one.ended_at === null).at(-1);
  if (flight === undefined) return { speed_m_s: null };
  // The flight's time is by its broker's clock, those of the events by the edge server's
  const since_ms = Math.min(Date.parse(flight.started_at), now_ms - CLOCK_MARGIN_MS);
  return { speed_m_s: lastSpeedOf(await listEvents(vehicleId, new Date(since_ms))) };
}

/** The speed of the last order that was carried out; null without one. */
export function lastSpeedOf(events: readonly StoredEvent[]): number | null {
  return speedsDone(events).at(-1)?.maximum_speed ?? null;
}

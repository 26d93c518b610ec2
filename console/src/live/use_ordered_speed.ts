/** The speed that was ordered while a mission was in flight, in place of the planned one. */

import { listEvents, NEW_SPEED } from "../api/resources";
import type { Flight, StoredEvent } from "../api/types";
import { useNow } from "./use_live";
import { useResource } from "./use_resource";

/** Somebody else may order another speed: the live feed carries no orders. */
const LOOK_AGAIN_MS = 5_000;

export interface OrderedSpeed {
  speed_m_s: number;
  /** When it was ordered. */
  at: string;
}

/** Gives the speed that was ordered last in a flight, null without one; and a function that reads it again. */
export function useOrderedSpeed(flight: Flight | undefined): [OrderedSpeed | null, () => void] {
  const now_ms = useNow();
  const round = flight?.ended_at === null ? Math.floor(now_ms / LOOK_AGAIN_MS) : "";
  const events = useResource(
    async () => (flight === undefined ? [] : listEvents(flight.vehicle_id, new Date(flight.started_at))),
    `${flight?.id} ${flight?.ended_at} ${round}`,
  );
  return [flight === undefined ? null : speedOrderedIn(flight, events.value ?? []), events.reload];
}

/** The last speed that was ordered in a flight and carried out; events are given the oldest first. */
export function speedOrderedIn(
  { started_at, ended_at, vehicle_id }: Pick<Flight, "started_at" | "ended_at" | "vehicle_id">,
  events: readonly StoredEvent[],
): OrderedSpeed | null {
  const last = speedsDone(events).filter(({ vehicle_id: of, received_at }) => {
    const at_ms = Date.parse(received_at);
    return of === vehicle_id && at_ms >= Date.parse(started_at) && (ended_at === null || at_ms <= Date.parse(ended_at));
  }).at(-1);
  if (last === undefined || last.maximum_speed === null) return null;
  return { speed_m_s: last.maximum_speed, at: last.received_at };
}

/** Orders of another speed that were carried out. */
export function speedsDone(events: readonly StoredEvent[]): StoredEvent[] {
  return events.filter((one) => one.event_type_id === NEW_SPEED && one.state === "done");
}

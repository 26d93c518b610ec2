/** Stop orders that were given in this dialog, and what became of each. */

import { useCallback, useEffect, useRef, useState } from "react";
import { UNREACHABLE, type RequestError } from "../api/client";
import { getEvent, stopVehicle, type StopKind } from "../api/resources";
import type { StoredEvent } from "../api/types";
import { asRequestError } from "../live/use_resource";

/** The event's states, and: sending, idle (nothing to stop), failed (it may not have arrived). */
export type OrderState =
  | "sending" | "queued" | "accepted" | "done" | "refused" | "expired" | "idle" | "failed";

export interface StopOrder {
  key: string;
  vehicleId: number;
  kind: StopKind;
  state: OrderState;
  reason: string;
}

const FINAL = new Set<OrderState>(["done", "refused", "expired", "idle", "failed"]);
const LOOK_AGAIN_MS = 500;

/** Gives the orders, the newest first, and a function that sends one to each vehicle. */
export function useStopOrders(): [StopOrder[], (vehicleIds: number[], kind: StopKind) => void] {
  const [orders, setOrders] = useState<StopOrder[]>([]);
  const isOpen = useRef(true);
  useEffect(() => {
    isOpen.current = true;
    return () => {
      isOpen.current = false;
    };
  }, []);

  const send = useCallback((vehicleIds: number[], kind: StopKind) => {
    const update = (key: string, change: Partial<StopOrder>) =>
      setOrders((all) => all.map((one) => (one.key === key ? { ...one, ...change } : one)));
    for (const vehicleId of vehicleIds) {
      const key = `${vehicleId}-${Date.now()}`;
      const order: StopOrder = { key, vehicleId, kind, state: "sending", reason: "" };
      setOrders((all) => [order, ...all]);
      void follow(vehicleId, kind, (change) => update(key, change), () => isOpen.current);
    }
  }, []);
  return [orders, send];
}

/** Sends one order and follows it to its end; a lost answer is said, never repeated silently. */
async function follow(
  vehicleId: number,
  kind: StopKind,
  update: (change: Partial<StopOrder>) => void,
  isOpen: () => boolean,
): Promise<void> {
  let event: StoredEvent;
  try {
    event = await stopVehicle(vehicleId, kind);
  } catch (reason) {
    update(stopOutcomeOf(asRequestError(reason)));
    return;
  }
  await followEvent(event, update, isOpen);
}

/** Of the edge server, for a vehicle that neither flies nor has a mission. */
const NOTHING_TO_STOP = "has no active mission";

/** What became of a stop order that the edge server has not stored, or whose answer was lost. */
export function stopOutcomeOf(error: RequestError): Pick<StopOrder, "state" | "reason"> {
  const isIdle = error.status === 409 && error.faults.some((one) => one.reported === NOTHING_TO_STOP);
  return isIdle ? { state: "idle", reason: "" } : outcomeOf(error);
}

/** What became of an order that the edge server has not stored, or whose answer was lost. */
export function outcomeOf(error: RequestError): Pick<StopOrder, "state" | "reason"> {
  if (error.status === UNREACHABLE) return { state: "failed", reason: "" };
  const faults = error.faults.map(({ text }) => text).join("; ");
  return { state: error.status >= 500 ? "failed" : "refused", reason: faults || error.message };
}

/** Follows a stored event to its end. */
export async function followEvent(
  stored: StoredEvent,
  update: (change: Pick<StopOrder, "state" | "reason">) => void,
  isOpen: () => boolean,
): Promise<void> {
  let event = stored;
  for (;;) {
    update({ state: event.state, reason: event.message ?? "" });
    if (FINAL.has(event.state) || !isOpen()) return;
    await new Promise((resolve) => setTimeout(resolve, LOOK_AGAIN_MS));
    try {
      event = await getEvent(event.id);
    } catch {
      // The order was stored; its state is read again when the server answers
    }
  }
}

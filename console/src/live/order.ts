/** An order to a vehicle: what it can become, and how it is followed to its end. */

import { UNREACHABLE, type RequestError } from "../api/client";
import { getEvent, listEvents } from "../api/resources";
import { serverAheadMs } from "../api/server_clock";
import type { StoredEvent } from "../api/types";
import type { Tone } from "../controls/StatusPill";
import { asRequestError } from "./use_resource";

/** The event's states, and: sending, replaced (by a later order), ended (otherwise than ordered), deleted (the
 *  edge server does not have it any more), idle (nothing to stop), failed (what became of it is not known). */
export type OrderState =
  | "sending" | "queued" | "accepted" | "done" | "replaced" | "ended" | "refused" | "expired" | "deleted" | "idle" | "failed";

/** What has become of an order, with what broker or edge server say about it. */
export interface Outcome {
  state: OrderState;
  reason: string;
}

export const TONES: Record<OrderState, Tone> = {
  sending: "neutral", queued: "active", accepted: "active", done: "good", replaced: "neutral", ended: "neutral",
  refused: "bad", expired: "bad", deleted: "bad", idle: "neutral", failed: "bad",
};

const FINAL = new Set<OrderState>(["done", "replaced", "ended", "refused", "expired", "deleted", "idle", "failed"]);
/** Of an event that has been deleted. */
const GONE = [404, 410];
const DELETED: Outcome = { state: "deleted", reason: "" };
const LOOK_AGAIN_MS = 500;
const FIND_AGAIN_MS = 1_000;
/** An edge server that stood still carries out what it has received within this time after it answers again. */
const ANSWERS_WITHOUT_IT = 10;
/** What the clocks of browser and edge server may differ where the difference is not known. */
const CLOCK_MARGIN_MS = 60_000;
/** Of the broker, for an order in whose place a later one is carried out. */
const REPLACED = "a later event replaced it";
/** Of the edge server, for a vehicle that neither flies nor has a mission. */
const NOTHING_TO_STOP = "has no active mission";

export function isFinal(state: OrderState): boolean {
  return FINAL.has(state);
}

/** A number by which an order is recognised whose answer was lost. */
export function orderNumber(): number {
  return (crypto.getRandomValues(new Uint32Array(1))[0] ?? 0) >>> 1;
}

/** Sends one order, once, and follows it to its end.
 *
 * An order whose answer was lost is not repeated: it is looked for among the vehicle's events, since it
 * may have arrived.
 */
export async function giveOrder(
  vehicleId: number,
  send: (number: number) => Promise<StoredEvent>,
  update: (change: Outcome) => void,
  isOpen: () => boolean,
  refusal: (error: RequestError) => Outcome = outcomeOf,
): Promise<void> {
  const number = orderNumber();
  const since = new Date(Date.now() + serverAheadMs() - CLOCK_MARGIN_MS);
  let event: StoredEvent | undefined;
  try {
    event = await send(number);
  } catch (reason) {
    const outcome = refusal(asRequestError(reason));
    update(outcome);
    if (outcome.state === "failed") event = await findOrder(vehicleId, number, since, isOpen);
  }
  if (event !== undefined) await followEvent(event, update, isOpen);
}

/** Looks for an order until it is found, or the edge server has answered often enough without it. */
async function findOrder(
  vehicleId: number, number: number, since: Date, isOpen: () => boolean,
): Promise<StoredEvent | undefined> {
  for (let answers = 0; answers < ANSWERS_WITHOUT_IT;) {
    await new Promise((resolve) => setTimeout(resolve, FIND_AGAIN_MS));
    if (!isOpen()) return undefined;
    try {
      const found = (await listEvents(vehicleId, since)).find((one) => one.sequence_number === number);
      if (found !== undefined) return found;
      answers += 1;
    } catch {
      // The edge server does not answer yet
    }
  }
  return undefined;
}

/** What became of a stop order that the edge server has not stored, or whose answer was lost. */
export function stopOutcomeOf(error: RequestError): Outcome {
  const isIdle = error.status === 409 && error.faults.some((one) => one.reported === NOTHING_TO_STOP);
  return isIdle ? { state: "idle", reason: "" } : outcomeOf(error);
}

/** What became of an order that the edge server has not stored, or whose answer was lost. */
export function outcomeOf(error: RequestError): Outcome {
  if (error.status === UNREACHABLE) return { state: "failed", reason: "" };
  const faults = error.faults.map(({ text }) => text).join("; ");
  return { state: error.status >= 500 ? "failed" : "refused", reason: faults || error.message };
}

/** Which text says what has become of an order; an accepted one that ends a mission waits for a drone that is not received. */
export function textKeyOf({ state }: Pick<Outcome, "state">, endsMission: boolean, isReceived: boolean): OrderState | "accepted_lost" {
  return state === "accepted" && endsMission && !isReceived ? "accepted_lost" : state;
}

/** What has become of a stored event: one that is done with a note has not ended as ordered. */
export function eventOutcome({ state, message }: Pick<StoredEvent, "state" | "message">): Outcome {
  if (state !== "done" || !message) return { state, reason: message ?? "" };
  return message === REPLACED ? { state: "replaced", reason: "" } : { state: "ended", reason: message };
}

/** Follows a stored event to its end, also while the edge server does not answer: from its expiry on nobody knows then
 *  what has become of it. */
export async function followEvent(
  stored: StoredEvent, update: (change: Outcome) => void, isOpen: () => boolean,
): Promise<void> {
  let event = stored;
  let outcome = eventOutcome(event);
  for (;;) {
    update(outcome);
    if (FINAL.has(event.state) || !isOpen()) return;
    await new Promise((resolve) => setTimeout(resolve, LOOK_AGAIN_MS));
    try {
      event = await getEvent(event.id);
      outcome = eventOutcome(event);
      // After a restore the edge server gives a number again
      if (event.sequence_number !== stored.sequence_number) return update(DELETED);
    } catch (reason) {
      if (GONE.includes(asRequestError(reason).status)) return update(DELETED);
      // The order was stored; its state is read again when the server answers
      if (Date.now() + serverAheadMs() > Date.parse(event.expires_at ?? "")) outcome = { state: "failed", reason: "" };
    }
  }
}

/** An order to fly at another speed, and what becomes of it. */

import { useCallback, useEffect, useRef, useState } from "react";
import { RequestError, UNREACHABLE } from "../api/client";
import { changeSpeed } from "../api/resources";
import { asRequestError } from "../live/use_resource";
import { followEvent, type OrderState } from "./use_stop_orders";

export interface SpeedOrder {
  speed_m_s: number;
  state: OrderState;
  reason: string;
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
    const update = (change: Partial<SpeedOrder>) =>
      setOrder((present) => (present !== null && isLast() ? { ...present, ...change } : present));
    changeSpeed(vehicleId, speed_m_s)
      .then((event) => followEvent(event, update, isLast))
      .catch((reason: unknown) => update(outcomeOf(asRequestError(reason))));
  }, [vehicleId]);
  return [order, send];
}

/** What became of an order that the edge server has not stored, or whose answer was lost. */
export function outcomeOf(error: RequestError): Pick<SpeedOrder, "state" | "reason"> {
  if (error.status === UNREACHABLE) return { state: "failed", reason: "" };
  const faults = error.faults.map(({ text }) => text).join("; ");
  return { state: error.status >= 500 ? "failed" : "refused", reason: faults || error.message };
}

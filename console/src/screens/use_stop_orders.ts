/** Stop orders that were given in this dialog, and what became of each. */

import { useCallback, useEffect, useRef, useState } from "react";
import { stopVehicle, type StopKind } from "../api/resources";
import { giveOrder, stopOutcomeOf, type Outcome } from "../live/order";

export interface StopOrder extends Outcome {
  key: string;
  vehicleId: number;
  kind: StopKind;
}

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
    for (const vehicleId of vehicleIds) {
      const key = `${vehicleId}-${Date.now()}`;
      const order: StopOrder = { key, vehicleId, kind, state: "sending", reason: "" };
      setOrders((all) => [order, ...all]);
      const update = (change: Outcome) =>
        setOrders((all) => all.map((one) => (one.key === key ? { ...one, ...change } : one)));
      const stop = (number: number) => stopVehicle(vehicleId, kind, number);
      void giveOrder(vehicleId, stop, update, () => isOpen.current, stopOutcomeOf);
    }
  }, []);
  return [orders, send];
}

/** Who is signed in, for components. */

import { createContext, useContext } from "react";
import type { Session } from "../api/types";

export interface SessionValue {
  session: Session;
  leave: () => void;
}

export const SessionContext = createContext<SessionValue | null>(null);

export function useSession(): SessionValue {
  const value = useContext(SessionContext);
  if (value === null) throw new Error("there is no SessionContext");
  return value;
}

/** Whether the person may dispatch, change and cancel plans, and release vehicles. */
export function useIsOperator(): boolean {
  const { session } = useSession();
  return session.role === "operator" || session.role === "admin";
}

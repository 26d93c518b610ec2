/** Until when a plan may be dispatched. Pure. */

import type { Plan } from "../api/types";

/** How the edge server ends a mission that no broker has taken in time, and a broker one of its own. */
const EXPIRED = ["expired before dispatch", "expired before take-off"];

/** "open": it can be flown until then; "expired": it ended unflown; null: neither matters any more. */
export function lifeOf({ missions, expires_at }: Pick<Plan, "missions" | "expires_at">, nowMs: number): "open" | "expired" | null {
  if (missions.some((one) => EXPIRED.includes(one.message ?? ""))) return "expired";
  const waits = missions.some((one) => one.dispatch_state === "held" || one.dispatch_state === "queued");
  if (!waits) return null;
  return nowMs < Date.parse(expires_at) ? "open" : "expired";
}

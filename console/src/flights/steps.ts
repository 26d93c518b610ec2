/** The steps of a flight at a moment of its replay. Pure. */

import type { FlownCommand, StatusId } from "../api/types";

type Times = Pick<FlownCommand, "command_status_id" | "started_at" | "ended_at">;

const NOT_STARTED = 1;
const RUNNING = 2;

/** The status of a step at a moment; null is the end, when it has its last one. */
export function statusAt({ command_status_id, started_at, ended_at }: Times, at_ms: number | null): StatusId {
  if (at_ms === null || (ended_at !== null && at_ms >= Date.parse(ended_at))) return command_status_id;
  return started_at !== null && at_ms >= Date.parse(started_at) ? RUNNING : NOT_STARTED;
}

/** Index of the step that began last before a moment; null at the end and before the first one. */
export function stepAt(commands: readonly Times[], at_ms: number | null): number | null {
  if (at_ms === null) return null;
  const begun = commands.map(({ started_at }) => started_at !== null && Date.parse(started_at) <= at_ms);
  const last = begun.lastIndexOf(true);
  return last < 0 ? null : last;
}

import type { FlownCommand } from "../api/types";
import { useUnits } from "../app/preferences";

/** When a command began and ended, and how long it took. */
export function CommandTimes({ command: { started_at, ended_at } }: { command: FlownCommand }) {
  const units = useUnits();
  if (started_at === null) return null;
  if (ended_at === null) return <>{units.clock(started_at)} –</>;
  const took = units.elapsed(Date.parse(ended_at) - Date.parse(started_at));
  return <>{`${units.clock(started_at)} – ${units.clock(ended_at)} · ${took}`}</>;
}

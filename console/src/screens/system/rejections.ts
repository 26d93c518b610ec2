/** The order of rejected records in their list. Pure. */

import type { DeadLetter } from "../../api/types";

/** The newest rejection first; those of which no time is known last, the newest record first. */
export function newestFirst(letters: readonly DeadLetter[]): DeadLetter[] {
  return [...letters].sort((one, other) => rejectedMs(other) - rejectedMs(one) || receivedMs(other) - receivedMs(one));
}

function rejectedMs({ rejected_at }: DeadLetter): number {
  return rejected_at === null ? 0 : Date.parse(rejected_at);
}

function receivedMs({ report }: DeadLetter): number {
  return Date.parse(report.received_at);
}

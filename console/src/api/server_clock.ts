/** How far the edge server's clock is ahead of the browser's, by the Date of its answers. */

/** An answer that took longer says too little about when its Date was written. */
const LONGEST_MS = 2_000;
/** Of a Date: it is cut to whole seconds. */
const RESOLUTION_MS = 1_000;

let ahead_ms = 0;
let isKnown = false;

/** The difference by one answer; null without a usable Date. */
export function aheadBy(date: string | null, sentMs: number, receivedMs: number): number | null {
  const stampMs = date === null ? NaN : Date.parse(date);
  if (!Number.isFinite(stampMs)) return null;
  return stampMs + RESOLUTION_MS / 2 - (sentMs + receivedMs) / 2;
}

/** Takes the Date of an answer that has just come. */
export function noteServerTime(response: Response, sentMs: number): void {
  const receivedMs = Date.now();
  if (isKnown && receivedMs - sentMs > LONGEST_MS) return;
  const found = aheadBy(response.headers.get("Date"), sentMs, receivedMs);
  if (found === null) return;
  isKnown = true;
  // Within the resolution nothing has changed: ages do not jump to and fro
  if (Math.abs(found - ahead_ms) > RESOLUTION_MS) ahead_ms = found;
}

/** Milliseconds to add to the browser's clock; 0 until the server has answered. */
export function serverAheadMs(): number {
  return ahead_ms;
}

/** Whether the edge server still has the console that this page was loaded from. */

/** "updated": it has another one, and files of this one may be gone. */
export type ServerState = "same" | "updated" | "unreachable";

const TIMEOUT_MS = 5_000;
const PAGE = "/console/";

/** The script of a page, whose name has a hash of its content; null without one. */
export function scriptOf(page: string): string | null {
  return /<script\b[^>]*\bsrc="([^"]+)"/.exec(page)?.[1] ?? null;
}

export function compared(page: string, present: string | null): ServerState {
  const script = scriptOf(page);
  return script === null || script === present ? "same" : "updated";
}

/** Asks the edge server for the page. */
export async function presentServer(): Promise<ServerState> {
  try {
    const response = await fetch(PAGE, { cache: "no-store", signal: AbortSignal.timeout(TIMEOUT_MS) });
    if (!response.ok) return "unreachable";
    const present = document.querySelector("script[src]")?.getAttribute("src") ?? null;
    return compared(await response.text(), present);
  } catch {
    return "unreachable";
  }
}

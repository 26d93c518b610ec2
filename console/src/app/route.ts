/** The address of the page below /console/, as a list of parts: `plans/3` is ["plans", "3"].
 *
 * A guard may hold a change of the address back, until a person has decided.
 */

import { useSyncExternalStore, type MouseEvent } from "react";

const BASE = "/console/";
const CHANGED = "console:route";

/** Asked before the address changes: calls `leave` when it may, at once or later. */
type Guard = (leave: () => void) => void;

let guard: Guard | null = null;
/** What is shown: the address is ahead of it while a guard holds a step of the browser back. */
let shown: string | null = null;
/** Place of what is shown in the browser's history. */
let shownAt = 0;
let isReturning = false;
let isListening = false;

/** Sets who is asked before the screen is left; null: nobody. */
export function setGuard(next: Guard | null): void {
  guard = next;
}

function address(): string {
  return window.location.pathname.slice(BASE.length).replace(/\/+$/, "");
}

function placeInHistory(): number | null {
  const at = (window.history.state as { at?: unknown } | null)?.at;
  return typeof at === "number" ? at : null;
}

function path(): string {
  if (shown === null) {
    shown = address();
    shownAt = placeInHistory() ?? 0;
  }
  return shown;
}

function show(at: number): void {
  shown = address();
  shownAt = at;
  window.dispatchEvent(new Event(CHANGED));
}

/** The browser has gone back or forward. */
function popped(): void {
  if (isReturning) {
    isReturning = false;
    return;
  }
  const at = placeInHistory();
  if (address() === path()) {
    // A link to a place on the same screen
    if (at === null) window.history.replaceState({ at: shownAt + 1 }, "");
    shownAt = at ?? shownAt + 1;
    return;
  }
  const there = at ?? 0;
  if (guard === null) {
    show(there);
    return;
  }
  const steps = there - shownAt;
  isReturning = true;
  window.history.go(-steps);
  guard(() => {
    guard = null;
    window.history.go(steps);
  });
}

function subscribe(listener: () => void): () => void {
  if (!isListening) window.addEventListener("popstate", popped);
  isListening = true;
  window.addEventListener(CHANGED, listener);
  return () => window.removeEventListener(CHANGED, listener);
}

/** The parts of the present address; none on the first screen. */
export function useRoute(): string[] {
  const present = useSyncExternalStore(subscribe, path);
  return present === "" ? [] : present.split("/").map(decodeURIComponent);
}

/** The number that a part of an address is; null for anything else. */
export function numberOf(part: string): number | null {
  return /^[1-9]\d{0,14}$/.test(part) ? Number(part) : null;
}

/** Goes to an address below /console/. */
export function go(to: string): void {
  const leave = () => {
    window.history.pushState({ at: shownAt + 1 }, "", BASE + to);
    show(shownAt + 1);
    document.querySelector("main")?.focus({ preventScroll: false });
  };
  if (guard === null || to === path()) leave();
  else guard(leave);
}

/** Properties of a link that does not load the page again. */
export function linkTo(to: string): { href: string; onClick: (event: MouseEvent) => void } {
  return {
    href: BASE + to,
    onClick: (event) => {
      if (event.metaKey || event.ctrlKey || event.shiftKey || event.button !== 0) return;
      event.preventDefault();
      go(to);
    },
  };
}

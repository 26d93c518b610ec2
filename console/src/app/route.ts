/** The address of the page below /console/, as a list of parts: `plans/3` is ["plans", "3"]. */

import { useSyncExternalStore, type MouseEvent } from "react";

const BASE = "/console/";
const CHANGED = "console:route";

function path(): string {
  return window.location.pathname.slice(BASE.length).replace(/\/+$/, "");
}

function subscribe(listener: () => void): () => void {
  window.addEventListener("popstate", listener);
  window.addEventListener(CHANGED, listener);
  return () => {
    window.removeEventListener("popstate", listener);
    window.removeEventListener(CHANGED, listener);
  };
}

/** The parts of the present address; none on the first screen. */
export function useRoute(): string[] {
  const present = useSyncExternalStore(subscribe, path);
  return present === "" ? [] : present.split("/").map(decodeURIComponent);
}

/** Goes to an address below /console/. */
export function go(to: string): void {
  window.history.pushState(null, "", BASE + to);
  window.dispatchEvent(new Event(CHANGED));
  document.querySelector("main")?.focus({ preventScroll: false });
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

/** Loads the screens ahead of need, so that each opens also where the connection is lost. */

import { useEffect } from "react";
import { useIsConnected } from "../live/use_live";

/** After the page is loaded: the first map is drawn before. */
const AFTER_MS = 2_000;
const IDLE_TIMEOUT_MS = 10_000;

interface Preloaded {
  preload: () => Promise<boolean>;
}

/** Loads one after the other while the page is idle; stops where one cannot be loaded. */
export async function preloadAll(
  parts: readonly Preloaded[], idle: () => Promise<void>, isOver: () => boolean,
): Promise<void> {
  for (const one of parts) {
    await idle();
    if (isOver() || !(await one.preload())) return;
  }
}

/** Loads the parts when the first screen is usable, and what is missing whenever the connection returns. */
export function usePreload(parts: readonly Preloaded[]): void {
  const isConnected = useIsConnected();
  useEffect(() => {
    if (!isConnected) return;
    let isOver = false;
    void afterLoad().then(() => preloadAll(parts, idle, () => isOver));
    return () => {
      isOver = true;
    };
  }, [parts, isConnected]);
}

async function afterLoad(): Promise<void> {
  if (document.readyState !== "complete") {
    await new Promise((resolve) => window.addEventListener("load", resolve, { once: true }));
  }
  await new Promise((resolve) => setTimeout(resolve, AFTER_MS));
}

function idle(): Promise<void> {
  return new Promise((resolve) => {
    // Safari has no requestIdleCallback
    if (typeof window.requestIdleCallback === "function") {
      window.requestIdleCallback(() => resolve(), { timeout: IDLE_TIMEOUT_MS });
    } else setTimeout(resolve, 200);
  });
}

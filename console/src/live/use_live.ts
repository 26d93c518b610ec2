/** The live state for components. */

import { createContext, useContext, useEffect, useRef, useState, useSyncExternalStore } from "react";
import { Feed } from "./feed";
import type { LiveState } from "./state";

export const FeedContext = createContext<Feed>(new Feed());

export function useFeed(): Feed {
  return useContext(FeedContext);
}

/** A part of the live state; the component renders again when that part changes. */
export function useLive<Part>(part: (state: LiveState) => Part): Part {
  const feed = useFeed();
  return useSyncExternalStore(feed.subscribe, () => part(feed.state()));
}

/** A value that changes often, taken at most once in so many milliseconds. */
export function useSeldom<Value>(value: Value, every_ms: number): Value {
  const [taken, setTaken] = useState(value);
  const latest = useRef(value);
  latest.current = value;
  useEffect(() => {
    const timer = setInterval(() => setTaken(latest.current), every_ms);
    return () => clearInterval(timer);
  }, [every_ms]);
  return taken;
}

/** The present time in milliseconds, each second. */
export function useNow(): number {
  const [now, setNow] = useState(() => Date.now());
  useEffect(() => {
    const timer = setInterval(() => setNow(Date.now()), 1000);
    return () => clearInterval(timer);
  }, []);
  return now;
}

/** Whether orders reach the server now. */
export function useIsConnected(): boolean {
  return useLive((state) => state.connection === "live" || state.connection === "polling");
}

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

/** A value that changes often, taken so seldom that what is drawn of it takes little of the time.
 *
 * Once in `every_ms`, and less often where a frame after it takes long: without a graphics card a
 * map takes a fifth of a second to draw, and a page that draws it each second stutters.
 */
export function useSeldom<Value>(value: Value, every_ms: number): Value {
  const [taken, setTaken] = useState(value);
  const latest = useRef(value);
  latest.current = value;
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    let isOver = false;
    const take = async (): Promise<void> => {
      setTaken(latest.current);
      const longest_ms = await longestFrame(() => isOver);
      if (!isOver) timer = setTimeout(take, nextPause(longest_ms, every_ms));
    };
    timer = setTimeout(take, every_ms);
    return () => {
      isOver = true;
      clearTimeout(timer);
    };
  }, [every_ms]);
  return taken;
}

const WATCHED_FRAMES = 12;
/** Of the time, for slow frames. */
const SHARE = 0.04;
const LONGEST_PAUSE_MS = 5_000;
/** Frames that are hardly late pass unseen. */
const USUAL_FRAME_MS = 34;

/** How long to wait after a value whose slowest frame took so long. Pure. */
export function nextPause(longest_ms: number, every_ms: number): number {
  if (longest_ms <= USUAL_FRAME_MS) return every_ms;
  return Math.min(Math.max(longest_ms / SHARE, every_ms), LONGEST_PAUSE_MS);
}

/** Gives the longest time between two of the next frames; 0 while nobody sees the page. */
function longestFrame(isOver: () => boolean): Promise<number> {
  return new Promise((resolve) => {
    let [longest, before, left] = [0, performance.now(), WATCHED_FRAMES];
    const frame = (now: number) => {
      longest = Math.max(longest, now - before);
      before = now;
      left -= 1;
      if (left > 0 && !isOver()) requestAnimationFrame(frame);
      else resolve(longest);
    };
    if (document.hidden) resolve(0);
    else requestAnimationFrame(frame);
  });
}

/** One clock for all components: they render together, once a second. */
const clock = {
  now: Date.now(),
  readers: new Set<() => void>(),
  timer: undefined as ReturnType<typeof setInterval> | undefined,
};

function readClock(reader: () => void): () => void {
  if (clock.readers.size === 0) {
    clock.now = Date.now();
    clock.timer = setInterval(() => {
      clock.now = Date.now();
      for (const one of clock.readers) one();
    }, 1000);
  }
  clock.readers.add(reader);
  return () => {
    clock.readers.delete(reader);
    if (clock.readers.size === 0) clearInterval(clock.timer);
  };
}

/** The present time in milliseconds, each second. */
export function useNow(): number {
  return useSyncExternalStore(readClock, () => clock.now);
}

/** Whether orders reach the server now. */
export function useIsConnected(): boolean {
  return useLive((state) => state.connection === "live" || state.connection === "polling");
}

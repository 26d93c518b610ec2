/** Plays a flight: a part of it, from 0 to 1, that moves on. */

import { useEffect, useState } from "react";

const REPLAY_MS = 20_000;
const FRAME_MS = 50;

export interface Replay {
  part: number;
  /** Shows another moment, and stops playing. */
  show: (part: number) => void;
  isPlaying: boolean;
  play: (wanted: boolean) => void;
}

/** Begins at the end of the flight, where a flight that goes on grows. */
export function useReplay(): Replay {
  const [part, setPart] = useState(1);
  const [isPlaying, setPlaying] = useState(false);
  useEffect(() => {
    if (!isPlaying) return;
    const timer = setInterval(() => setPart((now) => Math.min(1, now + FRAME_MS / REPLAY_MS)), FRAME_MS);
    return () => clearInterval(timer);
  }, [isPlaying]);
  const hasEnded = part >= 1;
  useEffect(() => {
    if (hasEnded) setPlaying(false);
  }, [hasEnded]);
  return {
    part,
    isPlaying,
    show: (wanted) => {
      setPlaying(false);
      setPart(wanted);
    },
    play: (wanted) => {
      if (wanted && hasEnded) setPart(0);
      setPlaying(wanted);
    },
  };
}

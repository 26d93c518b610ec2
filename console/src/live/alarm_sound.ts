/** The sound of an alarm: which alarms are new, and what they sound like. */

import { useEffect, useRef } from "react";
import type { Alarm } from "../api/types";
import { usePreferences } from "../app/preferences";
import { useLive } from "./use_live";

const TONES_HZ = [880, 660, 880];
const TONE_S = 0.22;
const LOUDNESS = 0.25;

/** Whether an alarm is open that was not known before; at first all are known. */
export function hasNewAlarm(
  known: ReadonlySet<number> | null,
  alarms: ReadonlyMap<number, Alarm>,
): boolean {
  if (known === null) return false;
  return [...alarms.values()].some((one) => one.acknowledged_at === null && !known.has(one.id));
}

/** Sounds once for alarms that arrive while the console is open, unless it is muted. */
export function useAlarmSound(): void {
  const alarms = useLive((state) => state.alarms);
  const hasBegun = useLive((state) => state.contactAtMs !== null);
  const { preferences } = usePreferences();
  const known = useRef<Set<number> | null>(null);
  const sound = useRef<AudioContext | null>(null);
  useEffect(() => {
    // A browser allows sound after the first touch of the page
    const allow = () => {
      sound.current ??= new AudioContext();
      void sound.current.resume();
    };
    window.addEventListener("pointerdown", allow);
    window.addEventListener("keydown", allow);
    return () => {
      window.removeEventListener("pointerdown", allow);
      window.removeEventListener("keydown", allow);
      void sound.current?.close();
      sound.current = null;
    };
  }, []);
  useEffect(() => {
    if (!hasBegun) return;
    if (hasNewAlarm(known.current, alarms) && !preferences.isMuted && sound.current) play(sound.current);
    known.current = new Set(alarms.keys());
  }, [alarms, hasBegun, preferences.isMuted]);
}

function play(context: AudioContext): void {
  const volume = context.createGain();
  volume.gain.value = LOUDNESS;
  volume.connect(context.destination);
  TONES_HZ.forEach((frequency, index) => {
    const tone = context.createOscillator();
    tone.frequency.value = frequency;
    tone.connect(volume);
    tone.start(context.currentTime + index * TONE_S);
    tone.stop(context.currentTime + (index + 0.8) * TONE_S);
  });
}

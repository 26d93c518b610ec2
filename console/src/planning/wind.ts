/** The wind that the farm's drones have measured last. Pure. */

import type { FlightObservations } from "../api/types";

/** A wind and when it was measured. */
export interface Wind {
  speed_m_s: number;
  at_ms: number;
}

/** An older measurement says nothing about the next flight. */
export const WIND_EXPIRES_MS = 30 * 60_000;
/** Small drones keep their course up to about here, and up to there with little left for a gust. */
const CALM_M_S = 8;
const STRONG_M_S = 12;

/** The newest wind of the last half hour among the measurements of flights; null without one. */
export function newestWind(lists: readonly FlightObservations[], now_ms: number): Wind | null {
  let newest: Wind | null = null;
  for (const { observation_array } of lists) {
    for (const one of observation_array) {
      if (one.observed_property !== "wind_speed" || one.result_uom !== "m/s") continue;
      const at_ms = one.result_time * 1000;
      // A drone's clock may be wrong: it hides no other's wind
      if (Math.abs(now_ms - at_ms) > WIND_EXPIRES_MS) continue;
      if (newest === null || at_ms > newest.at_ms) newest = { speed_m_s: one.result_value, at_ms };
    }
  }
  return newest;
}

/** Whether one can fly in this wind; "look" where nobody has measured it lately. */
export function windState(wind: Wind | null, now_ms: number): "good" | "warning" | "bad" | "look" {
  const isKnown = wind !== null && Number.isFinite(wind.speed_m_s) && Math.abs(now_ms - wind.at_ms) <= WIND_EXPIRES_MS;
  if (!isKnown) return "look";
  if (wind.speed_m_s > STRONG_M_S) return "bad";
  return wind.speed_m_s > CALM_M_S ? "warning" : "good";
}

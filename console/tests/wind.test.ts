import { expect, test } from "vitest";
import type { FlightObservations } from "../src/api/types";
import { newestWind, windState } from "../src/planning/wind";

const NOW_MS = Date.parse("2026-11-27T10:00:00Z");
const MINUTE_MS = 60_000;
const list = (...values: [property: string, minutesAgo: number, value: number, unit?: string][]): FlightObservations => ({
  id: 1, latitude: 40, longitude: -3, altitude: 20,
  observation_array: values.map(([observed_property, minutesAgo, result_value, unit]) => ({
    resource_id: "urn:wind", observed_property, result_time: (NOW_MS - minutesAgo * MINUTE_MS) / 1000, result_value,
    result_uom: unit ?? "m/s",
  })),
});

test("the newest measurement of any flight is the wind", () => {
  const lists = [list(["wind_speed", 3, 4], ["wind_speed", 2, 5]), list(["wind_speed", 9, 11], ["air_temperature", 1, 20, "Cel"])];
  expect(newestWind(lists, NOW_MS)).toEqual({ speed_m_s: 5, at_ms: NOW_MS - 2 * MINUTE_MS });
});

test("a drone whose clock is wrong hides no other's wind", () => {
  const lists = [list(["wind_speed", -120, 2]), list(["wind_speed", 1, 13])];
  expect(newestWind(lists, NOW_MS)?.speed_m_s).toBe(13);
});

test("without a measurement, or with an old one, a person has to look", () => {
  expect(newestWind([list(["wind_direction", 1, 90, "deg"], ["wind_speed", 1, 9, "kn"])], NOW_MS)).toBeNull();
  expect(windState(null, NOW_MS)).toBe("look");
  expect(windState({ speed_m_s: 2, at_ms: NOW_MS - 31 * MINUTE_MS }, NOW_MS)).toBe("look");
  expect(windState({ speed_m_s: NaN, at_ms: NOW_MS }, NOW_MS)).toBe("look");
});

test("more wind is worse", () => {
  const state = (speed_m_s: number) => windState({ speed_m_s, at_ms: NOW_MS }, NOW_MS);
  expect([0, 8, 8.1, 12, 12.1, 30].map(state)).toEqual(["good", "good", "warning", "warning", "bad", "bad"]);
});

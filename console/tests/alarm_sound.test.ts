import { expect, test } from "vitest";
import type { Alarm } from "../src/api/types";
import { hasNewAlarm } from "../src/live/alarm_sound";

const alarms = (...rows: [id: number, acknowledged_at: string | null][]) =>
  new Map(
    rows.map(([id, acknowledged_at]): [number, Alarm] => [
      id,
      { id, acknowledged_at, vehicle_id: 1, recorded_at: "2026-05-01T10:00:00Z" },
    ]),
  );

test("an alarm that arrives sounds, one that was there when the page opened does not", () => {
  expect(hasNewAlarm(null, alarms([1, null]))).toBe(false);
  expect(hasNewAlarm(new Set([1]), alarms([1, null]))).toBe(false);
  expect(hasNewAlarm(new Set([1]), alarms([1, null], [2, null]))).toBe(true);
});

test("an alarm that somebody has acknowledged already makes no sound", () => {
  expect(hasNewAlarm(new Set([1]), alarms([2, "2026-05-01T10:01:00Z"]))).toBe(false);
});

import { expect, test } from "vitest";
import type { StoredEvent } from "../src/api/types";
import { speedOrderedIn } from "../src/live/use_ordered_speed";

const flight = { vehicle_id: 1, started_at: "2026-05-01T08:10:00Z", ended_at: null };
const order = (minute: string, maximum_speed: number, part: Partial<StoredEvent> = {}): StoredEvent =>
  ({ id: 1, vehicle_id: 1, event_type_id: 3, state: "done", received_at: `2026-05-01T08:${minute}:00Z`, maximum_speed, ...part }) as StoredEvent;

test("the last order that was carried out counts, with its time", () => {
  expect(speedOrderedIn(flight, [order("11", 3), order("12", 2), order("13", 9, { state: "refused" })]))
    .toEqual({ speed_m_s: 2, at: "2026-05-01T08:12:00Z" });
});

test("without an order the planned speed is flown", () => {
  expect(speedOrderedIn(flight, [])).toBeNull();
  const pause = order("11", 0, { event_type_id: 101, maximum_speed: null });
  expect(speedOrderedIn(flight, [pause, order("12", 2, { state: "expired" })])).toBeNull();
});

test("orders of another flight or vehicle are not its own", () => {
  const ended = { ...flight, ended_at: "2026-05-01T08:20:00Z" };
  const others = [order("09", 1), order("21", 2), order("15", 4, { vehicle_id: 2 })];
  expect(speedOrderedIn(ended, others)).toBeNull();
  expect(speedOrderedIn(ended, [...others, order("16", 3)])?.speed_m_s).toBe(3);
});

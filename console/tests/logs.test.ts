import { expect, test } from "vitest";
import type { Flight, FlightLog } from "../src/api/types";
import { awaitsLog } from "../src/flights/logs";

const NOON = Date.parse("2026-11-21T12:00:00Z");
const flight = (ended_at: string | null): Flight => ({
  id: 1, vehicle_id: 1, mission_id: null, started_at: "2026-11-21T11:50:00Z", ended_at,
  mission_status_id: null, distance_m: 0, pictures: 0, alarms: 0,
} as Flight);
const log = (url: string | null, format: FlightLog["format"] = "ulg"): FlightLog => ({
  id: 1, format, file_name: "flight.ulg", started_at: "2026-11-21T11:50:00Z",
  ended_at: "2026-11-21T11:59:00Z", size_bytes: 10, received_bytes: 5, is_complete: url !== null, url,
});

test("a log is awaited for a while after the landing", () => {
  expect(awaitsLog(flight(null), [], NOON)).toBe(false);
  expect(awaitsLog(flight("2026-11-21T11:59:00Z"), [], NOON)).toBe(true);
  expect(awaitsLog(flight("2026-11-21T11:30:00Z"), [], NOON)).toBe(false);
});

test("a log that is being received is awaited until it is complete", () => {
  expect(awaitsLog(flight("2026-11-21T09:00:00Z"), [log("/flights/1/logs/1"), log(null)], NOON)).toBe(true);
  expect(awaitsLog(flight("2026-11-21T11:59:00Z"), [log("/flights/1/logs/1")], NOON)).toBe(false);
});

test("the drone's own log is awaited beside the messages that the broker has kept", () => {
  const messages = log("/flights/1/logs/1", "tlog");
  expect(awaitsLog(flight("2026-11-21T11:59:00Z"), [messages], NOON)).toBe(true);
  expect(awaitsLog(flight("2026-11-21T11:59:00Z"), [messages, log("/flights/1/logs/2")], NOON)).toBe(false);
});

import { expect, test } from "vitest";
import type { StatusId } from "../src/api/types";
import { statusAt, stepAt } from "../src/flights/steps";

const at = (second: number) => `2026-05-01T10:00:${String(second).padStart(2, "0")}Z`;
const ms = (second: number) => Date.parse(at(second));
const step = (command_status_id: StatusId, started?: number, ended?: number) => ({
  command_status_id,
  started_at: started === undefined ? null : at(started),
  ended_at: ended === undefined ? null : at(ended),
});
const FLIGHT = [step(3, 10, 20), step(3, 20, 30), step(4, 30, 40), step(5, undefined, 40)];

test.each([
  [5, [1, 1, 1, 1], null],
  [10, [2, 1, 1, 1], 0],
  [19, [2, 1, 1, 1], 0],
  [20, [3, 2, 1, 1], 1],
  [35, [3, 3, 2, 1], 2],
  [40, [3, 3, 4, 5], 2],
])("at second %i of the replay each step has the status of then", (second, statuses, index) => {
  expect(FLIGHT.map((one) => statusAt(one, ms(second)))).toEqual(statuses);
  expect(stepAt(FLIGHT, ms(second))).toBe(index);
});

test("at the end each step has its last status, and none is marked", () => {
  expect(FLIGHT.map((one) => statusAt(one, null))).toEqual([3, 3, 4, 5]);
  expect(stepAt(FLIGHT, null)).toBeNull();
});

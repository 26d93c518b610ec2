import { expect, test } from "vitest";
import { aheadBy, noteServerTime, serverAheadMs } from "../src/api/server_clock";

const DATE = "Fri, 01 May 2026 10:00:00 GMT";
const STAMP_MS = Date.parse("2026-05-01T10:00:00Z");

test("a clock is as far ahead as the middle of the second that an answer names", () => {
  expect(aheadBy(DATE, STAMP_MS + 480, STAMP_MS + 520)).toBe(0);
  expect(aheadBy(DATE, STAMP_MS - 3_600_000, STAMP_MS - 3_599_000)).toBe(3_600_000);
  expect(aheadBy(null, 0, 10)).toBeNull();
  expect(aheadBy("yesterday", 0, 10)).toBeNull();
});

test("the difference of the clocks is that of the last quick answer", () => {
  const answer = (aheadMs: number) =>
    new Response(null, { headers: { Date: new Date(Date.now() + aheadMs).toUTCString() } });
  noteServerTime(answer(7_200_000), Date.now());
  expect(Math.abs(serverAheadMs() - 7_200_000)).toBeLessThan(1_500);
  noteServerTime(answer(60_000), Date.now() - 9_000); // Its Date may be nine seconds old
  expect(Math.abs(serverAheadMs() - 7_200_000)).toBeLessThan(1_500);
  noteServerTime(answer(0), Date.now());
  expect(Math.abs(serverAheadMs())).toBeLessThan(1_500);
});

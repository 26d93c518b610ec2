import { expect, test } from "vitest";
import { nextPause } from "../src/live/use_live";

test("what is drawn fast is drawn at its usual pace", () => {
  expect(nextPause(16.7, 1000)).toBe(1000);
  expect(nextPause(33.4, 1000)).toBe(1000);
});

test("slow frames take a small share of the time", () => {
  expect(nextPause(100, 1000)).toBe(2500);
  expect(nextPause(35, 1000)).toBe(1000);
});

test("nothing is drawn less often than every five seconds", () => {
  expect(nextPause(900, 1000)).toBe(5000);
});

import { expect, test } from "vitest";
import { matches } from "../src/planning/library";

const TEXTS = ["Olivar del Río 2", "Drone 1, Drone 12", "2 Nov 10:15"];

test("each word begins a word of the plan, in any order", () => {
  expect(matches("", TEXTS)).toBe(true);
  expect(matches("rio oli", TEXTS)).toBe(true);
  expect(matches("OLIVAR drone 12", TEXTS)).toBe(true);
  expect(matches("olivar meadow", TEXTS)).toBe(false);
  expect(matches("var", TEXTS)).toBe(false);
});

test("signs are no words, and none is special", () => {
  expect(matches("río, (2", TEXTS)).toBe(true);
  expect(matches(".*", TEXTS)).toBe(true);
  expect(matches("[", ["a"])).toBe(true);
});

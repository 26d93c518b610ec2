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

test("a number is itself, and the one behind a word belongs to it", () => {
  const texts = ["North 7", "Drone 1, Drone 12", "27 Nov 10:41"];
  expect(["drone 12", "drone 1", "nov 27", "27 nov", "north 7 drone 1", "10:41", "7"].map((one) => matches(one, texts)))
    .toEqual([true, true, true, true, true, true, true]);
  expect(["drone 2", "2", "10:4", "drone 27", "north 12"].map((one) => matches(one, texts)))
    .toEqual([false, false, false, false, false]);
});

test("signs are no words, and none is special", () => {
  expect(matches("río, (2", TEXTS)).toBe(true);
  expect(matches(".*", TEXTS)).toBe(true);
  expect(matches("[", ["a"])).toBe(true);
});

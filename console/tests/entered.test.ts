import { expect, test } from "vitest";
import { parametersOf, problemOf } from "../src/planning/command_forms";
import { fromUnit, inUnit, readNumber } from "../src/units/entered";
import { Units } from "../src/units/units";

const FEET = new Units("imperial", "en").lengthInput;
const METRES = new Units("metric", "en").lengthInput;

test("what is entered in feet is stored in metres, and shown as it was entered", () => {
  expect(fromUnit(50, FEET)).toBe(15.24);
  for (const feet of [0.5, 3, 33, 49.2, 50, 393.7, -164]) expect(inUnit(fromUnit(feet, FEET), FEET)).toBe(String(feet));
  expect([fromUnit(15.5, METRES), inUnit(15.5, METRES)]).toEqual([15.5, "15.5"]);
});

test("a limit that is shown in feet is allowed", () => {
  for (const one of parametersOf(7).filter(({ name }) => name === "orbit_altitude" || name === "radius")) {
    const shown = [inUnit(one.minimum ?? 0, FEET, Math.ceil), inUnit(one.maximum ?? 0, FEET, Math.floor)];
    for (const feet of shown) expect(problemOf(one, fromUnit(Number(feet), FEET))).toBeNull();
  }
});

test.each([
  ["1,5", 1.5], ["98.5", 98.5], [" -3 ", -3], ["+.5", 0.5], ["12,", 12], ["", null], ["  ", null],
  ["-", NaN], ["1.234,5", NaN], ["1,2,3", NaN], ["1e3", NaN], ["0x10", NaN], ["abc", NaN], ["Infinity", NaN],
])("a number is read with a point or a comma: %s", (text, number) => {
  expect(readNumber(text)).toBe(number);
});

test("a comma that may divide thousands is no decimal mark where the language has a point", () => {
  expect([readNumber("1,000", "."), readNumber("1,000", ","), readNumber("1,5", "."), readNumber("40,4434", ".")])
    .toEqual([NaN, 1, 1.5, 40.4434]);
});

test("a value without a system is shown as it is", () => {
  expect(inUnit(40.4434123, { symbol: "°", factor: 1, digits: null })).toBe("40.4434123");
});

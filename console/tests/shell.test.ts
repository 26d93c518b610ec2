import { expect, test } from "vitest";
import type { Vehicle } from "../src/api/types";
import { numberOf } from "../src/app/route";
import { titleOf } from "../src/app/use_title";
import { vehicleLevel } from "../src/screens/use_fleet_symbols";
import { Units } from "../src/units/units";

test("a number of an address is a whole number above 0", () => {
  expect(["7", "x", "", "0", "1.5", "NaN", "-3"].map(numberOf)).toEqual([7, null, null, null, null, null, null]);
});

test("each screen has a title", () => {
  expect([undefined, "alarms", "nowhere"].map(titleOf)).toEqual(["nav.fleet", "nav.alarms", null]);
});

test("a drone with its motors on lies above one that stands", () => {
  const [flying, idle] = [{ armed: true }, { armed: false }].map((one) => vehicleLevel(one as Vehicle));
  expect(flying).toBeGreaterThan(idle ?? 99);
});

test("a time has the same form with and without seconds, by the language", () => {
  const stamp = new Date(2026, 4, 1, 15, 4, 5).toISOString();
  const [english, spanish] = [new Units("metric", "en"), new Units("metric", "es")];
  expect([spanish.time(stamp).slice(-5), spanish.clock(stamp)]).toEqual(["15:04", "15:04:05"]);
  expect(english.time(stamp)).toMatch(/03:04\sPM$/);
  expect(english.clock(stamp)).toMatch(/^03:04:05\sPM$/);
});

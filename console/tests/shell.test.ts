import { expect, test } from "vitest";
import type { Vehicle } from "../src/api/types";
import { numberOf } from "../src/app/route";
import { titleOf } from "../src/app/use_title";
import { vehicleLevel } from "../src/screens/use_fleet_symbols";

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

import { expect, test } from "vitest";
import type { Command, ParameterValue } from "../src/api/types";
import { heightProfile, lengthOf } from "../src/planning/height_profile";

const command = (type: number, parameters: Record<string, ParameterValue>): Command => ({
  command_id: 1, command_type_id: type, parameters,
});
const at = (latitude: number, altitude: number) => ({ latitude, longitude: -3.7382, altitude });

test("a plan climbs at its start, follows its points and lands where it began", () => {
  const profile = heightProfile([
    command(1, at(40, 10)),
    command(3, at(40.001, 30)),
    command(4, { photo_count: 1 }),
    command(11, { landing: true }),
  ]);
  expect(profile.map((one) => one.height_m)).toEqual([0, 10, 30, 30, 0]);
  expect(profile[2]?.distance_m).toBeCloseTo(111.2, 0);
  expect(lengthOf(profile)).toBeCloseTo(222.4, 0);
});

test("a circle counts with its own height", () => {
  const circle = { latitude: 40, longitude: -3.7382, orbit_altitude: 20, radius: 10 };
  const profile = heightProfile([command(1, at(40, 10)), command(7, circle)]);
  expect(profile.at(-1)?.height_m).toBe(20);
});

test("nothing is flown before the takeoff", () => {
  expect(heightProfile([])).toEqual([]);
  expect(heightProfile([command(3, at(40, 10))])).toEqual([]);
});

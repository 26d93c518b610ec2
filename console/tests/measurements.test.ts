import { expect, test } from "vitest";
import { COLOURS, colourOf, kindsOf, measurementFeatures } from "../src/flights/measurements";

const one = (observed_property: string, result_value: number, result_time = 0, result_uom = "Cel") => ({
  resource_id: "urn", observed_property, result_value, result_time, result_uom,
});
const place = { latitude: 40, longitude: -3, altitude: 12 };

test("measurements are grouped by quantity, those of people's first questions first", () => {
  const kinds = kindsOf([
    { id: 2, ...place, observation_array: [one("leaf_wetness", 1, 5, "1"), one("air_temperature", 21, 5)] },
    { id: 1, ...place, observation_array: [one("air_temperature", 18, 3)] },
  ]);
  expect(kinds.map((kind) => kind.property)).toEqual(["air_temperature", "leaf_wetness"]);
  expect(kinds[0]).toMatchObject({ lowest: 18, highest: 21 });
  expect(kinds[0]?.measurements.map((each) => [each.at_ms, each.height_m])).toEqual([[3000, 12], [5000, 12]]);
});

test("the same quantity in another unit is another kind", () => {
  expect(kindsOf([{ id: 1, ...place, observation_array: [one("t", 1), one("t", 274, 0, "K")] }])).toHaveLength(2);
});

test("colours go from the lowest to the highest value", () => {
  const kind = { lowest: -10, highest: 30 };
  expect([-10, 10, 30, 99].map((value) => colourOf(value, kind))).toEqual([
    COLOURS[0], COLOURS[2], COLOURS[4], COLOURS[4],
  ]);
  expect(colourOf(5, { lowest: 5, highest: 5 })).toBe(COLOURS[2]);
});

test("the chosen measurement is marked on the map", () => {
  const [kind] = kindsOf([{ id: 7, ...place, observation_array: [one("t", 1), one("t", 2)] }]);
  const { features } = measurementFeatures(kind ?? null, "7-1");
  expect(features.map((feature) => feature.properties?.["chosen"])).toEqual([false, true]);
  expect(measurementFeatures(null, null).features).toEqual([]);
});

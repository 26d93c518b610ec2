import { expect, test } from "vitest";
import { routeFeatures } from "../src/map/features";
import { newCommand } from "../src/planning/command_forms";
import { TAKEOFF } from "../src/planning/command_types";

const PLACE = { latitude: 40.4434, longitude: -3.7382 };
const points = (features: GeoJSON.Feature[]) => features.filter(({ geometry }) => geometry.type === "Point");
const lines = (features: GeoJSON.Feature[]) => features.filter(({ geometry }) => geometry.type === "LineString");

test("a mission of one place is seen on a map that knows no home", () => {
  const features = routeFeatures([newCommand(TAKEOFF, 1, PLACE)], null);
  expect(lines(features)).toEqual([]);
  expect(points(features).map(({ geometry }) => geometry)).toEqual([
    { type: "Point", coordinates: [PLACE.longitude, PLACE.latitude] },
  ]);
});

test("a command without a place is not drawn", () => {
  expect(routeFeatures([{ command_id: 1, command_type_id: 9, parameters: {} }], null)).toEqual([]);
});

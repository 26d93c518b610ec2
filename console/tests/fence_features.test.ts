import { expect, test } from "vitest";
import { fenceFeatures, fencePlaces } from "../src/map/fence_features";
import { allows, fenceOf, fenceOfField } from "../src/planning/fence";

const GEOFENCE = {
  inclusion: [[[40, -3], [40, -2], [41, -2]]],
  exclusion: [[[40.1, -2.5], [40.1, -2.4], [40.2, -2.4]]],
  max_altitude: 60,
};
const fence = fenceOf(GEOFENCE);

test("a fence keeps the height of its plan", () => {
  expect(fence?.highest_m).toBe(60);
  expect(fenceOf({ inclusion: [] })?.highest_m).toBeNull();
  expect(fenceOf(null)).toBeNull();
});

test("a plan without a fence stays in its field, outside its holes and no-fly parts", () => {
  const square = (from: number, to: number) => [[from, from], [from, to], [to, to], [to, from]];
  const field = fenceOfField({ boundary: square(0, 10), holes: [square(1, 2)], exclusions: [square(4, 5)] });
  const places: [number, number][] = [[7, 7], [1.5, 1.5], [4.5, 4.5], [11, 7]];
  expect(places.map((place) => allows(field, place))).toEqual([true, false, false, false]);
});

test("each area of a fence is drawn as a closed ring of its kind", () => {
  const { features } = fenceFeatures(fence ? [fence] : []);
  expect(features.map(({ properties }) => properties?.["kind"])).toEqual(["inclusion", "exclusion"]);
  expect(features[0]?.geometry).toEqual({ type: "Polygon", coordinates: [[[-3, 40], [-2, 40], [-2, 41], [-3, 40]]] });
});

test("a map shows all of a fence", () => {
  expect(fence && fencePlaces(fence)).toHaveLength(6);
});

test("without a fence nothing is drawn", () => {
  expect(fenceFeatures([])).toEqual({ type: "FeatureCollection", features: [] });
});

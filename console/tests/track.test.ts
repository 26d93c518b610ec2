import { expect, test } from "vitest";
import { momentAt, partAt, pointsOf, timeAt } from "../src/flights/track";

const at = (second: number) => `2026-05-01T10:00:${String(second).padStart(2, "0")}Z`;
const TRACK: GeoJSON.Feature = {
  type: "Feature",
  properties: { coordinateProperties: { times: [at(0), at(10), at(40)], speeds: [0, 4, 2] } },
  geometry: { type: "LineString", coordinates: [[-3, 40, 0], [-3, 40.001, 20], [-2.999, 40.001, 20]] },
};

test("the middle of a flight is its middle in time, not in points", () => {
  const points = pointsOf(TRACK);
  expect(timeAt(points, 0.5)).toBe(Date.parse(at(20)));
  const moment = momentAt(points, 0.5);
  expect(moment?.longitude_deg).toBeCloseTo(-3 + 0.001 / 3, 9);
  expect(moment?.heading_deg).toBeCloseTo(90, 6);
});

test("heights and speeds lie between those of the points", () => {
  const moment = momentAt(pointsOf(TRACK), 0.125);
  expect(moment?.height_m).toBeCloseTo(10);
  expect(moment?.speed_m_s).toBeCloseTo(2);
  expect(moment?.heading_deg).toBeCloseTo(0, 6);
});

test("the ends of a flight are its first and last point", () => {
  const points = pointsOf(TRACK);
  expect(momentAt(points, 0)).toMatchObject({ height_m: 0, latitude_deg: 40 });
  expect(momentAt(points, 1)).toMatchObject({ height_m: 20, longitude_deg: -2.999 });
  expect(partAt(points, Date.parse(at(59)))).toBe(1);
  expect(partAt(points, Date.parse(at(10)))).toBe(0.25);
});

test("a single point has no moments", () => {
  expect(momentAt(pointsOf({ ...TRACK, geometry: { type: "Point", coordinates: [-3, 40, 0] } }), 0.5)).toBeNull();
  expect(pointsOf(null)).toEqual([]);
});

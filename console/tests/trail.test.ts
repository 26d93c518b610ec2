import { expect, test } from "vitest";
import { distanceM, offsetM, type Fix } from "../src/live/motion";
import { beginTrail, extendTrail, TOLERANCE_M, trailPlaces, type Trail } from "../src/live/trail";

const M_PER_DEG = 111_195;
const SCALE = Math.cos((40 * Math.PI) / 180);

const fix = (north_m: number, east_m: number, time_ms = 0): Fix => ({
  latitude_deg: 40 + north_m / M_PER_DEG,
  longitude_deg: -3 + east_m / (M_PER_DEG * SCALE),
  altitude_m: 20,
  time_ms,
});

function flown(fixes: readonly Fix[]): Trail {
  const [first, ...others] = fixes;
  if (first === undefined) throw new Error("a flight has a fix");
  return others.reduce(extendTrail, beginTrail(first));
}

function drawn(trail: Trail): Fix[] {
  return trailPlaces(trail).map(([longitude_deg, latitude_deg]) => ({
    latitude_deg, longitude_deg, altitude_m: null, time_ms: 0,
  }));
}

/** The distance of a fix from the nearest part of a line [m], by steps along each part. */
function fromLineM(place: Fix, line: readonly Fix[]): number {
  let least = Infinity;
  line.slice(1).forEach((end, index) => {
    const begin = line[index];
    if (begin === undefined) return;
    const { north_m, east_m } = offsetM(begin, end);
    const from = offsetM(fix(0, 0), begin);
    for (let share = 0; share <= 1; share += 0.005) {
      const on = fix(from.north_m + share * north_m, from.east_m + share * east_m);
      least = Math.min(least, distanceM(on, place));
    }
  });
  return least;
}

const circle = (count: number): Fix[] =>
  Array.from({ length: count }, (_, step) => fix(50 * Math.cos(0.04 * step), 50 * Math.sin(0.04 * step), step));

const random = (seed: number) => () => (seed = (seed * 16807) % 2147483647) / 2147483647;

test("a straight flight needs few places", () => {
  const trail = flown(Array.from({ length: 400 }, (_, step) => fix(2 * step, 3 * step, step)));
  expect(trailPlaces(trail).length).toBeLessThan(15);
});

test("a circle keeps its shape in a third of its fixes", () => {
  const fixes = circle(150);
  const trail = flown(fixes);
  expect(trailPlaces(trail).length).toBeLessThan(50);
  for (const one of fixes) expect(fromLineM(one, drawn(trail))).toBeLessThan(TOLERANCE_M + 0.05);
});

test("no place of a wandering flight lies off the trail, but for the step of a vehicle that rests", () => {
  for (const seed of [1, 2, 3]) {
    const draw = random(seed);
    let [north, east, course] = [0, 0, 0];
    const fixes = Array.from({ length: 200 }, (_, step) => {
      course += (draw() - 0.5) * 1.5;
      north += 3 * draw() * Math.cos(course);
      east += 3 * draw() * Math.sin(course);
      return fix(north, east, step);
    });
    const line = drawn(flown(fixes));
    for (const one of fixes) expect(fromLineM(one, line)).toBeLessThan(1 + TOLERANCE_M);
  }
});

test("a vehicle that flies back on its line keeps the place where it turned", () => {
  const out = [0, 5, 10, 15, 20].map((north) => fix(north, 0, north));
  const back = [15, 10, 5, 0].map((north) => fix(north, 0, 40 - north));
  const norths = drawn(flown([...out, ...back])).map((one) => offsetM(fix(0, 0), one).north_m);
  expect(Math.max(...norths)).toBeCloseTo(20, 3);
});

test("a vehicle that rests adds no place, and its last fix is the newest", () => {
  const trail = flown([fix(0, 0, 0), fix(0.2, 0, 1), fix(0, 0.3, 2)]);
  expect(trailPlaces(trail)).toHaveLength(1);
  expect(trail.last.time_ms).toBe(2);
});

test("the oldest places go when a flight is long", () => {
  const zigzag = Array.from({ length: 3000 }, (_, step) => fix(5 * step, step % 2 === 0 ? 0 : 20, step));
  const places = drawn(flown(zigzag));
  expect(places.length).toBeLessThanOrEqual(502);
  expect(offsetM(fix(0, 0), places.at(-1) ?? fix(0, 0)).north_m).toBeCloseTo(5 * 2999, -1);
});

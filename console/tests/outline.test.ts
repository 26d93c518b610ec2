import { shifted } from "../src/planning/ground";
import { expect, test } from "vitest";
import {
  areaOf_m2, draftOf, EMPTY, fieldArea_m2, isComplete, middleOf, nextCorner, presentRing, ringOf, ringOfFault,
  ringsOf, withCorner, withEntry, withMovedCorner, withoutCorner, withRing, type Corner, type Outline,
  type Ring,
} from "../src/planning/outline";

const START: Corner = [40.443, -3.739];
const square = (side_m: number, from: Corner = START): Ring => [
  from, shifted(from, side_m, 0), shifted(from, side_m, side_m), shifted(from, 0, side_m),
];
const field: Outline = {
  boundary: square(100), holes: [square(10)], exclusions: [square(20), square(30)], entry: null,
};

test("corners are added in order or between two others, moved and deleted", () => {
  const drawn = square(100).reduce<Ring>((ring, corner) => withCorner(ring, corner), []);
  expect(drawn).toHaveLength(4);
  const divided = withCorner(drawn, middleOf(drawn, 1), 1);
  expect(divided[2]?.[0]).toBeCloseTo(divided[1]?.[0] ?? 0, 7);
  expect(divided[2]?.[1]).toBeGreaterThan(divided[1]?.[1] ?? 0);
  expect(divided[2]?.[1]).toBeLessThan(divided[3]?.[1] ?? 0);
  expect(withMovedCorner(divided, 2, [41, -4])[2]).toEqual([41, -4]);
  expect(withoutCorner(divided, 2)).toEqual(drawn);
});

test("the last edge ends at the first corner", () => {
  const ring = square(100);
  expect(middleOf(ring, 3)[0]).toBeCloseTo(START[0], 9);
});

test("a triangle can be made without a map, then its edges are divided", () => {
  let ring: Ring = [];
  for (let count = 0; count < 4; count += 1) ring = withCorner(ring, nextCorner(ring, START));
  expect(ring[0]).toEqual(START);
  expect(areaOf_m2(ring)).toBeGreaterThan(400);
});

test("the area is that of the boundary without the holes", () => {
  expect(areaOf_m2(square(100))).toBeCloseTo(10_000, -1);
  expect(areaOf_m2([...square(100)].reverse())).toBeCloseTo(10_000, -1);
  expect(fieldArea_m2(field)).toBeCloseTo(9_900, -1);
  expect(fieldArea_m2(EMPTY)).toBe(0);
});

test("a ring is replaced or removed, the others stay", () => {
  const replaced = withRing(field, "exclusions.1", square(5));
  expect(ringOf(replaced, "exclusions.1")).toEqual(square(5));
  expect(ringOf(replaced, "exclusions.0")).toEqual(square(20));
  expect(ringsOf(withRing(field, "exclusions.0", null)).map(([name]) => name)).toEqual([
    "boundary", "holes.0", "exclusions.0",
  ]);
  expect(ringOf(withRing(field, "exclusions.0", null), "exclusions.0")).toEqual(square(30));
});

test("a field is complete when each of its rings has three corners", () => {
  expect(isComplete(EMPTY)).toBe(false);
  expect(isComplete(field)).toBe(true);
  expect(isComplete({ ...field, exclusions: [[]] })).toBe(false);
});

test("a field without a name is sent without one, with every ring", () => {
  const draft = draftOf("  ", field);
  expect(draft.name).toBeNull();
  expect([draft.boundary.length, draft.holes.length, draft.exclusions.length]).toEqual([4, 1, 2]);
});

test("an entry is sent where there is one, to a centimetre", () => {
  expect(draftOf("", field)).not.toHaveProperty("entry");
  const entered = withEntry(field, [40.123456789, -3.7]);
  expect(draftOf("", entered).entry).toEqual([40.1234568, -3.7]);
  expect(draftOf("", withEntry(entered, null))).not.toHaveProperty("entry");
});

test("a fault names the ring that it concerns", () => {
  expect(ringOfFault("boundary")).toBe("boundary");
  expect(ringOfFault("boundary.3.0")).toBe("boundary");
  expect(ringOfFault("exclusions.1")).toBe("exclusions.1");
  expect(ringOfFault("holes.0.2")).toBe("holes.0");
  expect(ringOfFault("name")).toBeNull();
});

test("an undo that takes the chosen part away leads back to the boundary", () => {
  const part: Outline = { ...EMPTY, exclusions: [[START]] };
  expect(presentRing(part, "exclusions.0")).toBe("exclusions.0");
  expect(presentRing(EMPTY, "exclusions.0")).toBe("boundary");
});

import { expect, test } from "vitest";
import { offsetsOf, type Point } from "../src/map/spread";

const APART_PX = 34;

function nearest(points: readonly Point[], offsets: readonly Point[]): number {
  const moved = points.map((one, index) => ({ x: one.x + (offsets[index]?.x ?? 0), y: one.y + (offsets[index]?.y ?? 0) }));
  return Math.min(...moved.flatMap((one, index) =>
    moved.slice(index + 1).map((other) => Math.hypot(one.x - other.x, one.y - other.y))));
}

test("symbols that do not touch stay where they are", () => {
  expect(offsetsOf([{ x: 0, y: 0 }, { x: 40, y: 0 }, { x: 0, y: 50 }], APART_PX)).toEqual(Array(3).fill({ x: 0, y: 0 }));
});

test.each([2, 3, 5, 11])("%i symbols at one place can each be pressed", (count) => {
  const points = Array.from({ length: count }, () => ({ x: 100, y: 100 }));
  expect(nearest(points, offsetsOf(points, APART_PX))).toBeGreaterThan(30);
});

test("two that overlap move away from each other, alike", () => {
  const [one, other] = offsetsOf([{ x: 0, y: 0 }, { x: 10, y: 0 }], APART_PX);
  expect(one?.x).toBeCloseTo(-12);
  expect(other?.x).toBeCloseTo(12);
});

test("a row of symbols is stretched, and keeps its order", () => {
  const points = Array.from({ length: 8 }, (_, index) => ({ x: index * 12, y: index % 2 }));
  const offsets = offsetsOf(points, APART_PX);
  expect(nearest(points, offsets)).toBeGreaterThan(28);
});

test("very many symbols stay where they are", () => {
  const points = Array.from({ length: 101 }, () => ({ x: 0, y: 0 }));
  expect(offsetsOf(points, APART_PX).every(({ x, y }) => x === 0 && y === 0)).toBe(true);
});

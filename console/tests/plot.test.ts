import { expect, test } from "vitest";
import { rangeOf, thinned } from "../src/flights/plot";

test("a long curve keeps its single highest and lowest value", () => {
  const samples = Array.from({ length: 5000 }, (_, index) => ({ at_ms: index, value: Math.sin(index / 100) }));
  samples[1234] = { at_ms: 1234, value: 60 };
  samples[4321] = { at_ms: 4321, value: -7 };
  const kept = thinned(samples, 100);
  expect(kept.length).toBeLessThanOrEqual(202);
  expect(rangeOf(kept)).toEqual([-7, 60]);
  expect(kept.map((one) => one.at_ms)).toEqual(kept.map((one) => one.at_ms).sort((one, other) => one - other));
  expect([kept[0]?.at_ms, kept.at(-1)?.at_ms]).toEqual([0, 4999]);
});

test("a short curve stays as it is", () => {
  const samples = [{ at_ms: 0, value: 2 }, { at_ms: 9, value: 3 }];
  expect(thinned(samples, 10)).toEqual(samples);
});

test("a flat curve on the ground has a range to be drawn in", () => {
  expect(rangeOf([{ at_ms: 0, value: 0 }])).toEqual([0, 1]);
});

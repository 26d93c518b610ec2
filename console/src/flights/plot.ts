/** A curve over time as a few points that keep its highest and lowest values. Pure. */

export interface Sample {
  at_ms: number;
  value: number;
}

/** Keeps the first, the last, and of each part of the curve the highest and the lowest sample. */
export function thinned(samples: readonly Sample[], parts: number): Sample[] {
  if (samples.length <= 2 * parts) return [...samples];
  const kept: Sample[] = [];
  const size = samples.length / parts;
  for (let part = 0; part < parts; part += 1) {
    const slice = samples.slice(Math.floor(part * size), Math.floor((part + 1) * size));
    const low = slice.reduce((one, other) => (other.value < one.value ? other : one));
    const high = slice.reduce((one, other) => (other.value > one.value ? other : one));
    kept.push(...(low.at_ms < high.at_ms ? [low, high] : low === high ? [low] : [high, low]));
  }
  const first = samples[0];
  const last = samples.at(-1);
  if (first && kept[0] !== first) kept.unshift(first);
  if (last && kept.at(-1) !== last) kept.push(last);
  return kept;
}

/** The lowest and highest value of a curve, with zero in between them; [0, 1] for a flat one. */
export function rangeOf(samples: readonly Sample[]): [low: number, high: number] {
  let low = 0;
  let high = 0;
  for (const { value } of samples) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return low === high ? [low, low + 1] : [low, high];
}

/** The outline of a field while it is drawn: its boundary, holes, no-fly areas and entry. Pure. */

import type { FieldDraft } from "../api/resources";
import type { StoredField } from "../api/types";
import { rounded } from "./command_forms";
import { eastMPerDeg, M_PER_DEG, shifted } from "./ground";

/** Degrees, in the order of the edge server. */
export type Corner = readonly [latitude: number, longitude: number];
export type Ring = readonly Corner[];

export interface Outline {
  boundary: Ring;
  holes: readonly Ring[];
  exclusions: readonly Ring[];
  /** Where vehicles enter: they are started there, and a survey begins beside it. */
  entry: Corner | null;
}

/** Which ring of an outline: its path in the edge server's document. */
export type RingName = "boundary" | `holes.${number}` | `exclusions.${number}`;

export const EMPTY: Outline = { boundary: [], holes: [], exclusions: [], entry: null };
export const FEWEST_CORNERS = 3;
/** A corner that is added without a map to click lies this far from the last one. */
const STEP_M = 30;

export function outlineOf(field: StoredField): Outline {
  const ring = (corners: readonly (readonly number[])[]): Ring =>
    corners.map(([latitude = 0, longitude = 0]): Corner => [latitude, longitude]);
  return {
    boundary: ring(field.boundary),
    holes: (field.holes ?? []).map(ring),
    exclusions: (field.exclusions ?? []).map(ring),
    entry: field.entry ? [field.entry[0] ?? 0, field.entry[1] ?? 0] : null,
  };
}

/** Every ring of an outline with its name, the boundary first. */
export function ringsOf(outline: Outline): [RingName, Ring][] {
  return [
    ["boundary", outline.boundary],
    ...outline.holes.map((ring, index): [RingName, Ring] => [`holes.${index}`, ring]),
    ...outline.exclusions.map((ring, index): [RingName, Ring] => [`exclusions.${index}`, ring]),
  ];
}

export function ringOf(outline: Outline, name: RingName): Ring {
  return ringsOf(outline).find(([one]) => one === name)?.[1] ?? [];
}

/** The ring that is edited: the boundary when an undo has taken the chosen one away. */
export function presentRing(outline: Outline, chosen: RingName): RingName {
  return ringsOf(outline).some(([name]) => name === chosen) ? chosen : "boundary";
}

/** An outline with one ring replaced; null removes a hole or a no-fly area. */
export function withRing(outline: Outline, name: RingName, ring: Ring | null): Outline {
  if (name === "boundary") return { ...outline, boundary: ring ?? [] };
  const [kind, index] = name.split(".") as ["holes" | "exclusions", string];
  const rings = outline[kind].flatMap((one, at) => {
    if (at !== Number(index)) return [one];
    return ring === null ? [] : [ring];
  });
  return { ...outline, [kind]: rings };
}

/** A ring with a corner more, after the one at `index`; by default at its end. */
export function withCorner(ring: Ring, corner: Corner, index = ring.length - 1): Ring {
  return [...ring.slice(0, index + 1), precise(corner), ...ring.slice(index + 1)];
}

export function withMovedCorner(ring: Ring, index: number, corner: Corner): Ring {
  return ring.map((one, at) => (at === index ? precise(corner) : one));
}

export function withoutCorner(ring: Ring, index: number): Ring {
  return ring.filter((_, at) => at !== index);
}

/** The middle of the edge that begins at a corner. */
export function middleOf(ring: Ring, index: number): Corner {
  const [from, to] = [ring[index], ring[(index + 1) % ring.length]];
  if (from === undefined || to === undefined) return from ?? [0, 0];
  return [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
}

/** An outline with its entry elsewhere; null removes it. */
export function withEntry(outline: Outline, entry: Corner | null): Outline {
  return { ...outline, entry: entry && precise(entry) };
}

/** Where the next corner goes that nobody has clicked: `start` is that of a ring without any. */
export function nextCorner(ring: Ring, start: Corner): Corner {
  const last = ring.at(-1);
  if (last === undefined) return start;
  if (ring.length >= FEWEST_CORNERS) return middleOf(ring, ring.length - 1);
  return ring.length === 1 ? shifted(last, STEP_M, 0) : shifted(last, 0, STEP_M);
}

/** Size of a ring on level ground. */
export function areaOf_m2(ring: Ring): number {
  const first = ring[0];
  if (first === undefined) return 0;
  const east = eastMPerDeg(first[0]);
  const places = ring.map(([latitude, longitude]): Corner => [
    (latitude - first[0]) * M_PER_DEG,
    (longitude - first[1]) * east,
  ]);
  const doubled = places.reduce((sum, [y, x], index) => {
    const [nextY, nextX] = places[(index + 1) % places.length] ?? [0, 0];
    return sum + x * nextY - nextX * y;
  }, 0);
  return Math.abs(doubled) / 2;
}

/** Size of a field without its holes. */
export function fieldArea_m2(outline: Outline): number {
  return areaOf_m2(outline.boundary) - outline.holes.reduce((sum, hole) => sum + areaOf_m2(hole), 0);
}

/** Whether every ring has enough corners to be saved. */
export function isComplete(outline: Outline): boolean {
  return ringsOf(outline).every(([, ring]) => ring.length >= FEWEST_CORNERS);
}

/** The document of an outline; the edge server keeps a field without a name as one. */
export function draftOf(name: string, outline: Outline): FieldDraft {
  const written = (ring: Ring) => ring.map(([latitude, longitude]): [number, number] => [latitude, longitude]);
  return {
    name: name.trim() === "" ? null : name.trim(),
    boundary: written(outline.boundary),
    holes: outline.holes.map(written),
    exclusions: outline.exclusions.map(written),
    ...(outline.entry === null ? {} : { entry: [outline.entry[0], outline.entry[1]] }),
  };
}

/** Which ring a path of the edge server's faults names; null for none. */
export function ringOfFault(path: string): RingName | null {
  const found = /(?:^|\.)(boundary|(?:holes|exclusions)\.\d+)(?:\.|$)/.exec(path);
  return (found?.[1] as RingName | undefined) ?? null;
}

function precise([latitude, longitude]: Corner): Corner {
  return [rounded(latitude), rounded(longitude)];
}

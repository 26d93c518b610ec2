/** The part of a field that a survey covers: a ring of its own, or the whole field. Pure. */

import type { StoredField } from "../api/types";
import { isSame } from "./changes";
import { outlineOf, type Ring } from "./outline";

/** null: the whole field. */
export type SurveyArea = Ring | null;

/** The ring whose corners are shown. */
export function ringOfArea(area: SurveyArea, field: StoredField): Ring {
  return area ?? outlineOf(field).boundary;
}

/** The area of a ring that has changed: back at the corners of the field it is the whole field. */
export function areaOfRing(ring: Ring, field: StoredField): SurveyArea {
  return isSame(ring, outlineOf(field).boundary) ? null : ring;
}

/** What this browser keeps of an area: it is a part of the field as it was drawn in. */
export interface KeptArea {
  ring: Ring;
  boundary: Ring;
}

export function keptOf(area: SurveyArea, field: StoredField): KeptArea | null {
  return area === null ? null : { ring: area, boundary: outlineOf(field).boundary };
}

/** An area that was kept; the whole field when its boundary has changed since. */
export function areaOfKept(kept: KeptArea | null | undefined, field: StoredField): SurveyArea {
  return kept && isSame(kept.boundary, outlineOf(field).boundary) ? kept.ring : null;
}

/** Number of the corner that a path of the edge server's faults names, from 0; null for none. */
export function cornerOfFault(path: string): number | null {
  const found = /^area\.(\d+)(?:\.|$)/.exec(path);
  return found === null ? null : Number(found[1]);
}

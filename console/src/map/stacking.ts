/** Which base map lies above which. Pure. */

import type { BaseMap } from "../api/types";

/** Tiles cover everything, an aerial picture a part of it, a survey a field. */
function rankOf({ kind, survey }: BaseMap): number {
  if (survey !== undefined) return 2;
  return kind === "picture" || kind === "vegetation_index" ? 1 : 0;
}

/** Sorts base maps from the lowest to the highest; a newer survey lies above an older one. */
export function stacked(maps: readonly BaseMap[]): BaseMap[] {
  return [...maps].sort(
    (one, other) =>
      rankOf(one) - rankOf(other) ||
      (one.survey?.flightId ?? 0) - (other.survey?.flightId ?? 0) ||
      Number(one.kind === "vegetation_index") - Number(other.kind === "vegetation_index") ||
      one.name.localeCompare(other.name),
  );
}

/** The first of the drawn layers that lies above a source; undefined if none of the others does. */
export function layerAbove(
  layers: readonly { id: string; source?: string | undefined }[], source: string, order: readonly string[],
): string | undefined {
  const above = new Set(order.slice(order.indexOf(source) + 1));
  return layers.find((layer) => layer.source !== undefined && above.has(layer.source))?.id;
}

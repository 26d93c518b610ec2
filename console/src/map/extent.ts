/** The smallest view that shows all of some places. Pure. */

export type Extent = [west: number, south: number, east: number, north: number];

/** Gives the extent of places as [longitude, latitude]; null without any. */
export function extentOf(places: readonly (readonly [number, number])[]): Extent | null {
  const first = places[0];
  if (first === undefined) return null;
  const extent: Extent = [first[0], first[1], first[0], first[1]];
  for (const [longitude, latitude] of places) {
    extent[0] = Math.min(extent[0], longitude);
    extent[1] = Math.min(extent[1], latitude);
    extent[2] = Math.max(extent[2], longitude);
    extent[3] = Math.max(extent[3], latitude);
  }
  return extent;
}

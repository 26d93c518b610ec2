/** The grid of the map: lines at round distances, because there are no tiles without internet. Pure. */

import { M_PER_DEG } from "../planning/ground";

const MOST_LINES = 60;
const RAD = Math.PI / 180;

/** The part of the world that the map shows [deg]. */
export interface View {
  west: number;
  south: number;
  east: number;
  north: number;
}

/** The distance between lines [m]: 1, 2 or 5 times a power of ten, for 8 to 20 lines. */
export function stepOf(widthM: number): number {
  const rough = Math.max(1, widthM / 14);
  const power = 10 ** Math.floor(Math.log10(rough));
  const factor = [1, 2, 5, 10].find((one) => one * power >= rough) ?? 10;
  return factor * power;
}

/** Lines of constant latitude and longitude; every fifth is a main one. */
export function gridOf(view: View): GeoJSON.FeatureCollection<GeoJSON.LineString> {
  // The scale of a whole degree, so that lines keep their places while the map moves
  const latitude = Math.round((view.south + view.north) / 2);
  const scale = M_PER_DEG * Math.max(0.1, Math.cos(latitude * RAD));
  const step = stepOf((view.east - view.west) * scale);
  const features: GeoJSON.Feature<GeoJSON.LineString>[] = [];
  const add = (index: number, coordinates: GeoJSON.Position[]) =>
    features.push({
      type: "Feature",
      properties: { main: index % 5 === 0 },
      geometry: { type: "LineString", coordinates },
    });
  for (const index of indices(view.west, view.east, step / scale)) {
    const x = (index * step) / scale;
    add(index, [[x, view.south], [x, view.north]]);
  }
  for (const index of indices(view.south, view.north, step / M_PER_DEG)) {
    const y = (index * step) / M_PER_DEG;
    add(index, [[view.west, y], [view.east, y]]);
  }
  return { type: "FeatureCollection", features };
}

function indices(low: number, high: number, step: number): number[] {
  const first = Math.ceil(low / step);
  const count = Math.min(MOST_LINES, Math.max(0, Math.floor(high / step) - first + 1));
  return Array.from({ length: count }, (_, offset) => first + offset);
}

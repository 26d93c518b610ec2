/** The track of a recorded flight and where the vehicle was at a moment of it. Pure. */

/** A point of a track; height is above home. */
export interface TrackPoint {
  at_ms: number;
  longitude_deg: number;
  latitude_deg: number;
  height_m: number;
  speed_m_s: number | null;
}

/** A place between two points, with the direction of flight from north. */
export interface Moment extends TrackPoint {
  heading_deg: number;
}

const RAD = Math.PI / 180;
const STEP_MS = 1000;

/** The points of a track in the order of time; a track without times has a point each second. */
export function pointsOf(track: GeoJSON.FeatureCollection | GeoJSON.Feature | null): TrackPoint[] {
  if (track === null) return [];
  const features = track.type === "FeatureCollection" ? track.features : [track];
  return features.flatMap(({ geometry, properties }) => {
    if (geometry?.type !== "LineString") return [];
    const more = (properties?.["coordinateProperties"] ?? {}) as { times?: string[]; speeds?: number[] };
    return geometry.coordinates.map(([longitude_deg = 0, latitude_deg = 0, height_m = 0], index) => ({
      at_ms: Date.parse(more.times?.[index] ?? "") || index * STEP_MS,
      longitude_deg,
      latitude_deg,
      height_m,
      speed_m_s: more.speeds?.[index] ?? null,
    }));
  });
}

/** The time at a part of a track, from 0 to 1. */
export function timeAt(points: readonly TrackPoint[], part: number): number {
  const first = points[0]?.at_ms ?? 0;
  return first + part * ((points.at(-1)?.at_ms ?? first) - first);
}

/** The part of a track at a time, from 0 to 1. */
export function partAt(points: readonly TrackPoint[], at_ms: number): number {
  const first = points[0]?.at_ms ?? 0;
  const length_ms = (points.at(-1)?.at_ms ?? first) - first;
  return length_ms <= 0 ? 0 : Math.min(1, Math.max(0, (at_ms - first) / length_ms));
}

/** Where the vehicle was at a part of the track; null without a track. */
export function momentAt(points: readonly TrackPoint[], part: number): Moment | null {
  const at_ms = timeAt(points, part);
  let index = firstFrom(points, at_ms);
  index = Math.min(Math.max(index, 1), points.length - 1);
  const one = points[index - 1];
  const next = points[index];
  if (one === undefined || next === undefined) return null;
  const length_ms = next.at_ms - one.at_ms;
  const between = length_ms <= 0 ? 1 : Math.min(1, Math.max(0, (at_ms - one.at_ms) / length_ms));
  const mix = (from: number, to: number) => from + (to - from) * between;
  const east = (next.longitude_deg - one.longitude_deg) * Math.cos(one.latitude_deg * RAD);
  return {
    at_ms,
    longitude_deg: mix(one.longitude_deg, next.longitude_deg),
    latitude_deg: mix(one.latitude_deg, next.latitude_deg),
    height_m: mix(one.height_m, next.height_m),
    speed_m_s:
      one.speed_m_s === null || next.speed_m_s === null ? null : mix(one.speed_m_s, next.speed_m_s),
    heading_deg: Math.atan2(east, next.latitude_deg - one.latitude_deg) / RAD,
  };
}

/** The first point that is not before a time, found by halving. */
function firstFrom(points: readonly TrackPoint[], at_ms: number): number {
  let low = 0;
  let high = points.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((points[middle]?.at_ms ?? 0) < at_ms) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** GeoJSON of what the map draws: fields, trails and routes. Pure. */

import type { Command, CommandState } from "../api/types";
import type { Fix } from "../live/motion";
import { placeOfFix, trailPlaces, type Place, type Trail } from "../live/trail";

type Lines = GeoJSON.FeatureCollection;

const NOTHING: Lines = { type: "FeatureCollection", features: [] };
const CIRCLE_POINTS = 48;
const M_PER_DEG = 111_195;
const RAD = Math.PI / 180;

export function collection(features: GeoJSON.Feature[]): Lines {
  return features.length === 0 ? NOTHING : { type: "FeatureCollection", features };
}

/** The rings of a field that the map draws. */
export type Rings = {
  boundary: readonly (readonly number[])[];
  holes?: readonly (readonly (readonly number[])[])[];
  exclusions?: readonly (readonly (readonly number[])[])[];
};

/** Fields as areas, and what no vehicle may enter as areas of kind "exclusion". */
export function fieldFeatures(fields: readonly Rings[], kind: "field" | "drawn" = "field"): Lines {
  const ring = (corners: readonly (readonly number[])[]): Place[] => {
    const places = corners.map((corner): Place => [corner[1] ?? 0, corner[0] ?? 0]);
    return places[0] === undefined ? [] : [...places, places[0]];
  };
  const area = (name: string, rings: Place[][]): GeoJSON.Feature => ({
    type: "Feature",
    properties: { kind: name },
    geometry: { type: "Polygon", coordinates: rings },
  });
  return collection(
    fields.flatMap((field) => [
      area(kind, [field.boundary, ...(field.holes ?? [])].map(ring)),
      ...(field.exclusions ?? []).map((one) => area("exclusion", [ring(one)])),
    ]),
  );
}

/** The trails of vehicles that have moved. */
export function trailFeatures(trails: readonly (Trail | null)[]): GeoJSON.Feature[] {
  return trails.flatMap((trail) => {
    const places = trail === null ? [] : trailPlaces(trail);
    return places.length < 2 ? [] : [line(places, { kind: "trail" })];
  });
}

/** The place of a command, or null for one that is not a movement to a place. */
export function placeOf(command: Command): Place | null {
  const { latitude, longitude } = command.parameters;
  return typeof latitude === "number" && typeof longitude === "number"
    ? [longitude, latitude]
    : null;
}

/** The legs of a mission, each "flown", "present" or "ahead", its circles, and a point at each place. */
export function routeFeatures(
  commands: readonly (Command & Partial<CommandState>)[],
  home: Fix | null,
): GeoJSON.Feature[] {
  const features: GeoJSON.Feature[] = [];
  let before: Place | null = home && placeOfFix(home);
  const start = before;
  for (const command of commands) {
    const part = partOf(command.command_status_id ?? 1);
    const place = command.command_type_id === 11 ? start : placeOf(command);
    if (place === null) continue;
    if (before !== null) features.push(line([before, place], { kind: "route", part }));
    const radius = command.parameters["radius"];
    if (command.command_type_id === 7 && typeof radius === "number") {
      features.push(line(circle(place, radius), { kind: "route", part }));
    }
    features.push({
      type: "Feature",
      properties: { kind: "waypoint", part },
      geometry: { type: "Point", coordinates: [...place] },
    });
    before = place;
  }
  return features;
}

function partOf(status: number): "flown" | "present" | "ahead" {
  if (status === 1) return "ahead";
  return status === 2 ? "present" : "flown";
}

function circle([longitude, latitude]: Place, radiusM: number): Place[] {
  return Array.from({ length: CIRCLE_POINTS + 1 }, (_, index): Place => {
    const angle = (index / CIRCLE_POINTS) * 2 * Math.PI;
    const east = (Math.sin(angle) * radiusM) / (M_PER_DEG * Math.cos(latitude * RAD));
    return [longitude + east, latitude + (Math.cos(angle) * radiusM) / M_PER_DEG];
  });
}

function line(coordinates: Place[], properties: Record<string, string>): GeoJSON.Feature {
  return { type: "Feature", properties, geometry: { type: "LineString", coordinates } };
}

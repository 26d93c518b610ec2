/** GeoJSON of what the map draws: fields, trails and routes. Pure. */

import type { Command, CommandState } from "../api/types";
import type { Fix } from "../live/motion";
import { CIRCLE, HOME } from "../planning/command_types";
import { circleAround } from "../planning/ground";
import { placeOfFix, trailPlaces, type Place, type Trail } from "../live/trail";

type Lines = GeoJSON.FeatureCollection;

const NOTHING: Lines = { type: "FeatureCollection", features: [] };

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
    const place = command.command_type_id === HOME ? start : placeOf(command);
    if (place === null) continue;
    if (before !== null) features.push(line([before, place], { kind: "route", part }));
    const radius = command.parameters["radius"];
    if (command.command_type_id === CIRCLE && typeof radius === "number") {
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

function circle([longitude, latitude]: Place, radius_m: number): Place[] {
  return circleAround([latitude, longitude], radius_m).map(([north, east]): Place => [east, north]);
}

function line(coordinates: Place[], properties: Record<string, string>): GeoJSON.Feature {
  return { type: "Feature", properties, geometry: { type: "LineString", coordinates } };
}

/** GeoJSON of the areas in which plans may fly. Pure. */

import type { Fence } from "../planning/fence";
import { collection } from "./features";
import type { Place } from "../live/trail";

type Ring = readonly (readonly number[])[];

/** Areas of kind "inclusion", which a vehicle does not leave, and "exclusion", which it does not enter. */
export function fenceFeatures(fences: readonly Fence[]): GeoJSON.FeatureCollection {
  const area = (kind: string, ring: Ring): GeoJSON.Feature => {
    const places = placesOf(ring);
    const closed = places[0] === undefined ? [] : [...places, places[0]];
    return { type: "Feature", properties: { kind }, geometry: { type: "Polygon", coordinates: [closed] } };
  };
  return collection(
    fences.flatMap(({ inclusion, exclusion }) => [
      ...inclusion.map((ring) => area("inclusion", ring)),
      ...exclusion.map((ring) => area("exclusion", ring)),
    ]),
  );
}

/** The corners of a fence as [longitude, latitude]. */
export function fencePlaces({ inclusion, exclusion }: Fence): Place[] {
  return [...inclusion, ...exclusion].flatMap(placesOf);
}

function placesOf(ring: Ring): Place[] {
  return ring.map(([latitude = 0, longitude = 0]): Place => [longitude, latitude]);
}

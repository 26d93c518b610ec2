/** Maps that the edge server has made of surveys, as base maps. */

import { listFlightMaps } from "../api/resources";
import type { BaseMap, MadeFlightMap } from "../api/types";

const NAME = /^survey\/(\d+)\/(rgb|ndvi)$/;

/** What names the map of a flight among the base maps; no file has such a name. */
export function surveyName(flightId: number, band: string): string {
  return `survey/${flightId}/${band}`;
}

/** Whether a base map is the map of a survey. */
export function isSurvey(name: string): boolean {
  return NAME.test(name);
}

/** A map of a flight as a base map. */
export function asBaseMap(map: MadeFlightMap): BaseMap {
  return {
    name: surveyName(map.flight_id, map.band),
    kind: map.band === "ndvi" ? "vegetation_index" : "picture",
    url: map.url,
    bounds: null,
    corners: map.corners.map(([latitude = 0, longitude = 0]): [number, number] => [latitude, longitude]),
    fault: null,
    survey: {
      flightId: map.flight_id, vehicleId: map.vehicle_id, planName: map.plan_name, madeAt: map.made_at,
    },
  };
}

/** Reads the maps of surveys, the newest first; those in near infrared alone show nothing by themselves. */
export async function listSurveyMaps(): Promise<BaseMap[]> {
  const maps = (await listFlightMaps()).map(asBaseMap).filter(({ name }) => isSurvey(name));
  return maps.reverse();
}

/** Maps that the edge server has made of surveys, as base maps. */

import { getFlightMap, listFlights } from "../api/resources";
import type { BaseMap, Flight, FlightMap } from "../api/types";

const BANDS = ["rgb", "ndvi"] as const;
type SurveyBand = (typeof BANDS)[number];
/** Each asks the edge server for two maps. */
const MOST_FLIGHTS = 20;
/** Fewer pictures make no map. */
const FEWEST_PICTURES = 2;
const NAME = /^survey\/(\d+)\/(rgb|ndvi)$/;

/** What names the map of a flight among the base maps; no file has such a name. */
export function surveyName(flightId: number, band: SurveyBand): string {
  return `survey/${flightId}/${band}`;
}

/** The maps of surveys among names of base maps. */
export function surveysOf(names: readonly string[]): { flightId: number; band: SurveyBand }[] {
  return names.flatMap((name) => {
    const [, id, band] = NAME.exec(name) ?? [];
    return id === undefined ? [] : [{ flightId: Number(id), band: band as SurveyBand }];
  });
}

/** Of flights with the newest first, those that may have a map. */
export function surveyFlights(flights: readonly Flight[]): number[] {
  return flights.filter(({ pictures }) => pictures >= FEWEST_PICTURES).slice(0, MOST_FLIGHTS).map(({ id }) => id);
}

/** A finished map as a base map; null for one that is not made. */
export function asBaseMap(flightId: number, map: FlightMap): BaseMap | null {
  if (map.url === null || map.corners === null || map.made_at === null) return null;
  return {
    name: surveyName(flightId, map.band as SurveyBand),
    kind: map.band === "ndvi" ? "vegetation_index" : "picture",
    url: map.url,
    bounds: null,
    corners: map.corners.map(([latitude = 0, longitude = 0]): [number, number] => [latitude, longitude]),
    fault: null,
    survey: { flightId, madeAt: map.made_at },
  };
}

/** Reads the maps with these names; with `all` also those of the newest flights. */
export async function listSurveyMaps(names: readonly string[], all: boolean): Promise<BaseMap[]> {
  const ids = all ? surveyFlights(await listFlights()) : [];
  const wanted = new Map(
    [...surveysOf(names), ...ids.flatMap((flightId) => BANDS.map((band) => ({ flightId, band })))].map(
      (one) => [surveyName(one.flightId, one.band), one],
    ),
  );
  const found = await Promise.all(
    [...wanted.values()].map(({ flightId, band }) =>
      getFlightMap(flightId, band).then(
        (map) => asBaseMap(flightId, map),
        () => null, // The flight is no longer there
      ),
    ),
  );
  return found.filter((one) => one !== null);
}

/** GeoJSON of a survey: a line for each flight and its pictures, by vehicle. Pure. */

import type { PlannedSurvey } from "../api/types";
import { placeOf } from "./features";

/** So many colours; further vehicles begin again with the first. */
export const DRONE_COLOURS = 6;
const PICTURE = 4;

/** One flight of a survey: its places and where it takes pictures, as [longitude, latitude]. */
export interface SurveyFlight {
  vehicleId: number;
  /** Which battery of this vehicle, from 1. */
  round: number;
  places: [number, number][];
  pictures: [number, number][];
}

export function surveyFlights(survey: PlannedSurvey): SurveyFlight[] {
  return survey.plans.flatMap((plan, index) =>
    plan.missions.map((mission): SurveyFlight => {
      const flight: SurveyFlight = { vehicleId: mission.vehicle_id, round: index + 1, places: [], pictures: [] };
      for (const command of mission.command_array) {
        const place = placeOf(command);
        const last = flight.places.at(-1);
        if (place !== null) flight.places.push(place);
        else if (command.command_type_id === PICTURE && last) flight.pictures.push(last);
      }
      return flight;
    }),
  );
}

/** From 1 to DRONE_COLOURS, by the order in which vehicles take part. */
export function colourOf(vehicleId: number, vehicles: readonly number[]): number {
  return (Math.max(0, vehicles.indexOf(vehicleId)) % DRONE_COLOURS) + 1;
}

export function surveyFeatures(flights: readonly SurveyFlight[], vehicles: readonly number[]): GeoJSON.FeatureCollection {
  const features = flights.flatMap(({ vehicleId, places, pictures }): GeoJSON.Feature[] => {
    const properties = { part: "survey", drone: colourOf(vehicleId, vehicles) };
    return [
      { type: "Feature", properties, geometry: { type: "LineString", coordinates: places } },
      { type: "Feature", properties: { ...properties, part: "picture" }, geometry: { type: "MultiPoint", coordinates: pictures } },
    ];
  });
  return { type: "FeatureCollection", features };
}

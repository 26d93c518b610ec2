/** GeoJSON of a survey: a line for each flight and its pictures, by vehicle. Pure. */

import type { PlannedSurvey } from "../api/types";
import { PICTURE, TAKEOFF } from "../planning/command_types";
import { shifted } from "../planning/ground";
import type { Camera } from "../planning/survey";
import { placeOf } from "./features";

/** So many colours; further vehicles begin again with the first. */
export const DRONE_COLOURS = 6;
const RAD = Math.PI / 180;

/** One flight of a survey: its places and where it takes pictures, as [longitude, latitude]. */
export interface SurveyFlight {
  vehicleId: number;
  /** Which battery of this vehicle, from 1. */
  round: number;
  /** Where it begins and ends; null where it takes off towards its first place. */
  home: [number, number] | null;
  places: [number, number][];
  pictures: [number, number][];
}

export function surveyFlights(survey: PlannedSurvey): SurveyFlight[] {
  return survey.plans.flatMap((plan, index) =>
    plan.missions.map((mission): SurveyFlight => {
      const flight: SurveyFlight = { vehicleId: mission.vehicle_id, round: index + 1, home: null, places: [], pictures: [] };
      for (const command of mission.command_array) {
        const place = placeOf(command);
        const last = flight.places.at(-1);
        if (command.command_type_id === TAKEOFF) flight.home = place;
        else if (place !== null) flight.places.push(place);
        else if (command.command_type_id === PICTURE && last) flight.pictures.push(last);
      }
      const [first] = flight.places;
      if (first?.every((degrees, axis) => degrees === flight.home?.[axis])) flight.home = null;
      return flight;
    }),
  );
}

/** From 1 to DRONE_COLOURS, by the order in which vehicles take part. */
export function colourOf(vehicleId: number, vehicles: readonly number[]): number {
  return (Math.max(0, vehicles.indexOf(vehicleId)) % DRONE_COLOURS) + 1;
}

export function surveyFeatures(flights: readonly SurveyFlight[], vehicles: readonly number[]): GeoJSON.FeatureCollection {
  const features = flights.flatMap(({ vehicleId, home, places, pictures }): GeoJSON.Feature[] => {
    const properties = { part: "survey", drone: colourOf(vehicleId, vehicles) };
    const [first, last] = [places[0], places.at(-1)];
    const transit = home === null || first === undefined || last === undefined ? [] : [[home, first], [last, home]];
    return [
      { type: "Feature", properties: { ...properties, part: "transit" }, geometry: { type: "MultiLineString", coordinates: transit } },
      { type: "Feature", properties, geometry: { type: "LineString", coordinates: places } },
      { type: "Feature", properties: { ...properties, part: "picture" }, geometry: { type: "MultiPoint", coordinates: pictures } },
    ];
  });
  return { type: "FeatureCollection", features };
}

/** The ground that a picture shows, on level ground: across the line of flight and along it. */
export interface Footprint {
  across_m: number;
  along_m: number;
  /** Of the lines, from north. */
  bearing_deg: number;
}

export function footprintOf(camera: Camera, height_m: number, bearing_deg: number): Footprint {
  const scale = height_m / camera.focal_length_mm;
  return {
    across_m: camera.sensor_width_mm * scale,
    along_m: camera.sensor_height_mm * scale,
    bearing_deg,
  };
}

/** An area for each picture; where two overlap, the map shows it darker. */
export function footprintFeatures(
  flights: readonly SurveyFlight[], vehicles: readonly number[], footprint: Footprint,
): GeoJSON.Feature[] {
  return flights.flatMap(({ vehicleId, pictures }) =>
    pictures.map((place): GeoJSON.Feature => ({
      type: "Feature",
      properties: { part: "footprint", drone: colourOf(vehicleId, vehicles) },
      geometry: { type: "Polygon", coordinates: [cornersOf(place, footprint)] },
    })),
  );
}

function cornersOf([longitude, latitude]: [number, number], one: Footprint): [number, number][] {
  const [cosine, sine] = [Math.cos(one.bearing_deg * RAD), Math.sin(one.bearing_deg * RAD)];
  return [[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]].map(([forward = 0, right = 0]) => {
    const [along_m, across_m] = [(forward * one.along_m) / 2, (right * one.across_m) / 2];
    const [north, east] = shifted([latitude, longitude], along_m * cosine - across_m * sine, along_m * sine + across_m * cosine);
    return [east, north];
  });
}

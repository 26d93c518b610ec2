/** What a flight has measured, by kind, and the colours of its values on the map. Pure. */

import type { FlightObservations } from "../api/types";

/** One value at the place where it was measured. */
export interface Measurement {
  key: string;
  at_ms: number;
  latitude_deg: number;
  longitude_deg: number;
  height_m: number;
  sensor: string;
  value: number;
}

/** Everything that a flight has measured of one quantity, the oldest first. */
export interface Kind {
  property: string;
  unit: string;
  measurements: Measurement[];
  lowest: number;
  highest: number;
}

/** Kinds that people ask for first. */
const ORDER = [
  "air_temperature", "temperature", "relative_humidity", "soil_moisture", "soil_temperature", "illuminance",
  "wind_speed", "wind_direction", "air_pressure",
];
/** From low to high: viridis, which people with a colour vision deficiency can read too. */
export const COLOURS = ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"] as const;

/** Groups measurements by their quantity and unit, those that people ask for first. */
export function kindsOf(lists: readonly FlightObservations[]): Kind[] {
  const kinds = new Map<string, Kind>();
  for (const list of lists) {
    list.observation_array.forEach((one, index) => {
      const name = `${one.observed_property} ${one.result_uom}`;
      const kind = kinds.get(name) ?? {
        property: one.observed_property,
        unit: one.result_uom,
        measurements: [],
        lowest: one.result_value,
        highest: one.result_value,
      };
      kinds.set(name, kind);
      kind.lowest = Math.min(kind.lowest, one.result_value);
      kind.highest = Math.max(kind.highest, one.result_value);
      kind.measurements.push({
        key: `${list.id}-${index}`,
        at_ms: one.result_time * 1000,
        latitude_deg: list.latitude,
        longitude_deg: list.longitude,
        height_m: list.altitude,
        sensor: one.resource_id,
        value: one.result_value,
      });
    });
  }
  const place = ({ property }: Kind) => (ORDER.includes(property) ? ORDER.indexOf(property) : ORDER.length);
  const sorted = [...kinds.values()].sort(
    (one, other) => place(one) - place(other) || one.property.localeCompare(other.property),
  );
  for (const kind of sorted) kind.measurements.sort((one, other) => one.at_ms - other.at_ms);
  return sorted;
}

/** The colour of a value between the lowest and the highest of its kind. */
export function colourOf(value: number, { lowest, highest }: Pick<Kind, "lowest" | "highest">): string {
  const part = highest > lowest ? Math.min(1, Math.max(0, (value - lowest) / (highest - lowest))) : 0.5;
  const at = part * (COLOURS.length - 1);
  const from = Math.min(Math.floor(at), COLOURS.length - 2);
  const mixed = [1, 3, 5].map((digit) => {
    const channel = (colour: string | undefined) => parseInt(colour?.slice(digit, digit + 2) ?? "0", 16);
    const [low, high] = [channel(COLOURS[from]), channel(COLOURS[from + 1])];
    return Math.round(low + (high - low) * (at - from)).toString(16).padStart(2, "0");
  });
  return `#${mixed.join("")}`;
}

/** Points for the map, each in the colour of its value. */
export function measurementFeatures(kind: Kind | null, chosen: string | null): GeoJSON.FeatureCollection {
  return {
    type: "FeatureCollection",
    features: (kind?.measurements ?? []).map((one) => ({
      type: "Feature",
      properties: { key: one.key, colour: kind && colourOf(one.value, kind), chosen: one.key === chosen },
      geometry: { type: "Point", coordinates: [one.longitude_deg, one.latitude_deg] },
    })),
  };
}

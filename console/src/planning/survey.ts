/** What a person chooses for a survey, and the order to the edge server that it makes. Pure. */

import type { SurveyOrder } from "../api/types";
import { orderedSpeed } from "./speed_limits";
import type { SurveyArea } from "./survey_area";

/** Where vehicles stand, as [longitude, latitude] by number: they take off there and return. */
export type Homes = ReadonlyMap<number, readonly [number, number]>;

/** A camera that looks straight down; its width lies across the line of flight. */
export interface Camera {
  sensor_width_mm: number;
  sensor_height_mm: number;
  focal_length_mm: number;
  /** Pixels along the width of the sensor. */
  pixels_across: number;
}

/** Cameras by the name of their text; sizes are those of data sheets. */
export const CAMERAS = {
  one_inch: { sensor_width_mm: 13.2, sensor_height_mm: 8.8, focal_length_mm: 8.8, pixels_across: 5472 },
  aps_c: { sensor_width_mm: 23.5, sensor_height_mm: 15.6, focal_length_mm: 16, pixels_across: 6000 },
  full_frame: { sensor_width_mm: 35.9, sensor_height_mm: 24, focal_length_mm: 35, pixels_across: 7952 },
  multispectral: { sensor_width_mm: 4.8, sensor_height_mm: 3.6, focal_length_mm: 5.4, pixels_across: 1280 },
} as const satisfies Record<string, Camera>;

/** A camera of the list, one by its own sizes, or none: a swath, as of a sprayer. */
export type CameraChoice = keyof typeof CAMERAS | "own" | "none";
export const CAMERA_CHOICES: readonly CameraChoice[] = [
  ...(Object.keys(CAMERAS) as (keyof typeof CAMERAS)[]), "own", "none",
];

/** Values in SI units, fractions and degrees; null where nothing usable was entered. */
export interface SurveyForm {
  camera: CameraChoice;
  own: { [name in keyof Camera]: number | null };
  swath_width_m: number | null;
  height_m: number | null;
  side_overlap: number | null;
  front_overlap: number | null;
  speed_m_s: number | null;
  /** Bearing of the lines; "automatic" leaves it to the edge server. */
  direction_deg: number | "automatic";
  endurance_s: number | null;
}

export const FIRST_FORM: SurveyForm = {
  camera: "one_inch",
  own: CAMERAS.one_inch,
  swath_width_m: 5,
  height_m: 30,
  side_overlap: 0.6,
  front_overlap: 0.75,
  speed_m_s: 5,
  direction_deg: "automatic",
  endurance_s: 900,
};

/** A mission's limit: where it ends, a flight should end by its battery and not before. */
const MOST_COMMANDS = 700;

/** The camera of a form; null without one, or while a size of it is missing. */
export function cameraOf(form: SurveyForm): Camera | null {
  if (form.camera === "none") return null;
  if (form.camera !== "own") return CAMERAS[form.camera];
  const { sensor_width_mm, sensor_height_mm, focal_length_mm, pixels_across } = form.own;
  if (!sensor_width_mm || !sensor_height_mm || !focal_length_mm || !pixels_across) return null;
  return { sensor_width_mm, sensor_height_mm, focal_length_mm, pixels_across };
}

/** Width of a pixel on level ground. */
export function resolutionOf_m(camera: Camera, height_m: number): number {
  return (camera.sensor_width_mm * height_m) / (camera.focal_length_mm * camera.pixels_across);
}

/** The height from which a pixel is so wide on the ground. */
export function heightOf_m(camera: Camera, resolution_m: number): number {
  return (resolution_m * camera.focal_length_mm * camera.pixels_across) / camera.sensor_width_mm;
}

/** The order of a form for a field, held until somebody dispatches it; null while a value is missing. */
export function orderOf(
  form: SurveyForm, fieldId: number, vehicles: readonly number[], area: SurveyArea = null, homes: Homes = new Map(),
): SurveyOrder | null {
  const { height_m, side_overlap, front_overlap, speed_m_s, endurance_s, swath_width_m } = form;
  // The survey's own limit is higher than that of the plans which are made of it
  const flown_m_s = orderedSpeed(speed_m_s);
  const numbers = [height_m, side_overlap, front_overlap, flown_m_s, endurance_s];
  if (numbers.includes(null) || vehicles.length === 0) return null;
  const shared = {
    field_id: fieldId,
    altitude: height_m ?? 0,
    side_overlap: side_overlap ?? 0,
    front_overlap: front_overlap ?? 0,
    maximum_speed: flown_m_s ?? 0,
    endurance: endurance_s ?? 0,
    vehicles: [...vehicles],
    most_commands: MOST_COMMANDS,
    dispatch: false,
    homes: vehicles.flatMap((vehicle_id) => {
      const [longitude, latitude] = homes.get(vehicle_id) ?? [];
      return longitude === undefined || latitude === undefined ? [] : [{ vehicle_id, latitude, longitude }];
    }),
    ...(area === null ? {} : { area: area.map(([latitude, longitude]): [number, number] => [latitude, longitude]) }),
    ...(form.direction_deg === "automatic" ? {} : { angle: form.direction_deg }),
  };
  if (form.camera === "none") return swath_width_m === null ? null : { ...shared, swath_width: swath_width_m };
  const camera = cameraOf(form);
  if (camera === null) return null;
  const { sensor_width_mm, sensor_height_mm, focal_length_mm } = camera;
  return { ...shared, camera: { sensor_width_mm, sensor_height_mm, focal_length_mm } };
}

/** Which vehicles fly at once, and which wait for somebody. */
export type Departure = "now" | "hold";

/** An order whose flights can be dispatched by themselves, where not all vehicles fly at once. */
export function withDepartures(order: SurveyOrder, departures: readonly Departure[]): SurveyOrder {
  const isMixed = departures.includes("now") && departures.includes("hold");
  return isMixed ? { ...order, plan_per_vehicle: true } : order;
}

/** The plans to dispatch: the first flight of each vehicle that flies now. */
export function departing<Stored extends { missions: readonly { vehicle_id: number }[] }>(
  plans: readonly Stored[], departs: (vehicleId: number) => boolean,
): Stored[] {
  const seen = new Set<number>();
  return plans.filter(({ missions }) => {
    const ids = missions.map((one) => one.vehicle_id);
    const isFirst = !ids.some((id) => seen.has(id));
    ids.forEach((id) => seen.add(id));
    return isFirst && ids.every(departs);
  });
}

/** The inputs of the form at which a fault of the edge server can be shown. */
export const FAULT_PATHS = [
  "camera.sensor_width_mm", "camera.sensor_height_mm", "camera.focal_length_mm", "swath_width",
  "altitude", "side_overlap", "front_overlap", "maximum_speed", "angle", "endurance", "vehicles",
] as const;
export type FaultPath = (typeof FAULT_PATHS)[number];

/** Which input of the form as it is a path of the edge server's faults names; null for none. */
export function inputOfFault(path: string, form: SurveyForm): FaultPath | null {
  return FAULT_PATHS.find((one) => isAt(path, one) && isShown(one, form)) ?? null;
}

function isShown(path: FaultPath, { camera }: SurveyForm): boolean {
  if (path.startsWith("camera.")) return camera === "own";
  if (path === "swath_width") return camera === "none";
  return path !== "front_overlap" || camera !== "none";
}

/** By paths of the edge server's document: the texts that a person sees for them. */
const TEXTS = {
  "camera.sensor_width_mm": "survey.sensor_width_mm",
  "camera.sensor_height_mm": "survey.sensor_height_mm",
  "camera.focal_length_mm": "survey.focal_length_mm",
  camera: "survey.camera",
  swath_width: "survey.swath_width_m",
  altitude: "survey.height_m",
  side_overlap: "survey.side_overlap",
  front_overlap: "survey.front_overlap",
  maximum_speed: "survey.speed_m_s",
  angle: "survey.direction",
  endurance: "survey.endurance_s",
  vehicles: "survey.vehicles",
  field_id: "survey.field",
  area: "survey.part",
  boundary: "survey.field",
  holes: "survey.field",
  exclusions: "survey.field_exclusions",
  entry: "fields.entry",
  homes: "survey.home",
  home: "survey.home",
  missions: "survey.plan",
} as const;

/** The text by which a person knows what a path names; null where the console has none. */
export function textOfFault(path: string): (typeof TEXTS)[keyof typeof TEXTS] | null {
  const found = (Object.keys(TEXTS) as (keyof typeof TEXTS)[]).find((one) => isAt(path, one));
  return found === undefined ? null : TEXTS[found];
}

function isAt(path: string, place: string): boolean {
  return path === place || path.startsWith(`${place}.`);
}

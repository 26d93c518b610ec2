import { expect, test } from "vitest";
import type { PlannedSurvey } from "../src/api/types";
import en from "../src/i18n/en.json";
import { colourOf, footprintFeatures, footprintOf, surveyFeatures, surveyFlights } from "../src/map/survey_features";
import {
  CAMERAS, departing, FAULT_PATHS, FIRST_FORM, heightOf_m, inputOfFault, orderOf, resolutionOf_m, textOfFault,
  withDepartures,
} from "../src/planning/survey";

test("ground resolution and height follow each other", () => {
  // The data sheet of the multispectral camera: 8 cm per pixel from 120 m
  expect(resolutionOf_m(CAMERAS.multispectral, 120)).toBeCloseTo(0.083, 3);
  for (const camera of Object.values(CAMERAS)) {
    expect(heightOf_m(camera, resolutionOf_m(camera, 42))).toBeCloseTo(42, 9);
  }
});

test("an order names the field, is held, and has a camera or a swath", () => {
  const order = orderOf(FIRST_FORM, 7, [2, 1]);
  expect(order).toMatchObject({ field_id: 7, vehicles: [2, 1], dispatch: false, altitude: 30 });
  expect(order?.camera).toEqual({ sensor_width_mm: 13.2, sensor_height_mm: 8.8, focal_length_mm: 8.8 });
  expect(order).not.toHaveProperty("angle");
  const sprayed = orderOf({ ...FIRST_FORM, camera: "none", direction_deg: 40 }, 7, [1]);
  expect(sprayed).toMatchObject({ swath_width: 5, angle: 40 });
  expect(sprayed).not.toHaveProperty("camera");
});

test("there is no order while a value or a vehicle is missing", () => {
  expect(orderOf(FIRST_FORM, 7, [])).toBeNull();
  expect(orderOf({ ...FIRST_FORM, height_m: null }, 7, [1])).toBeNull();
  expect(orderOf({ ...FIRST_FORM, speed_m_s: 13 }, 7, [1])).toBeNull();
  expect(orderOf({ ...FIRST_FORM, speed_m_s: 12 }, 7, [1])).toMatchObject({ maximum_speed: 12 });
  expect(orderOf({ ...FIRST_FORM, side_overlap: 0 }, 7, [1])).not.toBeNull();
  const own = { ...CAMERAS.one_inch, focal_length_mm: null };
  expect(orderOf({ ...FIRST_FORM, camera: "own", own }, 7, [1])).toBeNull();
});

test("vehicles that do not all fly at once get plans of their own", () => {
  const order = orderOf(FIRST_FORM, 7, [1, 2]);
  expect(order).not.toBeNull();
  if (order === null) return;
  expect(withDepartures(order, ["now", "now"])).toEqual(order);
  expect(withDepartures(order, ["now", "hold"])).toEqual({ ...order, plan_per_vehicle: true });
});

test("the first flight of each vehicle that flies now is dispatched, and no other", () => {
  const plan = (...ids: number[]) => ({ missions: ids.map((vehicle_id) => ({ vehicle_id })) });
  const together = [plan(1, 2), plan(1, 2)];
  expect(departing(together, () => true)).toEqual([together[0]]);
  const apart = [plan(1), plan(2), plan(3), plan(1), plan(3)];
  expect(departing(apart, (id) => id !== 2)).toEqual([apart[0], apart[2]]);
  expect(departing(together, (id) => id === 1)).toEqual([]);
});

test("a fault is shown at the input that it names", () => {
  const own = { ...FIRST_FORM, camera: "own" as const };
  expect(inputOfFault("camera.focal_length_mm", own)).toBe("camera.focal_length_mm");
  expect(inputOfFault("vehicles.1", own)).toBe("vehicles");
  expect(inputOfFault("angle", own)).toBe("angle");
  expect(inputOfFault("field_id", own)).toBeNull();
});

test("a fault of an input that is not shown is named in the notice", () => {
  expect(inputOfFault("camera.focal_length_mm", FIRST_FORM)).toBeNull();
  expect(inputOfFault("swath_width", FIRST_FORM)).toBeNull();
  const swath = { ...FIRST_FORM, camera: "none" as const };
  expect(inputOfFault("front_overlap", swath)).toBeNull();
  expect(textOfFault("camera.focal_length_mm")).toBe("survey.focal_length_mm");
  expect(textOfFault("camera")).toBe("survey.camera");
  expect(textOfFault("exclusions.2")).toBe("survey.field_exclusions");
  expect(textOfFault("most_commands")).toBeNull();
});

test("every name of a fault is a text", () => {
  const texts: { [section: string]: { [name: string]: string } } = { survey: en.survey, fields: en.fields };
  for (const path of [...FAULT_PATHS, "field_id", "boundary", "holes", "exclusions", "entry", "home", "missions"]) {
    const [section = "", name = ""] = textOfFault(path)?.split(".") ?? [];
    expect([path, texts[section]?.[name]]).toEqual([path, expect.any(String)]);
  }
});

test("a footprint is as large as the camera shows it, along the lines", () => {
  const footprint = footprintOf(CAMERAS.one_inch, 30, 90);
  expect(footprint.across_m).toBeCloseTo(45, 9);
  expect(footprint.along_m).toBeCloseTo(30, 9);
  const [area] = footprintFeatures(surveyFlights(survey), [2, 1], footprint);
  const ring = (area?.geometry as GeoJSON.Polygon).coordinates[0] ?? [];
  const width = (axis: 0 | 1) => {
    const values = ring.map((place) => place[axis] ?? 0);
    return Math.max(...values) - Math.min(...values);
  };
  // Lines to the east: the long side of the picture lies north to south
  expect(width(1) * 111_195).toBeCloseTo(45, 3);
  expect(width(0) * 111_195 * Math.cos((40 * Math.PI) / 180)).toBeCloseTo(30, 3);
  expect(ring[0]).toEqual(ring.at(-1));
});

const place = (longitude: number) => ({ latitude: 40, longitude, altitude: 30 });
const mission = (vehicleId: number, start: number, takeoff = place(start)) => ({
  mission_id: vehicleId, vehicle_id: vehicleId, dispatch_state: "held", mission_status_id: 1,
  command_array: [
    [1, takeoff], [3, place(start)], [4, { pitch_angle: -90 }], [3, place(start + 1)], [11, { landing: true }],
  ].map(([type, parameters], index) => ({
    command_id: index + 1, command_type_id: type, command_status_id: 1, parameters,
  })),
});
const survey = {
  plans: [{ missions: [mission(2, 0), mission(1, 5)] }, { missions: [mission(2, 10, { latitude: 40.4, longitude: -3.74, altitude: 30 })] }],
} as unknown as PlannedSurvey;

test("each mission of each plan is a flight with its pictures", () => {
  const flights = surveyFlights(survey);
  expect(flights.map((one) => [one.vehicleId, one.round])).toEqual([[2, 1], [1, 1], [2, 2]]);
  expect(flights[0]?.pictures).toEqual([[0, 40]]);
  expect(flights[0]?.places.at(-1)).toEqual([1, 40]);
});

test("a vehicle has one colour in all its flights, by the order of the vehicles", () => {
  const lines = surveyFeatures(surveyFlights(survey), [2, 1]).features
    .filter((one) => one.geometry.type === "LineString");
  expect(lines.map((one) => one.properties?.["drone"])).toEqual([1, 2, 1]);
  expect(colourOf(9, [3, 4, 5, 6, 7, 8, 9])).toBe(1);
});

test("a flight is drawn from where it takes off and back, if that is not its first place", () => {
  const paths = surveyFeatures(surveyFlights(survey), [2, 1]).features
    .filter((one) => one.properties?.["part"] === "transit")
    .map(({ geometry }) => (geometry.type === "MultiLineString" ? geometry.coordinates : null));
  expect(paths).toEqual([[], [], [[[-3.74, 40.4], [10, 40]], [[11, 40], [-3.74, 40.4]]]]);
});

test("each vehicle of a survey takes off where it stood", () => {
  const homes = new Map<number, [number, number]>([[2, [-3.7, 40.4]], [3, [-3.8, 40.5]]]);
  expect(orderOf(FIRST_FORM, 7, [2, 1], null, homes)?.homes).toEqual([{ vehicle_id: 2, longitude: -3.7, latitude: 40.4 }]);
  expect(orderOf(FIRST_FORM, 7, [1])?.homes).toEqual([]);
});

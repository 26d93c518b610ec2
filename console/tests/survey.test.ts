import { expect, test } from "vitest";
import type { PlannedSurvey } from "../src/api/types";
import { colourOf, surveyFeatures, surveyFlights } from "../src/map/survey_features";
import {
  CAMERAS, FIRST_FORM, heightOf_m, inputOfFault, orderOf, resolutionOf_m,
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
  expect(orderOf({ ...FIRST_FORM, side_overlap: 0 }, 7, [1])).not.toBeNull();
  const own = { ...CAMERAS.one_inch, focal_length_mm: null };
  expect(orderOf({ ...FIRST_FORM, camera: "own", own }, 7, [1])).toBeNull();
});

test("a fault is shown at the input that it names", () => {
  expect(inputOfFault("camera.focal_length_mm")).toBe("camera.focal_length_mm");
  expect(inputOfFault("vehicles.1")).toBe("vehicles");
  expect(inputOfFault("field_id")).toBeNull();
});

const place = (longitude: number) => ({ latitude: 40, longitude, altitude: 30 });
const mission = (vehicleId: number, start: number) => ({
  mission_id: vehicleId, vehicle_id: vehicleId, dispatch_state: "held", mission_status_id: 1,
  command_array: [
    [1, place(start)], [3, place(start)], [4, { pitch_angle: -90 }], [3, place(start + 1)], [11, { landing: true }],
  ].map(([type, parameters], index) => ({
    command_id: index + 1, command_type_id: type, command_status_id: 1, parameters,
  })),
});
const survey = {
  plans: [{ missions: [mission(2, 0), mission(1, 5)] }, { missions: [mission(2, 10)] }],
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

import { expect, test } from "vitest";
import {
  COMMAND_TYPES, heightOf_m, newCommand, parametersOf, placeOfFault, problemOf, problemsOf,
} from "../src/planning/command_forms";
import { USUAL_SPEED_M_S } from "../src/planning/plan_form";

const PLACE = { latitude: 40.4434, longitude: -3.7382 };
const parameter = (type: number, name: string) => {
  const found = parametersOf(type).find((one) => one.name === name);
  if (found === undefined) throw new Error(`command ${type} has no ${name}`);
  return found;
};

test("every command type of the edge server has a form whose first values are valid", () => {
  expect(COMMAND_TYPES).toEqual([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
  for (const type of COMMAND_TYPES) {
    const { parameters } = newCommand(type, 1, PLACE);
    for (const one of parametersOf(type)) expect(problemOf(one, parameters[one.name])).toBeNull();
  }
});

test("no new command is faster than the usual plan, as the edge server reckons it", () => {
  for (const type of COMMAND_TYPES) {
    const { angular_velocity, radius } = newCommand(type, 1, PLACE).parameters;
    if (angular_velocity === undefined) continue;
    const speed_m_s = ((Number(angular_velocity) * Math.PI) / 180) * Number(radius);
    expect(speed_m_s).toBeGreaterThan(1);
    expect(speed_m_s).toBeLessThanOrEqual(USUAL_SPEED_M_S);
  }
});

test("a circle has a height as a waypoint has one", () => {
  const CIRCLE = 7;
  expect(heightOf_m(newCommand(CIRCLE, 1, PLACE))).toBe(15);
  expect(heightOf_m({ command_id: 1, command_type_id: 11, parameters: {} })).toBeNull();
});

test("ranges are those of the edge server", () => {
  expect(problemOf(parameter(1, "altitude"), 0)).toBe("out_of_range");
  expect(problemOf(parameter(3, "altitude"), 0)).toBeNull();
  expect(problemOf(parameter(3, "altitude"), 120.5)).toBe("out_of_range");
  expect(problemOf(parameter(4, "photo_count"), 1.5)).toBe("whole");
  expect(problemOf(parameter(7, "radius"), null)).toBe("number");
});

test("the problems of a command name its parameters", () => {
  const command = newCommand(3, 1, PLACE);
  expect(problemsOf(command)).toEqual([]);
  const faulty = { ...command, parameters: { ...command.parameters, altitude: 500, hold_time: NaN } };
  expect(problemsOf(faulty).map((one) => [one.parameter.name, one.problem])).toEqual([
    ["altitude", "out_of_range"], ["hold_time", "number"],
  ]);
});

test("corners of a picture are fractions of its sides", () => {
  const track = COMMAND_TYPES.map((type) => parametersOf(type).find((one) => one.name === "corners")).find((one) => one !== undefined)!;
  expect(problemOf(track, [[0.1, 0.2], [0.8, 0.9]])).toBeNull();
  expect(problemOf(track, [[NaN, NaN], [NaN, NaN]])).toBe("number");
  expect(problemOf(track, [[0.1, 0.2], [0.8, 1.1]])).toBe("out_of_range");
});

test("a fault of the edge server belongs to the command and parameter of its path", () => {
  expect(placeOfFault("missions.0.command_array.3.parameters.altitude")).toEqual({ mission: 0, index: 3, parameter: "altitude" });
  expect(placeOfFault("missions.1.command_array.2")).toEqual({ mission: 1, index: 2, parameter: null });
  expect(placeOfFault("missions.0.vehicle_id")).toBeNull();
});

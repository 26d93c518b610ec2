/** The parameters of the eleven commands, as the edge server's document describes them. Pure. */

import type { Command, ParameterValue } from "../api/types";
import schemas from "../../generated/commands.json";

/** One parameter of a command, with its range. */
export interface Parameter {
  name: string;
  type: string;
  minimum: number | null;
  maximum: number | null;
  /** Whether the minimum itself is not allowed. */
  above_minimum: boolean;
  below_maximum: boolean;
  choices: number[] | null;
  default: number | boolean | null;
  nullable: boolean;
  required: boolean;
}

const PARAMETERS = new Map<number, Parameter[]>(
  (schemas as { command_type_id: number; parameters: Parameter[] }[]).map((one) => [
    one.command_type_id,
    one.parameters,
  ]),
);

export const COMMAND_TYPES = [...PARAMETERS.keys()];

const USUAL: Record<string, ParameterValue> = {
  altitude: 15,
  orbit_altitude: 15,
  radius: 20,
  // With this radius 3.5 m/s: less than the usual maximum speed of a plan, unlike the server's 20 deg/s
  angular_velocity: 10,
  pitch_angle: -90,
  corners: [[0.25, 0.25], [0.75, 0.75]],
};

/** Parameters of a command type, those that must be given first. */
export function parametersOf(commandType: number): Parameter[] {
  const all = PARAMETERS.get(commandType) ?? [];
  return [...all.filter((one) => one.required), ...all.filter((one) => !one.required)];
}

export function hasPlace(commandType: number): boolean {
  return parametersOf(commandType).some((one) => one.name === "latitude");
}

/** A new command with usual values, at a place if it has one. */
export function newCommand(
  commandType: number,
  commandId: number,
  place: { latitude: number; longitude: number },
): Command {
  const parameters: Record<string, ParameterValue> = {};
  for (const one of parametersOf(commandType)) {
    const isPlace = one.name === "latitude" || one.name === "longitude";
    if (isPlace) parameters[one.name] = rounded(place[one.name as "latitude" | "longitude"]);
    else if (one.required) parameters[one.name] = USUAL[one.name] ?? one.minimum ?? 0;
    else if (one.default !== null) parameters[one.name] = USUAL[one.name] ?? one.default;
  }
  return { command_id: commandId, command_type_id: commandType, parameters };
}

/** Height above the take-off in metres that a command leads to; null for one without. */
export function heightOf_m({ parameters }: Command): number | null {
  const height = parameters["altitude"] ?? parameters["orbit_altitude"];
  return typeof height === "number" && Number.isFinite(height) ? height : null;
}

/** Degrees to a centimetre. */
export function rounded(degrees: number): number {
  return Math.round(degrees * 1e7) / 1e7;
}

/** What is wrong with a value: a key of the texts, or null. */
export function problemOf(
  one: Parameter,
  value: ParameterValue | undefined,
): "number" | "whole" | "out_of_range" | null {
  if (value === null || value === undefined) return one.required ? "number" : null;
  if (Array.isArray(value)) return problemOfCorners(value);
  if (typeof value !== "number") return null;
  if (!Number.isFinite(value)) return "number";
  if (one.type === "integer" && !Number.isInteger(value)) return "whole";
  const { minimum, maximum } = one;
  if (minimum !== null && (one.above_minimum ? value <= minimum : value < minimum)) return "out_of_range";
  if (maximum !== null && (one.below_maximum ? value >= maximum : value > maximum)) return "out_of_range";
  return null;
}

/** Two corners of a picture as fractions of its sides. */
function problemOfCorners(corners: unknown[]): "number" | "out_of_range" | null {
  const values = corners.flat();
  if (!values.every((one) => typeof one === "number" && Number.isFinite(one))) return "number";
  return values.every((one) => (one as number) >= 0 && (one as number) <= 1) ? null : "out_of_range";
}

/** The parameters of a command with whose values something is wrong. */
export function problemsOf(command: Command): { parameter: Parameter; problem: "number" | "whole" | "out_of_range" }[] {
  return parametersOf(command.command_type_id).flatMap((parameter) => {
    const problem = problemOf(parameter, command.parameters[parameter.name]);
    return problem === null ? [] : [{ parameter, problem }];
  });
}

/** Numbers the commands again from 1, after one was moved or removed. */
export function renumbered(commands: readonly Command[]): Command[] {
  return commands.map((command, index) => ({ ...command, command_id: index + 1 }));
}

/** A command of a mission, both counted from 0, and one of its parameters or none. */
export interface FaultPlace {
  mission: number;
  index: number;
  parameter: string | null;
}

/** Which command and parameter a path of the server's faults names; null for none. */
export function placeOfFault(path: string): FaultPlace | null {
  const found = /(?:^|\.)missions\.(\d+)\.command_array\.(\d+)(?:\.(?:parameters\.)?(.+))?$/.exec(path);
  if (found?.[2] === undefined) return null;
  return { mission: Number(found[1]), index: Number(found[2]), parameter: found[3] ?? null };
}

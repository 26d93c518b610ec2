/** Names for the types that are generated from the edge server's OpenAPI document. */

import type { components } from "../../generated/schema";

type Schemas = components["schemas"];

export type Role = "farmer" | "operator" | "admin" | "broker" | "cloud";
export type StoredField = Schemas["StoredField"];
export type AccessKey = Schemas["AccessKey"];
/** A key with its secret, which is shown once. */
export type NewAccessKey = Schemas["NewAccessKey"];
/** A browser in which a person is signed in. */
export type OpenSession = Schemas["Session"];
export type Storage = Schemas["Storage"];
export type Backup = Schemas["Backup"];
export type Backups = Schemas["Backups"];
export type FlightLog = Schemas["FlightLog"];
export type FlightMap = Schemas["FlightMap"];
export type MadeFlightMap = Schemas["MadeFlightMap"];
/** What the pictures of a map show: colours, near infrared, vegetation index. */
export type Band = FlightMap["band"];
export type Video = Schemas["Video"];
export type DeadLetter = Schemas["DeadLetter"];
export type StoredEvent = Schemas["StoredEvent"] & { message?: string };

/** A vehicle with the last values that it has reported. */
export type Vehicle = Schemas["Vehicle"];

/** A survey as it is ordered; what is left out has the edge server's value. */
export type SurveyOrder = Partial<Schemas["SurveyOrder"]> & Pick<Schemas["SurveyOrder"], "altitude" | "vehicles">;

/** Figures of a survey, and its plans in the order of flight; a preview's have no number yet. */
export interface PlannedSurvey {
  area_m2: number;
  angle_deg: number;
  lines: number;
  pictures: number;
  flights: number;
  length_m: number;
  duration_s: number;
  plans: (Pick<Plan, "missions"> & { id?: number })[];
}

/** Number of a status of a mission or command: 1 not started, 2 running, 3 finished, 4 failed, 5 aborted. */
export type StatusId = 1 | 2 | 3 | 4 | 5;

/** A value of a command's parameter; corners of a picture are pairs. */
export type ParameterValue = number | boolean | null | number[][];

/** A command as it is sent. */
export interface Command {
  command_id: number;
  command_type_id: number;
  parameters: Record<string, ParameterValue>;
}

/** A command with its live status. */
export interface CommandState extends Command {
  command_status_id: StatusId;
  message?: string;
}

/** A mission of a stored plan. */
export interface Mission {
  sequence_number?: number;
  mission_id: number;
  vehicle_id: number;
  maximum_speed?: number | null;
  dispatch_state: "held" | "queued" | "accepted" | "closed";
  mission_status_id: StatusId;
  waiting?: string;
  message?: string;
  command_array: CommandState[];
}

/** A plan as it is sent and kept in a file: without numbers and statuses of the edge server. */
export interface PlanDocument {
  plan_id?: string;
  created_at?: string;
  name?: string | null;
  sequence_number?: number;
  field_id?: number | null;
  profile?: string;
  expires_at?: string;
  dispatch?: boolean;
  geofence?: object | null;
  rally_points?: object[];
  missions: {
    sequence_number?: number;
    mission_id: number;
    vehicle_id: number;
    maximum_speed?: number | null;
    command_array: Command[];
  }[];
}

/** A stored plan with its live statuses. */
export interface Plan {
  id: number;
  plan_id: string;
  name?: string | null;
  sequence_number?: number;
  field_id?: number | null;
  profile?: string;
  geofence?: object | null;
  rally_points?: object[];
  received_at: string;
  expires_at: string;
  plan_status_id: StatusId;
  missions: Mission[];
  warnings: { path?: string; message?: string }[];
}

/** Live state of a mission, as the feed sends it. */
export interface MissionChange {
  /** Of the work: missions are flown in the order of these numbers. */
  id?: number;
  plan_id: string;
  mission_id: number;
  vehicle_id: number;
  mission_status_id: StatusId;
  command_array: { command_id: number; command_status_id: StatusId }[];
}

/** "stalled": the relay hangs, which no internet repairs; "closed": everything else that is not open. */
export type UplinkState = "open" | "stalled" | "closed";

export interface Uplink {
  state: UplinkState;
  records_waiting: number | null;
}

export interface Alarm {
  id: number;
  recorded_at: string;
  vehicle_id: number;
  flight_id?: number | null;
  alarm_type_id?: number;
  alarm_code_id?: number;
  alarm_type?: string;
  description?: string | null;
  acknowledged_at: string | null;
}

/** Measurements that a vehicle has made at one place; times are seconds since 1970. */
export interface FlightObservations {
  id: number;
  latitude: number;
  longitude: number;
  altitude: number;
  observation_array: {
    resource_id: string;
    observed_property: string;
    result_time: number;
    result_value: number;
    result_uom: string;
  }[];
}

export interface Flight {
  id: number;
  vehicle_id: number;
  mission_id: number | null;
  plan_id: string | null;
  plan_name: string | null;
  started_at: string;
  ended_at: string | null;
  mission_status_id: StatusId | null;
  distance_m: number | null;
  pictures: number;
  alarms: number;
}

/** A command of a recorded flight; times are null where it has not begun or ended. */
export interface FlownCommand {
  command_id: number;
  command_status_id: StatusId;
  message?: string | null;
  started_at: string | null;
  ended_at: string | null;
}

/** A file of the maps folder, or the map of a survey; one that cannot be shown has a fault and no address. */
export interface BaseMap {
  name: string;
  kind: "vector_tiles" | "raster_tiles" | "picture" | "vegetation_index" | null;
  url: string | null;
  /** West, south, east, north [deg]. */
  bounds: [number, number, number, number] | null;
  /** Latitude and longitude from the north-west on clockwise, of a picture. */
  corners: [number, number][] | null;
  fault: string | null;
  /** Of which flight it was made, of which plan, and when; not of a file. */
  survey?: { flightId: number; vehicleId: number; planName: string | null; madeAt: string };
}

/** What ground a picture shows; null for one that is no map. */
export interface Footprint {
  id: number;
  /** Latitude and longitude, from the picture's top left on clockwise. */
  corners: [number, number][] | null;
  band: Schemas["PictureFootprint"]["band"];
}

export interface Picture {
  id: number;
  recorded_at: string;
  latitude: number | null;
  longitude: number | null;
  altitude: number | null;
  url: string;
  thumbnail_url: string | null;
}

export interface User {
  name: string;
  role: Role;
  created_at: string;
  last_sign_in_at: string | null;
  disabled: boolean;
}

export interface Session {
  name: string;
  role: Role;
  csrf_token: string;
  expires_at: string;
}

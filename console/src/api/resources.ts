/** The edge server's resources that the console reads and writes. */

import { request, requestTagged, requestText, type Tagged } from "./client";
import type {
  AccessKey, Alarm, Band, Backup, Backups, BaseMap, DeadLetter, Flight, FlightLog, FlightMap, FlightObservations, Footprint, FlownCommand, MadeFlightMap, NewAccessKey,
  OpenSession, Picture, Plan,
  PlanDocument, PlannedSurvey, Storage, StoredEvent, StoredField, SurveyOrder, User, Vehicle, Video,
} from "./types";

const PAGE = 500;
const MOST_PAGES = 100;

/** Lists answer the oldest first, so all pages are read to get the newest. */
async function allOf<Row extends { id: number }>(path: string): Promise<Row[]> {
  const rows: Row[] = [];
  for (let page = 0; page < MOST_PAGES; page += 1) {
    const after = rows.at(-1)?.id ?? 0;
    const joint = path.includes("?") ? "&" : "?";
    const more = await request<Row[]>(`${path}${joint}limit=${PAGE}&after=${after}`);
    rows.push(...more);
    if (more.length < PAGE) break;
  }
  return rows;
}

export const listVehicles = (): Promise<Vehicle[]> => request("/vehicles/");
export const releaseVehicle = (vehicleId: number, reason: string): Promise<Vehicle> =>
  request(`/vehicles/${vehicleId}/release`, { method: "POST", body: { reason } });

/** Lists the vehicles whose live picture can be looked at. */
export const listVideos = (): Promise<Video[]> => request("/videos/");

export const listFields = (): Promise<StoredField[]> => allOf("/fields/");

/** A field as it is drawn: rings of [latitude, longitude], the first corner not repeated. */
export interface FieldDraft {
  name: string | null;
  boundary: [number, number][];
  holes: [number, number][][];
  exclusions: [number, number][][];
  entry?: [number, number];
}

/** Stores a field; the same key again gives the same field. */
export const createField = (draft: FieldDraft, idempotencyKey: string): Promise<StoredField> =>
  request("/fields/", { method: "POST", body: draft, idempotencyKey });
export const getField = (id: number): Promise<Tagged<StoredField>> => requestTagged(`/fields/${id}`);
/** Replaces a field that still has this tag; raises RequestError 412 for any other. */
export const replaceField = (id: number, draft: FieldDraft, tag: string): Promise<StoredField> =>
  request(`/fields/${id}`, { method: "PUT", body: draft, ifMatch: tag });
/** Deletes a field that still has this tag; raises RequestError 412 for any other. */
export const deleteField = (id: number, tag: string): Promise<void> =>
  request(`/fields/${id}`, { method: "DELETE", ifMatch: tag });
/** Stores every field of a GeoJSON, KML, KMZ or zipped Shapefile, or none of them. */
/** The fields of a file, and what of it is no area. */
export interface ImportedFields {
  fields: StoredField[];
  leftOut: { path: string; message: string }[];
}

export const importFields = async (file: File): Promise<ImportedFields> => {
  const stored = await request<StoredField | { fields: StoredField[]; left_out?: ImportedFields["leftOut"] }>("/fields/", {
    method: "POST",
    file,
  });
  return "fields" in stored
    ? { fields: stored.fields, leftOut: stored.left_out ?? [] }
    : { fields: [stored], leftOut: [] };
};

const SURVEY_TIMEOUT_MS = 60_000;
export const previewSurvey = (order: SurveyOrder): Promise<PlannedSurvey> =>
  request("/surveys/?preview=true", { method: "POST", body: order, timeoutMs: SURVEY_TIMEOUT_MS });
/** Stores the plans of a survey; the same key again gives the same plans. */
export const createSurvey = (order: SurveyOrder, idempotencyKey: string): Promise<PlannedSurvey> =>
  request("/surveys/", { method: "POST", body: order, timeoutMs: SURVEY_TIMEOUT_MS, idempotencyKey });

/** Lists the plans that were received since a time. */
export const listPlans = (since: Date): Promise<Plan[]> =>
  allOf(`/plans/?since=${encodeURIComponent(since.toISOString())}`);
export const getPlan = (reference: string): Promise<Plan> => request(`/plans/${reference}`);
export const getTaggedPlan = (reference: string): Promise<Tagged<Plan>> =>
  requestTagged(`/plans/${reference}`);
/** Dispatches a plan; with a tag only as it was read, otherwise RequestError 412. */
export const dispatchPlan = (id: number, tag?: string): Promise<Plan> =>
  request(`/plans/${id}/dispatch`, { method: "POST", ifMatch: tag });
/** Deletes a plan that still has this tag; raises RequestError 412 for any other. */
export const deletePlan = (id: number, tag: string): Promise<void> =>
  request(`/plans/${id}`, { method: "DELETE", ifMatch: tag });

/** Stores a plan; the same key again gives the same plan. */
export const createPlan = (document: PlanDocument, idempotencyKey?: string): Promise<Plan> =>
  request("/plans/", { method: "POST", body: document, ...(idempotencyKey && { idempotencyKey }) });
/** Replaces a plan that still has this tag; raises RequestError 412 for any other. */
export const replacePlan = (id: number, document: PlanDocument, tag: string): Promise<Plan> =>
  request(`/plans/${id}`, { method: "PUT", body: document, ifMatch: tag });
/** Imports a mission file of a ground station for one vehicle; the same key again gives the same plan. */
export const importPlan = (file: File, vehicleId: number, idempotencyKey: string): Promise<Plan> =>
  request(`/plans/import?vehicle_id=${vehicleId}&name=${encodeURIComponent(file.name)}`, {
    method: "POST",
    file,
    idempotencyKey,
  });

/** Numbers of the events that stop a mission, or let it fly on. */
export const LAND_HERE = 1;
export const PAUSE = 101;
export const RESUME = 102;
export const RETURN_HOME = 103;
export type StopKind = typeof LAND_HERE | typeof PAUSE | typeof RESUME | typeof RETURN_HOME;

/** Gives a vehicle an order at once; it is tried once and never queued in the browser. */
export const stopVehicle = (vehicleId: number, kind: StopKind, number: number): Promise<StoredEvent> =>
  request("/events/", {
    method: "POST",
    body: { sequence_number: number, vehicle_id: vehicleId, event_type_id: kind },
    timeoutMs: 5_000,
    asWhoever: true,
  });
/** Number of the event that changes a speed. */
export const NEW_SPEED = 3;
/** Lets a vehicle fly its mission at another speed; it is tried once and never queued in the browser. */
export const changeSpeed = (vehicleId: number, speed_m_s: number, number: number): Promise<StoredEvent> =>
  request("/events/", {
    method: "POST",
    body: { sequence_number: number, vehicle_id: vehicleId, event_type_id: NEW_SPEED, maximum_speed: speed_m_s },
    timeoutMs: 5_000,
  });
/** Lists the events of a vehicle since a time, the oldest first. */
export const listEvents = (vehicleId: number, since: Date): Promise<StoredEvent[]> =>
  allOf(`/events/?vehicle_id=${vehicleId}&since=${encodeURIComponent(since.toISOString())}`);
export const getEvent = (id: number): Promise<StoredEvent> =>
  request(`/events/${id}`, { timeoutMs: 3_000 });

/** Lists the flights of the archive, the newest first. */
export const listFlights = async (): Promise<Flight[]> =>
  (await allOf<Flight>("/flights/")).reverse();
/** Lists the flights since a time, the oldest first. */
export const listFlightsSince = (since: Date): Promise<Flight[]> =>
  allOf(`/flights/?since=${encodeURIComponent(since.toISOString())}`);
export const getFlight = (id: number): Promise<Flight & { command_array: FlownCommand[]; lost_reports: number }> =>
  request(`/flights/${id}`);
export const flightTrack = (id: number): Promise<GeoJSON.FeatureCollection | GeoJSON.Feature> =>
  request(`/flights/${id}/track?format=geojson`);
export const listPictures = (id: number): Promise<Picture[]> => allOf(`/flights/${id}/pictures`);
export const listFootprints = (id: number): Promise<Footprint[]> => allOf(`/flights/${id}/footprints`);
export const listFlightLogs = (id: number): Promise<FlightLog[]> => request(`/flights/${id}/logs`);
export const getFlightMap = (id: number, band: Band): Promise<FlightMap> => request(`/flights/${id}/map?band=${band}`);
/** Begins to make the map of a flight; its state says when it is done. */
export const makeFlightMap = (id: number, band: Band): Promise<FlightMap> =>
  request(`/flights/${id}/map?band=${band}`, { method: "POST", timeoutMs: 30_000 });
/** Lists the maps of flights that are made, the newest last. */
export const listFlightMaps = (): Promise<MadeFlightMap[]> => allOf("/flight_maps/");
/** Lists the base maps that somebody has put into the edge server's maps folder. */
export const listBaseMaps = (): Promise<BaseMap[]> => request("/maps/");

export const listObservations = (id: number): Promise<FlightObservations[]> =>
  allOf(`/flights/${id}/observations`);
/** Lists the alarms of a flight, the oldest first. */
export const listFlightAlarms = async (flight: Flight): Promise<Alarm[]> => {
  if (flight.alarms === 0) return [];
  const since = encodeURIComponent(flight.started_at);
  const alarms = await allOf<Alarm>(`/alarms/history/?vehicle_id=${flight.vehicle_id}&since=${since}`);
  return alarms.filter((alarm) => alarm.flight_id === flight.id);
};

export const listAlarms = (): Promise<Alarm[]> => allOf("/alarms/history/");
export const acknowledgeAlarm = (id: number): Promise<Alarm> =>
  request(`/alarms/history/${id}/acknowledge`, { method: "POST" });

export const listUsers = (): Promise<User[]> => request("/users/");
/** Makes an account; one without a password signs in by link. */
export const createUser = (name: string, role: string, password: string | null): Promise<User> =>
  request("/users/", { method: "POST", body: { name, role, password } });
/** What of an account can be changed; a new password ends the person's sessions. */
export type UserChange = Partial<{ role: string; password: string; disabled: boolean }>;
export const changeUser = (name: string, change: UserChange): Promise<User> =>
  request(`/users/${encodeURIComponent(name)}`, { method: "PATCH", body: change });

export const deleteUser = (name: string): Promise<void> =>
  request(`/users/${encodeURIComponent(name)}`, { method: "DELETE" });
/** Makes a link that signs the person in once, within 10 minutes. */
export const makeSignInLink = (name: string): Promise<{ path: string }> =>
  request(`/users/${encodeURIComponent(name)}/link`, { method: "POST" });

/** Lists the browsers in which people are signed in. */
export const listSessions = (): Promise<OpenSession[]> => request("/sessions/");
export const endSession = (id: string): Promise<void> => request(`/sessions/${id}`, { method: "DELETE" });

export const getStorage = (): Promise<Storage> => request("/storage");

export const listBackups = (): Promise<Backups> => request("/backups/");
/** Makes a backup; a large database takes some time. */
export const makeBackup = (): Promise<Backup> => request("/backups/", { method: "POST", timeoutMs: 300_000 });

export const listKeys = (): Promise<AccessKey[]> => request("/keys/");
/** Makes a key; its secret is in this answer alone. */
export const createKey = (name: string, role: string, expires_at: string | null): Promise<NewAccessKey> =>
  request("/keys/", { method: "POST", body: { name, role, expires_at } });
export const revokeKey = (prefix: string): Promise<void> =>
  request(`/keys/${prefix}`, { method: "DELETE" });

export const listDeadLetters = (): Promise<DeadLetter[]> => allOf("/dead_letters/");
export const getDeadLetter = (id: number): Promise<DeadLetter> => request(`/dead_letters/${id}`);
/** Sends a corrected record; the server names the members that it cannot use. */
export const correctDeadLetter = (id: number, report: object): Promise<unknown> =>
  request(`/dead_letters/${id}`, { method: "PUT", body: report, timeoutMs: 60_000 });
export const retryDeadLetter = (id: number): Promise<unknown> =>
  request(`/dead_letters/${id}/retry`, { method: "POST" });

/** A row of the audit log. */
export interface AuditRow {
  id: number;
  [member: string]: unknown;
}

/** Reads the audit log since a time, the newest row first. */
export async function listAudit(since: Date): Promise<AuditRow[]> {
  const text = await requestText(`/audit?since=${encodeURIComponent(since.toISOString())}`);
  const lines = text.split("\n").filter((line) => line !== "");
  return lines.map((line) => JSON.parse(line) as AuditRow).reverse();
}

/** The edge server's word for the state of the uplink, where the live feed does not say it. */
export async function readUplink(): Promise<string | undefined> {
  return (await request<{ uplink?: string }>("/readyz")).uplink;
}

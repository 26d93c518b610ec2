/** The state that the live feed keeps up to date, and how each of its events changes it. Pure. */

import type { Alarm, MissionChange, Uplink, Vehicle } from "../api/types";
import { distanceM, motionBetween, type Fix, type Motion } from "./motion";
import { beginTrail, extendTrail, type Trail } from "./trail";

/** "polling" while the server has no live feed: positions are then read each second. */
export type Connection = "connecting" | "live" | "polling" | "offline";

/** A vehicle with what the browser knows beside its last report. */
export interface Tracked {
  vehicle: Vehicle;
  motion: Motion;
  /** Since this page was opened; null before the first position. */
  trail: Trail | null;
  /** When the vehicle itself was last heard, by the edge server's clock. */
  heardAtMs: number;
  /** How far its broker's clock is behind the edge server's, as far as that is known. */
  behindMs: number;
}

export interface LiveState {
  connection: Connection;
  /** Time of the last sign of life from the server, in milliseconds. */
  contactAtMs: number | null;
  vehicles: ReadonlyMap<number, Tracked>;
  /** Where each vehicle was last seen standing, within 5 m; the same map until one has changed. */
  homes: ReadonlyMap<number, Fix>;
  missions: ReadonlyMap<string, MissionChange>;
  alarms: ReadonlyMap<number, Alarm>;
  uplink: Uplink | null;
  /** Counts changes of missions, so that lists of plans load again. */
  missionChanges: number;
}

export const EMPTY: LiveState = {
  connection: "connecting",
  contactAtMs: null,
  vehicles: new Map(),
  homes: new Map(),
  missions: new Map(),
  alarms: new Map(),
  uplink: null,
  missionChanges: 0,
};

/** What the feed says about the uplink: "open" while records reach the cloud. */
interface UplinkRow {
  state?: string;
  records_waiting: number | null;
}

interface Snapshot {
  vehicles: Vehicle[];
  missions: MissionChange[];
  alarms?: Alarm[];
  uplink: UplinkRow | null;
}

/** A report that seems to have taken longer was recorded by a clock that is behind. */
const LONGEST_REPORT_MS = 15_000;
/** A broker reports a vehicle every 2 s at least while it receives it. */
const STALE_AFTER_MS = 6_000;
const LOST_AFTER_MS = 20_000;
const ON_GROUND_M = 0.5;
/** Further than a position wanders that stands still. */
const CARRIED_M = 5;

/** Applies one event of the feed; an unknown one changes nothing. */
export function apply(state: LiveState, type: string, data: unknown, nowMs: number): LiveState {
  const contacted = { ...state, contactAtMs: nowMs };
  switch (type) {
    case "snapshot": {
      const all = data as Snapshot;
      return {
        ...contacted,
        vehicles: new Map(all.vehicles.map((one) => [one.vehicle_id, track(state, one, nowMs)])),
        homes: homesWith(state, all.vehicles, nowMs, true),
        missions: new Map(all.missions.map((one) => [missionKey(one), one])),
        alarms: new Map((all.alarms ?? []).map((one) => [one.id, one])),
        uplink: uplinkOf(all.uplink),
        missionChanges: state.missionChanges + 1,
      };
    }
    case "vehicle": {
      const one = data as Vehicle;
      const vehicles = set(state.vehicles, one.vehicle_id, track(state, one, nowMs));
      return { ...contacted, vehicles, homes: homesWith(state, [one], nowMs) };
    }
    case "vehicle_removed": {
      const id = (data as Vehicle).vehicle_id;
      return { ...contacted, vehicles: without(state.vehicles, id), homes: without(state.homes, id) };
    }
    case "mission": {
      const one = data as MissionChange;
      const missions = set(state.missions, missionKey(one), one);
      return { ...contacted, missions, missionChanges: state.missionChanges + 1 };
    }
    case "alarm": {
      const one = data as Alarm;
      return { ...contacted, alarms: set(state.alarms, one.id, one) };
    }
    case "uplink":
      return { ...contacted, uplink: uplinkOf(data as UplinkRow) };
    default:
      return contacted;
  }
}

/** Marks the vehicles of which nothing has been reported for some time: their broker may have stopped.
 *
 * `serverMs` is the time by the edge server's clock, which has noted when each report came: the
 * broker's own clock may be behind. The same state where nothing has changed.
 */
export function markSilent(state: LiveState, serverMs: number): LiveState {
  const marked = [...state.vehicles].flatMap(([id, tracked]): [number, Tracked][] => {
    const link_state = linkAfter(serverMs - Date.parse(tracked.vehicle.updated_at), tracked.vehicle.link_state);
    if (link_state === tracked.vehicle.link_state) return [];
    return [[id, { ...tracked, vehicle: { ...tracked.vehicle, link_state } }]];
  });
  return marked.length === 0 ? state : { ...state, vehicles: new Map([...state.vehicles, ...marked]) };
}

function linkAfter(silentMs: number, present: Vehicle["link_state"]): Vehicle["link_state"] {
  if (present === "lost" || silentMs > LOST_AFTER_MS) return "lost";
  return silentMs > STALE_AFTER_MS ? "stale" : present;
}

function uplinkOf(row: UplinkRow | null): Uplink | null {
  if (row === null) return null;
  const state = row.state === "open" || row.state === "stalled" ? row.state : "closed";
  return { state, records_waiting: row.records_waiting };
}

export function missionKey(mission: { plan_id: string; mission_id: number }): string {
  return `${mission.plan_id}/${mission.mission_id}`;
}

function set<Key, Value>(map: ReadonlyMap<Key, Value>, key: Key, value: Value): Map<Key, Value> {
  return new Map(map).set(key, value);
}

function without<Key, Value>(map: ReadonlyMap<Key, Value>, key: Key): Map<Key, Value> {
  return new Map([...map].filter(([other]) => other !== key));
}

/** What is known of a vehicle; nothing if it was deleted and registered again meanwhile. */
function knownOf(state: LiveState, vehicle: Vehicle): Tracked | undefined {
  const known = state.vehicles.get(vehicle.vehicle_id);
  return known?.vehicle.registered_at === vehicle.registered_at ? known : undefined;
}

function track(state: LiveState, vehicle: Vehicle, nowMs: number): Tracked {
  const known = knownOf(state, vehicle);
  const fix = fixOf(vehicle, nowMs);
  const lastMotion = known?.motion ?? { heading_deg: null, speed_m_s: null };
  const motion = { ...lastMotion };
  let trail = known?.trail ?? null;
  if (fix !== null && trail === null) {
    trail = beginTrail(fix);
  } else if (fix !== null && trail !== null && fix.time_ms !== trail.last.time_ms) {
    // Of an earlier time too: reports come in order, so its clock was set back
    Object.assign(motion, motionBetween(trail.last, fix, lastMotion));
    trail = extendTrail(trail, fix);
  }
  if (typeof vehicle.heading === "number") motion.heading_deg = vehicle.heading;
  if (typeof vehicle.speed === "number") motion.speed_m_s = vehicle.speed;
  return { vehicle, motion, trail, ...heard(vehicle, known) };
}

/** When a vehicle was last heard: its broker reports it also while its link is lost.
 *
 * A broker's clock may be ahead: the edge server has had the report no later than it says. Or it is
 * behind: by the quickest report, unless that can have been on its way for so long.
 */
function heard(vehicle: Vehicle, known: Tracked | undefined): Pick<Tracked, "heardAtMs" | "behindMs"> {
  const receivedMs = Date.parse(vehicle.updated_at);
  const stampMs = Date.parse(vehicle.recorded_at ?? vehicle.updated_at);
  const recordedMs = Number.isFinite(stampMs) ? stampMs : receivedMs;
  const lastStampMs = Date.parse(known?.vehicle.recorded_at ?? "");
  const wasSetBack = recordedMs < lastStampMs;
  const lagMs = receivedMs - recordedMs;
  const present = lagMs > LONGEST_REPORT_MS ? lagMs : 0;
  const behindMs = known === undefined || wasSetBack ? present : Math.min(known.behindMs, Math.max(lagMs, 0));
  const age_s = vehicle.link_state === "connected" ? 0 : (vehicle.position_age ?? 0);
  return { heardAtMs: Math.min(recordedMs + behindMs, receivedMs) - age_s * 1000, behindMs };
}

/** Gives the homes after a report of these vehicles; the same map if no home has changed. */
function homesWith(
  state: LiveState,
  vehicles: readonly Vehicle[],
  nowMs: number,
  areAll = false,
): LiveState["homes"] {
  const changed = areAll ? new Map<number, Fix>() : new Map(state.homes);
  for (const vehicle of vehicles) {
    const id = vehicle.vehicle_id;
    const known = knownOf(state, vehicle) === undefined ? undefined : state.homes.get(id);
    const home = homeOf(vehicle, known, nowMs);
    if (home === undefined) changed.delete(id);
    else changed.set(id, home);
  }
  const ids = [...changed.keys()];
  const isSame = changed.size === state.homes.size && ids.every((id) => changed.get(id) === state.homes.get(id));
  return isSame ? state.homes : changed;
}

/** Where a vehicle was last seen standing; while it is armed its height decides at first sight. */
function homeOf(vehicle: Vehicle, known: Fix | undefined, nowMs: number): Fix | undefined {
  const fix = fixOf(vehicle, nowMs);
  if (fix === null) return known;
  const isDisarmed = vehicle.armed === false;
  const isLow = Math.abs(fix.altitude_m ?? 99) < ON_GROUND_M;
  if (known === undefined) return isDisarmed || isLow ? fix : undefined;
  return isDisarmed && distanceM(known, fix) > CARRIED_M ? fix : known;
}

function fixOf(vehicle: Vehicle, nowMs: number): Fix | null {
  if (typeof vehicle.latitude !== "number" || typeof vehicle.longitude !== "number") return null;
  const stamp = vehicle.recorded_at ?? vehicle.updated_at;
  const time_ms = Date.parse(String(stamp));
  return {
    latitude_deg: vehicle.latitude,
    longitude_deg: vehicle.longitude,
    altitude_m: vehicle.altitude ?? null,
    time_ms: Number.isFinite(time_ms) ? time_ms : nowMs,
  };
}

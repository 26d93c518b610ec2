/** The state that the live feed keeps up to date, and how each of its events changes it. Pure. */

import type { Alarm, MissionChange, Uplink, Vehicle } from "../api/types";
import { motionBetween, type Fix, type Motion } from "./motion";
import { beginTrail, extendTrail, type Trail } from "./trail";

/** "polling" while the server has no live feed: positions are then read each second. */
export type Connection = "connecting" | "live" | "polling" | "offline";

/** A vehicle with what the browser knows beside its last report. */
export interface Tracked {
  vehicle: Vehicle;
  motion: Motion;
  /** Since this page was opened; null before the first position. */
  trail: Trail | null;
  /** When a newer report of it arrived, by this browser's clock: clocks of machines differ. */
  reportedAtMs: number;
}

export interface LiveState {
  connection: Connection;
  /** Time of the last sign of life from the server, in milliseconds. */
  contactAtMs: number | null;
  vehicles: ReadonlyMap<number, Tracked>;
  /** Where each vehicle was first seen on the ground; the same map until there is another home. */
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
  reachable?: boolean;
  records_waiting: number | null;
}

interface Snapshot {
  vehicles: Vehicle[];
  missions: MissionChange[];
  alarms?: Alarm[];
  uplink: UplinkRow | null;
}

const ON_GROUND_M = 0.5;

/** Applies one event of the feed; an unknown one changes nothing. */
export function apply(state: LiveState, type: string, data: unknown, nowMs: number): LiveState {
  const contacted = { ...state, contactAtMs: nowMs };
  switch (type) {
    case "snapshot": {
      const all = data as Snapshot;
      return {
        ...contacted,
        vehicles: new Map(all.vehicles.map((one) => [one.vehicle_id, track(state, one, nowMs)])),
        homes: homesWith(state.homes, all.vehicles, nowMs),
        missions: new Map(all.missions.map((one) => [missionKey(one), one])),
        alarms: new Map((all.alarms ?? []).map((one) => [one.id, one])),
        uplink: uplinkOf(all.uplink),
        missionChanges: state.missionChanges + 1,
      };
    }
    case "vehicle": {
      const one = data as Vehicle;
      const vehicles = set(state.vehicles, one.vehicle_id, track(state, one, nowMs));
      return { ...contacted, vehicles, homes: homesWith(state.homes, [one], nowMs) };
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

function uplinkOf(row: UplinkRow | null): Uplink | null {
  if (row === null) return null;
  return { reachable: row.reachable ?? row.state === "open", records_waiting: row.records_waiting };
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

function track(state: LiveState, vehicle: Vehicle, nowMs: number): Tracked {
  const known = state.vehicles.get(vehicle.vehicle_id);
  const fix = fixOf(vehicle, nowMs);
  const lastMotion = known?.motion ?? { heading_deg: null, speed_m_s: null };
  const motion = { ...lastMotion };
  let trail = known?.trail ?? null;
  if (fix !== null && trail === null) {
    trail = beginTrail(fix);
  } else if (fix !== null && trail !== null && fix.time_ms > trail.last.time_ms) {
    Object.assign(motion, motionBetween(trail.last, fix, lastMotion));
    trail = extendTrail(trail, fix);
  }
  if (typeof vehicle.heading === "number") motion.heading_deg = vehicle.heading;
  if (typeof vehicle.speed === "number") motion.speed_m_s = vehicle.speed;
  const isNews = known === undefined || known.vehicle.updated_at !== vehicle.updated_at;
  const reportedAtMs = isNews ? nowMs : known.reportedAtMs;
  return { vehicle, motion, trail, reportedAtMs };
}

/** Adds the places of vehicles that stand on the ground and have no home yet. */
function homesWith(
  homes: LiveState["homes"],
  vehicles: readonly Vehicle[],
  nowMs: number,
): LiveState["homes"] {
  const found = vehicles.flatMap((vehicle): [number, Fix][] => {
    const fix = homes.has(vehicle.vehicle_id) ? null : fixOf(vehicle, nowMs);
    const isOnGround = fix !== null && Math.abs(fix.altitude_m ?? 99) < ON_GROUND_M;
    return isOnGround ? [[vehicle.vehicle_id, fix]] : [];
  });
  return found.length === 0 ? homes : new Map([...homes, ...found]);
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

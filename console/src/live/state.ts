/** The state that the live feed keeps up to date, and how each of its events changes it. Pure. */

import type { Alarm, MissionChange, StoredEvent, Uplink, Vehicle } from "../api/types";
import { distanceM, motionBetween, type Fix, type Motion } from "./motion";

/** "polling" while the server has no live feed: positions are then read each second. */
export type Connection = "connecting" | "live" | "polling" | "offline";

/** A vehicle with what the browser knows beside its last report. */
export interface Tracked {
  vehicle: Vehicle;
  motion: Motion;
  /** Places since this page was opened, the oldest first. */
  trail: Fix[];
  /** When a newer report of it arrived, by this browser's clock: clocks of machines differ. */
  reportedAtMs: number;
  /** Where it was first seen on the ground. */
  home: Fix | null;
}

export interface LiveState {
  connection: Connection;
  /** Time of the last sign of life from the server, in milliseconds. */
  contactAtMs: number | null;
  vehicles: ReadonlyMap<number, Tracked>;
  missions: ReadonlyMap<string, MissionChange>;
  events: ReadonlyMap<number, StoredEvent>;
  alarms: ReadonlyMap<number, Alarm>;
  uplink: Uplink | null;
  /** Counts changes of missions, so that lists of plans load again. */
  missionChanges: number;
}

export const EMPTY: LiveState = {
  connection: "connecting",
  contactAtMs: null,
  vehicles: new Map(),
  missions: new Map(),
  events: new Map(),
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
  events?: StoredEvent[];
  alarms?: Alarm[];
  uplink: UplinkRow | null;
}

const TRAIL_STEP_M = 1;
const TRAIL_LENGTH = 1500;
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
        missions: new Map(all.missions.map((one) => [missionKey(one), one])),
        events: new Map((all.events ?? []).map((one) => [one.id, one])),
        alarms: new Map((all.alarms ?? []).map((one) => [one.id, one])),
        uplink: uplinkOf(all.uplink),
        missionChanges: state.missionChanges + 1,
      };
    }
    case "vehicle": {
      const one = data as Vehicle;
      return { ...contacted, vehicles: set(state.vehicles, one.vehicle_id, track(state, one, nowMs)) };
    }
    case "vehicle_removed": {
      const vehicles = new Map(state.vehicles);
      vehicles.delete((data as Vehicle).vehicle_id);
      return { ...contacted, vehicles };
    }
    case "mission": {
      const one = data as MissionChange;
      const missions = set(state.missions, missionKey(one), one);
      return { ...contacted, missions, missionChanges: state.missionChanges + 1 };
    }
    case "event": {
      const one = data as StoredEvent;
      return { ...contacted, events: set(state.events, one.id, one) };
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

function track(state: LiveState, vehicle: Vehicle, nowMs: number): Tracked {
  const known = state.vehicles.get(vehicle.vehicle_id);
  const fix = fixOf(vehicle, nowMs);
  const last = known?.trail.at(-1);
  const lastMotion = known?.motion ?? { heading_deg: null, speed_m_s: null };
  const motion = { ...lastMotion };
  let trail = known?.trail ?? [];
  if (fix !== null) {
    if (last === undefined) {
      trail = [fix];
    } else if (fix.time_ms > last.time_ms) {
      Object.assign(motion, motionBetween(last, fix, lastMotion));
      // A vehicle that rests moves the last place's time, not its trail
      const isNew = distanceM(last, fix) >= TRAIL_STEP_M || trail.length === 1;
      trail = isNew
        ? [...trail.slice(-TRAIL_LENGTH), fix]
        : [...trail.slice(0, -1), { ...last, time_ms: fix.time_ms }];
    }
  }
  if (typeof vehicle.heading === "number") motion.heading_deg = vehicle.heading;
  if (typeof vehicle.speed === "number") motion.speed_m_s = vehicle.speed;
  const isOnGround = fix !== null && Math.abs(fix.altitude_m ?? 99) < ON_GROUND_M;
  const isNews = known === undefined || known.vehicle.updated_at !== vehicle.updated_at;
  const reportedAtMs = isNews ? nowMs : known.reportedAtMs;
  return { vehicle, motion, trail, reportedAtMs, home: known?.home ?? (isOnGround ? fix : null) };
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

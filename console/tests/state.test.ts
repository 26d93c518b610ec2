import { expect, test } from "vitest";
import type { Vehicle } from "../src/api/types";
import { apply, EMPTY, markSilent } from "../src/live/state";
import { trailFeatures } from "../src/map/features";

const vehicle = (time: string, latitude: number, altitude = 20, more: object = {}): Vehicle =>
  ({
    vehicle_id: 1, link_state: "connected", armed: true, latitude, longitude: -3.7382, altitude,
    held: null, brokers: [], registered_at: "2026-05-01T09:00:00Z", updated_at: time, recorded_at: time,
    ...more,
  }) as unknown as Vehicle;

test("a vehicle that flies north gets a heading, a speed and a trail", () => {
  const first = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434), 0);
  const next = apply(first, "vehicle", vehicle("2026-05-01T10:00:02Z", 40.4435), 2000);
  const tracked = next.vehicles.get(1);
  expect(tracked?.motion.heading_deg).toBeCloseTo(0);
  expect(tracked?.motion.speed_m_s).toBeCloseTo(5.56, 1);
  expect(trailFeatures([tracked?.trail ?? null])[0]?.geometry).toEqual({
    type: "LineString",
    coordinates: [[-3.7382, 40.4434], [-3.7382, 40.4435]],
  });
});

test("a vehicle of which no broker reports any more is not shown as connected", () => {
  const at = (time: string) => Date.parse(`2026-05-01T10:00:${time}Z`);
  const linkAt = (time: string, state = known) => markSilent(state, at(time)).vehicles.get(1)?.vehicle.link_state;
  const known = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434), 0);
  expect(markSilent(known, at("05"))).toBe(known);
  expect(["05", "07", "21"].map((time) => linkAt(time))).toEqual(["connected", "stale", "lost"]);
  expect(linkAt("30", markSilent(known, at("07")))).toBe("lost");
  const again = apply(markSilent(known, at("21")), "vehicle", vehicle("2026-05-01T10:00:40Z", 40.4434), 40_000);
  expect(linkAt("41", again)).toBe("connected");
  const lost = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 20, { link_state: "lost" }), 0);
  expect(linkAt("01", lost)).toBe("lost");
  const slowClock = vehicle("2026-05-01T10:00:00Z", 40.4434, 20, { updated_at: "2026-05-01T10:00:10Z" });
  expect(linkAt("12", apply(EMPTY, "vehicle", slowClock, 0))).toBe("connected");
});

test("home is where a vehicle was seen on the ground, and stays there", () => {
  const ground = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 0), 0);
  const above = apply(ground, "vehicle", vehicle("2026-05-01T10:00:09Z", 40.4444), 9000);
  expect(above.homes).toBe(ground.homes); // Routes that begin there are not drawn again
  expect(above.homes.get(1)?.latitude_deg).toBe(40.4434);
});

test("a vehicle that is carried to another place has its home there", () => {
  const rest = { armed: false };
  const first = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 0, rest), 0);
  const landed = apply(first, "vehicle", vehicle("2026-05-01T10:00:09Z", 40.44342, 0, rest), 9000);
  expect(landed.homes).toBe(first.homes); // A position that stands still wanders
  const carried = apply(landed, "vehicle", vehicle("2026-05-01T10:05:00Z", 40.4444, 0, rest), 300_000);
  expect(carried.homes.get(1)?.latitude_deg).toBe(40.4444);
});

test("a disarmed vehicle stands where it is, whatever its height above another place", () => {
  const slope = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 2, { armed: false }), 0);
  expect(slope.homes.get(1)?.latitude_deg).toBe(40.4434);
});

test("a vehicle that flies keeps its home, however low", () => {
  const ground = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 0), 0);
  const low = apply(ground, "vehicle", vehicle("2026-05-01T10:01:00Z", 40.4444, 0.2), 60_000);
  expect(low.homes.get(1)?.latitude_deg).toBe(40.4434);
});

test("a vehicle that was registered anew has neither the trail nor the home of the former one", () => {
  const ground = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 0), 0);
  const anew = vehicle("2026-05-01T10:00:09Z", 40.45, 30, { registered_at: "2026-05-01T10:00:08Z" });
  const other = apply(ground, "vehicle", anew, 9000);
  expect(other.homes.size).toBe(0);
  expect(trailFeatures([other.vehicles.get(1)?.trail ?? null])).toEqual([]);
  const again = apply(ground, "snapshot", { vehicles: [anew], missions: [], uplink: null }, 9000);
  expect(again.homes.size).toBe(0);
});

test("the trail goes on when the clock of a vehicle is set back", () => {
  const ahead = apply(EMPTY, "vehicle", vehicle("2026-05-01T11:00:00Z", 40.4434), 0);
  const right = apply(ahead, "vehicle", vehicle("2026-05-01T10:00:01Z", 40.4435), 1000);
  const next = apply(right, "vehicle", vehicle("2026-05-01T10:00:03Z", 40.4436), 3000);
  const tracked = next.vehicles.get(1);
  expect(trailFeatures([tracked?.trail ?? null])[0]?.geometry).toMatchObject({
    coordinates: [[-3.7382, 40.4434], [-3.7382, 40.4436]],
  });
  expect(tracked?.motion.speed_m_s).toBeCloseTo(5.56, 1);
});

test("a snapshot replaces the vehicles that are no longer there", () => {
  const one = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 0), 0);
  const none = apply(one, "snapshot", { vehicles: [], missions: [], uplink: null }, 10);
  expect([none.vehicles.size, none.homes.size]).toEqual([0, 0]);
});

test("a vehicle that the server has deleted is gone", () => {
  const one = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434), 0);
  expect(apply(one, "vehicle_removed", { vehicle_id: 1 }, 10).vehicles.size).toBe(0);
});

test("a vehicle that comes back after it was deleted has the home where it stands then", () => {
  const one = apply(EMPTY, "vehicle", vehicle("2026-05-01T10:00:00Z", 40.4434, 0), 0);
  const gone = apply(one, "vehicle_removed", { vehicle_id: 1 }, 10);
  const back = apply(gone, "vehicle", vehicle("2026-05-01T11:00:00Z", 40.5, 0), 20);
  expect(back.homes.get(1)?.latitude_deg).toBe(40.5);
});

test.each([
  ["open", "open"], ["blocked", "closed"], ["paused", "closed"], ["stopped", "closed"], ["stalled", "stalled"],
])("an uplink that is %s is shown as %s", (state, shown) => {
  const after = apply(EMPTY, "uplink", { state, records_waiting: 3 }, 0);
  expect(after.uplink).toEqual({ state: shown, records_waiting: 3 });
});

const heardAt = (last: Vehicle) => {
  const tracked = apply(EMPTY, "snapshot", { vehicles: [last], missions: [], uplink: null }, 9e12).vehicles.get(1);
  return new Date(tracked?.heardAtMs ?? 0).toISOString();
};

test("a broker's clock that is behind makes no report older", () => {
  const slow = (recorded: string, received: string) => vehicle(recorded, 40.4434, 20, { updated_at: received });
  expect(heardAt(slow("2026-05-01T09:00:00Z", "2026-05-01T10:00:00Z"))).toBe("2026-05-01T10:00:00.000Z");
  const said = (...reports: Vehicle[]) => {
    const state = reports.reduce((before, one) => apply(before, "vehicle", one, 0), EMPTY);
    return new Date(state.vehicles.get(1)?.heardAtMs ?? 0).toISOString().slice(11, 19);
  };
  const first = slow("2026-05-01T09:00:00Z", "2026-05-01T10:00:00Z");
  // The vehicle is silent: its report is sent again
  expect(said(first, slow("2026-05-01T09:00:00Z", "2026-05-01T10:00:40Z"))).toBe("10:00:00");
  // The clock is put right
  expect(said(first, slow("2026-05-01T10:01:00Z", "2026-05-01T10:01:00Z"), slow("2026-05-01T10:01:00Z", "2026-05-01T10:01:30Z")))
    .toBe("10:01:00");
  // The clock is set back
  expect(said(slow("2026-05-01T10:00:00Z", "2026-05-01T10:00:00Z"), slow("2026-05-01T09:00:01Z", "2026-05-01T10:00:01Z")))
    .toBe("10:00:01");
});

test("a vehicle was heard when its broker says so, not when this browser learns of it", () => {
  expect(heardAt(vehicle("2026-05-01T10:00:00Z", 40.4434))).toBe("2026-05-01T10:00:00.000Z");
  const late = { updated_at: "2026-05-01T10:00:07Z" };
  expect(heardAt(vehicle("2026-05-01T10:00:00Z", 40.4434, 20, late))).toBe("2026-05-01T10:00:00.000Z");
  const ahead = { updated_at: "2026-05-01T09:59:00Z" };
  expect(heardAt(vehicle("2026-05-01T10:00:00Z", 40.4434, 20, ahead))).toBe("2026-05-01T09:59:00.000Z");
});

test("what a broker reports of a lost vehicle does not make it heard", () => {
  const lost = { link_state: "lost", position_age: 86_400 };
  expect(heardAt(vehicle("2026-05-02T10:00:00Z", 40.4434, 20, lost))).toBe("2026-05-01T10:00:00.000Z");
});

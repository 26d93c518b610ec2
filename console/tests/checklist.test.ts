import { expect, test } from "vitest";
import type { Mission, Vehicle } from "../src/api/types";
import { checklist, type Circumstances } from "../src/planning/checklist";
import type { Fence } from "../src/planning/fence";

const PLACE = { latitude: 40.4434, longitude: -3.7382 };
const mission = (hold_time: number): Mission => ({
  mission_id: 1, vehicle_id: 1, dispatch_state: "held", mission_status_id: 1,
  command_array: [
    { command_id: 1, command_type_id: 1, command_status_id: 1, parameters: { ...PLACE, altitude: 10 } },
    { command_id: 2, command_type_id: 3, command_status_id: 1, parameters: { ...PLACE, altitude: 10, hold_time } },
  ],
});
const vehicle = (values: Partial<Vehicle> = {}): Vehicle =>
  ({
    vehicle_id: 1, link_state: "connected", armed: false, held: null, gps_fix: "3d",
    battery_percentage: 0.9, ...PLACE, ...values,
  }) as Vehicle;
const around = (half_deg: number): Fence => ({
  inclusion: [[[-1, -1], [-1, 1], [1, 1], [1, -1]].map(([north = 0, east = 0]) =>
    [PLACE.latitude + north * half_deg, PLACE.longitude + east * half_deg])],
  exclusion: [],
});
const states = (of: Mission, one: Vehicle | undefined, circumstances: Partial<Circumstances> = {}) =>
  Object.fromEntries(checklist(of, one, { fence: around(0.01), ...circumstances }).map(({ name, state }) => [name, state]));

test("a charged vehicle at the place of the takeoff is ready", () => {
  expect(states(mission(10), vehicle())).toEqual({
    ready: "good", battery: "good", gps: "good", place: "good", home: "good", fence: "good", wind: "look",
  });
});

test("a vehicle that is away, held or in the air is not", () => {
  expect(states(mission(10), undefined)["ready"]).toBe("bad");
  expect(states(mission(10), vehicle({ link_state: "lost" }))["ready"]).toBe("bad");
  expect(states(mission(10), vehicle({ armed: true }))["ready"]).toBe("warning");
});

test("the charge has to last for the plan", () => {
  expect(states(mission(700), vehicle())["battery"]).toBe("warning");
  expect(states(mission(10), vehicle({ battery_percentage: 0.2 }))["battery"]).toBe("bad");
});

test("a vehicle without a fix or far from the takeoff is shown", () => {
  expect(states(mission(10), vehicle({ gps_fix: "2d" }))["gps"]).toBe("bad");
  expect(states(mission(10), vehicle({ latitude: 40.4444 }))["place"]).toBe("warning");
});

test("a battery that lasts longer is enough for more", () => {
  expect(states(mission(700), vehicle(), { endurance_s: 3600 })["battery"]).toBe("good");
});

test("pictures take their time", () => {
  const of = mission(10);
  const picture = { command_id: 3, command_type_id: 4, command_status_id: 1 as const, parameters: { pitch_angle: -90 } };
  const many = { ...of, command_array: [...of.command_array, ...Array.from({ length: 200 }, () => picture)] };
  expect(states(many, vehicle())["battery"]).toBe("warning");
});

test("a plan without a fence is to be looked at, one that leaves it is not ready", () => {
  expect(states(mission(10), vehicle(), { fence: null })["fence"]).toBe("warning");
  const elsewhere = { inclusion: [[[1, 1], [1, 2], [2, 2]]], exclusion: [] };
  expect(states(mission(10), vehicle(), { fence: elsewhere })["fence"]).toBe("bad");
  const closed = { inclusion: [], exclusion: around(0.01).inclusion };
  expect(states(mission(10), vehicle(), { fence: closed })["fence"]).toBe("bad");
});

test("a path through a no-fly area is not ready, from home and back too", () => {
  const at = (north_deg: number, east_deg: number) => ({ latitude: PLACE.latitude + north_deg, longitude: PLACE.longitude + east_deg });
  const flown = (home: object, ...places: object[]) => {
    const commands = places.map((place, index) => ({
      command_id: index + 1, command_type_id: index === 0 ? 1 : 3, command_status_id: 1 as const, parameters: { ...place, altitude: 10 },
    }));
    const back = { command_id: 9, command_type_id: 11, command_status_id: 1 as const, parameters: { landing: true } };
    const of = { ...mission(0), command_array: [...commands, back] };
    return states(of, vehicle(home), { fence: { ...around(0.01), exclusion: around(0.001).inclusion } })["fence"];
  };
  expect(flown(at(0, -0.003), at(0.002, -0.003), at(0.002, 0.003), at(0.002, -0.002))).toBe("good");
  expect(flown(at(0, -0.003), at(0.002, -0.003), at(0, 0.003), at(0.002, 0.003))).toBe("bad"); // On the way
  expect(flown(at(0, -0.003), at(0, 0.003), at(0.002, 0.003), at(0.002, -0.002))).toBe("bad"); // From home
  expect(flown(at(0, -0.003), at(0.002, -0.003), at(0.002, 0.003), at(0, 0.003))).toBe("bad"); // Back
});

test("a vehicle in the air begins and returns where it stood", () => {
  const fence = { ...around(0.01), exclusion: around(0.001).inclusion };
  const beside = { ...PLACE, latitude: PLACE.latitude + 0.002 };
  const of = { ...mission(0), command_array: mission(0).command_array.map((one) => ({ ...one, parameters: { ...beside, altitude: 10 } })) };
  const behind = { latitude: PLACE.latitude - 0.002, longitude: PLACE.longitude };
  expect(states(of, vehicle(beside), { fence })["fence"]).toBe("good");
  expect(states(of, vehicle({ ...beside, armed: true }), { fence, home: behind })["fence"]).toBe("bad");
});

/** A mission that takes off at the place, with these commands behind. */
const flying = (...commands: [type: number, parameters: Mission["command_array"][number]["parameters"]][]): Mission => ({
  ...mission(0),
  command_array: [...mission(0).command_array.slice(0, 1), ...commands.map(([command_type_id, parameters], index) => (
    { command_id: index + 2, command_type_id, command_status_id: 1 as const, parameters }))],
});
const north = (metres: number) => ({ latitude: PLACE.latitude + metres / 111_195, longitude: PLACE.longitude, altitude: 10 });

test("a vehicle may take off beside its field, and not in a no-fly area", () => {
  const beyond: Fence = { inclusion: around(0.001).inclusion.map((ring) => ring.map(([latitude = 0, longitude = 0]) => [latitude + 0.003, longitude])), exclusion: [] };
  const of = flying([3, north(333)], [11, { landing: true }]);
  expect(states(of, vehicle(), { fence: beyond })["fence"]).toBe("good");
  expect(states(flying([3, north(100)]), vehicle(), { fence: beyond })["fence"]).toBe("bad");
  expect(states(of, vehicle(), { fence: { ...beyond, exclusion: around(0.0001).inclusion } })["fence"]).toBe("bad");
});

test("a place on the edge of the field is in it", () => {
  const [, east = 0] = around(0.001).inclusion[0]?.[1] ?? [];
  const edge = (metres: number) => flying([3, { latitude: PLACE.latitude, longitude: east + metres / (111_195 * Math.cos(PLACE.latitude * Math.PI / 180)), altitude: 10 }]);
  const fence = around(0.001);
  expect([-1, 0, 0.05, 1].map((metres) => states(edge(metres), vehicle(), { fence })["fence"])).toEqual(["good", "good", "good", "bad"]);
});

test("a circle is looked at as far as it reaches", () => {
  const fence = { inclusion: around(0.002).inclusion, exclusion: [] }; // 222 m to the north
  const circle = (radius: number, metres = 150) => flying([7, { ...north(metres), orbit_altitude: 10, radius }]);
  expect(states(circle(50), vehicle(), { fence })["fence"]).toBe("good");
  expect(states(circle(100), vehicle(), { fence })["fence"]).toBe("bad");
  const rock = { ...fence, exclusion: around(0.0001).inclusion.map((ring) => ring.map(([latitude = 0, longitude = 0]) => [latitude + 0.001, longitude])) };
  expect(states(circle(20, 60), vehicle(), { fence: rock })["fence"]).toBe("good");
  expect(states(circle(50, 60), vehicle(), { fence: rock })["fence"]).toBe("bad"); // Its line meets the rock 111 m north
  const inTheMiddle = flying([7, { ...north(111), orbit_altitude: 10, radius: 60, start_point: 1 }]);
  expect(states(inTheMiddle, vehicle(), { fence: rock })["fence"]).toBe("good"); // The circle goes round it
  const behind = flying([7, { ...north(111), orbit_altitude: 10, radius: 60, start_point: 0 }]);
  expect(states(behind, vehicle(), { fence: rock })["fence"]).toBe("bad"); // It is entered behind the rock
});

test("a no-fly area of another field is to be looked at, unless the vehicle stands in it", () => {
  const of = flying([3, north(200)]);
  const area = (metres: number) => [around(0.0003).inclusion[0]?.map(([latitude = 0, longitude = 0]) => [latitude + metres / 111_195, longitude]) ?? []];
  expect(states(of, vehicle(), { elsewhere: area(100) })["fence"]).toBe("warning");
  expect(states(of, vehicle(), { elsewhere: area(0) })["fence"]).toBe("good");
  expect(states(of, vehicle(), { elsewhere: area(-100) })["fence"]).toBe("good");
});

test("a vehicle far away would return far away", () => {
  expect(states(mission(10), vehicle({ latitude: 40.4444 }))["home"]).toBe("good");
  expect(states(mission(10), vehicle({ latitude: 40.4634 }))["home"]).toBe("warning");
});

import { expect, test } from "vitest";
import { documentOf, renumberedFrom } from "../src/planning/plan_document";
import { changedMission, formOf, isPlanForm, isSameForm, lacksOf, newMission, openAfter, withForm, withMission } from "../src/planning/plan_form";
import { storedPlan, waypoint } from "./plans";

const GEOFENCE = { inclusion: [[[0, 0], [0, 1], [1, 1]]] };
const PLAN = storedPlan([waypoint(1)], { geofence: GEOFENCE, field_id: 4 });

test("a document has what a person has made, and nothing of the edge server", () => {
  expect(documentOf(PLAN)).toEqual({
    name: "North", field_id: 4, geofence: GEOFENCE, dispatch: false,
    missions: [{
      mission_id: 3, vehicle_id: 1, maximum_speed: 5,
      command_array: [{ command_id: 1, command_type_id: 3, parameters: { latitude: 40, longitude: 1, altitude: 15 } }],
    }],
  });
});

test("a copy has mission numbers of its own, one after the other", () => {
  const [mission] = PLAN.missions;
  const copy = renumberedFrom(documentOf({ ...PLAN, missions: [mission!, mission!] }), 90);
  expect(copy.missions.map((one) => one.mission_id)).toEqual([90, 91]);
});

test("the editor keeps fence, field and mission number, which it does not show", () => {
  const form = withMission({ ...formOf(PLAN), name: "South" }, 0, (one) => ({ ...one, vehicleId: 2, speed: "7.5" }));
  const written = withForm(documentOf(PLAN), { form, vehicleId: 1, missionId: 50 });
  expect(written).toMatchObject({ name: "South", geofence: GEOFENCE, field_id: 4, dispatch: false });
  expect(written.missions).toMatchObject([{ mission_id: 3, vehicle_id: 2, maximum_speed: 7.5 }]);
});

test("each mission of a plan keeps its number, and one that is added gets a new one", () => {
  const [mission] = PLAN.missions;
  const pair = { ...PLAN, missions: [mission!, { ...mission!, mission_id: 4, vehicle_id: 2 }] };
  const { missions } = formOf(pair);
  const form = { name: "Both", missions: [...missions.slice(1), newMission(3)] };
  const written = withForm(documentOf(pair), { form, vehicleId: 1, missionId: 50 });
  expect(written.missions).toMatchObject([{ mission_id: 4, vehicle_id: 2 }, { mission_id: 51, vehicle_id: 3 }]);
  expect(isSameForm(form, { ...form, missions: [missions[1]!, { ...newMission(3), missionId: 51 }] })).toBe(true);
  expect(isSameForm(form, { ...form, missions })).toBe(false);
});

test("a change of one mission leaves the others as they are", () => {
  const [mission] = formOf(PLAN).missions;
  const form = { name: "Both", missions: [mission!, mission!] };
  const changed = withMission(form, 1, (one) => ({ ...one, speed: "2" }));
  expect(changed.missions.map(({ speed }) => speed)).toEqual([mission!.speed, "2"]);
});

test("a new plan has one mission under a new number", () => {
  const written = withForm(null, { form: { ...formOf(null), name: "New" }, vehicleId: 1, missionId: 50 });
  expect(written.missions).toMatchObject([{ mission_id: 50, vehicle_id: 1, maximum_speed: 5 }]);
});

test("a form of another version of the console is none", () => {
  expect(isPlanForm(formOf(PLAN))).toBe(true);
  const others = [{ name: "Old", vehicleId: 1, speed: "5", commands: [] }, { name: "", missions: [] }, { missions: [null], name: "" }];
  expect(others.map(isPlanForm)).toEqual([false, false, false]);
});

test("a mission says what it lacks", () => {
  expect(lacksOf({ ...newMission(1), speed: "0" })).toEqual(["speed", "steps"]);
  const [mission] = formOf(PLAN).missions;
  expect(lacksOf(mission!)).toEqual([]);
  const faulty = mission!.commands.map((one) => ({ ...one, parameters: { ...one.parameters, altitude: 1e6 } }));
  expect(lacksOf({ ...mission!, commands: faulty })).toEqual(["values"]);
});

test("a step back names the mission that it has changed", () => {
  const form = { name: "Both", missions: [newMission(1), newMission(2)] };
  expect(changedMission(form, withMission(form, 1, (one) => ({ ...one, speed: "2" })))).toBe(1);
  expect(changedMission(form, { ...form, missions: [...form.missions, newMission(3)] })).toBe(2);
  expect(changedMission(form, { ...form, name: "All" })).toBeNull();
});

test("a step back keeps the open step, shows the one that has changed, and closes it where steps come or go", () => {
  const steps = formOf(storedPlan([waypoint(-1), waypoint(-2), waypoint(-3)])).missions[0]!.commands;
  const form = { name: "North", missions: [{ ...newMission(1), commands: steps }, newMission(2)] };
  const changed = (index: number) => withMission(form, 0, (one) => ({
    ...one,
    commands: one.commands.map((step, at) => (at === index ? { ...step, parameters: { ...step.parameters, altitude: 99 } } : step)),
  }));
  expect(openAfter(form, { ...form, name: "South" }, 0, 1)).toBe(1);
  expect(openAfter(form, withMission(form, 0, (one) => ({ ...one, speed: "9" })), 0, 1)).toBe(1);
  expect(openAfter(form, changed(2), 0, 2)).toBe(2);
  expect(openAfter(form, changed(0), 0, 2)).toBe(0);
  expect(openAfter(form, changed(0), 0, null)).toBeNull();
  expect(openAfter(form, withMission(form, 0, (one) => ({ ...one, commands: steps.slice(1) })), 0, 1)).toBeNull();
  expect(openAfter(form, withMission(form, 1, (one) => ({ ...one, speed: "9" })), 0, 1)).toBeNull();
});

import { expect, test } from "vitest";
import { documentOf, renumberedFrom } from "../src/planning/plan_document";
import { formOf, isSameForm, newMission, withForm, withMission } from "../src/planning/plan_form";
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

import { expect, test } from "vitest";
import { documentOf, renumberedFrom } from "../src/planning/plan_document";
import { formOf, withForm } from "../src/planning/plan_form";
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
  const form = { ...formOf(PLAN), name: "South", speed: "7.5" };
  const written = withForm(documentOf(PLAN), { form, vehicleId: 2, missionId: 50 });
  expect(written).toMatchObject({ name: "South", geofence: GEOFENCE, field_id: 4, dispatch: false });
  expect(written.missions).toMatchObject([{ mission_id: 3, vehicle_id: 2, maximum_speed: 7.5 }]);
});

test("a new plan has one mission under a new number", () => {
  const written = withForm(null, { form: { ...formOf(null), name: "New" }, vehicleId: 1, missionId: 50 });
  expect(written.missions).toMatchObject([{ mission_id: 50, vehicle_id: 1, maximum_speed: 5 }]);
});

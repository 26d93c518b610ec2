import { expect, test } from "vitest";
import type { StoredField } from "../src/api/types";
import { withMovedCorner } from "../src/planning/outline";
import { FIRST_FORM, orderOf, textOfFault } from "../src/planning/survey";
import { areaOfKept, areaOfRing, cornerOfFault, keptOf, ringOfArea } from "../src/planning/survey_area";

const boundary: [number, number][] = [[40.443, -3.7392], [40.444, -3.7392], [40.444, -3.738], [40.443, -3.738]];
const field = { id: 7, name: "Hill", boundary, holes: [], exclusions: [] } as unknown as StoredField;
const moved = withMovedCorner(ringOfArea(null, field), 2, [40.4436, -3.7384]);

test("the corners are those of the field until one is moved, and again when it is back", () => {
  expect(ringOfArea(null, field)).toEqual(boundary);
  const area = areaOfRing(moved, field);
  expect(ringOfArea(area, field)[2]).toEqual([40.4436, -3.7384]);
  expect(areaOfRing(withMovedCorner(moved, 2, [40.444, -3.738]), field)).toBeNull();
});

test("an order names a part of the field beside the field, and nothing for the whole", () => {
  expect(orderOf(FIRST_FORM, 7, [1], moved)).toMatchObject({ field_id: 7, area: moved });
  expect(orderOf(FIRST_FORM, 7, [1])).not.toHaveProperty("area");
  expect(orderOf(FIRST_FORM, 7, [1], moved)).not.toHaveProperty("boundary");
});

test("an area that was kept counts until the field has another boundary", () => {
  const kept = keptOf(moved, field);
  expect(areaOfKept(kept, field)).toEqual(moved);
  expect(areaOfKept(kept, { ...field, boundary: boundary.slice(1) })).toBeNull();
  expect(areaOfKept(keptOf(null, field), field)).toBeNull();
  // Kept by a console that knew no areas
  expect(areaOfKept(undefined, field)).toBeNull();
});

test("a fault is that of a corner of the area, or of the area", () => {
  expect(["area.2", "area.12.0", "area", "area_m2", "boundary.2"].map(cornerOfFault)).toEqual([2, 12, null, null, null]);
  expect(textOfFault("area")).toBe("survey.part");
});

import { expect, test } from "vitest";
import { correctionOf, editableOf } from "../src/screens/system/correction";

const POSE = { id: 7, vehicle_id: 1, latitude: 40.4, received_at: "2026-05-01T10:00:00Z" };

test("what the server has added is not corrected", () => {
  expect(JSON.parse(editableOf(POSE))).toEqual({ vehicle_id: 1, latitude: 40.4 });
});

test("a corrected record is what was entered", () => {
  expect(correctionOf('{"vehicle_id": 1, "latitude": 40.5}', POSE)).toEqual({ vehicle_id: 1, latitude: 40.5 });
});

test("a picture keeps its bytes, which are not shown", () => {
  const image = { ...POSE, frame: { data: "AAAA" } };
  expect(editableOf(image)).not.toContain("AAAA");
  expect(correctionOf('{"vehicle_id": 2}', image)).toEqual({ vehicle_id: 2, frame: { data: "AAAA" } });
});

test.each(["", "{", "[1]", "7", "null"])("%s is no record", (text) => {
  expect(correctionOf(text, POSE)).toBeNull();
});

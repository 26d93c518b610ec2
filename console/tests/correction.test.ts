import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { correctionOf, editableOf } from "../src/screens/system/correction";

const POSE = { id: 7, vehicle_id: 1, latitude: 40.4, message_id: "01J00000000000000000000000", received_at: "2026-05-01T10:00:00Z" };

test("what the server has added is not corrected", () => {
  expect(JSON.parse(editableOf(POSE))).toEqual({ vehicle_id: 1, latitude: 40.4 });
});

interface Schema {
  properties: Record<string, unknown>;
  anyOf?: { $ref: string }[];
}
const { schemas } = (JSON.parse(readFileSync("generated/openapi.json", "utf8")) as {
  components: { schemas: Record<string, Schema> };
}).components;
const KINDS = (schemas["AnyReport"]?.anyOf ?? []).map(({ $ref }) => $ref.split("/").at(-1) ?? "");

test("there are seven kinds of records", () => {
  expect(KINDS).toHaveLength(7);
});

test.each(KINDS)("the edge server knows every member of a stored %s that is shown to be corrected", (kind) => {
  const members = (name: string) => Object.keys(schemas[name]?.properties ?? {});
  const stored = Object.fromEntries(members(`Stored${kind}`).map((member) => [member, null]));
  const sent = correctionOf(editableOf(stored), stored) ?? {};
  expect(Object.keys(sent).sort()).toEqual(members(kind).sort());
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

import { readFileSync } from "node:fs";
import { afterEach, expect, test, vi } from "vitest";
import { changeUser, createKey, createUser, deleteUser, endSession, makeSignInLink } from "../src/api/resources";
import {
  endOfDay, KEY_ROLES, LONGEST_PASSWORD, NAME_PATTERN, SHORTEST_PASSWORD, signInAddress,
} from "../src/screens/system/accounts";

interface Schema {
  properties: Record<string, { pattern?: string; anyOf?: { minLength?: number; maxLength?: number }[] }>;
  enum?: string[];
}
const { schemas } = (JSON.parse(readFileSync("generated/openapi.json", "utf8")) as {
  components: { schemas: Record<string, Schema> };
}).components;

afterEach(() => vi.unstubAllGlobals());

test("the rules of the forms are those of the edge server", () => {
  expect([...KEY_ROLES].sort()).toEqual([...(schemas["Role"]?.enum ?? [])].sort());
  const password = schemas["AccountRequest"]?.properties["password"]?.anyOf?.[0];
  expect([password?.minLength, password?.maxLength]).toEqual([SHORTEST_PASSWORD, LONGEST_PASSWORD]);
  // A browser reads the pattern of a field with the flag v, where a hyphen in a class is escaped
  const pattern = `^${NAME_PATTERN.replace("\\-", "-")}$`;
  for (const name of ["AccountRequest", "KeyRequest"]) {
    expect(schemas[name]?.properties["name"]?.pattern).toBe(pattern);
  }
});

test("a key holds until the end of the chosen day", () => {
  expect(endOfDay("")).toBeNull();
  expect(new Date(endOfDay("2026-05-01") ?? "").getTime()).toBe(new Date(2026, 4, 1, 23, 59, 59).getTime());
});

test("a link leads to the server from which the console came", () => {
  expect(signInAddress("/console/#link=abc", "https://farm:8443")).toBe("https://farm:8443/console/#link=abc");
});

test("each change of an account or a key is one request", async () => {
  const sent: [string, string | undefined, unknown][] = [];
  vi.stubGlobal("fetch", async (path: string, { method, body }: RequestInit) => {
    sent.push([path, method, body ? JSON.parse(String(body)) : null]);
    return new Response("{}", { status: 200 });
  });
  await createUser("maria", "farmer", null);
  await changeUser("maria", { role: "operator" });
  await changeUser("maria", { password: "long enough" });
  await makeSignInLink("maria");
  await deleteUser("maria");
  await endSession("d79d01c2");
  await createKey("north-broker", "broker", null);
  expect(sent).toEqual([
    ["/users/", "POST", { name: "maria", role: "farmer", password: null }],
    ["/users/maria", "PATCH", { role: "operator" }],
    ["/users/maria", "PATCH", { password: "long enough" }],
    ["/users/maria/link", "POST", null],
    ["/users/maria", "DELETE", null],
    ["/sessions/d79d01c2", "DELETE", null],
    ["/keys/", "POST", { name: "north-broker", role: "broker", expires_at: null }],
  ]);
});

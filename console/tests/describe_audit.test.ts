import { expect, test } from "vitest";
import i18next, { loadLanguage } from "../src/i18n/i18n";
import { describeAction, describeResult } from "../src/i18n/describe_audit";

await loadLanguage("es");
const said = (action: string, object: string, language = "en") =>
  describeAction({ id: 1, action, object }, i18next.getFixedT(language), i18next);

test("a row says what was done to what", () => {
  expect(said("plans.dispatch", "plans/3")).toBe("Plan 3 dispatched");
  expect(said("plans.dispatch", "plans/3", "es")).toBe("Plan 3 enviado a volar");
  expect(said("users.create", "users/maria")).toBe("Account maria made");
  expect(said("vehicles.release", "vehicles/2: looked at it/again")).toBe("Drone 2: looked at it/again released");
});

test("a row without a number, or of the program, reads as well", () => {
  expect(said("session.end", "session")).toBe("Signed out");
  expect(said("session.create", "session")).toBe("Sign-in");
  expect(said("session.create", "users/ana")).toBe("Sign-in ana");
  expect(said("plans.create", "plans")).toBe("Plan  stored".replace("  ", " "));
  expect(said("retention.plans", "12 plans")).toBe("Old plans deleted: 12 plans");
  expect(said("telemetry.state_vector_put", "telemetry/7")).toBe("Record state_vector 7 corrected");
});

test("an action that has no text stays as it is", () => {
  expect(said("brakes.cut", "vehicles/1")).toBe("brakes.cut vehicles/1");
  expect(said("audit", "vehicles/1")).toBe("audit vehicles/1");
});

test("a result is a word, a refusal has its status", () => {
  const t = i18next.getFixedT("es");
  expect(["done", "403", "odd"].map((result) => describeResult({ id: 1, result }, t))).toEqual(["Hecho", "Rechazado (403)", "odd"]);
});

import { expect, test } from "vitest";
import i18next, { loadLanguage } from "../src/i18n/i18n";
import { describeAction, describeActor, describeResult } from "../src/i18n/describe_audit";

await loadLanguage("es");
const said = (action: string, object: string, language = "en") =>
  describeAction({ id: 1, action, object }, i18next.getFixedT(language), i18next);

test("a row says what was done to what", () => {
  expect(said("plans.dispatch", "plans/3")).toBe("Plan 3 dispatched");
  expect(said("plans.dispatch", "plans/3", "es")).toBe("Plan 3 enviado a volar");
  expect(said("users.create", "users/maria")).toBe("Account maria made");
  expect(said("vehicles.release", "vehicles/2: looked at it/again")).toBe("Drone 2: looked at it/again released");
});

test("an order says what was ordered of which drone", () => {
  expect(said("events.create", "events/7: PAUSE_MISSION of vehicle 2")).toBe("Order 7 to drone 2: pause");
  expect(said("events.create", "events/7: PAUSE_MISSION of vehicle 2", "es")).toBe("Orden 7 al dron 2: pausa");
  expect(said("events.create", "events/7: DANCE of vehicle 2")).toBe("Order 7: DANCE of vehicle 2 to a drone");
  expect(said("events.create", "events")).toBe("Order to a drone");
  expect(said("flight_maps.make", "flights/2/map?band=ndvi")).toBe("Map made of flight 2 (ndvi)");
});

test("an alarm is named by its number", () => {
  expect(said("alarm_history.acknowledge", "alarms/history/2")).toBe("Alarm 2 acknowledged");
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
  expect(["done", "403", "odd"].map((result) => describeResult({ id: 1, result }, t))).toEqual(["Hecho", "Rechazado: no permitido", "odd"]);
  expect(describeResult({ id: 1, result: "418" }, t)).toBe("Rechazado (418)");
  expect(describeActor({ id: 1, who: "user/ana", role: "admin" }, t)).toBe("ana");
  expect(describeActor({ id: 1, who: "user/link", role: "" }, t)).toBe("por enlace");
});

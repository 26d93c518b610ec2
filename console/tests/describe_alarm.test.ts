import { readFileSync } from "node:fs";
import type { TFunction } from "i18next";
import { expect, test } from "vitest";
import type { Alarm } from "../src/api/types";
import en from "../src/i18n/en.json";
import es from "../src/i18n/es.json";
import { describeAlarm, describeHold, nameOfAlarm, typeOfAlarm, whatToDo } from "../src/i18n/describe_alarm";

const texts: Record<string, string> = en.alarms;
const t = ((key: string) => texts[key.replace("alarms.", "")]) as unknown as TFunction;
const alarm = (part: Partial<Alarm>): Alarm =>
  ({ id: 1, vehicle_id: 1, recorded_at: "2026-05-01T10:00:00Z", acknowledged_at: null, ...part });

test("an alarm of AFarCloud has a name in the person's language", () => {
  for (const code of [1, 2, 3, 4, 5, 6, 50, 51, 52, 53]) {
    expect(nameOfAlarm(alarm({ alarm_code_id: code }), t)).toBe(texts[`code_${code}`]);
  }
  expect(nameOfAlarm(alarm({ alarm_code_id: 5, description: "no fix" }), t)).toBe("GPS failed");
});

test("a hold after an alarm has its name in place of its numbers", () => {
  const told = (reason: string) => describeHold(reason, t, (text) => `<${text}>`);
  expect(told("alarm 2/52: it has left its fence")).toBe("Navigation failed: <it has left its fence>");
  expect(told("alarm 1/5")).toBe("GPS failed");
  expect(told("alarm 1/77: the tank is empty")).toBe("<alarm 1/77: the tank is empty>");
  expect(told("the vehicle was restarted")).toBe("<the vehicle was restarted>");
});

test("the drone's own words name an alarm whose code is not known", () => {
  expect(nameOfAlarm(alarm({ alarm_code_id: 77, description: "the tank is empty" }), t)).toBe("the tank is empty");
  expect(nameOfAlarm(alarm({ alarm_code_id: 77, alarm_type_id: 2 }), t)).toBe("Function unavailable");
  expect(nameOfAlarm(alarm({ description: "" }), t)).toBe("Alarm");
});

test("the kind of an alarm is known for AFarCloud's two types", () => {
  expect([1, 2, 3, undefined].map((type) => typeOfAlarm(alarm({ alarm_type_id: type }), t)))
    .toEqual(["Equipment failure", "Function unavailable", "Alarm", "Alarm"]);
});

test("a description adds the drone's own words once", () => {
  expect(describeAlarm(alarm({ alarm_code_id: 5, description: "no fix" }), t, (text) => text)).toBe("GPS failed: no fix");
  expect(describeAlarm(alarm({ alarm_code_id: 5 }), t, (text) => text)).toBe("GPS failed");
  expect(describeAlarm(alarm({ description: "the tank is empty" }), t, (text) => text)).toBe("the tank is empty");
});

test("each alarm says what to do, in each language", () => {
  for (const language of [en.alarms, es.alarms] as Record<string, string>[]) {
    const say = ((key: string) => language[key.replace("alarms.", "")]) as unknown as TFunction;
    for (const code of [1, 2, 3, 4, 5, 6, 50, 51, 52, 53]) {
      expect(whatToDo(alarm({ alarm_code_id: code }), say)).toBe(language[`do_${code}`]);
      expect(language[`do_${code}`]?.length).toBeGreaterThan(40);
    }
    expect(whatToDo(alarm({ alarm_code_id: 77 }), say)).toBe(language["do_other"]);
  }
});

test("the operator's guide says the same of an alarm", () => {
  const guide = readFileSync("../docs/operators-guide/alarms.md", "utf8").toLowerCase();
  for (const words of [
    "it brakes, holds its place for a moment and lands if the position does not come back",
    "keep away until it has landed and the motors have stopped", "its landing is slower",
    "keep the ground below it free", "if it does not do what you expect", "a mission in flight ends and the drone returns home",
  ]) {
    expect(guide).toContain(words);
    expect(Object.values(texts).some((text) => text.toLowerCase().includes(words))).toBe(true);
  }
});

import type { TFunction } from "i18next";
import { expect, test } from "vitest";
import type { Alarm } from "../src/api/types";
import en from "../src/i18n/en.json";
import { describeAlarm, nameOfAlarm, typeOfAlarm } from "../src/i18n/describe_alarm";

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

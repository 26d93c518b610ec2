/** Alarms in plain words. */

import type { TFunction } from "i18next";
import type { Alarm } from "../api/types";

/** The `alarm_code_id` of AFarCloud: equipment 1 to 6, functions 50 to 53. */
const KNOWN = new Set([1, 2, 3, 4, 5, 6, 50, 51, 52, 53]);

/** Says what has failed; of a code that is not known, the drone's own words or the kind of alarm. */
export function nameOfAlarm(alarm: Alarm, t: TFunction): string {
  const code = alarm.alarm_code_id ?? 0;
  if (KNOWN.has(code)) return t(`alarms.code_${code}`);
  return alarm.description || typeOfAlarm(alarm, t);
}

/** Says what kind of thing has failed. */
export function typeOfAlarm(alarm: Alarm, t: TFunction): string {
  const type = alarm.alarm_type_id ?? 0;
  return t([1, 2].includes(type) ? `alarms.type_${type}` : "alarms.type_other");
}

/** Says what a person does about it; of a code that is not known, by the kind of alarm. */
export function whatToDo(alarm: Alarm, t: TFunction): string {
  const code = alarm.alarm_code_id ?? 0;
  return t(KNOWN.has(code) ? `alarms.do_${code}` : "alarms.do_other");
}

const CODED = /^alarm \d+\/(\d+)(?:: (.*))?$/s;

/** Says why a vehicle waits; the edge server writes an alarm with the numbers of AFarCloud. */
export function describeHold(reason: string, t: TFunction, reportText: (text: string) => string): string {
  const coded = CODED.exec(reason);
  const code = Number(coded?.[1]);
  if (coded === null || !KNOWN.has(code)) return reportText(reason);
  const name = t(`alarms.code_${code}`);
  return coded[2] === undefined ? name : `${name}: ${reportText(coded[2])}`;
}

/** Gives the name with the words of the report. */
export function describeAlarm(alarm: Alarm, t: TFunction, reportText: (text: string) => string): string {
  const name = nameOfAlarm(alarm, t);
  const words = alarm.description ?? "";
  return words === "" || words === name ? name : `${name}: ${reportText(words)}`;
}

/** Rows of the audit log in plain words. */

import type { i18n, TFunction } from "i18next";
import type { AuditRow } from "../api/resources";

/** An order to a vehicle, and the map of a flight, as the edge server writes them. */
const ORDER = /^(\d+): (\w+) of vehicle (\d+)$/;
const MAP = /^(\d+)\/map\?band=(\w+)$/;
/** A report of a vehicle: which kind it is says the object. */
const RECORD = /^telemetry\.(\w+)_(create|put|delete)$/;

/** What was done, to what; an action without a text stays as the edge server has it. */
export function describeAction(row: AuditRow, t: TFunction, texts: Pick<i18n, "exists">): string {
  const action = textOf(row["action"]);
  const object = textOf(row["object"]);
  const [, kind, verb] = RECORD.exec(action) ?? [];
  const key = `audit.${kind === undefined ? action : `record.${verb}`}`;
  if (action === "" || !texts.exists(key)) return [action, object].filter(Boolean).join(" ");
  const [, rest] = /^(?:alarms\/history|\w+)\/(.*)$/s.exec(object) ?? [];
  const [, id, order, vehicle] = ORDER.exec(rest ?? "") ?? [];
  if (vehicle !== undefined && texts.exists(`audit.event.${order}`)) {
    return t("audit.ordered", { id, order: t(`audit.event.${order}`), vehicle });
  }
  const what = rest?.replace(MAP, "$1 ($2)") ?? (/^\w+$/.test(object) ? "" : object);
  return t(key, { what: kind === undefined ? what : `${kind} ${what}` }).replace(/ +/g, " ").trim();
}

/** Whether it was done, or the status with which it was refused. */
export function describeResult(row: AuditRow, t: TFunction): string {
  const result = textOf(row["result"]);
  if (result === "done") return t("audit.done");
  return /^\d+$/.test(result) ? t([`audit.refused_${result}`, "audit.refused"], { status: result }) : result;
}

/** Who did it: a person without the prefix that tells accounts from keys. */
export function describeActor(row: AuditRow, t: TFunction): string {
  const who = textOf(row["who"]).replace(/^user\//, "");
  return who === "link" && textOf(row["role"]) === "" ? t("audit.by_link") : who;
}

function textOf(value: unknown): string {
  return value === null || value === undefined ? "" : String(value);
}

/** Rows of the audit log in plain words. */

import type { i18n, TFunction } from "i18next";
import type { AuditRow } from "../api/resources";

/** A report of a vehicle: which kind it is says the object. */
const RECORD = /^telemetry\.(\w+)_(create|put|delete)$/;

/** What was done, to what; an action without a text stays as the edge server has it. */
export function describeAction(row: AuditRow, t: TFunction, texts: Pick<i18n, "exists">): string {
  const action = textOf(row["action"]);
  const object = textOf(row["object"]);
  const [, kind, verb] = RECORD.exec(action) ?? [];
  const key = `audit.${kind === undefined ? action : `record.${verb}`}`;
  if (action === "" || !texts.exists(key)) return [action, object].filter(Boolean).join(" ");
  const [, rest] = /^\w+\/(.*)$/s.exec(object) ?? [];
  const what = rest ?? (/^\w+$/.test(object) ? "" : object);
  return t(key, { what: kind === undefined ? what : `${kind} ${what}` }).replace(/ +/g, " ").trim();
}

/** Whether it was done, or the status with which it was refused. */
export function describeResult(row: AuditRow, t: TFunction): string {
  const result = textOf(row["result"]);
  if (result === "done") return t("audit.done");
  return /^\d+$/.test(result) ? t("audit.refused", { status: result }) : result;
}

function textOf(value: unknown): string {
  return value === null || value === undefined ? "" : String(value);
}

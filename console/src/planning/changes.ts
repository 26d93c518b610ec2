/** What differs between two versions of a plan or a field, as keys of the texts. Pure. */

import type { Command, Plan, StoredField } from "../api/types";
import { bare, documentOf } from "./plan_document";

/** One line about a difference; `count` is how many of them there are. */
export interface Change {
  name: "name" | "vehicle" | "speed" | "steps_changed" | "steps_added" | "steps_removed" | "dispatched"
    | "rest" | "boundary" | "holes" | "exclusions" | "entry";
  text?: string;
  count?: number;
}

/** Whether two values are the same as JSON, in whatever order their members are. */
export function isSame(one: unknown, other: unknown): boolean {
  return ordered(one) === ordered(other);
}

/** What somebody has changed in a plan of one mission. */
export function planChanges(base: Plan, theirs: Plan): Change[] {
  const [before, after] = [base.missions[0], theirs.missions[0]];
  const changes: Change[] = [];
  if (!isSame(statesOf(base), statesOf(theirs))) changes.push({ name: "dispatched" });
  if ((base.name ?? "") !== (theirs.name ?? "")) changes.push({ name: "name", text: theirs.name ?? "" });
  if (before?.vehicle_id !== after?.vehicle_id) {
    changes.push({ name: "vehicle", text: String(after?.vehicle_id ?? "") });
  }
  if (before?.maximum_speed !== after?.maximum_speed) {
    changes.push({ name: "speed", text: String(after?.maximum_speed ?? "") });
  }
  changes.push(...stepChanges(before?.command_array ?? [], after?.command_array ?? []));
  if (!isSame(restOf(base), restOf(theirs))) changes.push({ name: "rest" });
  return changes;
}

/** What somebody has changed in a field. */
export function fieldChanges(base: StoredField, theirs: StoredField): Change[] {
  const changes: Change[] = [];
  if ((base.name ?? "") !== (theirs.name ?? "")) changes.push({ name: "name", text: theirs.name ?? "" });
  for (const name of ["boundary", "holes", "exclusions"] as const) {
    if (!isSame(base[name] ?? [], theirs[name] ?? [])) changes.push({ name });
  }
  if (!isSame(base.entry ?? null, theirs.entry ?? null)) changes.push({ name: "entry" });
  return changes;
}

/** Whether two versions of a plan differ in nothing but their live status. */
export function isSamePlan(one: Plan, other: Plan): boolean {
  return planChanges(one, other).length === 0;
}

export function isSameField(one: StoredField, other: StoredField): boolean {
  return fieldChanges(one, other).length === 0;
}

function stepChanges(before: readonly Command[], after: readonly Command[]): Change[] {
  const shared = Math.min(before.length, after.length);
  const changed = before.slice(0, shared)
    .filter((one, index) => !isSame(bare(one), after[index] && bare(after[index]))).length;
  const changes: Change[] = [];
  if (changed > 0) changes.push({ name: "steps_changed", count: changed });
  if (after.length > shared) changes.push({ name: "steps_added", count: after.length - shared });
  if (before.length > shared) changes.push({ name: "steps_removed", count: before.length - shared });
  return changes;
}

function statesOf(plan: Plan): string[] {
  return plan.missions.map((one) => one.dispatch_state);
}

/** What the editor does not show, and keeps as it is. */
function restOf(plan: Plan): object {
  const { name: _name, missions, ...rest } = documentOf(plan);
  return { ...rest, more: missions.slice(1) };
}

function ordered(value: unknown): string {
  return JSON.stringify(value, (_key, one: unknown) =>
    typeof one === "object" && one !== null && !Array.isArray(one)
      ? Object.fromEntries(Object.entries(one).sort(([a], [b]) => (a < b ? -1 : 1)))
      : one,
  );
}

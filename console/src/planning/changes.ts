/** What differs between two versions of a plan or a field, as keys of the texts. Pure. */

import type { Mission, Plan, StoredField } from "../api/types";
import { bare, documentOf } from "./plan_document";

/** One line about a difference; `count` is how many of them there are. */
export interface Change {
  name: "name" | "vehicle" | "speed" | "steps_changed" | "steps_added" | "steps_removed" | "dispatched"
    | "missions" | "rest" | "boundary" | "holes" | "exclusions" | "entry";
  text?: string;
  count?: number;
}

/** Whether two values are the same as JSON, in whatever order their members are. */
export function isSame(one: unknown, other: unknown): boolean {
  return ordered(one) === ordered(other);
}

/** What somebody has changed in a plan. */
export function planChanges(base: Plan, theirs: Plan): Change[] {
  const changes: Change[] = [];
  const pairs = base.missions.flatMap((before) => {
    const after = theirs.missions.find(({ mission_id }) => mission_id === before.mission_id);
    return after === undefined ? [] : [[before, after] as const];
  });
  if (pairs.some(([before, after]) => before.dispatch_state !== after.dispatch_state)) {
    changes.push({ name: "dispatched" });
  }
  if ((base.name ?? "") !== (theirs.name ?? "")) changes.push({ name: "name", text: theirs.name ?? "" });
  if (pairs.length < Math.max(base.missions.length, theirs.missions.length)) changes.push({ name: "missions" });
  for (const [before, after] of pairs) {
    if (before.vehicle_id !== after.vehicle_id) changes.push({ name: "vehicle", text: String(after.vehicle_id) });
  }
  for (const [before, after] of pairs) {
    if (before.maximum_speed !== after.maximum_speed) {
      changes.push({ name: "speed", text: String(after.maximum_speed ?? "") });
    }
  }
  changes.push(...stepChanges(pairs));
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

/** How many steps differ in all missions together. */
function stepChanges(pairs: readonly (readonly [Mission, Mission])[]): Change[] {
  const counts = { steps_changed: 0, steps_added: 0, steps_removed: 0 };
  for (const [{ command_array: before }, { command_array: after }] of pairs) {
    const shared = Math.min(before.length, after.length);
    counts.steps_changed += before.slice(0, shared)
      .filter((one, index) => !isSame(bare(one), after[index] && bare(after[index]))).length;
    counts.steps_added += after.length - shared;
    counts.steps_removed += before.length - shared;
  }
  const names = ["steps_changed", "steps_added", "steps_removed"] as const;
  return names.filter((name) => counts[name] > 0).map((name) => ({ name, count: counts[name] }));
}

/** What the editor does not show, and keeps as it is. */
function restOf(plan: Plan): object {
  const { name: _name, missions: _missions, ...rest } = documentOf(plan);
  return rest;
}

function ordered(value: unknown): string {
  return JSON.stringify(value, (_key, one: unknown) =>
    typeof one === "object" && one !== null && !Array.isArray(one)
      ? Object.fromEntries(Object.entries(one).sort(([a], [b]) => (a < b ? -1 : 1)))
      : one,
  );
}

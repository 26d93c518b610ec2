/** A plan as its editor holds it. Pure. */

import type { Command, Plan, PlanDocument } from "../api/types";
import { isSame } from "./changes";
import { problemsOf } from "./command_forms";
import { bare } from "./plan_document";

export interface PlanForm {
  name: string;
  /** One for each drone; never empty. */
  missions: MissionForm[];
}

export interface MissionForm {
  /** Null for one that was added. */
  missionId: number | null;
  /** Null until somebody has chosen: then it is the first vehicle. */
  vehicleId: number | null;
  /** [m/s]; empty while what is typed is no number. */
  speed: string;
  commands: Command[];
}

export const USUAL_SPEED_M_S = 5;

/** The form of a stored plan; null: of a new one. */
export function formOf(plan: Plan | null): PlanForm {
  return {
    name: plan?.name ?? "",
    missions: plan?.missions.map((one) => ({
      missionId: one.mission_id,
      vehicleId: one.vehicle_id,
      speed: String(one.maximum_speed ?? USUAL_SPEED_M_S),
      commands: one.command_array.map(bare),
    })) ?? [newMission(null)],
  };
}

/** Under which the draft of a plan is kept. */
export function draftName(id: number | "new"): string {
  return `plan/${id}`;
}

/** Whether what a browser has kept is a form of this version of the console. */
export function isPlanForm(kept: object): kept is PlanForm {
  if (!("missions" in kept) || !Array.isArray(kept.missions) || kept.missions.length === 0) return false;
  return "name" in kept && kept.missions.every((one: Partial<MissionForm> | null) => Array.isArray(one?.commands));
}

/** The first mission in which two forms differ; null if they differ in none. */
export function changedMission(before: PlanForm, after: PlanForm): number | null {
  const index = after.missions.findIndex((one, at) => !isSame(one, before.missions[at] ?? null));
  return index === -1 ? null : index;
}

/** Which step is open after a step back or forward, if one was: the one that has changed, else that one.
 *
 * None where steps have come or gone: the one at its place is another.
 */
export function openAfter(before: PlanForm, after: PlanForm, mission: number, open: number | null): number | null {
  const changed = changedMission(before, after);
  if (open === null || changed === null) return open;
  const [old, present] = [before, after].map(({ missions }) => missions[changed]?.commands ?? []);
  if (changed !== mission || old?.length !== present?.length) return null;
  const steps = (present ?? []).flatMap((one, at) => (isSame(one, old?.[at] ?? null) ? [] : [at]));
  return steps.length === 0 ? open : steps.length === 1 ? (steps[0] ?? null) : null;
}

/** An empty mission for a vehicle. */
export function newMission(vehicleId: number | null): MissionForm {
  return { missionId: null, vehicleId, speed: String(USUAL_SPEED_M_S), commands: [] };
}

/** What keeps a mission from being stored, as keys of the texts. */
export function lacksOf({ speed, commands }: MissionForm): ("speed" | "steps" | "values")[] {
  const lacks: ReturnType<typeof lacksOf> = [];
  if (!(Number(speed) > 0)) lacks.push("speed");
  if (commands.length === 0) lacks.push("steps");
  if (commands.some((command) => problemsOf(command).length > 0)) lacks.push("values");
  return lacks;
}

/** Changes the mission at a place, and no other. */
export function withMission(form: PlanForm, index: number, change: (mission: MissionForm) => MissionForm): PlanForm {
  return { ...form, missions: form.missions.map((one, at) => (at === index ? change(one) : one)) };
}

/** Whether two forms make the same plan; a mission that was just stored has its number now. */
export function isSameForm(one: PlanForm, other: PlanForm): boolean {
  const unnumbered = (form: PlanForm) =>
    ({ ...form, missions: form.missions.map((mission) => ({ ...mission, missionId: null })) });
  return isSame(unnumbered(one), unnumbered(other));
}

/** The document of a form, as a draft; what the editor does not show stays as it is in `before`. */
export function withForm(before: PlanDocument | null, { form, vehicleId, missionId }: {
  form: PlanForm;
  /** For a mission for which nobody has chosen one. */
  vehicleId: number;
  /** Of the first new mission; the others have the next ones. */
  missionId: number;
}): PlanDocument {
  return {
    ...before,
    name: form.name,
    dispatch: false,
    missions: form.missions.map((one, index) => ({
      ...(before?.missions.find(({ mission_id }) => mission_id === one.missionId)
        ?? { mission_id: missionId + index }),
      vehicle_id: one.vehicleId ?? vehicleId,
      maximum_speed: Number(one.speed),
      command_array: one.commands,
    })),
  };
}

/** A plan of one mission as its editor holds it. Pure. */

import type { Command, Plan, PlanDocument } from "../api/types";
import { isSame } from "./changes";
import { bare } from "./plan_document";

export interface PlanForm {
  name: string;
  /** Null until somebody has chosen: then it is the first vehicle. */
  vehicleId: number | null;
  /** [m/s]; empty while what is typed is no number. */
  speed: string;
  commands: Command[];
}

export const USUAL_SPEED_M_S = 5;

/** The form of a stored plan; null: of a new one. */
export function formOf(plan: Plan | null): PlanForm {
  const mission = plan?.missions[0];
  return {
    name: plan?.name ?? "",
    vehicleId: mission?.vehicle_id ?? null,
    speed: String(mission?.maximum_speed ?? USUAL_SPEED_M_S),
    commands: (mission?.command_array ?? []).map(bare),
  };
}

export function isSameForm(one: PlanForm, other: PlanForm): boolean {
  return isSame(one, other);
}

/** The document of a form, as a draft; what the editor does not show stays as it is in `before`. */
export function withForm(before: PlanDocument | null, { form, vehicleId, missionId }: {
  form: PlanForm;
  vehicleId: number;
  /** Of a new plan. */
  missionId: number;
}): PlanDocument {
  const mission = before?.missions[0] ?? { mission_id: missionId };
  return {
    ...before,
    name: form.name,
    dispatch: false,
    missions: [
      {
        ...mission,
        vehicle_id: vehicleId,
        maximum_speed: Number(form.speed),
        command_array: form.commands,
      },
    ],
  };
}

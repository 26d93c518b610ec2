/** Limits in a person's units, each rounded to its allowed side. Pure. */

import type { TFunction } from "i18next";
import { FASTEST_M_S, SLOWEST_M_S } from "../planning/speed_limits";
import { inUnit } from "./entered";
import type { Units } from "./units";

/** The speeds that a mission may have, such as "0.4 to 43.2". */
export function speedRange(units: Units, t: TFunction): string {
  const unit = units.speedInput;
  const [low, high] = [inUnit(SLOWEST_M_S, unit, Math.ceil), inUnit(FASTEST_M_S, unit, Math.floor)];
  return t("editor.range", { low: units.written(low), high: units.written(high) });
}

/** The units of a document's fields, as a person enters them and reads them in faults. Pure. */

import type { SiUnit, WriteQuantity } from "../i18n/describe_report";
import { inUnit, type EnteredUnit } from "./entered";
import type { Units } from "./units";

export const PERCENT = { symbol: "%", factor: 100, digits: 0 };
export const MINUTES = { symbol: "min", factor: 1 / 60, digits: 1 };

const LENGTHS = new Set([
  "altitude", "orbit_altitude", "landing_altitude", "minimum_target_altitude", "radius",
  "acceptance_radius", "trajectory_control", "swath_width", "max_altitude",
]);
const FRACTIONS = new Set(["side_overlap", "front_overlap"]);
/** Units that are the same in each system. */
const SYMBOLS: Record<string, string> = {
  hold_time: "s", time_interval: "s",
  angular_velocity: "°/s", latitude: "°", longitude: "°", yaw_angle: "°", desired_yaw_angle: "°",
  pitch_angle: "°", minimum_pitch: "°",
};

/** The unit of a field by its name in the edge server's documents. */
export function unitOfField(name: string, units: Units): EnteredUnit {
  if (LENGTHS.has(name)) return units.lengthInput;
  if (name === "maximum_speed") return units.speedInput;
  if (FRACTIONS.has(name)) return PERCENT;
  if (name === "endurance") return MINUTES;
  return { symbol: SYMBOLS[name] ?? "", factor: 1, digits: null };
}

/** Writes the numbers of reports and faults in a person's units; bare numbers are those of `field`. */
export function quantitiesIn(units: Units, field: string | null = null): WriteQuantity {
  return (value, unit, limit) => {
    const entered = unit === null ? unitOfField(field ?? "", units) : enteredUnitOf(unit, units);
    const round = limit === "least" ? Math.ceil : limit === "most" ? Math.floor : Math.round;
    return [units.written(inUnit(value, entered, round)), entered.symbol].filter(Boolean).join(" ");
  };
}

function enteredUnitOf(unit: SiUnit, units: Units): EnteredUnit {
  switch (unit) {
    case "m":
      return units.lengthInput;
    case "m/s":
      return units.speedInput;
    case "deg/s":
      return { symbol: "°/s", factor: 1, digits: null };
  }
}

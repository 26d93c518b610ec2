import { expect, test } from "vitest";
import { Fault } from "../src/api/client";
import i18next, { loadLanguage, reportTexts } from "../src/i18n/i18n";
import { fromUnit } from "../src/units/entered";
import { orderedSpeed } from "../src/planning/speed_limits";
import { quantitiesIn, unitOfField } from "../src/units/fields";
import { speedRange } from "../src/units/limits";
import { Units } from "../src/units/units";

await loadLanguage("es");
const metric = new Units("metric", "en");
const imperial = new Units("imperial", "en");
const said = (text: string, units: Units, field: string | null = null) =>
  reportTexts("en").describe(text, quantitiesIn(units, field));

test("a fault names a speed in the unit of its field", () => {
  const fault = "must be at least 0.5 m/s: no vehicle flies slower";
  expect(said(fault, metric)).toBe("must be at least 1.8 km/h: no drone flies slower");
  expect(said(fault, imperial)).toBe("must be at least 1.2 mph: no drone flies slower");
});

test("a range without a unit has the one of the field", () => {
  expect(said("must be less than or equal to 100", imperial, "altitude")).toBe("must be at most 328 ft");
  expect(said("must be greater than 0", imperial, "altitude")).toBe("must be more than 0 ft");
  expect(said("must be less than or equal to 0.9", metric, "side_overlap")).toBe("must be at most 90 %");
  expect(said("must be less than or equal to 11", imperial, "command_type_id")).toBe("must be at most 11");
});

test("a limit that is entered as it is written is within the limit", () => {
  for (const units of [metric, imperial]) {
    for (const [field, phrase] of [["altitude", "m"], ["maximum_speed", "m/s"]] as const) {
      for (let limit = 0.5; limit < 130; limit += 0.37) {
        const shown = (side: string) => Number(/[\d.]+/.exec(said(`must be at ${side} ${limit} ${phrase}${side === "most" ? ", the vehicle's limit" : ": no vehicle flies slower"}`, units))?.[0]);
        const unit = unitOfField(field, units);
        if (field === "altitude") {
          expect(fromUnit(shown("most"), unit)).toBeLessThanOrEqual(limit + 1e-4);
        } else {
          expect(fromUnit(shown("least"), unit)).toBeGreaterThanOrEqual(limit - 1e-4);
          expect(fromUnit(shown("most"), unit)).toBeLessThanOrEqual(limit + 1e-4);
        }
      }
    }
  }
});

test("a report in words of a program has its quantities in the person's units", () => {
  expect(said("stopped 12.5 m above the ground, 3 m/s too fast", imperial)).toBe("stopped 41 ft above the ground, 6.7 mph too fast");
  expect(said("takes 4 m² in 5 min at 2 m/s²", imperial)).toBe("takes 4 m² in 5 min at 2 m/s²");
  expect(said("the place lies 300 m from the one before it, at most 200 m (longest_leg_m)", imperial))
    .toBe("the place lies 984.3 ft from the one before, at most 656.1 ft are allowed");
});

test("a step and a vehicle's number are no quantities", () => {
  expect(said("7 is already in command_array.3", imperial)).toBe("7 is the number of step 4 already");
  expect(said("vehicle 12 is not registered", imperial)).toBe("drone 12 is not registered");
});

test("a Spanish phrase has the units too", () => {
  const said = (text: string, field: string | null = null) =>
    reportTexts("es").describe(text, quantitiesIn(new Units("metric", "es"), field));
  expect(said("must be at least 0.00417 deg/s, one turn a day", "angular_velocity")).toBe("debe ser al menos 0,00417 °/s");
  expect(said("must be at least 0.5 m/s: no vehicle flies slower")).toContain("1,8 km/h");
});

test("a fault on the screen follows the language", async () => {
  const fault = new Fault("missions.0.maximum_speed", "must be at most 12 m/s, the vehicle's limit");
  expect(fault.text).toBe("must be at most 43.2 km/h, the drone's limit");
  await i18next.changeLanguage("es");
  expect(fault.text).toBe("debe ser como máximo 43,2 km/h, el límite del dron");
  await i18next.changeLanguage("en");
});

test("both ends of the named range of speeds can be ordered", () => {
  for (const units of [metric, imperial]) {
    const ends = speedRange(units, i18next.t).match(/[\d.]+/g)?.map((one) => fromUnit(Number(one), units.speedInput)) ?? [];
    expect(ends).toHaveLength(2);
    expect(ends.map((one) => orderedSpeed(one) === null)).toEqual([false, false]);
  }
});

import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { TFunction } from "i18next";
import type { Fault } from "../api/client";
import type { Command, ParameterValue } from "../api/types";
import { useUnits } from "../app/preferences";
import { Button } from "../controls/Button";
import { SelectField, TextField } from "../controls/fields";
import { NumberField } from "../controls/NumberField";
import { heightOf_m, parametersOf, placeOfFault, problemOf, problemsOf, type Parameter } from "../planning/command_forms";
import { fromUnit, inUnit, readNumber, type EnteredUnit } from "../units/entered";
import { unitOfField } from "../units/fields";
import type { Units } from "../units/units";

/** Of the sides of a picture. */
const CORNER_RANGE = "0 … 1";

/** One step of a plan: its name, and while it is open a field for each parameter. */
export function CommandForm({ index, count, command, isOpen, faults, toggle, change, remove, up, down }: {
  index: number;
  count: number;
  command: Command;
  isOpen: boolean;
  faults: Fault[];
  toggle: () => void;
  change: (parameters: Record<string, ParameterValue>) => void;
  remove: () => void;
  up: () => void;
  down: () => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const parameters = parametersOf(command.command_type_id);
  const number = index + 1;
  const general = faults.filter(
    (fault) => !parameters.some((one) => placeOfFault(fault.path)?.parameter === one.name),
  );
  const height_m = heightOf_m(command);
  const hasProblem = faults.length > 0 || problemsOf(command).length > 0;
  const set = (name: string, value: ParameterValue) => change({ ...command.parameters, [name]: value });
  return (
    <li className={`step ${isOpen ? "is-open" : ""} ${hasProblem ? "has-error" : ""}`}>
      <div className="step-head">
        <button type="button" className="step-title" aria-expanded={isOpen} onClick={toggle}>
          <b>{number}</b>
          {t(`command.${command.command_type_id}`)}
          {height_m !== null && <small>{units.height(height_m)}</small>}
        </button>
        <Button kind="quiet" icon="up" aria-label={t("editor.up", { index: number })} disabled={index === 0} onClick={up} />
        <Button kind="quiet" icon="down" aria-label={t("editor.down", { index: number })} disabled={number === count} onClick={down} />
        <Button kind="quiet" icon="remove" aria-label={t("editor.remove", { index: number })} onClick={remove} />
      </div>
      {general.map((fault) => (
        <p key={fault.text} className="fault step-body" role="alert">
          {fault.text}
        </p>
      ))}
      {isOpen && (
        <div className="step-body">
          <div className="form-grid">
            {parameters.map((one) => (
              <ParameterField
                key={one.name}
                parameter={one}
                value={command.parameters[one.name]}
                fault={faults.find((fault) => placeOfFault(fault.path)?.parameter === one.name)?.text}
                set={(value) => set(one.name, value)}
              />
            ))}
          </div>
        </div>
      )}
    </li>
  );
}

interface ParameterProperties {
  parameter: Parameter;
  value: ParameterValue | undefined;
  fault: string | undefined;
  set: (value: ParameterValue) => void;
}

function ParameterField({ parameter, value, fault, set }: ParameterProperties) {
  const { t } = useTranslation();
  const units = useUnits();
  const { name } = parameter;
  const unit = unitOfField(name, units);
  const label = t(`parameter.${name}`) + (unit.symbol === "" ? "" : ` (${unit.symbol})`);
  if (parameter.type === "boolean") {
    return (
      <SelectField label={label} error={fault} value={String(value ?? parameter.default)} onChange={(event) => set(event.target.value === "true")}>
        <option value="true">{t("choice.true")}</option>
        <option value="false">{t("choice.false")}</option>
      </SelectField>
    );
  }
  if (parameter.choices !== null) {
    return (
      <SelectField label={label} error={fault} value={Number(value ?? parameter.default)} onChange={(event) => set(Number(event.target.value))}>
        {parameter.choices.map((choice) => (
          <option key={choice} value={choice}>
            {t(`choice.${name}.${choice}`)}
          </option>
        ))}
      </SelectField>
    );
  }
  if (parameter.type === "array") {
    const problem = problemOf(parameter, value);
    const ownFault = problem === null ? undefined : t(`editor.${problem}`, { range: CORNER_RANGE });
    return <CornersField label={label} fault={fault ?? ownFault} value={value} set={set} />;
  }
  const problem = problemOf(parameter, value);
  const range = rangeOf(parameter, unit, units, t);
  const ownFault = problem === null ? undefined : t(`editor.${problem}`, { range });
  const number = typeof value === "number" ? value : null;
  return (
    <NumberField
      label={label}
      key={unit.symbol}
      value={number}
      shown={number === null || Number.isNaN(number) ? "" : inUnit(number, unit)}
      hint={parameter.required ? range : `${range}, ${t("editor.optional")}`}
      error={fault ?? ownFault}
      placeholder={parameter.default === null ? t("editor.automatic") : units.written(inUnit(Number(parameter.default), unit))}
      enter={(entered) => {
        const made = entered === null ? null : fromUnit(entered, unit);
        set(made);
        return made;
      }}
    />
  );
}

function rangeOf(one: Parameter, unit: EnteredUnit, units: Units, t: TFunction): string {
  const low = one.minimum === null ? "…" : units.written(inUnit(one.minimum, unit, Math.ceil));
  const high = one.maximum === null ? "…" : units.written(inUnit(one.maximum, unit, Math.floor));
  if (one.below_maximum) return t("editor.below", { low, high });
  return t(one.above_minimum ? "editor.above" : "editor.range", { low, high });
}

/** A rectangle of the picture as four fractions. */
function CornersField({ label, value, fault, set }: {
  label: string;
  value: ParameterValue | undefined;
  fault: string | undefined;
  set: (value: ParameterValue) => void;
}) {
  const [typed, setTyped] = useState(() => (Array.isArray(value) ? value.flat().join(" ") : ""));
  return (
    <TextField
      label={label}
      hint={CORNER_RANGE}
      error={fault}
      value={typed}
      onChange={(event) => {
        setTyped(event.target.value);
        const [left = NaN, top = NaN, right = NaN, bottom = NaN] = event.target.value
          .trim()
          .split(/[\s;]+/)
          .map((part) => readNumber(part) ?? NaN);
        set([[left, top], [right, bottom]]);
      }}
    />
  );
}

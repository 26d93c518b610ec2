import { useState } from "react";
import { TextField } from "./fields";

/** The unit in which a person enters a value: so many of it make one of the value's own unit. */
export interface InputUnit {
  symbol: string;
  factor: number;
  digits: number;
}

/** A number with its unit; gives null while what is entered is no number. */
export function QuantityField({ label, unit, value, change, error, hint, max }: {
  label: string;
  unit: InputUnit;
  value: number | null;
  change: (value: number | null) => void;
  error?: string | undefined;
  hint?: string;
  max?: number;
}) {
  // What a person types stays as it is, until the value changes from elsewhere or the unit does
  const [typed, setTyped] = useState<{ text: string; value: number | null; factor: number } | null>(null);
  const isTyped = typed !== null && typed.value === value && typed.factor === unit.factor;
  const shown = value === null ? "" : String(Number((value * unit.factor).toFixed(unit.digits)));
  return (
    <TextField
      label={unit.symbol === "" ? label : `${label} (${unit.symbol})`}
      type="number"
      inputMode="decimal"
      step="any"
      min={0}
      max={max === undefined ? undefined : max * unit.factor}
      value={isTyped ? typed.text : shown}
      onChange={(event) => {
        const number = event.target.valueAsNumber;
        const entered = Number.isFinite(number) ? number / unit.factor : null;
        setTyped({ text: event.target.value, value: entered, factor: unit.factor });
        change(entered);
      }}
      error={error}
      {...(hint === undefined ? {} : { hint })}
    />
  );
}

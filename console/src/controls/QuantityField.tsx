import { NumberField } from "./NumberField";

/** The unit in which a person enters a value: so many of it make one of the value's own unit. */
export interface InputUnit {
  symbol: string;
  factor: number;
  digits: number;
}

/** A number with its unit; gives null while what is entered is no number. */
export function QuantityField({ label, unit, value, change, error, hint }: {
  label: string;
  unit: InputUnit;
  value: number | null;
  change: (value: number | null) => void;
  error?: string | undefined;
  hint?: string;
}) {
  return (
    <NumberField
      key={unit.symbol}
      label={unit.symbol === "" ? label : `${label} (${unit.symbol})`}
      value={value}
      shown={value === null ? "" : String(Number((value * unit.factor).toFixed(unit.digits)))}
      enter={(number) => {
        const entered = number === null || Number.isNaN(number) ? null : number / unit.factor;
        change(entered);
        return entered;
      }}
      error={error}
      hint={hint}
    />
  );
}

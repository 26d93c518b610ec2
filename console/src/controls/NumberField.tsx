import { useState } from "react";
import { useUnits } from "../app/preferences";
import { readNumber } from "../units/entered";
import { TextField } from "./fields";

/** A number as a person writes it, with a point or a comma, typed step by step: "-" is no number yet.
 *
 * A field of the type "number" drops a comma where the browser's language is not that of the console.
 * What is typed stays, with all its decimals, until the value changes from elsewhere; what is no number
 * stays until the field is left.
 */
export function NumberField({ value, shown, enter, keepsFaults = false, ...rest }: {
  label: string;
  value: number | null;
  /** The value as text, with a point. */
  shown: string;
  /** Takes what is entered, null for nothing and NaN for no number; gives the value that it makes. */
  enter: (entered: number | null) => number | null;
  /** What is no number stays when the field is left: its error says why it is not taken. */
  keepsFaults?: boolean;
  hint?: string | undefined;
  error?: string | undefined;
  placeholder?: string;
}) {
  const units = useUnits();
  const [typed, setTyped] = useState<{ text: string; value: number | null } | null>(null);
  const isTyped = typed !== null && isSame(typed.value, value);
  const { hint, ...others } = rest;
  return (
    <TextField
      {...others}
      {...(hint === undefined ? {} : { hint })}
      inputMode="decimal"
      value={isTyped ? typed.text : units.written(shown)}
      onChange={({ target: { value: text } }) => setTyped({ text, value: enter(readNumber(text, units.decimalMark)) })}
      onBlur={() => {
        const isNumber = typed !== null && Number.isFinite(readNumber(typed.text, units.decimalMark));
        if (!isNumber && !Number.isNaN(value) && !keepsFaults) setTyped(null);
      }}
    />
  );
}

/** Whether two values differ by rounding at most, as one does that is derived from another to and fro. */
function isSame(one: number | null, other: number | null): boolean {
  if (one === null || other === null) return one === other;
  return Object.is(one, other) || Math.abs(one - other) <= 1e-9 * Math.abs(other);
}

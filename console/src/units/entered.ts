/** Numbers between the edge server's unit and the one in which a person enters them. Pure. */

/** So many of it make one of the edge server's; `digits` null: a value is shown as it is. */
export interface EnteredUnit {
  symbol: string;
  factor: number;
  digits: number | null;
}

/** Digits of what is stored: a tenth of a millimetre. */
const STORED_DIGITS = 4;

/** A value as it is shown in a field; `round` keeps a limit on its allowed side. */
export function inUnit(value: number, unit: EnteredUnit, round: (value: number) => number = Math.round): string {
  const { factor, digits } = unit;
  if (digits === null) return String(value);
  const power = 10 ** digits;
  // Without the last digits, in which a product differs from what was entered
  return String(round(Number((value * factor * power).toFixed(3))) / power);
}

const NUMBER = /^[-+]?(\d+[.,]?\d*|[.,]\d+)$/;

const THOUSANDS = /^[-+]?\d{1,3},\d{3}$/;

/** Reads a number with a point or a comma before its decimals; null: nothing was typed, NaN: no number.
 *
 * In a language with the mark "." a comma before three digits is none: it may divide thousands.
 */
export function readNumber(text: string, decimalMark = ","): number | null {
  const typed = text.trim();
  if (typed === "") return null;
  if (decimalMark === "." && THOUSANDS.test(typed)) return NaN;
  return NUMBER.test(typed) ? Number(typed.replace(",", ".")) : NaN;
}

/** A value that was entered, for the edge server. */
export function fromUnit(entered: number, { factor }: EnteredUnit): number {
  return factor === 1 ? entered : Number((entered / factor).toFixed(STORED_DIGITS));
}

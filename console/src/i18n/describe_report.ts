/** What broker and edge server report, and the faults they find, in the person's language. */

/**
 * Phrases of one language by those of the programs; `{name}` stands for a value, or a phrase, and
 * `{step}` for a place in an array, which persons count from 1.
 */
export type Phrases = Record<string, string>;

interface Pattern {
  readonly expression: RegExp;
  readonly names: readonly string[];
  readonly phrase: string;
}

/** Units of the edge server and the broker that persons may read in others. */
export type SiUnit = "m" | "m/s" | "deg/s";

/** Which side of the number is allowed: to round to the other would give a value that is refused. */
export type Limit = "least" | "most" | null;

/** Writes a number of a report; its unit is null where the report has none: that of a field. */
export type WriteQuantity = (value: number, unit: SiUnit | null, limit: Limit) => string;

const PLACEHOLDER = /\{(\w+)\}/g;
/** A placeholder with the unit behind it. */
const QUANTITY_PLACE = /\{(\w+)\}(?: (m\/s|deg\/s|m)(?![\w/²^]))?/g;
const QUANTITY = /(?<![\w.,])(-?\d+(?:\.\d+)?) (m\/s|deg\/s|m)(?![\w/²^])/g;
const NUMBER = /^-?\d+(?:\.\d+)?$/;
/** Values of a range, in the unit of the field that it belongs to. */
const LIMITS: ReadonlyMap<string, Limit> = new Map<string, Limit>([
  ["least", "least"], ["low", "least"], ["most", "most"], ["high", "most"], ["largest", "most"], ["value", null],
]);
const SEPARATOR = "; ";
const STEP = "step";

/** A report joins several phrases; one that is not known stays as it is. */
export class ReportTexts {
  readonly #phrases: ReadonlyMap<string, string>;
  #patterns: Pattern[] | null = null;

  constructor(phrases: Phrases) {
    this.#phrases = new Map(Object.entries(phrases));
  }

  /** Gives a report in this language; `write` decides in which units it is read. */
  readonly describe = (text: string, write: WriteQuantity = asReported): string =>
    text.split(SEPARATOR).map((part) => this.#part(part, write)).join(SEPARATOR);

  #part(text: string, write: WriteQuantity): string {
    const known = this.#phrases.get(text);
    if (known !== undefined) return known;
    this.#patterns ??= patternsOf(this.#phrases);
    for (const { expression, names, phrase } of this.#patterns) {
      const found = expression.exec(text);
      if (found === null) continue;
      const values = new Map(
        names.map((name, index) => [name, found[index + 1] ?? ""]),
      );
      return phrase.replace(QUANTITY_PLACE, (whole, name: string, unit: SiUnit | undefined) => {
        const value = values.get(name);
        return value === undefined ? whole : this.#value(name, value, unit ?? null, write);
      });
    }
    return text.replace(QUANTITY, (_, value: string, unit: SiUnit) => write(Number(value), unit, null));
  }

  #value(name: string, text: string, unit: SiUnit | null, write: WriteQuantity): string {
    if (name === STEP) return String(Number(text) + 1);
    const isQuantity = NUMBER.test(text) && (unit !== null || LIMITS.has(name));
    if (isQuantity) return write(Number(text), unit, LIMITS.get(name) ?? null);
    return unit === null ? this.#part(text, write) : `${text} ${unit}`;
  }
}

/** Numbers and units as the programs write them. */
function asReported(value: number, unit: SiUnit | null): string {
  return unit === null ? String(value) : `${value} ${unit}`;
}

/** Gives the phrases with values, those with the longest fixed text first. */
function patternsOf(phrases: ReadonlyMap<string, string>): Pattern[] {
  const fixed = (text: string) => text.replace(PLACEHOLDER, "").length;
  return [...phrases]
    .filter(([text]) => text.includes("{"))
    .sort(([one], [other]) => fixed(other) - fixed(one))
    .map(([text, phrase]) => ({
      expression: new RegExp(`^${text.split(PLACEHOLDER).map(piece).join("")}$`, "s"),
      names: [...text.matchAll(PLACEHOLDER)].map(([, name]) => name ?? ""),
      phrase,
    }));
}

/** Split at a group, every second piece is the name of a value. */
function piece(text: string, index: number): string {
  return index % 2 === 1 ? "(.+?)" : text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
}

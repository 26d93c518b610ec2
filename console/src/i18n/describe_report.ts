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

const PLACEHOLDER = /\{(\w+)\}/g;
const SEPARATOR = "; ";
const STEP = "step";

/** A report joins several phrases; one that is not known stays as it is. */
export class ReportTexts {
  readonly #phrases: ReadonlyMap<string, string>;
  #patterns: Pattern[] | null = null;

  constructor(phrases: Phrases) {
    this.#phrases = new Map(Object.entries(phrases));
  }

  readonly describe = (text: string): string =>
    text.split(SEPARATOR).map((part) => this.#part(part)).join(SEPARATOR);

  #part(text: string): string {
    const known = this.#phrases.get(text);
    if (known !== undefined) return known;
    this.#patterns ??= patternsOf(this.#phrases);
    for (const { expression, names, phrase } of this.#patterns) {
      const found = expression.exec(text);
      if (found === null) continue;
      const values = new Map(
        names.map((name, index) => [name, this.#value(name, found[index + 1] ?? "")]),
      );
      return phrase.replace(PLACEHOLDER, (whole, name: string) => values.get(name) ?? whole);
    }
    return text;
  }

  #value(name: string, text: string): string {
    return name === STEP ? String(Number(text) + 1) : this.#part(text);
  }
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

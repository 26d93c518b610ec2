/** Search in the library of plans. Pure. */

/** Whether each word that was typed begins a word of one of the texts; case and accents do not matter. */
export function matches(typed: string, texts: readonly string[]): boolean {
  const known = wordsOf(texts.join(" "));
  return wordsOf(typed).every((word) => known.some((one) => one.startsWith(word)));
}

function wordsOf(text: string): string[] {
  const plain = text.normalize("NFD").replace(/\p{Mark}/gu, "").toLowerCase();
  return plain.split(/[^\p{Letter}\p{Number}]+/u).filter((word) => word !== "");
}

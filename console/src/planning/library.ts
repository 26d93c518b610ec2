/** Search in the library of plans. Pure. */

const NUMBER = /^\p{Number}+$/u;

/** Whether each word that was typed is found in the texts; case and accents do not matter.
 *
 * A word finds what it begins, a number only itself: "1" is not "12". A number behind the word of
 * numbered things, such as "drone 1", has to be that of one of them.
 */
export function matches(typed: string, texts: readonly string[]): boolean {
  const wanted = wordsOf(typed);
  const parts = texts.map(wordsOf);
  const known = parts.flat();
  const numbered = parts.filter((words) => words.every((one, index) => NUMBER.test(one) === (index % 2 === 1)));
  return wanted.every((word, index) => {
    if (!NUMBER.test(word)) return known.some((one) => one.startsWith(word));
    const before = wanted[index - 1];
    const behind = numbered.flatMap((words) => words.filter((_, at) => isBegun(words[at - 1], before)));
    return (behind.length > 0 ? behind : known).includes(word);
  });
}

function isBegun(word: string | undefined, by: string | undefined): boolean {
  return by !== undefined && !NUMBER.test(by) && word !== undefined && word.startsWith(by);
}

function wordsOf(text: string): string[] {
  const plain = text.normalize("NFD").replace(/\p{Mark}/gu, "").toLowerCase();
  return plain.split(/[^\p{Letter}\p{Number}]+/u).filter((word) => word !== "");
}

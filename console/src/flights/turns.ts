/** Turns of what the edge server makes few of at once: who waits gets one when another is given back. */

type Begin = () => void;

/** At most so many turns are taken at a time; those who wait get theirs in order. */
export class Turns {
  #free: number;
  readonly #waiting: Begin[] = [];

  constructor(count: number) {
    this.#free = count;
  }

  /** Calls `begin` when there is a turn; the function that it gives ends the turn, or the waiting. */
  readonly take = (begin: Begin): (() => void) => {
    let isTaken = false;
    let isOver = false;
    const start = () => {
      isTaken = true;
      begin();
    };
    if (this.#free > 0) {
      this.#free -= 1;
      start();
    } else {
      this.#waiting.push(start);
    }
    return () => {
      if (isOver) return;
      isOver = true;
      if (isTaken) this.#giveBack();
      else this.#waiting.splice(this.#waiting.indexOf(start), 1);
    };
  };

  #giveBack(): void {
    const next = this.#waiting.shift();
    if (next === undefined) this.#free += 1;
    else next();
  }
}

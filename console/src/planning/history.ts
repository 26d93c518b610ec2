/** Steps back and forward through the states of what is edited. Pure. */

export interface History<State> {
  past: State[];
  present: State;
  future: State[];
}

const MOST = 100;

export function begin<State>(present: State): History<State> {
  return { past: [], present, future: [] };
}

/** A new state; what had been undone cannot be redone any more.
 *
 * With `isContinued` it takes the place of the present one, as while a point is dragged.
 */
export function change<State>(
  history: History<State>,
  present: State,
  isContinued = false,
): History<State> {
  const past = isContinued ? history.past : [...history.past, history.present].slice(-MOST);
  return { past, present, future: [] };
}

/** The last state before that differs from the present one; the same history where there is none.
 *
 * A step may have led back to where it began, as when the browser itself undoes what is typed.
 */
export function undo<State>({ past, present, future }: History<State>): History<State> {
  const kept = past.slice(0, past.length - sameAtEnd(past, present));
  const before = kept.pop();
  if (before === undefined) return { past, present, future };
  return { past: kept, present: before, future: [present, ...future] };
}

/** Whether there is a state to which `undo` leads. */
export function canUndo<State>({ past, present }: History<State>): boolean {
  return past.some((state) => !isSame(state, present));
}

/** The state that was undone last; the same history where there is none. */
export function redo<State>({ past, present, future }: History<State>): History<State> {
  const [next, ...rest] = future;
  if (next === undefined) return { past, present, future };
  return { past: [...past, present], present: next, future: rest };
}

/** How many states in a row at the end hold the values of the present one. */
function sameAtEnd<State>(past: readonly State[], present: State): number {
  const differs = [...past].reverse().findIndex((state) => !isSame(state, present));
  return differs === -1 ? past.length : differs;
}

/** Whether two states hold the same values. */
function isSame(one: unknown, other: unknown): boolean {
  return one === other || JSON.stringify(one) === JSON.stringify(other);
}

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
  const index = past.findLastIndex((state) => !isSame(state, present));
  const before = past[index];
  if (before === undefined) return { past, present, future };
  return { past: past.slice(0, index), present: before, future: [present, ...future] };
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

/** Whether two states hold the same values. */
function isSame(one: unknown, other: unknown): boolean {
  return one === other || JSON.stringify(one) === JSON.stringify(other);
}

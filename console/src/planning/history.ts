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

/** The state before; the same history where there is none. */
export function undo<State>({ past, present, future }: History<State>): History<State> {
  const before = past.at(-1);
  if (before === undefined) return { past, present, future };
  return { past: past.slice(0, -1), present: before, future: [present, ...future] };
}

/** The state that was undone last; the same history where there is none. */
export function redo<State>({ past, present, future }: History<State>): History<State> {
  const [next, ...rest] = future;
  if (next === undefined) return { past, present, future };
  return { past: [...past, present], present: next, future: rest };
}

/** What an editor edits: steps back and forward, and whether it differs from what is stored. */

import { useEffect, useMemo, useRef, useState } from "react";
import type { Tagged } from "../api/client";
import { useSession } from "../app/session_context";
import { isSame } from "../planning/changes";
import { Drafts } from "../planning/drafts";
import { begin, change as record } from "../planning/history";
import { useSteps, type Steps } from "./use_steps";

export interface Editing<State, Value> extends Steps<State> {
  /** The version that is edited; null for something new. */
  base: Tagged<Value> | null;
  isChanged: boolean;
  /** When the draft was written that this browser had kept; null without one. */
  restoredAtMs: number | null;
  /** Takes another version as the base; what was edited is one step back. */
  rebase: (base: Tagged<Value>) => void;
  /** Goes back to the version as it was read; what was edited is one step back. */
  discard: () => void;
  /** Forgets the draft: it is saved, or nobody wants it. */
  forget: () => void;
}

export function useEditing<State, Value>({ name, read, stateOf, isState, isLocked, stepped }: {
  /** Under which the draft is kept. */
  name: string;
  /** The version as it was read; null for something new. */
  read: Tagged<Value> | null;
  stateOf: (value: Value | null) => State;
  /** Whether a draft that was kept is one of this version of the console; any other is dropped. */
  isState: (kept: object) => boolean;
  /** While it is saved: what came later would be lost. */
  isLocked: boolean;
  /** Called after a step back or forward, with the states before and after it. */
  stepped: (before: State, after: State) => void;
}): Editing<State, Value> {
  const { session } = useSession();
  const drafts = useMemo(() => new Drafts(window.sessionStorage, window.localStorage, session.name), [session.name]);
  const [kept] = useState(() => drafts.read<State, Value>(name, isState));
  const [base, setBase] = useState(kept === null ? read : kept.base);
  const [restoredAtMs, setRestoredAtMs] = useState(kept?.at_ms ?? null);
  const steps = useSteps(
    () => {
      const first = begin(stateOf(base?.value ?? null));
      return kept === null ? first : record(first, kept.state);
    },
    { isLocked, stepped },
  );
  const isForgotten = useRef(false);
  const { present, change } = steps;
  const stored = useMemo(() => stateOf(base?.value ?? null), [base]);
  const isChanged = !isSame(stored, present);

  useEffect(() => {
    if (isForgotten.current) return;
    if (isChanged) drafts.write(name, { at_ms: Date.now(), base, state: present });
    else drafts.remove(name);
  }, [drafts, name, base, present, isChanged]);

  return {
    ...steps,
    base,
    isChanged,
    restoredAtMs,
    rebase: (version) => {
      setBase(version);
      setRestoredAtMs(null);
      change(() => stateOf(version.value));
    },
    discard: () => {
      setBase(read);
      setRestoredAtMs(null);
      change(() => stateOf(read?.value ?? null));
    },
    forget: () => {
      isForgotten.current = true;
      drafts.remove(name);
    },
  };
}

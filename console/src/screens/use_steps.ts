/** States of what a person edits, with steps back and forward by button and key. */

import { useEffect, useRef, useState } from "react";
import { useUndoKeys } from "../controls/use_undo_keys";
import { canUndo, change as record, redo, undo, type History } from "../planning/history";

/** Inputs into which a person types; in others each change is one decision. */
const TYPED: ReadonlySet<string> = new Set(["text", "number", "search"]);

export interface Steps<State> {
  present: State;
  canUndo: boolean;
  canRedo: boolean;
  /** Makes a new state; those with the same name after each other are one step back, and what is typed into a field until it is left. */
  change: (update: (present: State) => State, continued?: string) => void;
  undo: () => void;
  redo: () => void;
}

export function useSteps<State>(first: () => History<State>, { isLocked = false, stepped }: {
  /** While it is saved: what came later would be lost. */
  isLocked?: boolean;
  /** Called after a step back or forward, with the states before and after it. */
  stepped: (before: State, after: State) => void;
}): Steps<State> {
  const [history, setHistory] = useState(first);
  const last = useRef<string | Element | undefined>(undefined);
  useEffect(() => {
    const leave = () => {
      if (last.current instanceof Element) last.current = undefined;
    };
    window.addEventListener("focusout", leave);
    return () => window.removeEventListener("focusout", leave);
  }, []);
  const change = (update: (present: State) => State, name?: string) => {
    if (isLocked) return;
    const continued = name ?? typedField();
    const isContinued = continued !== undefined && continued === last.current;
    last.current = continued;
    setHistory((all) => {
      const changed = update(all.present);
      return changed === all.present ? all : record(all, changed, isContinued);
    });
  };
  const step = (to: typeof undo) => {
    if (isLocked) return;
    last.current = undefined;
    setHistory((all) => to(all));
    stepped(history.present, to(history).present);
  };
  const steps = { undo: () => step(undo), redo: () => step(redo) };
  useUndoKeys(steps.undo, steps.redo);
  return {
    present: history.present,
    canUndo: canUndo(history),
    canRedo: history.future.length > 0,
    change,
    ...steps,
  };
}

/** The field in which somebody types now. */
function typedField(): Element | undefined {
  const field = document.activeElement;
  return field instanceof HTMLInputElement && TYPED.has(field.type) ? field : undefined;
}

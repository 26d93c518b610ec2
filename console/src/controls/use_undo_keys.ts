/** The keys of undo and redo. */

import { useEffect, useRef } from "react";

/** Ctrl+Z undoes and Ctrl+Shift+Z or Ctrl+Y redoes; in a field the keys are the field's own. */
export function useUndoKeys(undoStep: () => void, redoStep: () => void) {
  const latest = useRef({ undoStep, redoStep });
  latest.current = { undoStep, redoStep };
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      if (!(event.ctrlKey || event.metaKey) || event.target instanceof HTMLInputElement) return;
      const key = event.key.toLowerCase();
      if (key !== "z" && key !== "y") return;
      event.preventDefault();
      if (key === "y" || event.shiftKey) latest.current.redoStep();
      else latest.current.undoStep();
    };
    window.addEventListener("keydown", press);
    return () => window.removeEventListener("keydown", press);
  }, []);
}

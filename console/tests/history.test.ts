import { expect, test } from "vitest";
import { begin, canUndo, change, redo, undo } from "../src/planning/history";

test("undo gives the state before, redo the one that was undone", () => {
  const edited = change(change(begin("a"), "b"), "c");
  expect(undo(edited).present).toBe("b");
  expect(undo(undo(edited)).present).toBe("a");
  expect(redo(undo(edited))).toEqual(edited);
});

test("at either end nothing changes", () => {
  expect(undo(begin("a"))).toEqual(begin("a"));
  expect(redo(change(begin("a"), "b")).present).toBe("b");
});

test("a change after an undo ends what could be redone", () => {
  const other = change(undo(change(begin("a"), "b")), "c");
  expect(redo(other).present).toBe("c");
  expect(undo(other).present).toBe("a");
});

test("a drag is one step, however many places it passes", () => {
  const begun = change(begin(0), 1);
  const dragged = change(change(begun, 2, true), 3, true);
  expect(dragged.present).toBe(3);
  expect(undo(dragged).present).toBe(0);
});

test("a step that has led back to where it began is passed over", () => {
  const typed = change(change(begin({ altitude: 20 }), { altitude: 205 }), { altitude: 20 }, true);
  expect(canUndo(typed)).toBe(false);
  const before = change(change(change(begin({ altitude: 10 }), { altitude: 20 }), { altitude: 205 }), { altitude: 20 }, true);
  expect(canUndo(before)).toBe(true);
  expect(undo(before).present).toEqual({ altitude: 10 });
  expect(redo(undo(before)).present).toEqual({ altitude: 20 });
});

import { expect, test } from "vitest";
import { Drafts } from "../src/planning/drafts";

/** The browser's storage; `isFull` refuses what is written. */
class MemoryStorage {
  items = new Map<string, string>();
  isFull = false;
  get length() { return this.items.size; }
  key(index: number) { return [...this.items.keys()][index] ?? null; }
  getItem(key: string) { return this.items.get(key) ?? null; }
  removeItem(key: string) { this.items.delete(key); }
  setItem(key: string, value: string) {
    if (this.isFull) throw new Error("quota");
    this.items.set(key, value);
  }
}

const isState = (kept: object) => "name" in kept;
const draft = (name: string, at_ms = 1) => ({ at_ms, base: { value: "stored", tag: "t" }, state: { name } });

test("a draft is there again with the version that it was made of", () => {
  const place = new MemoryStorage();
  new Drafts(place, "ana").write("plans/7", draft("mine"));
  expect(new Drafts(place, "ana").read("plans/7", isState)).toEqual(draft("mine"));
});

test("nobody gets a draft of another person, or of another plan", () => {
  const place = new MemoryStorage();
  new Drafts(place, "ana").write("plans/7", draft("mine"));
  expect(new Drafts(place, "juan").read("plans/7", isState)).toBeNull();
  expect(new Drafts(place, "ana").read("plans/8", isState)).toBeNull();
});

test("the oldest drafts are forgotten", () => {
  const drafts = new Drafts(new MemoryStorage(), "ana");
  for (let index = 0; index < 45; index += 1) drafts.write(`plans/${index}`, draft("mine", index));
  expect(drafts.read("plans/4", isState)).toBeNull();
  expect(drafts.read("plans/5", isState)).not.toBeNull();
});

test("storage that is full, or holds something else, does not stop anybody", () => {
  const place = new MemoryStorage();
  const drafts = new Drafts(place, "ana");
  drafts.write("plans/7", draft("mine"));
  for (const key of place.items.keys()) place.items.set(key, "{broken");
  expect(drafts.read("plans/7", isState)).toBeNull();
  place.isFull = true;
  drafts.write("plans/7", draft("mine"));
});

test("a draft of another version of the console is dropped", () => {
  const drafts = new Drafts(new MemoryStorage(), "ana");
  drafts.write("plans/7", { at_ms: 1, base: null, state: { title: "old" } });
  expect(drafts.read("plans/7", isState)).toBeNull();
  drafts.write("plans/7", { at_ms: 1, base: null, state: "mine" });
  expect(drafts.read("plans/7", isState)).toBeNull();
});

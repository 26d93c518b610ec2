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
  new Drafts(new MemoryStorage(), place, "ana").write("plans/7", draft("mine"));
  expect(new Drafts(new MemoryStorage(), place, "ana").read("plans/7", isState)).toEqual(draft("mine"));
});

test("nobody gets a draft of another person, or of another plan", () => {
  const place = new MemoryStorage();
  new Drafts(new MemoryStorage(), place, "ana").write("plans/7", draft("mine"));
  expect(new Drafts(new MemoryStorage(), place, "juan").read("plans/7", isState)).toBeNull();
  expect(new Drafts(new MemoryStorage(), place, "ana").read("plans/8", isState)).toBeNull();
});

test("the oldest drafts are forgotten", () => {
  const drafts = new Drafts(new MemoryStorage(), new MemoryStorage(), "ana");
  for (let index = 0; index < 45; index += 1) drafts.write(`plans/${index}`, draft("mine", index));
  expect(drafts.read("plans/4", isState)).toBeNull();
  expect(drafts.read("plans/5", isState)).not.toBeNull();
});

test("storage that is full, or holds something else, does not stop anybody", () => {
  const [tab, place] = [new MemoryStorage(), new MemoryStorage()];
  const drafts = new Drafts(tab, place, "ana");
  drafts.write("plans/7", draft("mine"));
  for (const key of tab.items.keys()) tab.items.set(key, "{broken");
  expect(drafts.read("plans/7", isState)).toEqual(draft("mine"));
  for (const key of place.items.keys()) place.items.set(key, "{broken");
  expect(drafts.read("plans/7", isState)).toBeNull();
  tab.isFull = place.isFull = true;
  drafts.write("plans/7", draft("mine"));
});

test("a draft of another version of the console is dropped", () => {
  const drafts = new Drafts(new MemoryStorage(), new MemoryStorage(), "ana");
  drafts.write("plans/7", { at_ms: 1, base: null, state: { title: "old" } });
  expect(drafts.read("plans/7", isState)).toBeNull();
  drafts.write("plans/7", { at_ms: 1, base: null, state: "mine" });
  expect(drafts.read("plans/7", isState)).toBeNull();
});

test("what two tabs edit of one plan is found again by each of them", () => {
  const place = new MemoryStorage();
  const [first, second] = [new Drafts(new MemoryStorage(), place, "ana"), new Drafts(new MemoryStorage(), place, "ana")];
  second.write("plans/7", draft("of the second"));
  first.write("plans/7", draft("of the first"));
  expect(second.read("plans/7", isState)).toEqual(draft("of the second"));
  expect(first.read("plans/7", isState)).toEqual(draft("of the first"));
  const later = () => new Drafts(new MemoryStorage(), place, "ana").read("plans/7", isState);
  expect(later()).toEqual(draft("of the first"));
  second.remove("plans/7");
  expect(later()).toEqual(draft("of the first"));
  first.remove("plans/7");
  expect(later()).toBeNull();
});

test("a page that was opened later forgets what it has found", () => {
  const place = new MemoryStorage();
  new Drafts(new MemoryStorage(), place, "ana").write("plans/7", draft("mine"));
  const later = new Drafts(new MemoryStorage(), place, "ana");
  later.remove("plans/7");
  expect(later.read("plans/7", isState)).toBeNull();
});

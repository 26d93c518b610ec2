import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Asking, FOLLOWING_MS, PAUSE_MS } from "../src/live/asking";

/** An edge server whose answers come when a test says so, in any order. */
function begin() {
  const open = new Map<string, { answer: () => void; refuse: () => void }>();
  const asked: string[] = [];
  const told: string[] = [];
  const asking = new Asking<string, string>(
    (question) => {
      asked.push(question);
      return new Promise((resolve, reject) => {
        open.set(question, { answer: () => resolve(`to ${question}`), refuse: () => reject(new Error(question)) });
      });
    },
    (answer) => told.push(answer),
    (reason) => told.push(String(reason)),
  );
  const settle = async (question: string, how: "answer" | "refuse" = "answer") => {
    open.get(question)?.[how]();
    await vi.advanceTimersByTimeAsync(0);
  };
  return { asking, asked, told, settle };
}

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

test("what is typed is asked when it has not changed for a moment", async () => {
  const { asking, asked } = begin();
  for (const typed of ["4", "40", "40.5"]) {
    asking.put(typed, false);
    await vi.advanceTimersByTimeAsync(PAUSE_MS - 50);
  }
  expect(asked).toEqual([]);
  await vi.advanceTimersByTimeAsync(50);
  expect(asked).toEqual(["40.5"]);
});

test("what is dragged is asked on the way, one question at a time, and its end always", async () => {
  const { asking, asked, told, settle } = begin();
  for (let place = 0; place < 100; place += 1) {
    asking.put(`${place}`, true);
    await vi.advanceTimersByTimeAsync(10);
    const last = asked.at(-1);
    if (place % 10 === 9 && last !== undefined) await settle(last);
  }
  expect(asked.length).toBeGreaterThanOrEqual(4);
  expect(asked.length).toBeLessThanOrEqual(1 + 1000 / FOLLOWING_MS);
  expect(told.length).toBeGreaterThanOrEqual(4);
  await vi.advanceTimersByTimeAsync(PAUSE_MS);
  await settle("99");
  expect(asked.at(-1)).toBe("99");
  expect(told.at(-1)).toBe("to 99");
});

test("a slow edge server gets no second question while something is dragged", async () => {
  const { asking, asked, settle } = begin();
  for (let place = 0; place < 50; place += 1) {
    asking.put(`${place}`, true);
    await vi.advanceTimersByTimeAsync(20);
  }
  expect(asked).toEqual(["0"]);
  await settle("0");
  await vi.advanceTimersByTimeAsync(0);
  expect(asked).toEqual(["0", "49"]);
});

test("an answer to an older question does not replace that to a newer one", async () => {
  const { asking, told, settle } = begin();
  asking.put("old", false);
  await vi.advanceTimersByTimeAsync(PAUSE_MS);
  asking.put("new", false);
  await vi.advanceTimersByTimeAsync(PAUSE_MS);
  await settle("new");
  await settle("old");
  await settle("old", "refuse");
  expect(told).toEqual(["to new"]);
});

test("a refusal is told like an answer, and the next question is asked", async () => {
  const { asking, told, settle } = begin();
  asking.put("outside", true);
  await vi.advanceTimersByTimeAsync(0);
  asking.put("inside", true);
  await settle("outside", "refuse");
  await vi.advanceTimersByTimeAsync(FOLLOWING_MS);
  await settle("inside");
  expect(told).toEqual(["Error: outside", "to inside"]);
});

test("what is forgotten is neither asked nor answered", async () => {
  const { asking, asked, told, settle } = begin();
  asking.put("asked", true);
  await vi.advanceTimersByTimeAsync(0);
  asking.put("waiting", true);
  asking.forget();
  await settle("asked");
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked).toEqual(["asked"]);
  expect(told).toEqual([]);
});

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { DebouncedRequest, FOLLOWING_MS, PAUSE_MS } from "../src/live/debounced_request";

/** An edge server whose answers come when a test says so, in any order. */
function begin() {
  const open = new Map<string, { answer: () => void; refuse: () => void }>();
  const asked: string[] = [];
  const delivered: string[] = [];
  const requests = new DebouncedRequest<string, string>(
    (question) => {
      asked.push(question);
      return new Promise((resolve, reject) => {
        open.set(question, { answer: () => resolve(`to ${question}`), refuse: () => reject(new Error(question)) });
      });
    },
    (answer) => delivered.push(answer),
    (reason) => delivered.push(String(reason)),
  );
  const settle = async (question: string, how: "answer" | "refuse" = "answer") => {
    open.get(question)?.[how]();
    await vi.advanceTimersByTimeAsync(0);
  };
  return { requests, asked, delivered, settle };
}

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

test("what is typed is asked when it has not changed for a moment", async () => {
  const { requests, asked } = begin();
  for (const typed of ["4", "40", "40.5"]) {
    requests.change(typed, false);
    await vi.advanceTimersByTimeAsync(PAUSE_MS - 50);
  }
  expect(asked).toEqual([]);
  await vi.advanceTimersByTimeAsync(50);
  expect(asked).toEqual(["40.5"]);
});

test("what is dragged is asked on the way, one question at a time, and its end always", async () => {
  const { requests, asked, delivered, settle } = begin();
  for (let place = 0; place < 100; place += 1) {
    requests.change(`${place}`, true);
    await vi.advanceTimersByTimeAsync(10);
    const last = asked.at(-1);
    if (place % 10 === 9 && last !== undefined) await settle(last);
  }
  expect(asked.length).toBeGreaterThanOrEqual(4);
  expect(asked.length).toBeLessThanOrEqual(1 + 1000 / FOLLOWING_MS);
  expect(delivered.length).toBeGreaterThanOrEqual(4);
  await vi.advanceTimersByTimeAsync(PAUSE_MS);
  await settle("99");
  expect(asked.at(-1)).toBe("99");
  expect(delivered.at(-1)).toBe("to 99");
});

test("a slow edge server gets no second question while something is dragged", async () => {
  const { requests, asked, settle } = begin();
  for (let place = 0; place < 50; place += 1) {
    requests.change(`${place}`, true);
    await vi.advanceTimersByTimeAsync(20);
  }
  expect(asked).toEqual(["0"]);
  await settle("0");
  await vi.advanceTimersByTimeAsync(0);
  expect(asked).toEqual(["0", "49"]);
});

test("an answer to an older question does not replace that to a newer one", async () => {
  const { requests, delivered, settle } = begin();
  requests.change("old", false);
  await vi.advanceTimersByTimeAsync(PAUSE_MS);
  requests.change("new", false);
  await vi.advanceTimersByTimeAsync(PAUSE_MS);
  await settle("new");
  await settle("old");
  await settle("old", "refuse");
  expect(delivered).toEqual(["to new"]);
});

test("a refusal is delivered like an answer, and the next question is asked", async () => {
  const { requests, delivered, settle } = begin();
  requests.change("outside", true);
  await vi.advanceTimersByTimeAsync(0);
  requests.change("inside", true);
  await settle("outside", "refuse");
  await vi.advanceTimersByTimeAsync(FOLLOWING_MS);
  await settle("inside");
  expect(delivered).toEqual(["Error: outside", "to inside"]);
});

test("what is cancelled is neither asked nor answered", async () => {
  const { requests, asked, delivered, settle } = begin();
  requests.change("asked", true);
  await vi.advanceTimersByTimeAsync(0);
  requests.change("waiting", true);
  requests.cancel();
  await settle("asked");
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked).toEqual(["asked"]);
  expect(delivered).toEqual([]);
});

import { readFileSync } from "node:fs";
import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { Fault, RequestError } from "../src/api/client";
import type { StoredEvent } from "../src/api/types";
import { changeSpeed } from "../src/api/resources";
import { FASTEST_M_S, orderedSpeed, SLOWEST_M_S } from "../src/planning/speed_limits";
import { lastSpeedOf } from "../src/screens/use_speed_order";
import { eventOutcome, followEvent, giveOrder, outcomeOf, stopOutcomeOf, textKeyOf, type Outcome } from "../src/live/order";

const stored = (state: StoredEvent["state"], message?: string) =>
  ({ id: 4, state, ...(message === undefined ? {} : { message }) }) as StoredEvent;
const answer = (body: unknown) => new Response(JSON.stringify(body), { status: 200 });

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test("the limits are those of the edge server", () => {
  const source = readFileSync("../afarcloud/flyable.py", "utf8");
  expect(source).toContain(`SLOWEST_M_S: Final = ${SLOWEST_M_S}\n`);
  expect(source).toContain(`maximum_speed_m_s: float = ${FASTEST_M_S.toFixed(1)}\n`);
});

test("a speed within the limits is ordered as it was entered", () => {
  expect([null, 0, 0.05, 3, 12.1].map(orderedSpeed)).toEqual([null, null, null, 3, null]);
  expect(orderedSpeed(43.2 / 3.6)).toBe(FASTEST_M_S);
  expect(orderedSpeed(26.8 / 2.23694)).toBeCloseTo(11.98, 2);
});

test("an order names the vehicle and the speed", async () => {
  const fetched = vi.fn(async (_path: string, _options: RequestInit) => answer(stored("queued")));
  vi.stubGlobal("fetch", fetched);
  await changeSpeed(2, 3.5, 7);
  const [path, options] = fetched.mock.calls[0] ?? [];
  expect([path, options?.method]).toEqual(["/events/", "POST"]);
  expect(JSON.parse(String(options?.body))).toEqual({ sequence_number: 7, vehicle_id: 2, event_type_id: 3, maximum_speed: 3.5 });
});

test.each([
  [stored("done"), { state: "done", reason: "" }],
  [stored("refused", "there is no mission"), { state: "refused", reason: "there is no mission" }],
  [stored("expired"), { state: "expired", reason: "" }],
] as const)("an order is followed to its end: $state", async (end, told) => {
  const states = [stored("accepted"), end];
  vi.stubGlobal("fetch", vi.fn(async () => answer(states.shift())));
  const news: unknown[] = [];
  const followed = followEvent(stored("queued"), (one) => news.push(one), () => true);
  await vi.runAllTimersAsync();
  await followed;
  expect(news).toEqual([{ state: "queued", reason: "" }, { state: "accepted", reason: "" }, told]);
});

const followed = async (first: StoredEvent, look: () => Promise<Response>, isOpen = () => true) => {
  const fetched = vi.fn(look);
  vi.stubGlobal("fetch", fetched);
  const states: string[] = [];
  const following = followEvent(first, ({ state }) => states.at(-1) !== state && states.push(state), isOpen);
  await vi.runAllTimersAsync();
  await following;
  return { states, looks: fetched.mock.calls.length };
};

test.each([404, 410])("an order that somebody has deleted has ended: %i", async (status) => {
  const gone = async () => new Response(JSON.stringify({ message: "there is no event 4" }), { status });
  expect(await followed(stored("queued"), gone)).toEqual({ states: ["queued", "deleted"], looks: 1 });
});

test("another order with the number of one that a restore has lost is not taken for it", async () => {
  const other = async () => answer({ ...stored("done"), sequence_number: 8 });
  expect(await followed({ ...stored("queued"), sequence_number: 7 }, other)).toEqual({ states: ["queued", "deleted"], looks: 1 });
});

test.each(["queued", "accepted"] as const)("an order that is %s is not confirmed after its expiry without an answer", async (state) => {
  const expires_at = new Date(Date.now() + 10_000).toISOString();
  let until_ms = Date.now() + 9_000;
  const isOpen = () => Date.now() < until_ms;
  const silent = () => Promise.reject(new TypeError("no network"));
  expect((await followed({ ...stored(state), expires_at }, silent, isOpen)).states).toEqual([state]);
  until_ms += 5_000;
  expect((await followed({ ...stored(state), expires_at }, silent, isOpen)).states).toEqual([state, "failed"]);
});

test("an order that is not confirmed is followed until the edge server answers", async () => {
  const expires_at = new Date(Date.now() + 2_000).toISOString();
  const back_ms = Date.now() + 30_000;
  const back = async () => {
    if (Date.now() < back_ms) throw new TypeError("no network");
    return answer({ ...stored("done"), expires_at });
  };
  expect((await followed({ ...stored("queued"), expires_at }, back)).states).toEqual(["queued", "failed", "done"]);
});

test("an order that nobody looks at any more is not asked for again", async () => {
  const fetched = vi.fn();
  vi.stubGlobal("fetch", fetched);
  await followEvent(stored("queued"), () => undefined, () => false);
  expect(fetched).not.toHaveBeenCalled();
});

test.each([
  [undefined, { state: "done", reason: "" }],
  ["a later event replaced it", { state: "replaced", reason: "" }],
  ["the vehicle has landed unseen", { state: "ended", reason: "the vehicle has landed unseen" }],
] as const)("an order that is done with a note was not obeyed as given: %s", (message, outcome) => {
  expect(eventOutcome(stored("done", message))).toEqual(outcome);
  expect(eventOutcome(stored("refused", message)).state).toBe("refused");
});

test("an accepted landing of a drone that is not received is not about to be obeyed", () => {
  expect(textKeyOf({ state: "accepted" }, true, false)).toBe("accepted_lost");
  expect([textKeyOf({ state: "accepted" }, true, true), textKeyOf({ state: "accepted" }, false, false), textKeyOf({ state: "done" }, true, false)])
    .toEqual(["accepted", "accepted", "done"]);
});

test("the words for an order that was replaced are the broker's", () => {
  const source = readFileSync("../mavlink_broker/mission/flight_orders.py", "utf8");
  expect(source).toContain('REPLACED: Final = "a later event replaced it"\n');
});

describe("an order whose answer was lost", () => {
  const unreachable = () => Promise.reject(new RequestError(0, "unreachable"));
  const give = async (find: (number: number) => Promise<Response>, isOpen = () => true) => {
    let number = -1;
    const sent = vi.fn((marked: number) => {
      number = marked;
      return unreachable();
    });
    const fetched = vi.fn((_path: string, _options: RequestInit) => find(number));
    vi.stubGlobal("fetch", fetched);
    const news: Outcome[] = [];
    const given = giveOrder(2, sent, (one) => news.push(one), isOpen);
    await vi.runAllTimersAsync();
    await given;
    expect(sent).toHaveBeenCalledTimes(1);
    expect(fetched.mock.calls.every(([, options]) => options.method === "GET")).toBe(true);
    return { states: news.map(({ state }) => state), looks: fetched.mock.calls.length };
  };

  test("is found among the vehicle's events, and followed", async () => {
    let answers = 0;
    const found = await give(async (number) => {
      answers += 1;
      if (answers < 3) throw new TypeError("no network");
      return answer([{ ...stored("done"), id: 3, sequence_number: number - 1 }, { ...stored("done"), sequence_number: number }]);
    });
    expect(found).toEqual({ states: ["failed", "done"], looks: 3 });
  });

  test("stays unconfirmed where the edge server does not know it", async () => {
    const { states, looks } = await give(async () => answer([]));
    expect(states).toEqual(["failed"]);
    expect(looks).toBe(10);
  });

  test("is not looked for when nobody reads the answer", async () => {
    expect(await give(async () => answer([]), () => false)).toEqual({ states: ["failed"], looks: 0 });
  });
});

test("an order that was refused is not looked for", async () => {
  const fetched = vi.fn();
  vi.stubGlobal("fetch", fetched);
  const news: Outcome[] = [];
  const refused = () => Promise.reject(new RequestError(409, "no mission to interrupt"));
  await giveOrder(2, refused, (one) => news.push(one), () => true);
  expect(news).toEqual([{ state: "refused", reason: "no mission to interrupt" }]);
  expect(fetched).not.toHaveBeenCalled();
});

test("an order that was not stored says why", () => {
  const fault = new Fault("maximum_speed", "must be at most 12.0 m/s, the vehicle's limit");
  expect(outcomeOf(new RequestError(422, "invalid", [fault]))).toEqual({ state: "refused", reason: fault.text });
  expect(outcomeOf(new RequestError(409, "no mission to interrupt"))).toEqual({ state: "refused", reason: "no mission to interrupt" });
  expect(outcomeOf(new RequestError(0, "unreachable"))).toEqual({ state: "failed", reason: "" });
  expect(outcomeOf(new RequestError(503, "busy"))).toEqual({ state: "failed", reason: "busy" });
});

test("nothing to stop is what the edge server says, not any refusal", () => {
  const idle = new RequestError(409, "vehicle 2 has no active mission", [new Fault("vehicle_id", "has no active mission")]);
  expect(stopOutcomeOf(idle)).toEqual({ state: "idle", reason: "" });
  const stale = "the edge server stood still, and this may have waited for 13 s: it is not carried out";
  expect(stopOutcomeOf(new RequestError(409, stale))).toEqual({ state: "refused", reason: stale });
  expect(stopOutcomeOf(new RequestError(0, "unreachable"))).toEqual({ state: "failed", reason: "" });
  expect(stopOutcomeOf(new RequestError(500, "broken"))).toEqual({ state: "failed", reason: "broken" });
});

test("the speed that is flown is that of the last order that was carried out", () => {
  const speed = (maximum_speed: number, state: StoredEvent["state"], event_type_id = 3) =>
    ({ id: 1, event_type_id, state, maximum_speed }) as StoredEvent;
  expect(lastSpeedOf([speed(4, "done"), speed(2, "done"), speed(9, "refused"), speed(8, "done", 101)])).toBe(2);
  expect(lastSpeedOf([speed(9, "expired")])).toBeNull();
});

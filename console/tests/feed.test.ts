import { afterEach, expect, test, vi } from "vitest";
import { onSignedOut } from "../src/api/client";
import { Feed } from "../src/live/feed";

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
  onSignedOut(() => undefined);
});

async function answeredWith(status: number): Promise<{ asked: number; signedOut: number; connection: string }> {
  let [asked, signedOut] = [0, 0];
  vi.stubGlobal("fetch", async () => {
    asked += 1;
    return new Response(null, { status });
  });
  onSignedOut(() => (signedOut += 1));
  const feed = new Feed();
  feed.start();
  await vi.waitFor(() => expect(asked).toBeGreaterThan(0));
  await new Promise((resolve) => setTimeout(resolve, 800));
  feed.stop();
  return { asked, signedOut, connection: feed.state().connection };
}

test("a session that has ended leads to the sign-in and is not tried again", async () => {
  expect(await answeredWith(401)).toMatchObject({ asked: 1, signedOut: 1 });
});

test("a server that is busy or broken is offline, and is tried again", async () => {
  const { asked, signedOut, connection } = await answeredWith(503);
  expect(asked).toBeGreaterThan(1);
  expect(signedOut).toBe(0);
  expect(connection).toBe("offline");
});

test("a feed that is started twice connects once", async () => {
  let asked = 0;
  vi.stubGlobal("fetch", () => new Promise(() => (asked += 1)));
  const feed = new Feed();
  feed.start();
  feed.start();
  expect(asked).toBe(1);
  feed.stop();
  feed.start();
  expect(asked).toBe(2);
  feed.stop();
});

const SNAPSHOT = `id: a-1\nevent: snapshot\ndata: {"vehicles":[],"missions":[],"uplink":null}\n\n`;

/** Sends pieces of a stream, one each so many seconds; gives what the feed shows after each. */
async function shown(pieces: readonly string[], pause_s: number): Promise<{ asked: number; states: string[] }> {
  vi.useFakeTimers();
  let asked = 0;
  let send: (piece: string) => void = () => undefined;
  vi.stubGlobal("fetch", async (_path: string, { signal }: RequestInit) => {
    asked += 1;
    return new Response(
      new ReadableStream({
        start(control) {
          send = (piece) => control.enqueue(new TextEncoder().encode(piece));
          signal?.addEventListener("abort", () => control.error(new Error("aborted")));
        },
      }),
    );
  });
  const feed = new Feed();
  feed.start();
  const states: string[] = [];
  for (const piece of pieces) {
    await vi.advanceTimersByTimeAsync(100);
    send(piece);
    await vi.advanceTimersByTimeAsync(pause_s * 1000);
    states.push(feed.state().connection);
  }
  feed.stop();
  return { asked, states };
}

test("heartbeats keep a stream in which nothing happens", async () => {
  expect(await shown([SNAPSHOT, ":\n\n", ":\n\n", ":\n\n"], 4)).toEqual({
    asked: 1, states: ["live", "live", "live", "live"],
  });
});

test("a server that sends nothing for ten seconds is offline", async () => {
  // It has been asked again, and shows as live only when it has sent something
  expect(await shown([SNAPSHOT], 11)).toEqual({ asked: 2, states: ["offline"] });
});

test("a large event over a slow network is received whole, and shows as live at its end", async () => {
  const cut = 20;
  expect(await shown([SNAPSHOT.slice(0, cut), SNAPSHOT.slice(cut, 2 * cut), SNAPSHOT.slice(2 * cut)], 8)).toEqual({
    asked: 1, states: ["connecting", "connecting", "live"],
  });
});

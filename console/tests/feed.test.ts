import { afterEach, expect, test, vi } from "vitest";
import { onSignedOut } from "../src/api/client";
import { Feed } from "../src/live/feed";

afterEach(() => {
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

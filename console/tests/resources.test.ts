import { afterEach, expect, test, vi } from "vitest";
import { listFlights } from "../src/api/resources";

afterEach(() => vi.unstubAllGlobals());

/** An edge server with so many flights, which answers parts of the list, the oldest first. */
function archiveOf(count: number): void {
  vi.stubGlobal("fetch", async (path: string) => {
    const query = new URL(path, "http://edge").searchParams;
    const first = Number(query.get("after")) + 1;
    const last = Math.min(count, first + Number(query.get("limit")) - 1);
    const rows = Array.from({ length: Math.max(0, last - first + 1) }, (_, at) => ({ id: first + at }));
    return new Response(JSON.stringify(rows));
  });
}

test("the newest flight is the first, however many there are", async () => {
  archiveOf(1201);
  const flights = await listFlights();
  expect(flights).toHaveLength(1201);
  expect(flights[0]?.id).toBe(1201);
  expect(flights.at(-1)?.id).toBe(1);
});

test("an empty archive has no flights", async () => {
  archiveOf(0);
  expect(await listFlights()).toEqual([]);
});

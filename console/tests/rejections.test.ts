import { afterEach, expect, test, vi } from "vitest";
import { listDeadLetters } from "../src/api/resources";
import type { DeadLetter } from "../src/api/types";
import { newestFirst } from "../src/screens/system/rejections";

const letter = (id: number, received_at: string, rejected_at: string | null): DeadLetter => ({
  id, kind: "pose", vehicle_id: 1, attempts: 1, reason: "422", rejected_at,
  report: { id, message_id: "m", received_at },
});

afterEach(() => {
  vi.unstubAllGlobals();
});

test("the newest rejection comes first, those without a time last", () => {
  const letters = [
    letter(1, "2026-05-01T08:00:00Z", null),
    letter(2, "2026-05-01T09:00:00Z", null),
    letter(3, "2026-05-01T10:00:00Z", "2026-05-01T12:00:00Z"),
    // Rejected again after a person has sent it once more
    letter(4, "2026-05-01T11:00:00Z", "2026-05-01T11:00:01Z"),
  ];
  expect(newestFirst(letters).map(({ id }) => id)).toEqual([3, 4, 2, 1]);
});

test("all rejected records are read: the edge server lists the oldest first", async () => {
  const page = (from: number, count: number) => Array.from({ length: count }, (_, index) => ({ id: from + index }));
  const fetched = vi.fn(async (path: string) => {
    const after = Number(new URL(path, "http://edge").searchParams.get("after"));
    const limit = Number(new URL(path, "http://edge").searchParams.get("limit"));
    return new Response(JSON.stringify(after === 0 ? page(1, limit) : page(after + 1, 3)), { status: 200 });
  });
  vi.stubGlobal("fetch", fetched);
  const letters = await listDeadLetters();
  expect(fetched).toHaveBeenCalledTimes(2);
  expect(letters.length).toBeGreaterThan(103);
});

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { onOtherSession, OtherPersonError, request, setCsrfToken } from "../src/api/client";
import { stopVehicle } from "../src/api/resources";
import { presentSession } from "../src/api/session";

const FOREIGN = { message: "X-CSRF-Token must be the csrf_token of this session (GET /session/)" };
const sent: [string, string | undefined][] = [];
/** Of the session that the cookie belongs to by now. */
const PRESENT = "juan's token";

beforeEach(() => {
  sent.length = 0;
  vi.stubGlobal("fetch", async (path: string, { method, headers }: RequestInit) => {
    const token = (headers as Record<string, string>)["X-CSRF-Token"];
    sent.push([`${method} ${path}`, token]);
    if (method === "GET") return new Response(JSON.stringify({ name: "juan", role: "operator", csrf_token: PRESENT }));
    return token === PRESENT ? new Response("{}", { status: 201 }) : new Response(JSON.stringify(FOREIGN), { status: 403 });
  });
  setCsrfToken("ana's token");
});
afterEach(() => vi.unstubAllGlobals());

/** Another tab has signed in; this page was that of a person. */
const becomes = (name: string) => onOtherSession(async () => (await presentSession()).name === name);

test("what a tab writes with the token of an ended session of the same person is written with the new one", async () => {
  becomes("juan");
  await request("/plans/", { method: "POST", body: {} });
  expect(sent).toEqual([["POST /plans/", "ana's token"], ["GET /session/", undefined], ["POST /plans/", PRESENT]]);
});

test("nothing is written in the name of another person", async () => {
  becomes("ana");
  await expect(request("/plans/", { method: "POST", body: {} })).rejects.toBeInstanceOf(OtherPersonError);
  expect(sent).toHaveLength(2);
});

test("a vehicle is stopped whoever has signed in", async () => {
  becomes("ana");
  await stopVehicle(1, 103, 5);
  expect(sent.map(([what]) => what)).toEqual(["POST /events/", "GET /session/", "POST /events/"]);
});

test("any other refusal is not repeated, and the session is read again: the role may have changed", async () => {
  let read = 0;
  onOtherSession(async () => {
    read += 1;
    return true;
  });
  vi.stubGlobal("fetch", async (path: string) => {
    sent.push([path, undefined]);
    return new Response(JSON.stringify({ message: "the role farmer may not do this" }), { status: 403 });
  });
  await expect(stopVehicle(1, 103, 5)).rejects.toMatchObject({ status: 403, message: "the role farmer may not do this" });
  expect(sent).toHaveLength(1);
  expect(read).toBe(1);
});

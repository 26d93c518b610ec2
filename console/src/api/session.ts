/** The session of the person at this browser. */

import { request, setCsrfToken } from "./client";
import type { Session } from "./types";

/** Gives the present session; raises RequestError 401 if there is none. */
export async function presentSession(): Promise<Session> {
  return remember(await request<Session>("/session/"));
}

/** Signs in with name and password; raises RequestError. */
export async function signIn(name: string, password: string): Promise<Session> {
  return announce(await request<Session>("/session/", { method: "POST", body: { name, password } }));
}

/** Signs in with a one-time link; raises RequestError. */
export async function signInByLink(link: string): Promise<Session> {
  return announce(await request<Session>("/session/", { method: "POST", body: { link } }));
}

/** Ends the session on the server. */
export async function signOut(): Promise<void> {
  await request("/session/", { method: "DELETE" });
  setCsrfToken(null);
  tabs?.postMessage("signed out");
}

/** The tabs of this browser have one cookie: each is told when another has signed in or out. */
const tabs = typeof BroadcastChannel === "undefined" ? null : new BroadcastChannel("farm-console-session");

/** Sets what to call when another tab has signed in or out. */
export function onOtherTab(callback: () => void): void {
  if (tabs !== null) tabs.onmessage = callback;
}

const LINK = /^#link=(.+)$/;

/** Whether the address holds a one-time link. */
export function hasLink(): boolean {
  return LINK.test(window.location.hash);
}

/** Takes the token of a one-time link out of the address, so that it is in no history. */
export function takeLink(): string | null {
  const found = LINK.exec(window.location.hash);
  if (found?.[1] === undefined) return null;
  window.history.replaceState(null, "", window.location.pathname + window.location.search);
  try {
    return decodeURIComponent(found[1]);
  } catch {
    return found[1]; // No link of ours: the server refuses it, and the sign-in says so
  }
}

function announce(session: Session): Session {
  tabs?.postMessage("signed in");
  return remember(session);
}

function remember(session: Session): Session {
  setCsrfToken(session.csrf_token);
  return session;
}

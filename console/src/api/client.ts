/** Requests to the edge server that served this page: one place for cookie, CSRF token and errors. */

import { appliedUnits } from "../app/preferences";
import i18next, { reportTexts } from "../i18n/i18n";
import { quantitiesIn } from "../units/fields";
import { Units } from "../units/units";
import { noteServerTime } from "./server_clock";

/** What the edge server answers to a request that it refuses; see its HTTP errors. */
interface Problem {
  message?: string;
  changed?: LastChange;
  detail?: Record<string, Record<string, string[]>>;
}

/** Who has changed what was to be written, and when. */
export interface LastChange {
  by: string;
  at: string;
}

/** A faulty member of a document, by its path in the document. */
export class Fault {
  constructor(
    readonly path: string,
    /** In the edge server's words. */
    readonly reported: string,
  ) {}

  /** In the person's language and units, which may change while it is shown. */
  get text(): string {
    return inPersonsLanguage(this.reported, this.path.split(".").at(-1));
  }
}

/** Status of a request that never reached the server. */
export const UNREACHABLE = 0;

/** A request that was refused or never arrived. */
export class RequestError extends Error {
  constructor(
    readonly status: number,
    message: string,
    readonly faults: Fault[] = [],
    readonly retryAfterS: number | null = null,
    readonly changed: LastChange | null = null,
  ) {
    super(message);
  }

  /** The edge server's reason in the person's language. */
  get reason(): string {
    return inPersonsLanguage(this.message);
  }
}

/** A write of a page whose person is no longer the one who is signed in; nothing was done. */
export class OtherPersonError extends RequestError {
  constructor() {
    super(FORBIDDEN, "another person has signed in");
  }
}

const FORBIDDEN = 403;
/** Of the edge server, about a write with the token of another session than that of the cookie. */
const FOREIGN_TOKEN = "must be the csrf_token of this session";
const TIMEOUT_MS = 15_000;
let csrfToken: string | null = null;
let reportSignedOut: () => void = () => undefined;
let renewSession: () => Promise<boolean> = () => Promise.resolve(false);

/** Sets the token that every write needs; null after the session has ended. */
export function setCsrfToken(token: string | null): void {
  csrfToken = token;
}

/** Sets what to call when the server no longer knows the session. */
export function onSignedOut(callback: () => void): void {
  reportSignedOut = callback;
}

/** Sets what to call when the cookie is of another session: it reads that and gives whether the person is the same. */
export function onOtherSession(callback: () => Promise<boolean>): void {
  renewSession = callback;
}

/** Reports that the server no longer knows the session. */
export function noteSignedOut(): void {
  reportSignedOut();
}

export interface Request {
  method?: "GET" | "POST" | "PUT" | "PATCH" | "DELETE";
  body?: unknown;
  file?: File;
  timeoutMs?: number;
  /** Makes a repetition of a write harmless. */
  idempotencyKey?: string;
  /** Also if another person has signed in in this browser since: stopping a vehicle waits for nobody. */
  asWhoever?: boolean;
  /** Writes only what still has this tag; otherwise the answer is 412. */
  ifMatch?: string | undefined;
}

/** What was read, and the tag by which the edge server knows whether it has changed since. */
export interface Tagged<Value> {
  value: Value;
  /** Empty where the edge server has given none. */
  tag: string;
}

/** Sends a request and gives its JSON body; raises RequestError. */
export async function request<Body>(path: string, options: Request = {}): Promise<Body> {
  const response = await send(path, options);
  if (response.status === 204) return undefined as Body;
  const text = await response.text();
  return (text === "" ? undefined : JSON.parse(text)) as Body;
}

/** Reads a resource with its tag; raises RequestError. */
export async function requestTagged<Body>(path: string): Promise<Tagged<Body>> {
  const response = await send(path, {});
  return { value: (await response.json()) as Body, tag: response.headers.get("ETag") ?? "" };
}

/** Sends a request and gives its body as text; raises RequestError. */
export async function requestText(path: string): Promise<string> {
  return (await send(path, {})).text();
}

async function send(path: string, options: Request): Promise<Response> {
  let response = await sendOnce(path, options);
  if (response.status === FORBIDDEN && (await hadForeignToken(response))) {
    // Refused before anything was done: another tab has signed in, and the cookie is that of all tabs
    const isSame = await renewSession();
    if (!isSame && !options.asWhoever) throw new OtherPersonError();
    response = await sendOnce(path, options);
  } else if (response.status === FORBIDDEN && !path.startsWith("/session/")) {
    void renewSession().catch(() => undefined); // What a role may not do is not offered: it was changed meanwhile
  }
  if (response.ok) return response;
  if (response.status === 401 && !path.startsWith("/session/")) noteSignedOut();
  throw await refusalOf(response);
}

async function hadForeignToken(response: Response): Promise<boolean> {
  return (await response.clone().text()).includes(FOREIGN_TOKEN);
}

/** Sends a request; raises RequestError if it gets no answer. */
async function sendOnce(path: string, options: Request): Promise<Response> {
  const method = options.method ?? "GET";
  const headers: Record<string, string> = { Accept: "application/json" };
  if (method !== "GET" && csrfToken !== null) headers["X-CSRF-Token"] = csrfToken;
  if (options.idempotencyKey !== undefined) headers["Idempotency-Key"] = options.idempotencyKey;
  if (options.ifMatch !== undefined) headers["If-Match"] = options.ifMatch;
  let body: BodyInit | null = null;
  if (options.file !== undefined) {
    headers["Content-Type"] = contentType(options.file.name);
    body = options.file;
  } else if (options.body !== undefined) {
    headers["Content-Type"] = "application/json";
    body = JSON.stringify(options.body);
  }
  let response: Response;
  const sentMs = Date.now();
  try {
    response = await fetch(path, {
      method,
      headers,
      body,
      credentials: "same-origin",
      signal: AbortSignal.timeout(options.timeoutMs ?? TIMEOUT_MS),
    });
  } catch {
    throw new RequestError(UNREACHABLE, "unreachable");
  }
  noteServerTime(response, sentMs);
  return response;
}

function contentType(fileName: string): string {
  if (/\.geojson$/i.test(fileName)) return "application/geo+json";
  if (/\.kml$/i.test(fileName)) return "application/vnd.google-earth.kml+xml";
  if (/\.kmz$/i.test(fileName)) return "application/vnd.google-earth.kmz";
  if (/\.zip$/i.test(fileName)) return "application/zip";
  return /\.(plan|json)$/i.test(fileName) ? "application/json" : "text/plain";
}

async function refusalOf(response: Response): Promise<RequestError> {
  const retryAfter = Number(response.headers.get("Retry-After"));
  const problem = (await response.json().catch(() => ({}))) as Problem;
  return new RequestError(
    response.status,
    problem.message ?? response.statusText,
    faultsOf(problem),
    Number.isFinite(retryAfter) && retryAfter > 0 ? retryAfter : null,
    problem.changed ?? null,
  );
}

/** Lists the faults of an answer in the order of the answer. */
export function faultsOf(problem: Problem): Fault[] {
  return Object.values(problem.detail ?? {}).flatMap((paths) =>
    Object.entries(paths).flatMap(([path, texts]) => texts.map((text) => new Fault(path, text))),
  );
}

function inPersonsLanguage(text: string, field?: string): string {
  const units = new Units(appliedUnits(), i18next.language);
  return reportTexts(i18next.language).describe(text, quantitiesIn(units, field));
}

/** Server-sent events, read from a stream; unlike EventSource it shows status codes and heartbeats. */

import { noteServerTime } from "../api/server_clock";

/** One event of the stream; a comment line is an event of type "heartbeat". */
export interface StreamEvent {
  type: string;
  data: string;
  id: string | null;
}

const HEARTBEAT = "heartbeat";

/** Splits a stream's text into events; keeps what is not complete yet. */
export class EventParser {
  #rest = "";
  #type = "";
  #data: string[] = [];
  #id: string | null = null;

  /** Gives the events that this piece completes. */
  push(text: string): StreamEvent[] {
    const lines = (this.#rest + text).split(/\r\n|\n|\r(?!$)/);
    this.#rest = lines.pop() ?? "";
    return lines.flatMap((line) => this.#line(line));
  }

  #line(line: string): StreamEvent[] {
    if (line === "") return this.#end();
    if (line.startsWith(":")) return [{ type: HEARTBEAT, data: "", id: null }];
    const colon = line.indexOf(":");
    const name = colon < 0 ? line : line.slice(0, colon);
    const value = colon < 0 ? "" : line.slice(colon + 1).replace(/^ /, "");
    if (name === "event") this.#type = value;
    else if (name === "data") this.#data.push(value);
    else if (name === "id") this.#id = value;
    return [];
  }

  #end(): StreamEvent[] {
    const event = { type: this.#type || "message", data: this.#data.join("\n"), id: this.#id };
    this.#type = "";
    this.#data = [];
    return event.data === "" ? [] : [event];
  }
}

/** The server refused the stream. */
export class StreamRefusedError extends Error {
  constructor(readonly status: number) {
    super(`the stream was refused with ${status}`);
  }
}

/** Reads a stream until it ends; raises StreamRefusedError, or the network's error.
 *
 * `received` is called for each piece, of which a large event has many.
 */
export async function readStream(
  path: string,
  lastId: string | null,
  signal: AbortSignal,
  received: () => void,
  take: (event: StreamEvent) => void,
): Promise<void> {
  const headers: Record<string, string> = { Accept: "text/event-stream" };
  if (lastId !== null) headers["Last-Event-ID"] = lastId;
  const sentMs = Date.now();
  const response = await fetch(path, { headers, signal, credentials: "same-origin" });
  noteServerTime(response, sentMs);
  if (!response.ok || response.body === null) throw new StreamRefusedError(response.status);
  const parser = new EventParser();
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    received();
    for (const event of parser.push(value)) take(event);
  }
}

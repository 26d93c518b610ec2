/** The connection to the live feed: connects again by itself, and polls where there is no feed. */

import { listVehicles, readUplink } from "../api/resources";
import { noteSignedOut, RequestError } from "../api/client";
import { serverAheadMs } from "../api/server_clock";
import { readStream, StreamRefusedError } from "./event_stream";
import { apply, EMPTY, markSilent, type Connection, type LiveState } from "./state";

const RETRY_MS = [500, 1000, 2000, 4000, 5000];
/** Two heartbeats of the server, 4 s each (`HEARTBEAT_S`), and 2 s. */
const SILENCE_MS = 10_000;
const POLL_MS = 1000;
const SILENCE_CHECK_MS = 1000;

/** Changes that arrive together are shown together: fifty vehicles come as fifty events. */
const SHOWN_EVERY_MS = 100;

/** Holds the live state and notifies its readers of changes. */
export class Feed {
  #state: LiveState = EMPTY;
  #listeners = new Set<() => void>();
  #stop: AbortController | null = null;
  #lastId: string | null = null;
  #timer: ReturnType<typeof setTimeout> | null = null;
  #silence: ReturnType<typeof setInterval> | undefined;

  readonly subscribe = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  readonly state = (): LiveState => this.#state;

  /** Connects; a feed that is connected goes on. */
  start(): void {
    if (this.#stop !== null) return;
    this.#stop = new AbortController();
    this.#silence = setInterval(() => this.#markSilent(), SILENCE_CHECK_MS);
    void this.#run(this.#stop.signal);
  }

  stop(): void {
    this.#stop?.abort();
    this.#stop = null;
    clearInterval(this.#silence);
  }

  /** Takes an event that this browser has caused, so that it shows before the feed sends it. */
  take(type: string, data: unknown): void {
    this.#change(apply(this.#state, type, data, Date.now()));
  }

  async #run(stop: AbortSignal): Promise<void> {
    let failures = 0;
    while (!stop.aborted) {
      try {
        await this.#stream(stop, () => (failures = 0));
        // The server may end a stream in good order; only a refusal or silence is offline
        await pause(RETRY_MS[0] ?? 500, stop);
        continue;
      } catch (error) {
        const refused = error instanceof StreamRefusedError ? error.status : 0;
        if (refused === 401) {
          noteSignedOut(); // The session has ended: no network brings it back
          return;
        }
        if (refused === 404) await this.#poll(stop);
      }
      if (stop.aborted) return;
      this.#connection("offline");
      await pause(RETRY_MS[Math.min(failures, RETRY_MS.length - 1)] ?? 5000, stop);
      failures += 1;
    }
  }

  async #stream(stop: AbortSignal, connected: () => void): Promise<void> {
    const silence = new AbortController();
    let timer = setTimeout(() => silence.abort(), SILENCE_MS);
    try {
      const received = () => {
        clearTimeout(timer);
        timer = setTimeout(() => silence.abort(), SILENCE_MS);
      };
      const signal = AbortSignal.any([stop, silence.signal]);
      await readStream("/live/", this.#lastId, signal, received, (event) => {
        connected();
        if (event.id !== null) this.#lastId = event.id;
        const data: unknown = event.data === "" ? null : JSON.parse(event.data);
        const isFirst = this.#state.connection !== "live";
        const applied = apply(this.#state, event.type, data, Date.now());
        const state = event.type === "snapshot" ? markSilent(applied, Date.now() + serverAheadMs()) : applied;
        this.#state = { ...state, connection: "live" };
        if (isFirst) this.#notify();
        else this.#timer ??= setTimeout(() => this.#notify(), SHOWN_EVERY_MS);
      });
    } finally {
      clearTimeout(timer);
    }
  }

  /** Reads the vehicles each second until the server is out of reach. */
  async #poll(stop: AbortSignal): Promise<void> {
    for (let round = 0; !stop.aborted; round += 1) {
      try {
        const vehicles = await listVehicles();
        for (const vehicle of vehicles) this.take("vehicle", vehicle);
        if (round % 5 === 0) {
          this.take("uplink", { state: await readUplink(), records_waiting: null });
        }
      } catch (error) {
        if (!(error instanceof RequestError) || error.status === 0 || error.status === 401) return;
      }
      const missionChanges = this.#state.missionChanges + (round % 3 === 0 ? 1 : 0);
      this.#change({ ...this.#state, missionChanges, contactAtMs: Date.now(), connection: "polling" });
      await pause(POLL_MS, stop);
    }
  }

  /** While the page itself is offline it shows so, and how old all of it is. */
  #markSilent(): void {
    if (this.#state.connection === "offline" || this.#state.connection === "connecting") return;
    const marked = markSilent(this.#state, Date.now() + serverAheadMs());
    if (marked !== this.#state) this.#change(marked);
  }

  #connection(connection: Connection): void {
    this.#change({ ...this.#state, connection });
  }

  #change(state: LiveState): void {
    this.#state = state;
    this.#notify();
  }

  #notify(): void {
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.#timer = null;
    for (const listener of this.#listeners) listener();
  }
}

function pause(milliseconds: number, stop: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, milliseconds);
    stop.addEventListener("abort", () => (clearTimeout(timer), resolve()), { once: true });
  });
}

/** Work that is not saved yet, kept in this browser over a reload, a sign-out or an empty battery. */

import type { Tagged } from "../api/client";

/** What somebody has made of a version; `base` is null for something new. */
export interface StoredDraft<State, Value> {
  at_ms: number;
  base: Tagged<Value> | null;
  state: State;
}

const PREFIX = "farm-console draft ";
/** More than one would look at; the oldest is forgotten. */
const MOST = 40;

type Place = Pick<Storage, "getItem" | "setItem" | "removeItem" | "key" | "length">;

/** The drafts of one person: on a shared tablet nobody gets those of another. */
export class Drafts {
  constructor(private readonly place: Place, private readonly person: string) {}

  /** Gives a draft whose state is one of this version of the console; null without one. */
  read<State, Value>(name: string, isState: (state: object) => boolean): StoredDraft<State, Value> | null {
    try {
      const found = JSON.parse(this.place.getItem(this.key(name)) ?? "null") as StoredDraft<State, Value> | null;
      const state = found?.state;
      return typeof state === "object" && state !== null && isState(state) ? found : null;
    } catch {
      return null; // Storage is switched off, or holds something else
    }
  }

  write<State, Value>(name: string, draft: StoredDraft<State, Value>): void {
    try {
      this.place.setItem(this.key(name), JSON.stringify(draft));
      const keys = this.keys();
      if (keys.length <= MOST) return;
      const ages = keys.map((key) => [this.age(key), key] as const).sort(([a], [b]) => a - b);
      for (const [, key] of ages.slice(0, keys.length - MOST)) this.place.removeItem(key);
    } catch {
      // Storage is full or switched off: the work is kept until the page is closed
    }
  }

  remove(name: string): void {
    try {
      this.place.removeItem(this.key(name));
    } catch {
      // Storage is switched off
    }
  }

  private key(name: string): string {
    return `${PREFIX}${encodeURIComponent(this.person)} ${name}`;
  }

  private keys(): string[] {
    const all = Array.from({ length: this.place.length }, (_, index) => this.place.key(index) ?? "");
    return all.filter((key) => key.startsWith(PREFIX));
  }

  private age(key: string): number {
    try {
      return (JSON.parse(this.place.getItem(key) ?? "") as { at_ms?: number }).at_ms ?? 0;
    } catch {
      return 0;
    }
  }
}

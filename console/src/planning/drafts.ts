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

/** The drafts of one person: on a shared tablet nobody gets those of another.
 *
 * Each tab keeps its own, which a reload finds again whatever another tab edits. The newest of all
 * tabs is there for a page that is opened later.
 */
export class Drafts {
  constructor(private readonly ofTab: Place, private readonly shared: Place, private readonly person: string) {}

  /** Gives a draft whose state is one of this version of the console; null without one. */
  read<State, Value>(name: string, isState: (state: object) => boolean): StoredDraft<State, Value> | null {
    for (const place of [this.ofTab, this.shared]) {
      const found = draftIn<State, Value>(place, this.key(name));
      const state = found?.state;
      if (typeof state === "object" && state !== null && isState(state)) return found;
    }
    return null;
  }

  write<State, Value>(name: string, draft: StoredDraft<State, Value>): void {
    for (const place of [this.ofTab, this.shared]) {
      try {
        place.setItem(this.key(name), JSON.stringify(draft));
        forgetOldest(place);
      } catch {
        // Storage is full or switched off: the work is kept until the page is closed
      }
    }
  }

  /** Forgets the draft of this tab; that which another tab has written since is its own. */
  remove(name: string): void {
    const key = this.key(name);
    try {
      const own = this.ofTab.getItem(key);
      if (own === null || own === this.shared.getItem(key)) this.shared.removeItem(key);
      this.ofTab.removeItem(key);
    } catch {
      // Storage is switched off
    }
  }

  private key(name: string): string {
    return `${PREFIX}${encodeURIComponent(this.person)} ${name}`;
  }
}

function draftIn<State, Value>(place: Place, key: string): StoredDraft<State, Value> | null {
  try {
    return JSON.parse(place.getItem(key) ?? "null") as StoredDraft<State, Value> | null;
  } catch {
    return null; // Storage is switched off, or holds something else
  }
}

function forgetOldest(place: Place): void {
  const all = Array.from({ length: place.length }, (_, index) => place.key(index) ?? "");
  const keys = all.filter((key) => key.startsWith(PREFIX));
  if (keys.length <= MOST) return;
  const ages = keys.map((key) => [draftIn(place, key)?.at_ms ?? 0, key] as const).sort(([a], [b]) => a - b);
  for (const [, key] of ages.slice(0, keys.length - MOST)) place.removeItem(key);
}

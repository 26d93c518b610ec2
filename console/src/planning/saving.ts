/** Saving what several people may edit: nobody overwrites what they have not seen. */

import { RequestError, type LastChange, type Tagged } from "../api/client";

/** Somebody else has changed what was to be saved, or deleted it (`theirs` is null). */
export class ChangedError<Value> extends Error {
  constructor(
    readonly theirs: Tagged<Value> | null,
    /** Who has changed it last, as far as the edge server knows. */
    readonly last: LastChange | null = null,
  ) {
    super("changed by somebody else");
  }
}

const MOST_ATTEMPTS = 3;
const GONE = 404;
const PRECONDITION_FAILED = 412;

/** How one kind of resource is saved. */
export interface Saving<Value> {
  /** Replaces what still has this tag. */
  put: (tag: string) => Promise<Value>;
  read: () => Promise<Tagged<Value>>;
  /** Whether two versions have the same content; a live status is none of it. */
  isSame: (one: Value, other: Value) => boolean;
  /** Whether a version is what was to be saved: the answer to an earlier attempt was lost. */
  isMine: (theirs: Value) => boolean;
}

/** Replaces `base` as it was read.
 *
 * Raises ChangedError if its content has changed since; RequestError as the edge server refuses it.
 */
export async function save<Value>(base: Tagged<Value>, saving: Saving<Value>): Promise<Value> {
  let tag = base.tag;
  for (let attempt = 1; ; attempt += 1) {
    let last: LastChange | null = null;
    try {
      return await saving.put(tag);
    } catch (reason) {
      if (reason instanceof RequestError) last = reason.changed;
      const status = reason instanceof RequestError ? reason.status : null;
      if (status === GONE) throw new ChangedError<Value>(null);
      if (status !== PRECONDITION_FAILED || attempt === MOST_ATTEMPTS) throw reason;
    }
    const theirs = await present(saving.read);
    if (theirs === null) throw new ChangedError<Value>(null);
    if (saving.isMine(theirs.value)) return theirs.value;
    if (!saving.isSame(base.value, theirs.value)) throw new ChangedError(theirs, last);
    tag = theirs.tag;
  }
}

/** Stores something new: the same content again, after an answer that was lost, is stored once. */
export class Attempts {
  #last: { content: string; key: string; document: unknown } | null = null;

  /** Sends the first document that was made of this content, under its key. */
  run<Document, Value>(
    content: unknown, document: Document, send: (document: Document, idempotencyKey: string) => Promise<Value>,
  ): Promise<Value> {
    const text = JSON.stringify(content);
    if (this.#last?.content !== text) this.#last = { content: text, key: newKey(), document };
    return send(this.#last.document as Document, this.#last.key);
  }
}

/** A key that nobody else has; `crypto.randomUUID` needs HTTPS, which a farm may not have. */
export function newKey(): string {
  return Array.from(crypto.getRandomValues(new Uint32Array(4)), (part) => part.toString(16).padStart(8, "0")).join("");
}

async function present<Value>(read: () => Promise<Tagged<Value>>): Promise<Tagged<Value> | null> {
  try {
    return await read();
  } catch (reason) {
    if (reason instanceof RequestError && reason.status === GONE) return null;
    throw reason;
  }
}

/** Saving from an editor: busy, refused, or changed by somebody else in the meantime. */

import { useState } from "react";
import type { LastChange, RequestError, Tagged } from "../api/client";
import { asRequestError } from "../live/use_resource";
import { ChangedError } from "../planning/saving";

export interface Attempt<Value> {
  isBusy: boolean;
  error: RequestError | null;
  /** What somebody else has made of it; null inside if it is deleted. */
  conflict: { theirs: Tagged<Value> | null; last: LastChange | null } | null;
  /** Busy until `then` has ended too: a second press would store what is new once more. */
  run: (
    work: () => Promise<Value>,
    then: (stored: Value) => void | Promise<void>,
    refused?: (error: RequestError) => void,
  ) => void;
  forget: () => void;
}

export function useSaving<Value>(): Attempt<Value> {
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  const [conflict, setConflict] = useState<Attempt<Value>["conflict"]>(null);
  const run: Attempt<Value>["run"] = (work, then, refused) => {
    setBusy(true);
    setError(null);
    work()
      .then((stored) => {
        setConflict(null);
        return then(stored);
      })
      .catch((reason: unknown) => {
        if (reason instanceof ChangedError) {
          const { theirs, last } = reason as ChangedError<Value>;
          setConflict({ theirs, last });
          return;
        }
        const refusal = asRequestError(reason);
        setError(refusal);
        refused?.(refusal);
      })
      .finally(() => setBusy(false));
  };
  const forget = () => {
    setError(null);
    setConflict(null);
  };
  return { isBusy, error, conflict, run, forget };
}

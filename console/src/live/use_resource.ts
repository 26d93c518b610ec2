/** A resource that a screen loads: its state, and how to load it again. */

import { useCallback, useEffect, useRef, useState } from "react";
import { RequestError, UNREACHABLE } from "../api/client";

export interface Resource<Value> {
  value: Value | null;
  error: RequestError | null;
  isLoading: boolean;
  reload: () => void;
}

/** A screen that could not be loaded loads by itself once the edge server answers again. */
const AGAIN_MS = 5_000;

/** Loads now and whenever `version` changes; keeps the last value while it loads again. */
export function useResource<Value>(
  load: () => Promise<Value>,
  version: string | number = 0,
): Resource<Value> {
  const [value, setValue] = useState<Value | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const [isLoading, setLoading] = useState(true);
  const [round, setRound] = useState(0);
  const latest = useRef(load);
  latest.current = load;
  useEffect(() => {
    let isCurrent = true;
    setLoading(true);
    latest
      .current()
      .then((found) => {
        if (!isCurrent) return;
        setValue(found);
        setError(null);
      })
      .catch((reason: unknown) => {
        if (isCurrent) setError(asRequestError(reason));
      })
      .finally(() => {
        if (isCurrent) setLoading(false);
      });
    return () => {
      isCurrent = false;
    };
  }, [version, round]);
  const reload = useCallback(() => setRound((count) => count + 1), []);
  useEffect(() => {
    if (error?.status !== UNREACHABLE) return;
    const timer = setTimeout(reload, AGAIN_MS);
    return () => clearTimeout(timer);
  }, [error, reload]);
  return { value, error, isLoading, reload };
}

/** Gives a RequestError for whatever was thrown. */
export function asRequestError(reason: unknown): RequestError {
  return reason instanceof RequestError ? reason : new RequestError(UNREACHABLE, String(reason));
}

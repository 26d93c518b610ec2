/** An answer of the edge server that follows what a person enters. */

import { useEffect, useRef, useState } from "react";
import type { RequestError } from "../api/client";
import { asRequestError } from "./use_resource";

const PAUSE_MS = 350;

export interface Preview<Answer> {
  /** The last answer, also while the next one is awaited. */
  value: Answer | null;
  error: RequestError | null;
  isLoading: boolean;
  retry: () => void;
}

/** Asks when a question has not changed for a moment; an answer to an older one is dropped. */
export function usePreview<Question, Answer>(
  question: Question | null,
  ask: (question: Question) => Promise<Answer>,
): Preview<Answer> {
  const [value, setValue] = useState<Answer | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const [answered, setAnswered] = useState("");
  const [round, setRound] = useState(0);
  const text = question === null ? null : JSON.stringify(question);
  const version = `${round} ${text}`;
  const latest = useRef(ask);
  latest.current = ask;
  useEffect(() => {
    if (text === null) return;
    let isCurrent = true;
    const timer = setTimeout(() => {
      latest
        .current(JSON.parse(text) as Question)
        .then((answer) => {
          if (!isCurrent) return;
          setValue(answer);
          setError(null);
        })
        .catch((reason: unknown) => {
          if (!isCurrent) return;
          setValue(null);
          setError(asRequestError(reason));
        })
        .finally(() => {
          if (isCurrent) setAnswered(version);
        });
    }, PAUSE_MS);
    return () => {
      isCurrent = false;
      clearTimeout(timer);
    };
  }, [text, version]);
  return {
    value: text === null ? null : value,
    error: text === null ? null : error,
    isLoading: text !== null && answered !== version,
    retry: () => setRound((count) => count + 1),
  };
}

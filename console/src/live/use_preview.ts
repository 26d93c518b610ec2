/** An answer of the edge server that follows what a person enters. */

import { useEffect, useRef, useState } from "react";
import type { RequestError } from "../api/client";
import { DebouncedRequest } from "./debounced_request";
import { asRequestError } from "./use_resource";

export interface Preview<Answer> {
  /** The last answer, also while the next one is awaited. */
  value: Answer | null;
  error: RequestError | null;
  isLoading: boolean;
  retry: () => void;
}

/** Asks when a question has not changed for a moment, or again and again while it is followed.
 *
 * An answer to an older question never takes the place of one to a newer.
 */
export function usePreview<Question, Answer>(
  question: Question | null,
  ask: (question: Question) => Promise<Answer>,
  isFollowed = false,
): Preview<Answer> {
  const [value, setValue] = useState<Answer | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const [answered, setAnswered] = useState("");
  const [round, setRound] = useState(0);
  const text = question === null ? null : JSON.stringify(question);
  const version = `${round} ${text}`;
  const latest = useRef({ ask, isFollowed });
  latest.current = { ask, isFollowed };
  const [requests] = useState(() => {
    const show = (version: string, answer: Answer | null, fault: RequestError | null) => {
      setValue(answer);
      setError(fault);
      setAnswered(version);
    };
    return new DebouncedRequest<{ text: string; version: string }, Answer>(
      (one) => latest.current.ask(JSON.parse(one.text) as Question),
      (answer, one) => show(one.version, answer, null),
      (reason, one) => show(one.version, null, asRequestError(reason)),
    );
  });
  useEffect(() => {
    if (text === null) requests.cancel();
    else requests.change({ text, version }, latest.current.isFollowed);
  }, [requests, text, version]);
  useEffect(() => () => requests.cancel(), [requests]);
  return {
    value: text === null ? null : value,
    error: text === null ? null : error,
    isLoading: text !== null && answered !== version,
    retry: () => setRound((count) => count + 1),
  };
}

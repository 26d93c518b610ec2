/** What a person reads while something loads: after some seconds, that the server does not answer. */

import { useEffect, useState } from "react";
import { useTranslation } from "react-i18next";

const LONG_MS = 5_000;

export function useWaitingText(): { text: string; isLong: boolean } {
  const { t } = useTranslation();
  const [isLong, setLong] = useState(false);
  useEffect(() => {
    const timer = setTimeout(() => setLong(true), LONG_MS);
    return () => clearTimeout(timer);
  }, []);
  return { text: t(isLong ? "state.no_answer" : "state.loading"), isLong };
}

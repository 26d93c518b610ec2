import { useCallback, useEffect, useLayoutEffect, useMemo, useRef, useState } from "react";
import { onOtherSession, onSignedOut } from "../api/client";
import { onOtherTab, presentSession, signOut } from "../api/session";
import type { Session } from "../api/types";
import { Splash } from "../controls/Splash";
import { LANGUAGES, showLanguage } from "../i18n/i18n";
import { Feed } from "../live/feed";
import { asRequestError } from "../live/use_resource";
import { SignIn } from "../screens/SignIn";
import type { RequestError } from "../api/client";
import { applyPreferences, PreferencesContext, readPreferences } from "./preferences";
import type { Preferences } from "./preferences";
import { SessionContext } from "./session_context";
import { Shell } from "./Shell";

type Entry =
  | { kind: "checking" }
  | { kind: "signed out"; error: RequestError | null; hasEnded: boolean }
  | { kind: "signed in"; session: Session; feed: Feed };

interface AppProperties {
  /** The session that this browser has, or that of the one-time link with which it was opened. */
  entering: Promise<Session>;
  hasLink: boolean;
}

/** The console: the sign-in, or the shell for a person who is signed in. */
export function App({ entering, hasLink }: AppProperties) {
  const [entry, setEntry] = useState<Entry>({ kind: "checking" });
  const [preferences, setPreferences] = useState(() => readPreferences(Object.keys(LANGUAGES)));
  const change = useCallback((part: Partial<Preferences>) => {
    setPreferences((present) => ({ ...present, ...part }));
  }, []);
  const value = useMemo(() => ({ preferences, change }), [preferences, change]);

  // Before the effects of what is shown: the map reads the colours of the theme
  useLayoutEffect(() => applyPreferences(preferences), [preferences]);
  useEffect(() => {
    void showLanguage(preferences.language);
  }, [preferences.language]);

  const latest = useRef(entry);
  latest.current = entry;
  /** Reads who is signed in by now, as another tab may have changed; gives whether it is the same person. */
  const renew = useCallback(async () => {
    const before = latest.current;
    try {
      const session = await presentSession();
      setEntry(before.kind === "signed in" ? { ...before, session } : signedIn(session));
      return before.kind === "signed in" && before.session.name === session.name;
    } catch (reason) {
      if (asRequestError(reason).status === 401) setEntry({ kind: "signed out", error: null, hasEnded: true });
      return false;
    }
  }, []);
  useEffect(() => {
    onOtherSession(renew);
    onOtherTab(() => void renew());
    // An administrator may have changed the role meanwhile
    const look = () => {
      if (!document.hidden && latest.current.kind === "signed in") void renew();
    };
    document.addEventListener("visibilitychange", look);
    return () => document.removeEventListener("visibilitychange", look);
  }, [renew]);

  useEffect(() => {
    let isCurrent = true;
    onSignedOut(() => setEntry({ kind: "signed out", error: null, hasEnded: true }));
    entering
      .then((session) => isCurrent && setEntry(signedIn(session)))
      .catch((reason: unknown) => {
        const error = asRequestError(reason);
        // Without a link a missing session is the usual beginning, not an error
        const isUsual = !hasLink && error.status === 401;
        if (isCurrent) setEntry({ kind: "signed out", error: isUsual ? null : error, hasEnded: false });
      });
    return () => {
      isCurrent = false;
    };
  }, [entering, hasLink]);

  const leave = useCallback(() => {
    // The server may be out of reach; this browser is signed out in any case
    void signOut().catch(() => undefined);
    setEntry({ kind: "signed out", error: null, hasEnded: false });
  }, []);

  return (
    <PreferencesContext value={value}>
      {entry.kind === "checking" && <Splash />}
      {entry.kind === "signed out" && (
        <SignIn
          firstError={entry.error}
          hasEnded={entry.hasEnded}
          enter={(session) => setEntry(signedIn(session))}
        />
      )}
      {entry.kind === "signed in" && (
        <SessionContext value={{ session: entry.session, leave }}>
          <Shell feed={entry.feed} />
        </SessionContext>
      )}
    </PreferencesContext>
  );
}

/** The feed is opened before anything is drawn: the map waits for the places of the vehicles. */
function signedIn(session: Session): Entry {
  const feed = new Feed();
  feed.start();
  return { kind: "signed in", session, feed };
}

import { useEffect, useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { signIn } from "../api/session";
import type { Session } from "../api/types";
import { usePreferences } from "../app/preferences";
import { Button } from "../controls/Button";
import { TextField } from "../controls/fields";
import { Notice } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { LANGUAGES } from "../i18n/i18n";
import { asRequestError } from "../live/use_resource";

/** Name and password. After too many attempts it counts down until the next one. */
export function SignIn({ firstError, hasEnded, enter }: {
  firstError: RequestError | null;
  hasEnded: boolean;
  enter: (session: Session) => void;
}) {
  const { t } = useTranslation();
  const { preferences, change } = usePreferences();
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const [error, setError] = useState<RequestError | null>(firstError);
  const [isBusy, setBusy] = useState(false);
  const waitS = useCountdown(error);

  const submit = (event: FormEvent) => {
    event.preventDefault();
    setBusy(true);
    signIn(name.trim(), password)
      .then(enter)
      .catch((reason: unknown) => {
        setError(asRequestError(reason));
        setPassword("");
      })
      .finally(() => setBusy(false));
  };

  return (
    <div className="sign-in">
      <main className="sign-in-card">
        <img src="/console/icon.svg" alt="" width="48" height="48" />
        <h1>{t("sign_in.title")}</h1>
        <p className="muted">{t("sign_in.text")}</p>
        {hasEnded && error === null && <Notice kind="info">{t("sign_in.ended")}</Notice>}
        {error !== null && (
          <Notice kind="error">
            {error.status === 429 && waitS > 0
              ? t("error.429_after", { seconds: waitS })
              : textOf(error)}
          </Notice>
        )}
        <form onSubmit={submit}>
          <TextField
            label={t("sign_in.name")}
            value={name}
            onChange={(event) => setName(event.target.value)}
            autoComplete="username"
            autoCapitalize="none"
            spellCheck={false}
            required
            autoFocus
          />
          <TextField
            label={t("sign_in.password")}
            type="password"
            value={password}
            onChange={(event) => setPassword(event.target.value)}
            autoComplete="current-password"
            required
          />
          <Button kind="primary" type="submit" isBusy={isBusy} disabled={waitS > 0}>
            {t("sign_in.submit")}
          </Button>
        </form>
        <p className="muted small">{t("sign_in.help")}</p>
      </main>
      <nav className="sign-in-languages" aria-label={t("settings.language")}>
        {Object.entries(LANGUAGES).map(([code, language]) => (
          <button
            key={code}
            type="button"
            lang={code}
            aria-pressed={preferences.language === code}
            onClick={() => change({ language: code })}
          >
            {language.name}
          </button>
        ))}
      </nav>
    </div>
  );

  function textOf(one: RequestError): string {
    return one.status === 401
      ? t(one === firstError ? "sign_in.link_refused" : "sign_in.refused")
      : describeError(one, t);
  }
}

/** Seconds until the server accepts another attempt; 0 when it does. */
function useCountdown(error: RequestError | null): number {
  const [leftS, setLeft] = useState(0);
  useEffect(() => {
    const seconds = Math.ceil(error?.retryAfterS ?? 0);
    setLeft(seconds);
    if (seconds === 0) return;
    const timer = setInterval(() => setLeft((left) => Math.max(0, left - 1)), 1000);
    return () => clearInterval(timer);
  }, [error]);
  return leftS;
}

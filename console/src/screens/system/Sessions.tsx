import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { endSession, listSessions } from "../../api/resources";
import type { OpenSession } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { useSession } from "../../app/session_context";
import { Button } from "../../controls/Button";
import { ConfirmDialog } from "../../controls/ConfirmDialog";
import { Empty, ErrorNotice, Loaded } from "../../controls/states";
import { Pill } from "../../controls/StatusPill";
import { asRequestError, useResource } from "../../live/use_resource";
import { Missing } from "../Missing";

/** The browsers in which people are signed in; an administrator ends one that is lost or left open. */
export function Sessions() {
  const { t } = useTranslation();
  const units = useUnits();
  const { session } = useSession();
  const sessions = useResource(listSessions);
  const [ended, setEnded] = useState<OpenSession | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const isThis = ({ name, expires_at }: OpenSession) =>
    name === session.name && Date.parse(expires_at) === Date.parse(session.expires_at);
  const end = (one: OpenSession) => {
    setEnded(null);
    setError(null);
    endSession(one.id)
      .then(sessions.reload)
      .catch((reason: unknown) => setError(asRequestError(reason)));
  };
  return (
    <div className="card">
      {error && <ErrorNotice error={error} />}
      <Loaded
        resource={sessions}
        missing={<Missing />}
        empty={<Empty icon="system" title={t("system.empty_sessions")} />}
      >
        {(rows) => (
          <ul className="rows">
            {rows.map((one) => (
              <li key={one.id}>
                <div className="row-main">
                  <strong>{one.name}</strong>
                  <span>
                    {one.address} · {t("system.signed_in")}: {units.time(one.created_at)} · {t("system.ends")}:{" "}
                    {units.time(one.expires_at)}
                  </span>
                </div>
                {isThis(one) ? (
                  <Pill tone="good">{t("system.this_browser")}</Pill>
                ) : (
                  <Button
                    kind="danger"
                    aria-label={t("system.end_session_of", { name: one.name })}
                    onClick={() => setEnded(one)}
                  >
                    {t("system.end_session")}
                  </Button>
                )}
              </li>
            ))}
          </ul>
        )}
      </Loaded>
      {ended && (
        <ConfirmDialog
          title={t("system.end_session_of", { name: ended.name })}
          text={t("system.end_session_text", { name: ended.name })}
          action={t("system.end_session")}
          act={() => end(ended)}
          close={() => setEnded(null)}
        />
      )}
    </div>
  );
}

import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { listKeys, revokeKey } from "../../api/resources";
import type { AccessKey } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { ConfirmDialog } from "../../controls/ConfirmDialog";
import { Empty, ErrorNotice, Loaded } from "../../controls/states";
import { Pill } from "../../controls/StatusPill";
import { asRequestError, useResource } from "../../live/use_resource";
import { NewKey } from "./NewKey";

/** The access keys of programs. */
export function Keys() {
  const { t } = useTranslation();
  const units = useUnits();
  const keys = useResource(listKeys);
  const [revoked, setRevoked] = useState<AccessKey | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const revoke = (key: AccessKey) => {
    setRevoked(null);
    revokeKey(key.prefix)
      .then(keys.reload)
      .catch((reason: unknown) => setError(asRequestError(reason)));
  };
  return (
    <>
      <div className="card">
        {error && <ErrorNotice error={error} />}
        <Loaded resource={keys} empty={<Empty icon="system" title={t("system.empty_keys")} />}>
          {(rows) => (
            <ul className="rows">
              {rows.map((key) => (
                <li key={key.prefix}>
                  <div className="row-main">
                    <strong>{key.name}</strong>
                    <span>
                      {t(`role.${key.role}`)} · {key.prefix} · {t("system.created")}:{" "}
                      {units.time(key.created_at)}
                      {key.expires_at && ` · ${t("system.expires")}: ${units.time(key.expires_at)}`}
                    </span>
                  </div>
                  <Pill tone={key.state === "active" ? "good" : "neutral"}>
                    {t(`system.${key.state}`)}
                  </Pill>
                  {key.state === "active" && (
                    <Button kind="danger" aria-label={`${t("system.revoke")}: ${key.name}, ${key.prefix}`} onClick={() => setRevoked(key)}>
                      {t("system.revoke")}
                    </Button>
                  )}
                </li>
              ))}
            </ul>
          )}
        </Loaded>
        {revoked && (
          <ConfirmDialog
            title={`${t("system.revoke")}: ${revoked.name}`}
            text={t("system.revoke_text")}
            action={t("system.revoke")}
            act={() => revoke(revoked)}
            close={() => setRevoked(null)}
          />
        )}
      </div>
      <NewKey made={keys.reload} />
    </>
  );
}

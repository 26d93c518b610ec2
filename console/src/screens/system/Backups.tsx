import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { listBackups, makeBackup } from "../../api/resources";
import type { Backups as BackupList } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { Empty, ErrorNotice, Loaded, Notice } from "../../controls/states";
import { asRequestError, useResource } from "../../live/use_resource";

/** Older than this the newest backup is too old: about a week of work would be lost. */
const OLD_MS = 7 * 86_400_000;

const readBackups = async (): Promise<BackupList[]> => [await listBackups()];

/** The backups of the database, when the last one was made, and a new one on demand. */
export function Backups() {
  const found = useResource(readBackups);
  return (
    <div className="card">
      <Loaded resource={found} empty={null}>
        {(lists) => lists.map((list) => <BackupsOf key={list.folder} list={list} reload={found.reload} />)}
      </Loaded>
    </div>
  );
}

function BackupsOf({ list, reload }: { list: BackupList; reload: () => void }) {
  const { t } = useTranslation();
  const units = useUnits();
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  if (list.fault !== null) return <Notice kind="info">{t("system.backup_other", { reason: list.fault })}</Notice>;
  const newest = list.backups[0];
  const age_ms = newest === undefined ? null : Date.now() - Date.parse(newest.made_at);
  const make = () => {
    setBusy(true);
    setError(null);
    makeBackup()
      .then(reload)
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  return (
    <>
      <div className="backup-head">
        <div className="row-main">
          <strong>
            {age_ms === null ? t("system.backup_never") : t("system.backup_last", { age: units.duration(age_ms) })}
          </strong>
          <span>{t("system.backup_text", { count: list.kept })}</span>
        </div>
        <Button kind="primary" icon="add" isBusy={isBusy} onClick={make}>
          {t("system.backup_make")}
        </Button>
      </div>
      {error && <ErrorNotice error={error} />}
      {age_ms !== null && age_ms > OLD_MS && <Notice kind="info">{t("system.backup_old")}</Notice>}
      {list.backups.length === 0 ? (
        <Empty icon="system" title={t("system.empty_backups")} text={t("system.empty_backups_text")} />
      ) : (
        <ul className="rows">
          {list.backups.map((one) => (
            <li key={one.name}>
              <div className="row-main">
                <strong>{units.time(one.made_at)}</strong>
                <span className="path">{one.path}</span>
              </div>
              <span className="muted">{units.data(one.size_bytes)}</span>
            </li>
          ))}
        </ul>
      )}
    </>
  );
}

import { useEffect, useRef } from "react";
import { useTranslation } from "react-i18next";
import { Button } from "../controls/Button";
import { Notice } from "../controls/states";
import type { Change } from "../planning/changes";

/** Says what somebody else has changed, and leaves the choice between the two versions. */
export function ConflictNotice({ kind, changes, isBusy, load, copy }: {
  kind: "plan" | "field";
  /** Null if it has been deleted. */
  changes: readonly Change[] | null;
  isBusy: boolean;
  load: () => void;
  copy: () => void;
}) {
  const { t } = useTranslation();
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    place.current?.scrollIntoView({ block: "nearest" });
  }, []);
  return (
    <div ref={place}>
      <Notice kind="error">
        <strong>{t(`conflict.${kind}_${changes === null ? "deleted" : "changed"}`)}</strong>
        {changes !== null && (
          <ul>
            {changes.map(({ name, text, count }) => (
              <li key={name}>{t(`conflict.${name}`, { text, count })}</li>
            ))}
          </ul>
        )}
        <p>
          {t("conflict.kept")} {changes !== null && t("conflict.undo")}
        </p>
        <div className="actions">
          {changes !== null && (
            <Button icon="download" isBusy={isBusy} onClick={load}>
              {t("conflict.load")}
            </Button>
          )}
          <Button kind="primary" icon="add" isBusy={isBusy} onClick={copy}>
            {t("conflict.copy")}
          </Button>
        </div>
      </Notice>
    </div>
  );
}

import { useEffect, useRef } from "react";
import { useTranslation } from "react-i18next";
import type { LastChange } from "../api/client";
import { useUnits } from "../app/preferences";
import { Button } from "../controls/Button";
import { Notice } from "../controls/states";
import type { Change } from "../planning/changes";

/** Says what somebody else has changed, and leaves the choice between the two versions. */
export function ConflictNotice({ kind, changes, last, isBusy, load, copy }: {
  kind: "plan" | "field";
  /** Null if it has been deleted. */
  changes: readonly Change[] | null;
  last: LastChange | null;
  isBusy: boolean;
  load: () => void;
  copy: () => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    place.current?.scrollIntoView({ block: "nearest" });
  }, []);
  return (
    <div ref={place}>
      <Notice kind="error">
        <strong>
          {changes === null || last === null
            ? t(`conflict.${kind}_${changes === null ? "deleted" : "changed"}`)
            : t(`conflict.${kind}_changed_by`, { name: nameOf(last), time: units.time(last.at) })}
        </strong>
        {changes !== null && (
          <ul>
            {changes.map(({ name, text, count }) => (
              <li key={`${name} ${text ?? ""}`}>{t(`conflict.${name}`, { text: name === "speed" ? units.speed(Number(text)) : text, count })}</li>
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

/** The name of a person without the prefix that tells accounts from keys. */
function nameOf({ by }: LastChange): string {
  return by.replace(/^user\//, "");
}

import { useEffect, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { setGuard } from "../app/route";
import { Button } from "../controls/Button";
import { Icon } from "../controls/Icon";

/** Asks before an editor with unsaved changes is left; the header with STOP stays in reach. */
export function LeaveWarning({ isChanged, discard }: { isChanged: boolean; discard: () => void }) {
  const { t } = useTranslation();
  const [leave, setLeave] = useState<(() => void) | null>(null);
  const stay = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (!isChanged) return;
    setGuard((next) => setLeave(() => next));
    const warn = (event: BeforeUnloadEvent) => event.preventDefault();
    window.addEventListener("beforeunload", warn);
    return () => {
      setGuard(null);
      window.removeEventListener("beforeunload", warn);
    };
  }, [isChanged]);
  useEffect(() => {
    if (leave !== null) stay.current?.querySelector("button")?.focus();
  }, [leave]);
  if (leave === null || !isChanged) return null;
  return (
    // Not modal: what is outside of a modal dialog cannot be pressed, and STOP is outside
    <div
      ref={stay}
      className="leave-warning"
      role="alertdialog"
      aria-labelledby="leave-title"
      aria-describedby="leave-text"
      onKeyDown={(event) => {
        if (event.key === "Escape") setLeave(null);
      }}
    >
      <h2 id="leave-title">
        <Icon name="warning" /> {t("leave.title")}
      </h2>
      <p id="leave-text">{t("leave.text")}</p>
      <div className="dialog-actions">
        <Button kind="primary" onClick={() => setLeave(null)}>
          {t("leave.stay")}
        </Button>
        <Button
          kind="danger"
          icon="remove"
          onClick={() => {
            discard();
            setGuard(null);
            leave();
          }}
        >
          {t("leave.discard")}
        </Button>
      </div>
    </div>
  );
}

import { useEffect, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { Button } from "../controls/Button";
import { Notice } from "../controls/states";
import { NotLoadedError } from "./loaded_once";
import { presentServer, type ServerState } from "./server_version";

const ASKED_EVERY_MS = 3_000;

/** What stands in the place of a part that could not be loaded or has failed, and what helps. */
export function Failure({ error, again }: { error: unknown; again: () => void }) {
  const { t } = useTranslation();
  const isMissing = error instanceof NotLoadedError;
  const server = useServer(isMissing, again);
  const kind = isMissing ? server : "failed";
  return (
    <div className="screen">
      <h1 className="visually-hidden">{t("shell.name")}</h1>
      <Notice kind="error">
        <p>{t(`failure.${kind}`)}</p>
        <div className="actions">
          {kind !== "updated" && <Button onClick={again}>{t("action.try_again")}</Button>}
          {kind !== "unreachable" && (
            <Button kind={kind === "updated" ? "primary" : "plain"} onClick={() => window.location.reload()}>
              {t("failure.reload")}
            </Button>
          )}
        </div>
      </Notice>
    </div>
  );
}

/** Asks the edge server whether it is there; calls `again` when it is there again. */
function useServer(isAsked: boolean, again: () => void): ServerState {
  const [state, setState] = useState<ServerState>("unreachable");
  const latest = useRef(again);
  latest.current = again;
  useEffect(() => {
    if (!isAsked) return;
    let isCurrent = true;
    let timer: ReturnType<typeof setTimeout> | undefined;
    let wasUnreachable = false;
    const ask = async (): Promise<void> => {
      const found = await presentServer();
      if (!isCurrent) return;
      setState(found);
      if (found === "unreachable") {
        wasUnreachable = true;
        timer = setTimeout(() => void ask(), ASKED_EVERY_MS);
      } else if (found === "same" && wasUnreachable) {
        latest.current();
      }
    };
    void ask();
    return () => {
      isCurrent = false;
      clearTimeout(timer);
    };
  }, [isAsked]);
  return state;
}

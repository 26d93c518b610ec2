import { useEffect, useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { listDeadLetters, retryDeadLetter } from "../../api/resources";
import type { DeadLetter } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { MoreRows } from "../../controls/MoreRows";
import { Empty, ErrorNotice, Loaded } from "../../controls/states";
import { asRequestError, useResource } from "../../live/use_resource";
import { CorrectDialog } from "./CorrectDialog";
import { newestFirst } from "./rejections";

/** Kind of what declares that records were dropped: it has nothing to correct. */
const GAP = "gap";
/** When a record that was sent again may be listed again: the cloud has rejected it once more. */
const REJECTED_WITHIN_MS = [2_000, 6_000, 20_000];

/** Records that the cloud has rejected, with the reason; each can be corrected and sent again. */
export function DeadLetters() {
  const { t } = useTranslation();
  const units = useUnits();
  const letters = useResource(listDeadLetters);
  const [corrected, setCorrected] = useState<DeadLetter | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  /** Those that are sent again, and still listed. */
  const [retried, setRetried] = useState<readonly number[]>([]);
  useEffect(() => setRetried([]), [letters.value]);
  const retry = (id: number) => {
    setError(null);
    setRetried((all) => [...all, id]);
    retryDeadLetter(id)
      .then(() => [0, ...REJECTED_WITHIN_MS].forEach((wait_ms) => setTimeout(letters.reload, wait_ms)))
      .catch((reason: unknown) => {
        setError(asRequestError(reason));
        setRetried((all) => all.filter((one) => one !== id));
      });
  };
  return (
    <div className="card">
      {error && <ErrorNotice error={error} />}
      <Loaded
        resource={letters}
        empty={
          <Empty
            icon="check"
            title={t("system.empty_dead_letters")}
            text={t("system.empty_dead_letters_text")}
          />
        }
      >
        {(rows) => (
          <MoreRows rows={newestFirst(rows)}>
            {(letter) => (
              <li key={letter.id}>
                <div className="row-main">
                  <strong>{letter.reason}</strong>
                  <span>
                    {t(`system.kind_${letter.kind}`)} · {t("vehicle.name", { id: letter.vehicle_id })}
                  </span>
                  <span>
                    {t("system.received_at", { time: units.time(letter.report.received_at) })}
                    {letter.rejected_at !== null && (
                      <> · {t("system.rejected_at", { time: units.time(letter.rejected_at) })}</>
                    )}
                  </span>
                </div>
                {letter.kind !== GAP && (
                  <Button onClick={() => setCorrected(letter)}>
                    {t("system.correct")}
                  </Button>
                )}
                <Button isBusy={retried.includes(letter.id)} onClick={() => retry(letter.id)}>
                  {t("system.retry")}
                </Button>
              </li>
            )}
          </MoreRows>
        )}
      </Loaded>
      {corrected && (
        <CorrectDialog
          letter={corrected}
          close={() => setCorrected(null)}
          done={() => {
            setCorrected(null);
            letters.reload();
          }}
        />
      )}
    </div>
  );
}

import { useMemo, useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { correctDeadLetter, getDeadLetter } from "../../api/resources";
import type { DeadLetter } from "../../api/types";
import { Button } from "../../controls/Button";
import { Dialog } from "../../controls/Dialog";
import { TextArea } from "../../controls/fields";
import { ErrorNotice, FaultList, Notice, Skeleton } from "../../controls/states";
import { describeError } from "../../i18n/describe_error";
import { asRequestError, useResource } from "../../live/use_resource";
import { correctionOf, editableOf } from "./correction";

/** Corrects a record that the cloud has rejected; it is sent when the server finds no fault in it. */
export function CorrectDialog({ letter, close, done }: {
  letter: DeadLetter;
  close: () => void;
  done: () => void;
}) {
  const { t } = useTranslation();
  const whole = useResource(() => getDeadLetter(letter.id), letter.id);
  return (
    <Dialog title={t("system.correct_title")} close={close}>
      <p>
        <strong>{letter.reason}</strong>
      </p>
      {whole.error && <ErrorNotice error={whole.error} retry={whole.reload} />}
      {whole.value === null && !whole.error && <Skeleton />}
      {whole.value && <Correction letter={whole.value} close={close} done={done} />}
    </Dialog>
  );
}

function Correction({ letter, close, done }: {
  letter: DeadLetter;
  close: () => void;
  done: () => void;
}) {
  const { t } = useTranslation();
  const first = useMemo(() => editableOf(letter.report), [letter]);
  const [text, setText] = useState(first);
  const [error, setError] = useState<RequestError | null>(null);
  const [isBusy, setBusy] = useState(false);
  const correction = correctionOf(text, letter.report);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (correction === null) return;
    setBusy(true);
    correctDeadLetter(letter.id, correction)
      .then(done)
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  return (
    <form className="card-form" onSubmit={submit}>
      {error && (
        <Notice kind="error">
          <p>{describeError(error, t)}</p>
          <FaultList faults={error.faults} />
        </Notice>
      )}
      <TextArea
        label={t("system.record")}
        hint={t("system.correct_text")}
        error={correction === null ? t("system.not_json") : undefined}
        value={text}
        onChange={(event) => setText(event.target.value)}
        rows={14}
        spellCheck={false}
        autoComplete="off"
      />
      <div className="dialog-actions">
        <Button onClick={close}>{t("action.cancel")}</Button>
        <Button kind="primary" type="submit" isBusy={isBusy} disabled={correction === null || text === first}>
          {t("system.correct_send")}
        </Button>
      </div>
    </form>
  );
}

import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import { describeHold } from "../i18n/describe_alarm";
import { useReportText } from "../i18n/use_report_text";
import type { RequestError } from "../api/client";
import { releaseVehicle } from "../api/resources";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { TextField } from "../controls/fields";
import { ErrorNotice, Notice } from "../controls/states";
import { useFeed } from "../live/use_live";
import { asRequestError } from "../live/use_resource";

/** Why a vehicle waits after a fault, and how an operator lets it fly again. */
export function ReleaseForm({ vehicleId, reason }: { vehicleId: number; reason: string }) {
  const { t } = useTranslation();
  const reportText = useReportText();
  const feed = useFeed();
  const isOperator = useIsOperator();
  const [text, setText] = useState("");
  const [isOpen, setOpen] = useState(false);
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);

  const submit = (event: FormEvent) => {
    event.preventDefault();
    setBusy(true);
    releaseVehicle(vehicleId, text)
      .then((vehicle) => feed.take("vehicle", vehicle))
      .catch((failure: unknown) => setError(asRequestError(failure)))
      .finally(() => setBusy(false));
  };
  return (
    <div className="release">
      <Notice kind="info">{t("release.held", { reason: describeHold(reason, t, reportText) })}</Notice>
      {error && <ErrorNotice error={error} />}
      {isOperator && !isOpen && <Button onClick={() => setOpen(true)}>{t("release.open")}</Button>}
      {isOpen && (
        <form onSubmit={submit}>
          <TextField
            label={t("release.reason")}
            hint={t("release.hint")}
            value={text}
            onChange={(event) => setText(event.target.value)}
            required
            autoFocus
          />
          <Button kind="primary" type="submit" isBusy={isBusy}>
            {t("release.submit")}
          </Button>
        </form>
      )}
    </div>
  );
}

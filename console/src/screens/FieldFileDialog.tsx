import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { importFields, type ImportedFields } from "../api/resources";
import type { StoredField } from "../api/types";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { TextField } from "../controls/fields";
import { FaultList, Notice } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { useReportText } from "../i18n/use_report_text";
import { asRequestError } from "../live/use_resource";

/** Stores every field of a file, and says what of it is no area, or where the file is wrong. */
export function FieldFileDialog({ close, stored }: { close: () => void; stored: (fields: StoredField[]) => void }) {
  const { t } = useTranslation();
  const [file, setFile] = useState<File | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const [isBusy, setBusy] = useState(false);
  const [imported, setImported] = useState<ImportedFields | null>(null);
  const reportText = useReportText();
  const nameOf = (path: string) => {
    const area = /^(?:features|Placemark)\.(\d+)/.exec(path)?.[1];
    return area === undefined ? null : t("fields.upload_area", { number: Number(area) + 1 });
  };

  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (file === null) return;
    setBusy(true);
    importFields(file)
      .then((found) => (found.leftOut.length > 0 ? setImported(found) : stored(found.fields)))
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  if (imported !== null) {
    const show = () => stored(imported.fields);
    return (
      <Dialog title={t("fields.upload_title")} close={show}>
        <Notice kind="info">
          <p>{t("fields.upload_left_out", { count: imported.fields.length })}</p>
          <FaultList
            faults={imported.leftOut.map(({ path, message }) => ({ path, text: reportText(message) }))}
            nameOf={nameOf}
          />
        </Notice>
        <div className="dialog-actions">
          <Button kind="primary" icon="check" onClick={show}>{t("action.close")}</Button>
        </div>
      </Dialog>
    );
  }
  return (
    <Dialog title={t("fields.upload_title")} close={close}>
      <p className="muted">{t("fields.upload_text")}</p>
      {error !== null && (
        <Notice kind="error">
          <p>{error.faults.length > 0 ? t("error.422") : describeError(error, t)}</p>
          <FaultList
            faults={error.faults}
            nameOf={nameOf}
          />
        </Notice>
      )}
      <form className="card-form" onSubmit={submit}>
        <TextField
          label={t("fields.upload_file")}
          type="file"
          accept=".geojson,.json,.kml,.kmz,.zip"
          onChange={(event) => {
            setFile(event.target.files?.[0] ?? null);
            setError(null);
          }}
          required
        />
        <div className="dialog-actions">
          <Button onClick={close}>{t("action.cancel")}</Button>
          <Button kind="primary" icon="upload" type="submit" isBusy={isBusy} disabled={file === null}>
            {t("fields.upload")}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}

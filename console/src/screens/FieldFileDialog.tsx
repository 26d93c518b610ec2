import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { importFields } from "../api/resources";
import type { StoredField } from "../api/types";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { TextField } from "../controls/fields";
import { FaultList, Notice } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { asRequestError } from "../live/use_resource";

/** Stores every field of a file, or says where the file is wrong. */
export function FieldFileDialog({ close, stored }: { close: () => void; stored: (fields: StoredField[]) => void }) {
  const { t } = useTranslation();
  const [file, setFile] = useState<File | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const [isBusy, setBusy] = useState(false);

  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (file === null) return;
    setBusy(true);
    importFields(file)
      .then(stored)
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  return (
    <Dialog title={t("fields.upload_title")} close={close}>
      <p className="muted">{t("fields.upload_text")}</p>
      {error !== null && (
        <Notice kind="error">
          <p>{error.faults.length > 0 ? t("error.422") : describeError(error, t)}</p>
          <FaultList
            faults={error.faults}
            nameOf={(path) => {
              const area = /^features\.(\d+)/.exec(path)?.[1];
              return area === undefined ? null : t("fields.upload_area", { number: Number(area) + 1 });
            }}
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
        <footer className="dialog-actions">
          <Button onClick={close}>{t("action.cancel")}</Button>
          <Button kind="primary" icon="upload" type="submit" isBusy={isBusy} disabled={file === null}>
            {t("fields.upload")}
          </Button>
        </footer>
      </form>
    </Dialog>
  );
}

import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { createKey } from "../../api/resources";
import type { NewAccessKey } from "../../api/types";
import { Button } from "../../controls/Button";
import { CopyField } from "../../controls/CopyField";
import { Dialog } from "../../controls/Dialog";
import { TextField } from "../../controls/fields";
import { ErrorNotice, Notice } from "../../controls/states";
import { asRequestError } from "../../live/use_resource";
import { NameField, RoleField } from "./account_fields";
import { endOfDay, KEY_ROLES } from "./accounts";

/** Makes an access key for a program; its secret is shown once. */
export function NewKey({ made }: { made: () => void }) {
  const { t } = useTranslation();
  const [name, setName] = useState("");
  const [role, setRole] = useState<string>(KEY_ROLES[0]);
  const [date, setDate] = useState("");
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  const [key, setKey] = useState<NewAccessKey | null>(null);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    setBusy(true);
    setError(null);
    createKey(name, role, endOfDay(date))
      .then((found) => {
        setKey(found);
        setName("");
        setDate("");
        made();
      })
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  return (
    <section className="card">
      <form className="card-body" onSubmit={submit}>
        <h2>{t("system.add_key")}</h2>
        {error && <ErrorNotice error={error} />}
        <div className="form-line">
          <NameField value={name} change={setName} />
          <RoleField roles={KEY_ROLES} value={role} change={setRole} />
          <TextField
            label={t("system.expires_optional")}
            type="date"
            value={date}
            onChange={(event) => setDate(event.target.value)}
          />
          <Button kind="primary" icon="add" type="submit" isBusy={isBusy}>
            {t("system.add_key")}
          </Button>
        </div>
      </form>
      {key && (
        <Dialog title={t("system.key_made", { name: key.name })} close={() => setKey(null)}>
          <Notice kind="info">{t("system.key_once")}</Notice>
          <CopyField label={t("system.key")} text={key.key} />
          <div className="dialog-actions">
            <Button onClick={() => setKey(null)}>{t("action.done")}</Button>
          </div>
        </Dialog>
      )}
    </section>
  );
}

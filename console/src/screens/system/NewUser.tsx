import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { createUser } from "../../api/resources";
import { Button } from "../../controls/Button";
import { ErrorNotice } from "../../controls/states";
import { asRequestError } from "../../live/use_resource";
import { NameField, PasswordField, RoleField } from "./account_fields";
import { PERSON_ROLES, SHORTEST_PASSWORD } from "./accounts";

/** Makes an account; one without a password signs in by link. */
export function NewUser({ made }: { made: () => void }) {
  const { t } = useTranslation();
  const [name, setName] = useState("");
  const [role, setRole] = useState("operator");
  const [password, setPassword] = useState("");
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    setBusy(true);
    setError(null);
    createUser(name, role, password || null)
      .then(() => {
        setName("");
        setPassword("");
        made();
      })
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  return (
    <section className="card">
      <form className="card-body" onSubmit={submit}>
        <h2>{t("system.add_user")}</h2>
        {error && <ErrorNotice error={error} />}
        <div className="form-line">
          <NameField value={name} change={setName} />
          <RoleField roles={PERSON_ROLES} value={role} change={setRole} />
          <PasswordField label={t("system.password_optional")} value={password} change={setPassword} />
          <Button kind="primary" icon="add" type="submit" isBusy={isBusy}>
            {t("system.add_user")}
          </Button>
        </div>
        <p className="muted small">{t("system.password_rule", { count: SHORTEST_PASSWORD })}</p>
      </form>
    </section>
  );
}

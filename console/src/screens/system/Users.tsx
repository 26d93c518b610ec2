import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { changeUser, createUser, listUsers } from "../../api/resources";
import type { User } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { useSession } from "../../app/session_context";
import { Button } from "../../controls/Button";
import { SelectField, TextField } from "../../controls/fields";
import { Empty, ErrorNotice, Loaded } from "../../controls/states";
import { Pill } from "../../controls/StatusPill";
import { asRequestError, useResource } from "../../live/use_resource";
import { Missing } from "../Missing";

const ROLES = ["farmer", "operator", "admin"] as const;

/** Who may sign in, with which role. */
export function Users() {
  const { t } = useTranslation();
  const users = useResource(listUsers);
  const [error, setError] = useState<RequestError | null>(null);
  const run = (work: Promise<unknown>) =>
    work
      .then(() => {
        setError(null);
        users.reload();
      })
      .catch((reason: unknown) => setError(asRequestError(reason)));
  return (
    <>
      {error && <ErrorNotice error={error} />}
      <div className="card">
        <Loaded
          resource={users}
          missing={<Missing />}
          empty={<Empty icon="system" title={t("system.empty_users")} />}
        >
          {(rows) => (
            <ul className="rows">
              {rows.map((user) => (
                <UserRow
                  key={user.name}
                  user={user}
                  toggle={() => void run(changeUser(user.name, { disabled: !user.disabled }))}
                />
              ))}
            </ul>
          )}
        </Loaded>
      </div>
      {users.error?.status !== 404 && (
        <NewUser create={(name, role, password) => run(createUser(name, role, password))} />
      )}
    </>
  );
}

function UserRow({ user, toggle }: { user: User; toggle: () => void }) {
  const { t } = useTranslation();
  const units = useUnits();
  const { session } = useSession();
  return (
    <li>
      <div className="row-main">
        <strong>{user.name}</strong>
        <span>
          {t(`role.${user.role}`)} · {t("system.last_sign_in")}: {units.time(user.last_sign_in_at)}
        </span>
      </div>
      <Pill tone={user.disabled ? "neutral" : "good"}>
        {t(user.disabled ? "system.disabled" : "system.active")}
      </Pill>
      {user.name !== session.name && (
        <Button onClick={toggle}>{t(user.disabled ? "system.enable" : "system.disable")}</Button>
      )}
    </li>
  );
}

function NewUser({ create }: {
  create: (name: string, role: string, password: string) => Promise<unknown>;
}) {
  const { t } = useTranslation();
  const [name, setName] = useState("");
  const [role, setRole] = useState("operator");
  const [password, setPassword] = useState("");
  const [isBusy, setBusy] = useState(false);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    setBusy(true);
    void create(name, role, password).finally(() => {
      setBusy(false);
      setPassword("");
    });
  };
  return (
    <section className="card">
      <form className="card-body" onSubmit={submit}>
        <h2>{t("system.add_user")}</h2>
        <div className="form-line">
          <TextField
            label={t("system.name")}
            value={name}
            onChange={(event) => setName(event.target.value)}
            autoComplete="off"
            required
          />
          <SelectField
            label={t("system.role")}
            value={role}
            onChange={(event) => setRole(event.target.value)}
          >
            {ROLES.map((one) => (
              <option key={one} value={one}>
                {t(`role.${one}`)}
              </option>
            ))}
          </SelectField>
          <TextField
            label={t("system.password")}
            type="password"
            value={password}
            onChange={(event) => setPassword(event.target.value)}
            autoComplete="new-password"
            required
          />
          <Button kind="primary" icon="add" type="submit" isBusy={isBusy}>
            {t("system.add_user")}
          </Button>
        </div>
      </form>
    </section>
  );
}

import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { changeUser, deleteUser, makeSignInLink } from "../../api/resources";
import type { User } from "../../api/types";
import { Button } from "../../controls/Button";
import { CopyField } from "../../controls/CopyField";
import { Dialog } from "../../controls/Dialog";
import { ErrorNotice, Notice } from "../../controls/states";
import { asRequestError } from "../../live/use_resource";
import { PasswordField, RoleField } from "./account_fields";
import { PERSON_ROLES, SHORTEST_PASSWORD, signInAddress } from "./accounts";

/** Changes a person's account: role, password, a link that signs in once, the end of it. */
export function UserDialog({ user, isSelf, changed, close }: {
  user: User;
  /** Nobody takes the own role or account away by mistake. */
  isSelf: boolean;
  changed: () => void;
  close: () => void;
}) {
  const { t } = useTranslation();
  const [role, setRole] = useState<string>(user.role);
  const [password, setPassword] = useState("");
  const [link, setLink] = useState<string | null>(null);
  const [done, setDone] = useState<string | null>(null);
  const [isDeleting, setDeleting] = useState(false);
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  const act = (work: () => Promise<void>) => {
    setBusy(true);
    setError(null);
    setDone(null);
    work()
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  const changeRole = (event: FormEvent) => {
    event.preventDefault();
    act(async () => {
      await changeUser(user.name, { role });
      setDone(t("system.role_changed"));
      changed();
    });
  };
  const changePassword = (event: FormEvent) => {
    event.preventDefault();
    act(async () => {
      await changeUser(user.name, { password });
      setPassword("");
      setDone(t("system.password_changed"));
      changed();
    });
  };
  const remove = () =>
    act(async () => {
      await deleteUser(user.name);
      changed();
      close();
    });
  return (
    <Dialog title={user.name} close={close}>
      {error && <ErrorNotice error={error} />}
      {done !== null && <Notice kind="good">{done}</Notice>}
      {!isSelf && (
        <form className="form-line" onSubmit={changeRole}>
          <RoleField roles={PERSON_ROLES} value={role} change={setRole} />
          <Button type="submit" disabled={isBusy || role === user.role}>
            {t("system.change_role")}
          </Button>
        </form>
      )}
      <form className="form-line" onSubmit={changePassword}>
        <PasswordField label={t("system.new_password")} value={password} change={setPassword} required />
        <Button type="submit" disabled={isBusy || password === ""}>
          {t("system.set_password")}
        </Button>
      </form>
      <p className="muted small">{t("system.password_ends", { count: SHORTEST_PASSWORD })}</p>
      {link === null ? (
        <Button
          icon="link"
          disabled={isBusy || user.disabled}
          onClick={() => act(async () => setLink(signInAddress((await makeSignInLink(user.name)).path, location.origin)))}
        >
          {t("system.make_link")}
        </Button>
      ) : (
        <>
          <CopyField label={t("system.link")} text={link} />
          <p className="muted small">{t("system.link_text")}</p>
        </>
      )}
      {isDeleting && <Notice kind="error">{t("system.delete_text", { name: user.name })}</Notice>}
      <div className="dialog-actions">
        {!isSelf && (
          <Button kind="danger" icon="remove" disabled={isBusy} onClick={() => (isDeleting ? remove() : setDeleting(true))}>
            {t(isDeleting ? "system.delete_now" : "system.delete_user")}
          </Button>
        )}
        <Button onClick={close}>{t("action.close")}</Button>
      </div>
    </Dialog>
  );
}

import { useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../../api/client";
import { changeUser, listUsers } from "../../api/resources";
import type { User } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { useSession } from "../../app/session_context";
import { Button } from "../../controls/Button";
import { Empty, ErrorNotice, Loaded } from "../../controls/states";
import { Pill } from "../../controls/StatusPill";
import { asRequestError, useResource } from "../../live/use_resource";
import { Missing } from "../Missing";
import { NewUser } from "./NewUser";
import { UserDialog } from "./UserDialog";

/** Who may sign in, with which role. */
export function Users() {
  const { t } = useTranslation();
  const { session } = useSession();
  const users = useResource(listUsers);
  const [opened, setOpened] = useState<string | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const toggle = (user: User) => {
    changeUser(user.name, { disabled: !user.disabled })
      .then(() => {
        setError(null);
        users.reload();
      })
      .catch((reason: unknown) => setError(asRequestError(reason)));
  };
  const open = users.value?.find(({ name }) => name === opened);
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
                  isSelf={user.name === session.name}
                  toggle={() => toggle(user)}
                  open={() => setOpened(user.name)}
                />
              ))}
            </ul>
          )}
        </Loaded>
      </div>
      {users.error?.status !== 404 && <NewUser made={users.reload} />}
      {open && (
        <UserDialog
          key={open.name}
          user={open}
          isSelf={open.name === session.name}
          changed={users.reload}
          close={() => setOpened(null)}
        />
      )}
    </>
  );
}

function UserRow({ user, isSelf, toggle, open }: {
  user: User;
  isSelf: boolean;
  toggle: () => void;
  open: () => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
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
      {!isSelf && (
        <Button onClick={toggle}>{t(user.disabled ? "system.enable" : "system.disable")}</Button>
      )}
      <Button aria-label={t("system.change_user_of", { name: user.name })} onClick={open}>
        {t("system.change_user")}
      </Button>
    </li>
  );
}

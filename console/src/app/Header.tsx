import { useState } from "react";
import { useTranslation } from "react-i18next";
import { Dialog } from "../controls/Dialog";
import { Button } from "../controls/Button";
import { Segments, SelectField } from "../controls/fields";
import { Icon } from "../controls/Icon";
import { StopButton } from "../controls/StopButton";
import { LANGUAGES } from "../i18n/i18n";
import { useLive, useNow } from "../live/use_live";
import { THEMES, usePreferences, useUnits } from "./preferences";
import { linkTo } from "./route";
import { useSession } from "./session_context";

/** Name, connection, uplink, settings, and the stop that is always in reach. */
export function Header() {
  const { t } = useTranslation();
  const [isOpen, setOpen] = useState(false);
  const { session } = useSession();
  return (
    <header className="header">
      <a className="brand" aria-label={t("shell.name")} {...linkTo("")}>
        <img src="/console/icon.svg" alt="" width="32" height="32" />
        <span>{t("shell.name")}</span>
      </a>
      <ConnectionState />
      <UplinkState />
      <button
        type="button"
        className="header-person"
        onClick={() => setOpen(true)}
        aria-label={`${t("settings.title")}: ${session.name}`}
      >
        <Icon name="settings" />
        <span>{session.name}</span>
      </button>
      <StopButton />
      {isOpen && <Settings close={() => setOpen(false)} />}
    </header>
  );
}

function ConnectionState() {
  const { t } = useTranslation();
  const units = useUnits();
  const now = useNow();
  const connection = useLive((state) => state.connection);
  const contactAtMs = useLive((state) => state.contactAtMs);
  const isGood = connection === "live" || connection === "polling";
  const age = contactAtMs === null ? null : units.duration(now - contactAtMs);
  let text = t(`connection.${connection}`);
  if (connection === "offline" && age !== null) text = t("connection.offline_age", { age });
  return (
    <span className={`state state-${isGood ? "good" : connection}`} role="status">
      <i />
      <span>{text}</span>
    </span>
  );
}

function UplinkState() {
  const { t } = useTranslation();
  const uplink = useLive((state) => state.uplink);
  const isConnected = useLive((state) => state.connection !== "offline");
  if (uplink === null || !isConnected) return null;
  const waiting = uplink.records_waiting;
  const state = t(`uplink.${uplink.state}`);
  const count = waiting === null ? "" : t("uplink.waiting", { count: waiting });
  return (
    <span
      className={`state uplink ${uplink.state === "open" ? "" : "state-warning"}`}
      title={[state, count].filter(Boolean).join(", ")}
    >
      <Icon name="cloud" />
      <span>{state}</span>
      {waiting !== null && waiting > 0 && <b>{count}</b>}
    </span>
  );
}

function Settings({ close }: { close: () => void }) {
  const { t } = useTranslation();
  const { preferences, change } = usePreferences();
  const { session, leave } = useSession();
  return (
    <Dialog title={t("settings.title")} close={close}>
      <p className="muted">
        {t("settings.signed_in", { name: session.name, role: t(`role.${session.role}`) })}
      </p>
      <Segments
        label={t("settings.theme")}
        value={preferences.theme}
        options={THEMES.map((theme) => [theme, t(`settings.theme_${theme}`)] as const)}
        choose={(theme) => change({ theme })}
      />
      <Segments
        label={t("settings.units")}
        value={preferences.units}
        options={[
          ["metric", t("settings.metric")],
          ["imperial", t("settings.imperial")],
        ]}
        choose={(units) => change({ units })}
      />
      <SelectField
        label={t("settings.language")}
        value={preferences.language}
        onChange={(event) => change({ language: event.target.value })}
      >
        {Object.entries(LANGUAGES).map(([code, language]) => (
          <option key={code} value={code}>
            {language.name}
          </option>
        ))}
      </SelectField>
      <div className="dialog-actions">
        <Button icon="signOut" onClick={leave}>
          {t("settings.sign_out")}
        </Button>
        <Button kind="primary" onClick={close}>
          {t("action.done")}
        </Button>
      </div>
    </Dialog>
  );
}

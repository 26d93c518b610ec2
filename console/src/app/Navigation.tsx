import { useTranslation } from "react-i18next";
import { Icon, type IconName } from "../controls/Icon";
import { useLive } from "../live/use_live";
import { linkTo, useRoute } from "./route";
import { useSession } from "./session_context";

const ENTRIES: readonly (readonly [string, IconName, string])[] = [
  ["", "map", "nav.fleet"],
  ["fields", "field", "nav.fields"],
  ["plans", "plan", "nav.plans"],
  ["flights", "flight", "nav.flights"],
  ["alarms", "alarm", "nav.alarms"],
];

/** A rail beside the screen; on a phone a bar below it. */
export function Navigation() {
  const { t } = useTranslation();
  const { session } = useSession();
  const [first = ""] = useRoute();
  const openAlarms = useLive(
    (state) => [...state.alarms.values()].filter((alarm) => alarm.acknowledged_at === null).length,
  );
  const entries =
    session.role === "admin" ? [...ENTRIES, ["system", "system", "nav.system"] as const] : ENTRIES;
  return (
    <nav className="navigation" aria-label={t("nav.label")}>
      {entries.map(([to, icon, text]) => (
        <a key={to} {...linkTo(to)} aria-current={first === to ? "page" : undefined}>
          <span className="navigation-icon">
            <Icon name={icon} size={22} />
            {to === "alarms" && openAlarms > 0 && <span className="badge">{openAlarms}</span>}
          </span>
          <span>{t(text)}</span>
        </a>
      ))}
    </nav>
  );
}

import { useTranslation } from "react-i18next";
import { linkTo } from "../app/route";
import { useSession } from "../app/session_context";
import { Empty } from "../controls/states";
import { AuditLog } from "./system/AuditLog";
import { Backups } from "./system/Backups";
import { DeadLetters } from "./system/DeadLetters";
import { Keys } from "./system/Keys";
import { Sessions } from "./system/Sessions";
import { StorageUse } from "./system/StorageUse";
import { Users } from "./system/Users";

const SECTIONS = {
  users: Users,
  sessions: Sessions,
  keys: Keys,
  audit: AuditLog,
  dead_letters: DeadLetters,
  storage: StorageUse,
  backups: Backups,
} as const;

/** People, their sessions, keys, the audit log, rejected records, the use of the disk and backups, for administrators. */
export default function System({ section }: { section: string }) {
  const { t } = useTranslation();
  const { session } = useSession();
  if (session.role !== "admin") return <Empty isScreen icon="system" title={t("system.admin_only")} />;
  const Section = SECTIONS[section as keyof typeof SECTIONS] ?? Users;
  return (
    <div className="screen">
      <header className="screen-head">
        <h1>{t("system.title")}</h1>
      </header>
      <nav className="tabs" aria-label={t("system.title")}>
        {Object.keys(SECTIONS).map((name) => (
          <a
            key={name}
            {...linkTo(`system/${name}`)}
            aria-current={name === section ? "page" : undefined}
          >
            {t(`system.${name}`)}
          </a>
        ))}
      </nav>
      <Section />
    </div>
  );
}

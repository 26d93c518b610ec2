import { useTranslation } from "react-i18next";
import { getStorage } from "../../api/resources";
import type { Storage } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Loaded, Notice } from "../../controls/states";
import { useLive } from "../../live/use_live";
import { useResource } from "../../live/use_resource";

const readStorage = async (): Promise<Storage[]> => [await getStorage()];

/** What records, pictures and the flight archive use of their budgets, and the disk's free room. */
export function StorageUse() {
  const storage = useResource(readStorage);
  return (
    <div className="card">
      <Loaded resource={storage} empty={null}>
        {(found) => found.map((use) => <Uses key={use.version} {...use} />)}
      </Loaded>
    </div>
  );
}

function Uses({ records, pictures, archive, disk, version, database }: Storage) {
  const { t } = useTranslation();
  const archiveName = t("system.storage_archive", { count: archive.flights, days: archive.days });
  const usedOfDisk = disk.total_bytes - disk.free_bytes;
  return (
    <>
      {archive.lost_reports > 0 && (
        <Notice kind="info">{t("system.storage_lost", { count: archive.lost_reports })}</Notice>
      )}
      {!archive.is_working && <Notice kind="error">{t("system.storage_stopped")}</Notice>}
      <ul className="rows">
        <Use name={t("system.storage_records")} used={records.used_bytes} of={records.budget_bytes} />
        <Use name={t("system.storage_pictures")} used={pictures.used_bytes} of={pictures.budget_bytes} />
        <Use name={archiveName} used={archive.used_bytes} of={archive.budget_bytes} />
        <Use name={t("system.storage_disk")} used={usedOfDisk} of={disk.total_bytes} />
      </ul>
      <Versions version={version} database={database} />
    </>
  );
}

/** What runs: the edge server, its database, and the autopilot of each vehicle. */
function Versions({ version, database }: Pick<Storage, "version" | "database">) {
  const { t } = useTranslation();
  const vehicles = useLive((state) => state.vehicles);
  const rows: [string, string][] = [
    [t("system.version_edge"), version],
    [t("system.version_database"), database === "sqlite" ? "SQLite" : "PostgreSQL"],
    ...[...vehicles.values()].map(({ vehicle }): [string, string] => [
      t("vehicle.name", { id: vehicle.vehicle_id }),
      [vehicle.family, vehicle.version].filter(Boolean).join(" ") || t("system.version_unknown"),
    ]),
  ];
  return (
    <section className="versions">
      <h2>{t("system.versions")}</h2>
      <dl>
        {rows.map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}

function Use({ name, used, of }: { name: string; used: number; of: number }) {
  const { t } = useTranslation();
  const units = useUnits();
  const text = t("system.storage_of", { used: units.data(used), budget: units.data(of) });
  return (
    <li>
      <div className="row-main">
        <strong>{name}</strong>
        <span>{text}</span>
        <progress max={of} value={Math.min(used, of)} aria-label={`${name}: ${text}`} />
      </div>
    </li>
  );
}

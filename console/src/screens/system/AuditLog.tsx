import { useTranslation } from "react-i18next";
import { listAudit } from "../../api/resources";
import { useUnits } from "../../app/preferences";
import { describeAction, describeActor, describeResult } from "../../i18n/describe_audit";
import { Empty, Loaded } from "../../controls/states";
import { useResource } from "../../live/use_resource";

const WEEK_MS = 7 * 86_400_000;
const SHOWN = 300;

/** Who changed what in the last days. */
export function AuditLog() {
  const { t, i18n } = useTranslation();
  const units = useUnits();
  const rows = useResource(() => listAudit(new Date(Date.now() - WEEK_MS)));
  const text = (value: unknown) => (value === null || value === undefined ? "" : String(value));
  return (
    <div className="card">
      <Loaded resource={rows} empty={<Empty icon="check" title={t("system.empty_audit")} />}>
        {(all) => (
          <div className="table-scroll table-as-cards" tabIndex={0} role="region" aria-label={t("system.audit")}>
            <table className="table">
              <thead>
                <tr>
                  {["when", "who", "role", "what", "result"].map((name) => (
                    <th key={name} scope="col">
                      {t(`system.${name}`)}
                    </th>
                  ))}
                </tr>
              </thead>
              <tbody>
                {all.slice(0, SHOWN).map((row) => (
                  <tr key={row.id}>
                    <td data-label={t("system.when")}>{units.time(text(row["time"] ?? row["recorded_at"]))}</td>
                    <td data-label={t("system.who")}>{describeActor(row, t)}</td>
                    <td data-label={t("system.role")}>{text(row["role"]) && t(`role.${text(row["role"])}`)}</td>
                    <td data-label={t("system.what")}>{describeAction(row, t, i18n)}</td>
                    <td data-label={t("system.result")}>{describeResult(row, t)}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
        )}
      </Loaded>
    </div>
  );
}

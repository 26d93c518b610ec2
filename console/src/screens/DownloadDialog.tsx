import { useTranslation } from "react-i18next";
import type { Plan } from "../api/types";
import { Dialog } from "../controls/Dialog";
import { Icon } from "../controls/Icon";
import { documentOf } from "../planning/plan_document";

const MISSION_FILES = ["plan", "waypoints"] as const;

/** The files that a plan can be kept as: the document with everything, or a ground station's. */
export function DownloadDialog({ plan, close }: { plan: Plan; close: () => void }) {
  const { t } = useTranslation();
  const document = `data:application/json;charset=utf-8,${encodeURIComponent(JSON.stringify(documentOf(plan), null, 2))}`;
  return (
    <Dialog title={t("plans.download")} close={close}>
      <ul className="rows downloads">
        <li>
          <a className="button button-plain" href={document} download={`plan-${plan.id}.json`}>
            <Icon name="download" /> {t("plans.file_json")}
          </a>
          <p className="muted small">{t("plans.file_json_text")}</p>
        </li>
        {MISSION_FILES.flatMap((kind) =>
          plan.missions.map(({ vehicle_id }) => (
            <li key={`${kind}-${vehicle_id}`}>
              <a
                className="button button-plain"
                href={`/plans/${plan.id}?format=${kind}&vehicle_id=${vehicle_id}`}
                download={`plan-${plan.id}-vehicle-${vehicle_id}.${kind}`}
              >
                <Icon name="download" />
                {plan.missions.length > 1
                  ? t("plans.file_of", { kind, id: vehicle_id })
                  : t("plans.file", { kind })}
              </a>
              <p className="muted small">{t(`plans.file_${kind}_text`)}</p>
            </li>
          )),
        )}
      </ul>
    </Dialog>
  );
}

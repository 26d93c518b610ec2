import { useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import { createPlan } from "../api/resources";
import type { Plan } from "../api/types";
import { go } from "../app/route";
import { useSession } from "../app/session_context";
import { Button } from "../controls/Button";
import { Notice } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { Drafts } from "../planning/drafts";
import { documentOf, newMissionId, renumberedFrom } from "../planning/plan_document";
import { draftName, isPlanForm, withForm, type PlanForm } from "../planning/plan_form";
import { Attempts } from "../planning/saving";
import { useSaving } from "./use_saving";

/** What somebody has edited of a plan that can no longer be changed: it becomes a plan of its own. */
export function KeptDraft({ id }: { id: number }) {
  const { t } = useTranslation();
  const { session } = useSession();
  const drafts = useMemo(() => new Drafts(window.sessionStorage, window.localStorage, session.name), [session.name]);
  const [kept, setKept] = useState(() => drafts.read<PlanForm, Plan>(draftName(id), isPlanForm));
  const saving = useSaving<Plan>();
  const [attempts] = useState(() => new Attempts());
  if (kept === null) return null;
  const forget = () => {
    drafts.remove(draftName(id));
    setKept(null);
  };
  const copy = () => {
    const missionId = newMissionId(Date.now());
    const base = kept.base === null ? null : documentOf(kept.base.value);
    const document = renumberedFrom(withForm(base, { form: kept.state, vehicleId: 1, missionId }), missionId);
    const name = t("conflict.copy_of", { name: kept.state.name || t("editor.title_new") });
    saving.run(() => attempts.run(kept.state, { ...document, name }, createPlan), (stored) => {
      forget();
      go(`plans/${stored.id}/edit`);
    });
  };
  return (
    <Notice kind="info">
      <p>{t("leave.kept")}</p>
      {saving.error && <p className="fault">{describeError(saving.error, t)}</p>}
      <div className="actions">
        <Button kind="primary" icon="add" isBusy={saving.isBusy} onClick={copy}>{t("conflict.copy")}</Button>
        <Button icon="remove" onClick={forget}>{t("leave.discard_draft")}</Button>
      </div>
    </Notice>
  );
}

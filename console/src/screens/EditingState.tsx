import { useTranslation } from "react-i18next";
import { useUnits } from "../app/preferences";
import { Button } from "../controls/Button";
import { Notice } from "../controls/states";
import type { Editing } from "./use_editing";
import type { Steps } from "./use_steps";

/** Says that a draft of this browser is shown, and gives the stored version instead. */
export function RestoredNotice<State, Value>({ editing }: { editing: Editing<State, Value> }) {
  const { t } = useTranslation();
  const units = useUnits();
  if (editing.restoredAtMs === null || !editing.isChanged) return null;
  return (
    <Notice kind="info">
      <p>{t("leave.restored", { time: units.time(new Date(editing.restoredAtMs).toISOString()) })}</p>
      <Button icon="undo" onClick={editing.discard}>
        {t("leave.discard_draft")}
      </Button>
    </Notice>
  );
}

/** Steps back and forward. */
export function StepButtons<State>({ editing }: { editing: Steps<State> }) {
  const { t } = useTranslation();
  return (
    <>
      <Button icon="undo" disabled={!editing.canUndo} onClick={editing.undo}>
        {t("editor.undo")}
      </Button>
      <Button icon="redo" disabled={!editing.canRedo} onClick={editing.redo}>
        {t("editor.redo")}
      </Button>
    </>
  );
}

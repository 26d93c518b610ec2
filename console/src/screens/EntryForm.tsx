import { useTranslation } from "react-i18next";
import { Button } from "../controls/Button";
import { FEWEST_CORNERS, middleOf, type Corner, type Outline } from "../planning/outline";
import { CornerForm } from "./CornerForm";

/** Where the drones enter the field, or a button that puts it at the first edge. */
export function EntryForm({ outline, fault, set }: {
  outline: Outline;
  fault: string | undefined;
  set: (entry: Corner | null) => void;
}) {
  const { t } = useTranslation();
  if (outline.entry === null) {
    return (
      <div className="actions">
        <Button
          icon="add"
          disabled={outline.boundary.length < FEWEST_CORNERS}
          onClick={() => set(middleOf(outline.boundary, 0))}
        >
          {t("fields.add_entry")}
        </Button>
      </div>
    );
  }
  return (
    <div className="corner-form">
      <CornerForm
        title={t("fields.entry")}
        corner={outline.entry}
        move={set}
        remove={() => set(null)}
        removeText={t("fields.remove_entry")}
      />
      {fault !== undefined && <p className="fault">{fault}</p>}
      <p className="muted small">{t("fields.entry_hint")}</p>
    </div>
  );
}

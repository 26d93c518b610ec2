import { useTranslation } from "react-i18next";
import { Button } from "./Button";
import { Dialog } from "./Dialog";

/** Asks before something that cannot be undone. */
export function ConfirmDialog({ title, text, action, act, close }: {
  title: string;
  text: string;
  /** What the button says that does it. */
  action: string;
  act: () => void;
  close: () => void;
}) {
  const { t } = useTranslation();
  return (
    <Dialog title={title} close={close}>
      <p>{text}</p>
      <div className="dialog-actions">
        <Button onClick={close}>{t("action.cancel")}</Button>
        <Button kind="danger" onClick={act}>
          {action}
        </Button>
      </div>
    </Dialog>
  );
}

import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import type { Plan } from "../api/types";
import { Dialog } from "../controls/Dialog";
import { HoldButton } from "../controls/HoldButton";
import { Icon } from "../controls/Icon";
import { ErrorNotice } from "../controls/states";
import { Checklist } from "./Checklist";

/** What to look at before a stored plan is flown, and the button that is held to dispatch it. */
export function DispatchDialog({ plan, error = null, isBusy = false, dispatch, close }: {
  plan: Plan;
  /** Why it could not be dispatched. */
  error?: RequestError | null;
  isBusy?: boolean;
  dispatch: () => void;
  close: () => void;
}) {
  const { t } = useTranslation();
  return (
    <Dialog title={t("plans.dispatch")} close={close}>
      <Checklist plan={plan} />
      {error && <ErrorNotice error={error} />}
      <p>{t("plans.dispatch_text")}</p>
      <HoldButton className="hold-home" hint={t("stop.hold")} disabled={isBusy} act={dispatch}>
        <Icon name="flight" size={26} /> {t("plans.dispatch")}
      </HoldButton>
    </Dialog>
  );
}

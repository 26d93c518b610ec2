import { useTranslation } from "react-i18next";
import { Icon } from "./Icon";

/** Opens the stop orders. A dialog that covers the header has one of its own. */
export function StopButton({ stop }: { stop: () => void }) {
  const { t } = useTranslation();
  return (
    <button type="button" className="stop-button" onClick={stop}>
      <Icon name="stop" size={22} />
      <span>{t("stop.button")}</span>
    </button>
  );
}

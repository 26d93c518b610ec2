import { createContext, use } from "react";
import { useTranslation } from "react-i18next";
import { Icon } from "./Icon";

/** Opens the stop orders, for one vehicle or for all (null). */
export type Stop = (vehicleId: number | null) => void;

/** What each STOP of the console calls; null where nobody is signed in. */
export const StopContext = createContext<Stop | null>(null);

/** Opens the stop orders for all vehicles; in the header, and in each dialog, which covers the header. */
export function StopButton() {
  const { t } = useTranslation();
  const stop = use(StopContext);
  if (stop === null) return null;
  return (
    <button type="button" className="stop-button" onClick={() => stop(null)}>
      <Icon name="stop" size={22} />
      <span>{t("stop.button")}</span>
    </button>
  );
}

/** The title of the browser's tab: the screen, then the console. */

import { useEffect } from "react";
import { useTranslation } from "react-i18next";

const NAMES: Record<string, string> = {
  "": "nav.fleet", fields: "nav.fields", plans: "nav.plans", flights: "nav.flights", alarms: "nav.alarms", system: "nav.system",
};

/** The key of a screen's name; null for an address without a screen. */
export function titleOf(first: string | undefined): string | null {
  return NAMES[first ?? ""] ?? null;
}

export function useTitle(first: string | undefined): void {
  const { t } = useTranslation();
  const name = titleOf(first);
  useEffect(() => {
    document.title = name === null ? t("shell.name") : `${t(name)} - ${t("shell.name")}`;
  }, [name, t]);
}

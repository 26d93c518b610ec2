/** The hook that gives reports of broker and edge server in the person's language and units. */

import { useMemo } from "react";
import { useTranslation } from "react-i18next";
import { usePreferences } from "../app/preferences";
import { quantitiesIn } from "../units/fields";
import { Units } from "../units/units";
import { reportTexts } from "./i18n";

/** Gives a function that translates a report, with its quantities in the person's units. */
export function useReportText(): (text: string) => string {
  const { language } = useTranslation().i18n;
  const system = usePreferences().preferences.units;
  return useMemo(() => {
    const write = quantitiesIn(new Units(system, language));
    return (text) => reportTexts(language).describe(text, write);
  }, [language, system]);
}

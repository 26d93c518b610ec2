/** The hook that gives reports of broker and edge server in the person's language. */

import { useTranslation } from "react-i18next";
import { reportTexts } from "./i18n";

/** Gives a function that translates a report. */
export function useReportText(): (text: string) => string {
  return reportTexts(useTranslation().i18n.language).describe;
}

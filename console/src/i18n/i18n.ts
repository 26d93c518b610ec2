/**
 * Languages: each is three files beside this one, its texts and the phrases of reports and faults,
 * which come in English; add it to LANGUAGES and it can be chosen.
 */

import i18next from "i18next";
import { initReactI18next } from "react-i18next";
import { ReportTexts } from "./describe_report";
import en from "./en.json";
import es from "./es.json";
import enFaults from "./faults.en.json";
import esFaults from "./faults.es.json";
import esReports from "./reports.es.json";

/**
 * Each language's own name, its texts and its phrases of reports and faults. Reports are written for
 * persons, so English has phrases for faults alone, which name the members of a document.
 */
export const LANGUAGES = {
  en: { name: "English", texts: en, reports: new ReportTexts(enFaults) },
  es: { name: "Español", texts: es, reports: new ReportTexts({ ...esReports, ...esFaults }) },
} as const;

/** Gives the phrases of reports and faults in a language; English where it has none. */
export function reportTexts(language: string): ReportTexts {
  return (language in LANGUAGES ? LANGUAGES[language as keyof typeof LANGUAGES] : LANGUAGES.en).reports;
}

void i18next.use(initReactI18next).init({
  resources: Object.fromEntries(
    Object.entries(LANGUAGES).map(([code, one]) => [code, { translation: one.texts }]),
  ),
  lng: "en",
  fallbackLng: "en",
  interpolation: { escapeValue: false }, // React escapes
});

export default i18next;

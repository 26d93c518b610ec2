/**
 * Languages: each is two files beside this one, its texts and the phrases of reports, which come in
 * English; add it to LANGUAGES and it can be chosen.
 */

import i18next from "i18next";
import { initReactI18next } from "react-i18next";
import { ReportTexts } from "./describe_report";
import en from "./en.json";
import es from "./es.json";
import esReports from "./reports.es.json";

/** Each language's own name, its texts and its phrases of reports. */
export const LANGUAGES = {
  en: { name: "English", texts: en, reports: new ReportTexts({}) },
  es: { name: "Español", texts: es, reports: new ReportTexts(esReports) },
} as const;

/** Gives the phrases of reports in a language; English where it has none. */
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

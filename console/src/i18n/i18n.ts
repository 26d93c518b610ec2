/**
 * Languages: each is three files beside this one, its texts and the phrases of reports and faults,
 * which come in English, and a module that joins them; add it to LANGUAGES and it can be chosen.
 */

import i18next from "i18next";
import { initReactI18next } from "react-i18next";
import { ReportTexts, type Phrases } from "./describe_report";
import en from "./en.json";
import enFaults from "./faults.en.json";

interface LanguageFiles {
  texts: object;
  phrases: Phrases;
}

interface Language {
  /** In the language itself. */
  name: string;
  /** Null for what is always there. */
  load: (() => Promise<{ default: LanguageFiles }>) | null;
}

export const LANGUAGES: Readonly<Record<string, Language>> = {
  en: { name: "English", load: null },
  es: { name: "Español", load: () => import("./es") },
};

/**
 * Phrases by language, of those that are loaded. Reports are written for persons, so English has
 * phrases for faults alone, which name the members of a document.
 */
const english = new ReportTexts(enFaults);
const reports = new Map<string, ReportTexts>([["en", english]]);

/** Gives the phrases of reports and faults in a language; English while it is not loaded. */
export function reportTexts(language: string): ReportTexts {
  return reports.get(language) ?? english;
}

/** Loads the texts of a language; raises what the import raises. */
export async function loadLanguage(code: string): Promise<void> {
  const load = LANGUAGES[code]?.load;
  if (reports.has(code) || !load) return;
  const { texts, phrases } = (await load()).default;
  i18next.addResourceBundle(code, "translation", texts);
  reports.set(code, new ReportTexts(phrases));
}

/** Shows the console in a language as soon as it is loaded; the present one stays if it cannot be. */
export async function showLanguage(code: string): Promise<void> {
  try {
    await loadLanguage(code);
  } catch {
    return; // No connection: the next choice tries again
  }
  if (i18next.language !== code) await i18next.changeLanguage(code);
}

void i18next.use(initReactI18next).init({
  resources: { en: { translation: en } },
  lng: "en",
  fallbackLng: "en",
  interpolation: { escapeValue: false }, // React escapes
});

export default i18next;

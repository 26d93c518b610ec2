/** Languages: each is one file beside this one; add it to LANGUAGES and it can be chosen. */

import i18next from "i18next";
import { initReactI18next } from "react-i18next";
import en from "./en.json";
import es from "./es.json";

/** Each language's own name and texts. */
export const LANGUAGES = {
  en: { name: "English", texts: en },
  es: { name: "Español", texts: es },
} as const;

void i18next.use(initReactI18next).init({
  resources: Object.fromEntries(
    Object.entries(LANGUAGES).map(([code, one]) => [code, { translation: one.texts }]),
  ),
  lng: "en",
  fallbackLng: "en",
  interpolation: { escapeValue: false }, // React escapes
});

export default i18next;

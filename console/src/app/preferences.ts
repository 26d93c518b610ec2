/** What a person chooses for this browser: language, theme and units. */

import { createContext, useContext } from "react";
import { Units, type System } from "../units/units";

export const THEMES = ["light", "dark", "outdoor"] as const;
export type Theme = (typeof THEMES)[number];

export interface Preferences {
  language: string;
  theme: Theme;
  units: System;
  /** Whether an alarm makes no sound. */
  isMuted: boolean;
}

const KEY = "farm-console";

/** Reads the stored choices; what is missing follows the browser. */
export function readPreferences(languages: readonly string[]): Preferences {
  const preferred = navigator.language.slice(0, 2);
  const prefersDark = window.matchMedia("(prefers-color-scheme: dark)").matches;
  const defaults: Preferences = {
    language: languages.includes(preferred) ? preferred : "en",
    theme: prefersDark ? "dark" : "light",
    units: "metric",
    isMuted: false,
  };
  try {
    const stored = JSON.parse(localStorage.getItem(KEY) ?? "{}") as Partial<Preferences>;
    return { ...defaults, ...stored };
  } catch {
    return defaults; // Storage is switched off, or holds something else
  }
}

let applied: System = "metric";

/** The units that were chosen last, for what is no component. */
export function appliedUnits(): System {
  return applied;
}

/** Stores the choices and applies those that are attributes of the page. */
export function applyPreferences(preferences: Preferences): void {
  document.documentElement.dataset["theme"] = preferences.theme;
  document.documentElement.lang = preferences.language;
  applied = preferences.units;
  try {
    localStorage.setItem(KEY, JSON.stringify(preferences));
  } catch {
    // They hold until the page is closed
  }
}

export interface PreferencesValue {
  preferences: Preferences;
  change: (change: Partial<Preferences>) => void;
}

export const PreferencesContext = createContext<PreferencesValue | null>(null);

export function usePreferences(): PreferencesValue {
  const value = useContext(PreferencesContext);
  if (value === null) throw new Error("there is no PreferencesContext");
  return value;
}

/** Formats numbers in the units and language of the person. */
export function useUnits(): Units {
  const { preferences } = usePreferences();
  return new Units(preferences.units, preferences.language);
}

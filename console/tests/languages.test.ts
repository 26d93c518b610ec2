import { afterEach, expect, test } from "vitest";
import i18next, { LANGUAGES, reportTexts, showLanguage } from "../src/i18n/i18n";

const languages = LANGUAGES as Record<string, (typeof LANGUAGES)[string]>;

afterEach(async () => {
  await i18next.changeLanguage("en");
  delete languages["xx"];
});

test("a language is loaded when it is chosen, with the phrases of reports", async () => {
  await showLanguage("es");
  expect([i18next.language, i18next.t("nav.plans")]).toEqual(["es", "Planes"]);
  expect(reportTexts("es").describe("aborted by an event")).toBe("interrumpida por un evento");
});

test("a language that cannot be loaded leaves the present one, and is tried again", async () => {
  let isConnected = false;
  languages["xx"] = {
    name: "Xx",
    load: () => isConnected
      ? Promise.resolve({ default: { texts: { nav: { plans: "Xx" } }, phrases: {} } })
      : Promise.reject(new TypeError("Failed to fetch")),
  };
  await showLanguage("xx");
  expect([i18next.language, i18next.t("nav.plans")]).toEqual(["en", "Plans"]);
  isConnected = true;
  await showLanguage("xx");
  expect([i18next.language, i18next.t("nav.plans")]).toEqual(["xx", "Xx"]);
});

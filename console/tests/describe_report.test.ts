import { expect, test } from "vitest";
import { ReportTexts } from "../src/i18n/describe_report";
import { LANGUAGES, reportTexts } from "../src/i18n/i18n";
import phrases from "../src/i18n/reports.es.json";

const spanish = LANGUAGES.es.reports;
const values = (text: string) => [...text.matchAll(/\{(\w+)\}/g)].map((found) => found[1]).sort();

test("a report that is known is in the person's language", () => {
  expect(spanish.describe("aborted by an event")).toBe("interrumpida por un evento");
  expect(LANGUAGES.en.reports.describe("aborted by an event")).toBe("aborted by an event");
  expect(spanish.describe("constructor")).toBe("constructor");
});

test("values stay, phrases within phrases are translated", () => {
  expect(spanish.describe("picture 7 cannot be had: the vehicle does not answer"))
    .toBe("la imagen 7 no se puede obtener: el dron no contesta");
  expect(spanish.describe("mission error: the vehicle left the mission: mode POSCTL: somebody else flies the vehicle"))
    .toBe("error de misión: el dron dejó la misión: modo POSCTL: otra persona pilota el dron");
});

test("each part of a report is translated by itself, and the unknown stays", () => {
  expect(spanish.describe("left out: the vehicle has no camera; gusts; aborted by an event"))
    .toBe("omitida: el dron no tiene cámara; gusts; interrumpida por un evento");
});

test("the longest phrase decides", () => {
  const texts = new ReportTexts({ "{a} is {b}": "{b} = {a}", "it is at {b} m": "a {b} m" });
  expect(texts.describe("it is at 5 m")).toBe("a 5 m");
  expect(texts.describe("x is y")).toBe("y = x");
});

test("signs of expressions are nothing but signs", () => {
  const texts = new ReportTexts({ "what (is) {a}?": "qué es {a}" });
  expect(texts.describe("what (is) it?")).toBe("qué es it");
  expect(texts.describe("what is it")).toBe("what is it");
});

test("translations name the same values", () => {
  for (const [text, phrase] of Object.entries(phrases)) {
    expect([text, values(phrase)]).toEqual([text, values(text)]);
  }
});

test("a language without phrases gives reports as they are", () => {
  expect(reportTexts("xx").describe("aborted by an event")).toBe("aborted by an event");
});

import { expect, test } from "vitest";
import { ReportTexts } from "../src/i18n/describe_report";
import { loadLanguage, reportTexts } from "../src/i18n/i18n";
import englishFaults from "../src/i18n/faults.en.json";
import spanishFaults from "../src/i18n/faults.es.json";
import phrases from "../src/i18n/reports.es.json";

await loadLanguage("es");
const spanish = reportTexts("es");
const values = (text: string) => [...text.matchAll(/\{(\w+)\}/g)].map((found) => found[1]).sort();

test("a report that is known is in the person's language", () => {
  expect(spanish.describe("aborted by an event")).toBe("interrumpida por un evento");
  expect(reportTexts("en").describe("aborted by an event")).toBe("aborted by an event");
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

test("a fault names steps as they are on the screen, in both languages", () => {
  const fault = "follows the landing of command_array.3: NAV_TAKEOFF (1) has to come first";
  expect(reportTexts("en").describe(fault))
    .toBe("comes behind the landing of step 4: a take-off is needed before");
  expect(spanish.describe(fault))
    .toBe("viene tras el aterrizaje del paso 4: antes hace falta un despegue");
  expect(spanish.describe("the leg there enters geofence.exclusion.0"))
    .toBe("el trayecto hasta allí entra en la zona sin vuelo 1");
  expect(reportTexts("en").describe("coordinates of the field")).toBe("coordinates of the field");
});

test("phrases of faults name no value that the fault has not", () => {
  for (const faults of [englishFaults, spanishFaults]) {
    for (const [text, phrase] of Object.entries(faults)) {
      expect([text, values(text)]).toEqual([text, expect.arrayContaining(values(phrase))]);
    }
  }
});

test("a fault that has an English phrase has a Spanish one", () => {
  expect(Object.keys(spanishFaults)).toEqual(expect.arrayContaining(Object.keys(englishFaults)));
});

test("a language without phrases gives reports as they are", () => {
  expect(reportTexts("xx").describe("aborted by an event")).toBe("aborted by an event");
});

test("what a library says of a broken file is left out of a language that is not the library's", () => {
  expect(spanish.describe("not JSON: Expecting ',' delimiter at line 1 column 58")).toBe("no es JSON: en la línea 1, columna 58");
  expect(spanish.describe("is no whole KMZ: File is not a zip file")).toBe("no es un KMZ entero");
});

import { expect, test } from "vitest";
import en from "../src/i18n/en.json";
import es from "../src/i18n/es.json";

type Texts = { [key: string]: string | Texts };

function entries(texts: Texts, path = ""): [string, string][] {
  return Object.entries(texts).flatMap(([key, value]): [string, string][] =>
    typeof value === "string" ? [[path + key, value]] : entries(value, `${path}${key}.`),
  );
}
// Languages differ in their plural forms
const plain = (key: string) => key.replace(/_(one|many|other)$/, "");
const values = (text: string) => [...text.matchAll(/\{\{(\w+)\}\}/g)].map((found) => found[1]).sort();

test("every text of one language is in the other", () => {
  const keys = (texts: Texts) => new Set(entries(texts).map(([key]) => plain(key)));
  expect(keys(es)).toEqual(keys(en));
});

test("translations name the same values", () => {
  const spanish = new Map(entries(es));
  for (const [key, text] of entries(en)) {
    expect([key, values(spanish.get(key) ?? "")]).toEqual([key, values(text)]);
  }
});

test("the distance of a flight is named as the one over ground, unlike that of a flight report", () => {
  expect(en.flights.distance).toBe("Distance over ground");
  expect(es.flights.distance).toBe("Distancia sobre el suelo");
});

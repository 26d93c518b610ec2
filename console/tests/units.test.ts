import { afterEach, expect, test, vi } from "vitest";
import { gridOf, stepOf } from "../src/map/grid";
import { Units } from "../src/units/units";

test("people read kilometres per hour or miles per hour", () => {
  expect(new Units("metric", "en").speed(10)).toBe("36 km/h");
  expect(new Units("imperial", "en").speed(10)).toBe("22 mph");
});

afterEach(() => vi.unstubAllGlobals());

test.each([
  ["en-GB", "en", "14:05", "14:05:09"],
  ["en-US", "en", "02:05 PM", "02:05:09 PM"],
  ["en-GB", "es", "14:05", "14:05:09"],
  ["de-AT", "en", "02:05 PM", "02:05:09 PM"],
])("a browser in %s with the console in %s writes the time as %s", (region, language, minutes, seconds) => {
  vi.stubGlobal("navigator", { languages: ["fr-FR", region] });
  const units = new Units("metric", language);
  const stamp = "2026-11-28T14:05:09"; // Without a zone: that of the browser
  const plain = (text: string) => text.replace(/\s/g, " "); // Some regions write a narrow space
  expect(plain(units.time(stamp))).toMatch(new RegExp(`${minutes}$`));
  expect(plain(units.clock(stamp))).toBe(seconds);
  expect(plain(units.clock(Date.parse(stamp)))).toBe(seconds);
});

test("a moment beyond the calendar has no time of day", () => {
  expect(new Units("metric", "en").clock(18_446_744_073_709 * 1000)).toBe("–");
});

test.each([
  [0, "0 s"], [59_400, "59 s"], [60_000, "1 min"], [114_000, "1 min 54 s"], [298_000, "4 min 58 s"],
  [3_599_600, "1 h 0 min"], [7_500_000, "2 h 5 min"],
])("a duration of %i ms, to the second, is %s", (milliseconds, text) => {
  expect(new Units("metric", "en").elapsed(milliseconds)).toBe(text);
});

test("a height just below zero is no negative zero", () => {
  expect(new Units("metric", "en").height(-0.2)).toBe("0 m");
  expect(new Units("imperial", "en").height(-0.3)).toBe("0 ft");
});

test("a whole number is written as the language does, whatever its size", () => {
  const numbers = [0, 0.5, 1.5, 2.5, -2.5, -17.2, 99.49, 998.5, 999.4, 999.5, -999.5, 1000, 1234567, Infinity, NaN];
  for (const language of ["en", "es", "es-MX", "ar-EG"]) {
    const format = new Intl.NumberFormat(language, { maximumFractionDigits: 0 });
    for (const number of numbers) {
      const expected = format.format(number).replace(/^-0$/, "0");
      expect(new Units("metric", language).count(number), `${number} in ${language}`).toBe(expected);
    }
  }
});

test.each(["metric", "imperial"] as const)("a height, speed or time that no vehicle has is a dash, in %s units", (system) => {
  const units = new Units(system, "en");
  expect([1e300, Infinity, NaN].map((value) => units.duration(value))).toEqual(["–", "–", "–"]);
  for (const value of [1e300, -1e300, Infinity, NaN]) {
    expect([units.height(value), units.speed(value)], `${value}`).toEqual(["–", "–"]);
  }
  expect(new Units("metric", "en").height(-100_000)).toBe("-100,000 m");
  expect(new Units("metric", "en").speed(1_000)).toBe("3,600 km/h");
});

test("a value that is not known is a dash", () => {
  expect(new Units("metric", "es").percentage(null)).toBe("–");
});

test("long distances use the long unit", () => {
  expect(new Units("metric", "es").distance(1240)).toBe("1,24 km");
  expect(new Units("imperial", "en").distance(100)).toBe("328 ft");
});

test("an area that is small is no 0.0 of the large unit", () => {
  expect(new Units("metric", "en").area(340.2)).toBe("340 m²");
  expect(new Units("imperial", "en").area(340.2)).toBe("3,662 ft²");
  expect(new Units("metric", "es").area(6400)).toBe("0,64 ha");
  expect(new Units("metric", "en").area(99_400)).toBe("9.94 ha");
  expect(new Units("metric", "en").area(123_400)).toBe("12.3 ha");
});

test("the grid has round steps and keeps its lines while the map moves", () => {
  expect([stepOf(200), stepOf(1000), stepOf(9000)]).toEqual([20, 100, 1000]);
  const view = { west: -3.74, south: 40.44, east: -3.73, north: 40.45 };
  const moved = { ...view, west: -3.738, east: -3.728 };
  const places = (lines: ReturnType<typeof gridOf>) =>
    lines.features.map((one) => one.geometry.coordinates[0]?.[0]?.toFixed(9));
  const shared = places(gridOf(view)).filter((x) => places(gridOf(moved)).includes(x));
  expect(shared.length).toBeGreaterThan(5);
});

test("measured values keep their unit, or have that of the system", () => {
  const metric = new Units("metric", "en");
  const imperial = new Units("imperial", "en");
  expect(metric.measured(21.44, "Cel")).toBe("21.4 °C");
  expect(imperial.measured(20, "C")).toBe("68.0 °F");
  expect(imperial.measured(10, "m/s")).toBe("22.4 mph");
  expect(metric.measured(47.25, "%")).toBe("47.3 %");
  expect(metric.measured(12345, "lx")).toBe("12,345 lx");
  expect(metric.measured(0.5, "1")).toBe("0.50");
});

test("a limit of an entered value is written as people read it", () => {
  const [metric, imperial] = [new Units("metric", "es"), new Units("imperial", "en")];
  expect(metric.entered(0.1, metric.speedInput)).toBe("0,4");
  expect(imperial.entered(12, imperial.speedInput)).toBe("26.8");
});

/** An installed Chromium, what each journey needs of it, and what is kept when a journey fails. */
import { mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { chromium } from "playwright-core";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const TAGS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];
const PATIENCE_MS = 120_000;
const SIZES = { desktop: [1280, 800], tablet: [820, 1180], phone: [390, 844] };
/** A journey that judges no pixels: the layout is the same, the map has a quarter of them to draw. */
export const COARSE = { deviceScaleFactor: process.env.PICTURES ? 1 : 0.5 };
/** The map is drawn without a graphics card, the rest of a page without it too, at half the cost;
 * nothing but the edge server is asked. */
const ARGUMENTS = [
  "--no-sandbox", "--disable-gpu-compositing", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage",
  "--disable-background-networking", "--disable-component-update", "--disable-sync",
];

/** Starts the browser that CHROMIUM names. */
export function startBrowser() {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ARGUMENTS,
  });
}

/** Takes a person through the console in a browser profile of their own.
 *
 * Errors of the page fail the journey. A failure keeps a picture and a trace in the folder OUT.
 */
export async function journey(browser, name, act, options = {}) {
  const context = await browser.newContext({
    viewport: { width: 1280, height: 800 }, locale: "en-GB", ...options,
  });
  context.setDefaultTimeout(PATIENCE_MS);
  await context.tracing.start({ snapshots: true });
  const page = await context.newPage();
  const errors = [];
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("console", (message) => {
    if (/Content Security Policy/.test(message.text())) errors.push(message.text());
  });
  try {
    await act(page);
    if (errors.length > 0) throw new Error(`errors of the page:\n${errors.join("\n")}`);
    await context.tracing.stop();
  } catch (error) {
    const folder = process.env.OUT ?? ".";
    mkdirSync(folder, { recursive: true });
    await page.screenshot({ path: join(folder, `${name}.png`), timeout: 20_000 }).catch(() => undefined);
    await context.tracing.stop({ path: join(folder, `${name}-trace.zip`) });
    console.error(`${name}, at ${page.url().replace(/#.*/, "")}:`);
    throw error;
  } finally {
    await context.close();
  }
}

/** Keeps the screen in the folder PICTURES, if it is set, as a desktop, a tablet and a phone show it. */
export async function picture(page, name) {
  const folder = process.env.PICTURES;
  if (!folder) return;
  for (const [size, [width, height]] of Object.entries(SIZES)) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(400);
    await page.screenshot({ path: join(folder, `${name}-${size}.png`) });
  }
  const [width, height] = SIZES.desktop;
  await page.setViewportSize({ width, height });
}

/** Requires that axe finds no violation of WCAG 2.2 AA on the screen as it is. */
export async function requireAccessible(page, screen) {
  // Colours that still move from one state to the other are neither
  await page.waitForFunction(() =>
    document.getAnimations().every((one) => one.effect?.getComputedTiming().endTime === Infinity || one.playState !== "running"));
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(
    (values) => globalThis.axe.run(document, { runOnly: { type: "tag", values } }), TAGS);
  const lines = violations.flatMap(({ id, help, nodes }) =>
    nodes.filter(({ html }) => !isPlacedByTheMap(id, html)).map((node) => `  ${id}: ${help}\n    ${node.html}\n    ${node.failureSummary}`));
  if (lines.length > 0) throw new Error(`axe on ${screen}:\n${lines.join("\n")}`);
  console.log(`axe: nothing on ${screen}`);
}

/** Whether vehicles or corners lie so near to each other that a touch may hit the wrong one.
 *
 * WCAG 2.5.8 exempts targets whose place is the information, as on a map. Steps and pictures have no
 * need of it: they are moved aside, or share a symbol.
 */
function isPlacedByTheMap(rule, html) {
  return rule === "target-size" && html.includes("maplibregl-marker") && !/picture-marker|waypoint-marker/.test(html);
}

/** Holds a button until something shows that it has acted. */
export async function hold(page, button, outcome) {
  await button.hover();
  await page.mouse.down();
  await outcome.first().waitFor();
  await page.mouse.up();
}

/** Waits until a slider is above a value. */
export async function waitUntilAbove(page, slider, value) {
  const element = await slider.elementHandle();
  await page.waitForFunction(([input, low]) => Number(input.value) > low, [element, value]);
}

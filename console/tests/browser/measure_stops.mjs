/** Lands the drone from the STOP dialog, once for each line of the standard input.
 *
 *     LINK=... node tests/browser/measure_stops.mjs
 *
 * LINK signs an operator in. Prints "ready", then for each order the time at which it was given, in
 * ms since 1970: a second after the button was pressed, as long as it has to be held.
 */
import { createInterface } from "node:readline";
import { startBrowser } from "./chromium.mjs";

const HOLD_MS = 1000;
const HELD_MS = HOLD_MS + 200;

const browser = await startBrowser();
try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, locale: "en-GB" });
  const page = await context.newPage();
  await page.addInitScript(() => {
    addEventListener("pointerdown", ({ timeStamp }) => {
      globalThis.pressed_ms = performance.timeOrigin + timeStamp;
    }, { capture: true });
  });
  await page.goto(process.env.LINK);
  const stop = page.getByRole("button", { name: "STOP", exact: true });
  await stop.waitFor();
  console.log("ready");
  for await (const line of createInterface({ input: process.stdin })) {
    if (line === "") break;
    await stop.click();
    await page.getByRole("button", { name: "Land here" }).hover();
    await page.mouse.down();
    await page.waitForTimeout(HELD_MS);
    await page.mouse.up();
    console.log(String((await page.evaluate(() => globalThis.pressed_ms)) + HOLD_MS));
    await page.keyboard.press("Escape");
  }
} finally {
  await browser.close();
}

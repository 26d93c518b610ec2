/** STOP is in reach of pointer and keyboard above every dialog of the console.
 *
 *     node tests/browser/stop_in_dialogs.mjs
 *
 * ADMIN_LINK signs in; DRAFT and FIELD are numbers of a draft and a field, flight 1 has pictures.
 * OUT takes what a failure leaves.
 */
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { ADMIN_LINK, DRAFT, FIELD } = process.env;
const BASE = ADMIN_LINK.split("#")[0];
const SOURCES = new URL("../../src/", import.meta.url).pathname;
const SIZES = [["desktop", 1280, 800], ["tablet", 820, 1180], ["phone", 390, 844], ["phone on its side", 740, 360]];
const button = (page, name) => page.getByRole("button", { name, exact: true });
const LETTER = {
  id: 1, kind: "alarm", vehicle_id: 1, reason: "no such vehicle", rejected_at: "2026-05-01T10:01:00Z",
  report: { vehicle_id: 1, received_at: "2026-05-01T10:00:00Z", description: "a\n".repeat(60) },
};

/** How to open the dialogs that each source file has. */
const DIALOGS = {
  "app/Header.tsx": [["", (page) => page.locator(".header-person").click()]],
  "screens/FieldEditor.tsx": [[`fields/${FIELD}`, (page) => button(page, "Delete").click()]],
  "screens/FieldFileDialog.tsx": [["fields", (page) => button(page, "Upload a file").click()]],
  "screens/UploadDialog.tsx": [["plans", (page) => button(page, "Upload a file").click()]],
  "screens/DownloadDialog.tsx": [[`plans/${DRAFT}`, (page) => button(page, "Download").click()]],
  "screens/PlanView.tsx": [[`plans/${DRAFT}`, (page) => button(page, "Cancel plan").click()]],
  "screens/DispatchDialog.tsx": [
    [`plans/${DRAFT}`, (page) => button(page, "Fly now").click()],
    [`plans/${DRAFT}/edit`, (page) => button(page, "Save and fly").click()],
  ],
  "screens/SurveyDeparture.tsx": [[`fields/${FIELD}/survey`, async (page) => {
    await page.locator(".flight-marker").first().waitFor();
    await button(page, "Fly now").click();
  }]],
  "screens/flight/Gallery.tsx": [["flights/1", (page) => page.locator(".pictures button").nth(1).click()]],
  "controls/ConfirmDialog.tsx": [["system/keys", (page) => page.getByRole("button", { name: /^Revoke: / }).first().click()]],
  "screens/system/NewKey.tsx": [["system/keys", async (page) => {
    await page.getByLabel("Name").fill(`program-${Date.now()}`);
    await button(page, "Make a key").click();
  }]],
  "screens/system/UserDialog.tsx": [["system/users", (page) =>
    page.getByRole("button", { name: "Change the account of" }).first().click()]],
  "screens/system/CorrectDialog.tsx": [["system/dead_letters", async (page) => {
    await page.route("**/dead_letters/**", (route) =>
      route.fulfill({ json: route.request().url().includes("?") ? [LETTER] : LETTER }));
    await page.reload();
    await button(page, "Correct").click();
    await page.getByRole("dialog").locator("textarea").waitFor();
  }]],
};

/** Requires that this walk knows each dialog: one made of anything else could hide STOP. */
function requireAllDialogs() {
  const files = readdirSync(SOURCES, { recursive: true }).filter((path) => path.endsWith(".tsx"));
  const text = (path) => readFileSync(join(SOURCES, path), "utf8");
  const modal = files.filter((path) => /showModal|<dialog|aria-modal/.test(text(path)));
  if (`${modal}` !== "controls/Dialog.tsx") throw new Error(`modal without controls/Dialog.tsx: ${modal}`);
  const present = files.filter((path) => /<Dialog\b/.test(text(path)) && path !== "screens/StopDialog.tsx");
  const unknown = present.filter((path) => !(path in DIALOGS));
  if (unknown.length > 0) throw new Error(`dialogs that this walk does not open: ${unknown}`);
}

/** Requires that a click in the middle of an element reaches it, and that all of it is on the screen. */
async function requireInReach(page, element, where) {
  const inReach = await element.evaluate((one) => {
    const { left, right, top, bottom } = one.getBoundingClientRect();
    const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
    return one.contains(hit) && left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
  });
  if (!inReach) throw new Error(`STOP is not in reach ${where}`);
}

async function stopFromDialog(page, name) {
  const dialog = page.locator("dialog[open]");
  const orders = page.getByRole("dialog", { name: "Stop a flight" });
  const stop = dialog.first().locator(".stop-button");
  await dialog.waitFor();
  await requireAccessible(page, `the dialog of ${name}`);
  await picture(page, `stop-${name.replace(/.*\/|\.tsx/g, "")}`);
  for (const [size, width, height] of SIZES) {
    await page.setViewportSize({ width, height });
    await requireInReach(page, stop, `in ${name} on a ${size}`);
    await dialog.evaluate((one) => one.scrollTo(0, one.scrollHeight));
    await requireInReach(page, stop, `at the end of ${name} on a ${size}`);
  }
  await page.setViewportSize({ width: 1280, height: 800 });
  await stop.click();
  await orders.waitFor();
  await requireInReach(page, orders.getByRole("button", { name: "Land" }), `above ${name}`);
  await page.keyboard.press("Escape");
  await orders.waitFor({ state: "detached" });
  for (let presses = 0; !(await stop.evaluate((one) => one === document.activeElement)); presses += 1) {
    if (presses > 30) throw new Error(`STOP is not in reach of the Tab key in ${name}`);
    await page.keyboard.press("Tab");
  }
  await page.keyboard.press("Enter");
  await orders.waitFor();
  await page.keyboard.press("Escape");
  await orders.waitFor({ state: "detached" });
  await dialog.waitFor();
}

/** A press that begins in a dialog and ends beside it leaves it open; one beside it closes it. */
async function pressBeside(page) {
  await page.goto(BASE);
  await page.locator(".header-person").click();
  const dialog = page.locator("dialog[open]");
  const { x, y, width, height } = await dialog.locator("h2").boundingBox();
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  await page.mouse.move(5, 400);
  await page.mouse.up();
  if (!(await dialog.isVisible())) throw new Error("a press that began inside has closed the dialog");
  await page.mouse.click(5, 400);
  await dialog.waitFor({ state: "detached" });
}

/** The arrow keys change the picture, also after STOP was looked at. */
async function changePicture(page) {
  await page.keyboard.press("ArrowLeft");
  await page.getByRole("dialog", { name: "Picture 1" }).waitFor();
}

/** A link that is pasted into an open page signs in, and is not left in the address. */
async function signInByPastedLink(page) {
  await page.goto(BASE);
  await page.getByLabel("Password").waitFor();
  await page.evaluate((link) => { window.location.href = link; }, ADMIN_LINK);
  await page.locator(".shell").waitFor();
  if (page.url().includes("link=")) throw new Error(`the link is left at ${page.url()}`);
}

/** A busy page learns of press and release at once: the order was held long enough all the same. */
async function stopInABusyPage(page) {
  await page.locator(".header .stop-button").click();
  const orders = page.getByRole("dialog", { name: "Stop a flight" });
  const held = (milliseconds) => orders.getByRole("button", { name: "Land here" }).evaluate((button, duration) => {
    const key = (type) => button.dispatchEvent(new KeyboardEvent(type, { key: "Enter", bubbles: true }));
    key("keydown");
    const end = performance.now() + duration;
    while (performance.now() < end);
    key("keyup");
  }, milliseconds);
  await held(600);
  await page.waitForTimeout(800);
  if (await orders.locator(".stop-orders li").count()) throw new Error("an order was sent after 0.6 s");
  await held(1100);
  await orders.locator(".stop-orders li").first().waitFor();
  await page.keyboard.press("Escape");
}

async function walk(page) {
  await signInByPastedLink(page);
  await stopInABusyPage(page);
  await pressBeside(page);
  for (const [name, ways] of Object.entries(DIALOGS)) {
    for (const [screen, open] of ways) {
      await page.goto(BASE + screen);
      await open(page);
      await stopFromDialog(page, name);
      if (name.endsWith("Gallery.tsx")) await changePicture(page);
      await page.keyboard.press("Escape");
      await page.locator("dialog[open]").waitFor({ state: "detached" });
    }
  }
}

requireAllDialogs();
const browser = await startBrowser();
try {
  await journey(browser, "dialogs", walk);
} finally {
  await browser.close();
}

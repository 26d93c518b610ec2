// Takes pictures of the screens with an installed Chromium: node tests/screens.mjs FOLDER [NAME...]
// CONSOLE_URL names the console, else that of the fixture server; LINK signs in once; THEME and
// LANGUAGE choose the appearance; FLYING and DRAFT are numbers of plans.
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

const [folder = ".", ...names] = process.argv.slice(2);
const BASE = process.env.CONSOLE_URL ?? "http://127.0.0.1:8765/console/";
const SIZES = { desktop: [1280, 800], tablet: [1024, 768], phone: [390, 844] };
const sizes = (process.env.SIZES ?? Object.keys(SIZES).join(",")).split(",");
const SCREENS = {
  fleet: [""],
  stop: ["", (page) => page.click(".stop-button")],
  settings: ["", (page) => page.click(".header-person")],
  fields: ["fields"],
  field: ["fields/1", (page) => page.locator(".corner-marker").first().click()],
  survey: ["fields/1/survey", async (page) => {
    await page.locator(".check input").last().check();
    await page.locator(".split-side").evaluate((side) => side.scrollTo(0, 0));
  }],
  plans: ["plans"],
  plan: [`plans/${process.env.FLYING ?? 1}`],
  editor: [`plans/${process.env.DRAFT ?? 2}/edit`, (page) => page.locator(".step-title").first().click()],
  flights: ["flights"],
  flight: ["flights/1"],
  picture: ["flights/1", (page) => page.locator(".pictures button").first().click()],
  alarms: ["alarms"],
  users: ["system/users"],
  keys: ["system/keys"],
  audit: ["system/audit"],
  rejected: ["system/dead_letters"],
  storage: ["system/storage"],
};
const profile = mkdtempSync(join(tmpdir(), "console-screens-"));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: [
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
  ],
});
browser.setDefaultTimeout(60_000);
const page = await browser.newPage();
page.on("console", (message) => {
  if (["error", "warning"].includes(message.type())) console.log(message.type(), message.text());
});
page.on("pageerror", (error) => console.log("page error", error.message));
const picture = (name, size) => page.screenshot({ path: join(folder, `${name}-${size}.png`) });
try {
  await page.goto(BASE);
  await page.evaluate(([theme, language]) => {
    localStorage.setItem("farm-console", JSON.stringify({ theme, language }));
  }, [process.env.THEME ?? "light", process.env.LANGUAGE ?? "en"]);
  const link = `${BASE}#link=${process.env.LINK ?? "fixture"}`;
  if (names.length === 0 || names.includes("sign_in")) {
    await page.request.delete(new URL("/session/", BASE).href);
    await page.goto(`${BASE}?again`);
    await page.waitForSelector(".sign-in-card");
    for (const size of sizes) {
      await page.setViewportSize({ width: SIZES[size][0], height: SIZES[size][1] });
      await picture("sign_in", size);
    }
  }
  await page.goto("about:blank");
  await page.goto(link);
  await page.waitForSelector(".shell");
  for (const name of names.length === 0 ? Object.keys(SCREENS) : names) {
    if (!(name in SCREENS)) continue;
    const [address, prepare] = SCREENS[name];
    await page.goto(BASE + address);
    await page.waitForSelector("main");
    await page.waitForTimeout(Number(process.env.WAIT_MS ?? 4000));
    await prepare?.(page);
    for (const size of sizes) {
      await page.setViewportSize({ width: SIZES[size][0], height: SIZES[size][1] });
      await page.waitForTimeout(700);
      await picture(name, size);
    }
  }
} finally {
  await browser.close();
  rmSync(profile, { recursive: true, force: true });
}

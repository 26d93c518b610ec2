/** Every screen of the console, in each theme: axe finds nothing, and it fits a phone.
 *
 *     node tests/browser/all_screens.mjs
 *
 * ADMIN_LINK signs in; DRAFT and FIELD are numbers of a draft and a field; OUT takes what a failure leaves.
 */
import { journey, requireAccessible, startBrowser } from "./chromium.mjs";

const { ADMIN_LINK, DRAFT, FIELD } = process.env;
const BASE = ADMIN_LINK.split("#")[0];
const SCREENS = [
  "", "fields", "fields/new", `fields/${FIELD}`, `fields/${FIELD}/survey`, "plans",
  `plans/${DRAFT}`, "plans/new", `plans/${DRAFT}/edit`, "flights", "alarms",
  "system/users", "system/sessions", "system/keys", "system/audit", "system/dead_letters", "system/storage", "system/backups",
  "nowhere", "flights/999999",
];
const APPEARANCES = [["light", "desktop"], ["dark", "phone"], ["outdoor", "phone"]];
const SIZES = { desktop: { width: 1280, height: 800 }, phone: { width: 390, height: 844 } };

async function settled(page) {
  await page.locator("main :is(h1, h2)").first().waitFor({ state: "attached" });
  await page.waitForFunction(() => !document.querySelector(".skeleton"));
}

async function lookAtAll(page) {
  await page.goto(BASE);
  await page.locator(".sign-in-card").waitFor();
  await requireAccessible(page, "the sign-in");
  await page.goto("about:blank");
  await page.goto(ADMIN_LINK);
  await page.locator(".shell").waitFor();
  for (const [theme, size] of APPEARANCES) {
    await page.evaluate((chosen) => {
      localStorage.setItem("farm-console", JSON.stringify({ theme: chosen, language: "en" }));
    }, theme);
    await page.setViewportSize(SIZES[size]);
    for (const screen of SCREENS) {
      const name = `${screen || "fleet"} in ${theme} on a ${size}`;
      await page.goto(BASE + screen);
      await settled(page);
      if (screen.endsWith("/edit")) await page.locator(".step-title").first().click();
      await requireAccessible(page, name);
      const isWide = await page.evaluate(
        () => document.documentElement.scrollWidth > document.documentElement.clientWidth);
      if (isWide) throw new Error(`wider than the screen: ${name}`);
    }
    await page.locator(".header-person").click();
    await requireAccessible(page, `the settings in ${theme} on a ${size}`);
  }
}

const browser = await startBrowser();
try {
  await journey(browser, "admin", lookAtAll);
} finally {
  await browser.close();
}

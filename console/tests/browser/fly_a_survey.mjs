/** An operator flies a survey of two drones out of its screen: one at once, one held.
 *
 *     node tests/browser/fly_a_survey.mjs
 *
 * ANA_LINK signs the operator in, FIELD is the field. OUT takes what a failure leaves.
 */
import { hold, journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, FIELD } = process.env;
const origin = new URL(ANA_LINK).origin;

async function flySurvey(page) {
  await page.goto(`${origin}/console/fields/${FIELD}/survey`);
  await page.locator(".flight-marker").first().waitFor();
  await page.getByRole("checkbox", { name: "Drone 2" }).check();
  await page.locator(".flight-marker", { hasText: "Drone 2" }).first().waitFor();
  const fly = page.getByRole("button", { name: "Fly now" });
  await fly.click();
  const dialog = page.getByRole("dialog", { name: "Fly the survey" });
  await dialog.getByText("Every point lies inside the fence or the field").first().waitFor();
  const near = dialog.getByRole("listitem").filter({ hasText: "Stands where the plan takes off" });
  const found = await near.allInnerTexts();
  if (found.length !== 2 || !found.every((text) => /Good$/.test(text))) throw new Error(`the checks of both drones: ${found}`);
  const second = dialog.getByRole("group", { name: "Drone 2: when" });
  await second.getByRole("radio", { name: "Hold" }).check();
  await requireAccessible(page, "the departure of a survey");
  await picture(page, "departure");
  await hold(page, dialog.getByRole("button", { name: "Fly now" }),
    page.getByRole("heading", { level: 1, name: /vehicle 1$/ }));
  await page.getByText("Waiting", { exact: true }).first().waitFor();
}

const browser = await startBrowser();
try {
  await journey(browser, "departure", async (page) => {
    await page.goto(ANA_LINK);
    await page.getByRole("navigation").waitFor();
    await flySurvey(page);
  });
} finally {
  await browser.close();
}

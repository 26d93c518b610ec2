/** A farmer draws a field, looks at a survey of it, and makes the plan.
 *
 *     node tests/browser/plan_a_field.mjs
 *
 * PLANNER_LINK signs the farmer in, OUT takes what a failure leaves.
 */
import { journey, requireAccessible, startBrowser } from "./chromium.mjs";

const { PLANNER_LINK } = process.env;
const NAME = "Olive grove";
const BOUNDARY = [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]];
const NO_FLY_AREA = [[0.4, 0.3], [0.5, 0.3], [0.45, 0.4]];

/** Clicks the map at parts of its width and height. */
async function draw(page, corners) {
  const { x, y, width, height } = await page.locator(".farm-map-canvas").boundingBox();
  const present = await page.locator(".corner-marker").count();
  for (const [index, [right, down]] of corners.entries()) {
    await page.mouse.click(x + width * right, y + height * down);
    await page.locator(".corner-marker").nth(present + index).waitFor();
  }
}

async function drawField(page) {
  await page.getByRole("navigation").getByRole("link", { name: "Fields" }).click();
  await page.getByText("No fields yet").waitFor();
  await page.getByRole("button", { name: "New field" }).click();
  await page.getByLabel("Name").fill(NAME);
  await page.locator(".map-tools").waitFor();
  await draw(page, BOUNDARY);
  const corner = page.getByRole("button", { name: "Corner 2", exact: true });
  await corner.click();
  const latitude = page.getByLabel("Latitude");
  const before = await latitude.inputValue();
  await corner.press("Shift+ArrowUp");
  await page.waitForFunction(([input, old]) => input.value > old, [await latitude.elementHandle(), before]);
  await page.getByRole("button", { name: "Add a corner after corner 1" }).click();
  await page.getByText(/^5 corners/).waitFor();
  await page.getByRole("button", { name: "Undo" }).click();
  await page.getByText(/^4 corners/).waitFor();
  await page.getByRole("button", { name: "Add a no-fly area" }).click();
  await page.locator(".corner-marker").first().waitFor({ state: "detached" });
  await draw(page, NO_FLY_AREA);
  await requireAccessible(page, "a field that is drawn");
  await page.getByRole("button", { name: "Save the field" }).click();
  await page.getByRole("link", { name: NAME, exact: false }).first().waitFor();
  await requireAccessible(page, "the fields");
}

async function planSurvey(page) {
  await page.getByRole("link", { name: `Survey of ${NAME}` }).click();
  const pictures = page.locator(".survey-figures div", { hasText: "Pictures" }).locator("dd");
  const shown = async (differsFrom) => {
    const element = await pictures.elementHandle();
    await page.waitForFunction(
      ([figure, other]) => Number(figure.textContent) > 0 && figure.textContent !== other,
      [element, differsFrom]);
    return pictures.textContent();
  };
  const first = await shown(null);
  await page.getByLabel("Height").fill("40");
  const second = await shown(first);
  if (Number(second) >= Number(first)) throw new Error(`more pictures from higher: ${first}, ${second}`);
  await requireAccessible(page, "a survey");
  await page.getByRole("button", { name: "Make the plan" }).click();
  await page.getByRole("heading", { name: `${NAME} 1` }).waitFor();
  await page.getByText("Draft", { exact: true }).first().waitFor();
}

const browser = await startBrowser();
try {
  await journey(browser, "planner", async (page) => {
    await page.goto(PLANNER_LINK);
    await drawField(page);
    await planSurvey(page);
  });
} finally {
  await browser.close();
}

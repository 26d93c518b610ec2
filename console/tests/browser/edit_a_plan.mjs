/** An operator edits a draft in the editor and flies it from there.
 *
 *     node tests/browser/edit_a_plan.mjs
 *
 * ANA_LINK signs the operator in; DRAFT is the plan. OUT takes what a failure leaves.
 */
import { COARSE, hold, journey, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, DRAFT } = process.env;
const origin = new URL(ANA_LINK).origin;
const button = (page, text) => page.getByRole("button", { name: text, exact: true });
const stateOf = (page) =>
  page.evaluate(async (id) => (await (await fetch(`/plans/${id}`)).json()).missions[0].dispatch_state, DRAFT);

async function openEditor(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  await page.getByLabel("Name", { exact: true }).waitFor();
}

/** One click flies nothing: the checklist comes first, and the button is held. */
async function saveAndFly(page) {
  await openEditor(page);
  await page.getByLabel("Name", { exact: true }).fill("Flown from the editor");
  await button(page, "Save and fly").click();
  const dialog = page.getByRole("dialog", { name: "Fly now" });
  await dialog.getByText("Wind within the drone’s limit").waitFor();
  await requireAccessible(page, "the dispatch from the editor");
  await dialog.getByRole("button", { name: "Fly now" }).click();
  if ((await stateOf(page)) !== "held") throw new Error("the plan was dispatched by a click");
  await page.keyboard.press("Escape");
  await page.getByRole("heading", { name: "Flown from the editor" }).waitFor();

  await openEditor(page);
  await button(page, "Save and fly").click();
  await hold(page, dialog.getByRole("button", { name: "Fly now" }), page.locator(".timeline"));
  if ((await stateOf(page)) !== "queued") throw new Error("the plan was not dispatched");
}

/** A step of each kind as it is added is accepted; a landing ends the flight, so it is left out. */
async function addEachKind(page) {
  await page.goto(`${origin}/console/plans/new`);
  await page.locator(".farm-map canvas").click();
  const kinds = page.getByLabel("Add a step");
  const names = await kinds.locator("option:not([disabled])").allInnerTexts();
  if (names.length !== 11) throw new Error(`there are ${names.length} kinds of steps`);
  for (const name of names.filter((one) => !/^(Take off|Land|Return home)/.test(one))) {
    await kinds.selectOption({ label: name });
  }
  await button(page, "Save draft").click();
  await page.locator(".timeline li").nth(9).waitFor();
}

const browser = await startBrowser();
try {
  await journey(browser, "edit-a-plan", async (page) => {
    await page.goto(ANA_LINK);
    await page.getByRole("navigation").waitFor();
    await addEachKind(page);
    await saveAndFly(page);
  }, COARSE);
} finally {
  await browser.close();
}

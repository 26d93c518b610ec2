/** An operator gives a draft a second drone, corrects what is refused, edits both missions,
 * and keeps what was not saved when the plan is deleted.
 *
 *     node tests/browser/edit_two_drones.mjs
 *
 * ANA_LINK signs the operator in; DRAFT is the plan of drone 1. OUT takes what a failure leaves.
 */
import { journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, DRAFT } = process.env;
const origin = new URL(ANA_LINK).origin;
const button = (page, text) => page.getByRole("button", { name: text, exact: true });
const missionOf = (page, drone) => page.getByRole("radio", { name: new RegExp(`^Drone ${drone}\\b`) });

async function openEditor(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  await page.getByLabel("Name", { exact: true }).waitFor();
}

async function save(page) {
  await button(page, "Save draft").click();
  await page.locator(".timeline").first().waitFor();
}

async function addDrone(page) {
  await openEditor(page);
  await button(page, "Add a drone").click();
  await missionOf(page, 2).waitFor();
  if (await button(page, "Save draft").isEnabled()) throw new Error("a mission without a step can be saved");
  await page.locator(".farm-map canvas").click({ position: { x: 200, y: 150 } });
  await page.locator(".step-title").nth(1).waitFor();
  // The server's fault leads to the mission that has it
  const drone = page.getByLabel("Drone", { exact: true });
  await drone.selectOption({ label: "Drone 1" });
  await button(page, "Save draft").click();
  await page.locator(".notice-error").waitFor();
  await requireAccessible(page, "a plan with a drone twice");
  await drone.selectOption({ label: "Drone 2" });
  await save(page);
}

async function editBoth(page) {
  await openEditor(page);
  await missionOf(page, 2).check();
  await page.getByLabel("Maximum speed (km/h)").fill("7.2");
  await missionOf(page, 1).check();
  await page.getByLabel("Maximum speed (km/h)").fill("10.8");
  await requireAccessible(page, "the mission of one of two drones");
  await picture(page, "two-drones");
  await saveSlowly(page);
}

/** What is entered while the plan is being saved would be lost: nothing can be. */
async function saveSlowly(page) {
  let answer;
  const isHeld = new Promise((resolve) => { answer = resolve; });
  await page.route(`**/plans/${DRAFT}`, async (route) => {
    if (route.request().method() === "PUT") await isHeld;
    await route.continue();
  });
  await button(page, "Save draft").click();
  await page.locator(".split[inert]").waitFor({ state: "attached" });
  await page.keyboard.press("Control+z");
  answer();
  await page.locator(".timeline").first().waitFor();
  await page.unroute(`**/plans/${DRAFT}`);
}

/** The server stores the plan and its answer is lost: the same content is no other person's. */
async function saveOverALostAnswer(page) {
  await openEditor(page);
  await page.getByLabel("Name", { exact: true }).fill("Two drones  ");
  await page.route(`**/plans/${DRAFT}`, async (route) => {
    if (route.request().method() !== "PUT") return route.continue();
    await route.fetch();
    return route.abort();
  });
  await button(page, "Save draft").click();
  await page.locator(".notice-error").waitFor();
  await page.unroute(`**/plans/${DRAFT}`);
  await save(page);
}

/** A step back brings a drone back that was removed. */
async function removeAndUndo(page) {
  await openEditor(page);
  await missionOf(page, 2).check();
  await button(page, "Remove drone 2").click();
  await missionOf(page, 2).waitFor({ state: "detached" });
  // The button is gone: the keys go on from the one beside it
  const focused = await page.evaluate(() => document.activeElement?.textContent);
  if (focused !== "Add a drone") throw new Error(`the focus is at ${focused}`);
  await button(page, "Undo").click();
  await missionOf(page, 2).waitFor();
}

/** Somebody deletes the plan meanwhile: what was not saved becomes a plan of its own. */
async function keepDraft(page) {
  await openEditor(page);
  await page.getByLabel("Name", { exact: true }).fill("Kept");
  const status = await page.evaluate(async (id) => {
    const { csrf_token: token } = await (await fetch("/session/")).json();
    return (await fetch(`/plans/${id}`, { method: "DELETE", headers: { "X-CSRF-Token": token } })).status;
  }, DRAFT);
  if (status !== 204) throw new Error(`the plan cannot be deleted: ${status}`);
  await page.reload();
  await page.getByText("This browser has changes of yours").waitFor();
  await requireAccessible(page, "a draft of a plan that is gone");
  await button(page, "Save mine as a copy").click();
  await page.waitForFunction(() => document.querySelector(".split input")?.value === "Kept (copy)");
}

const browser = await startBrowser();
try {
  await journey(browser, "two-drones", async (page) => {
    await page.goto(ANA_LINK);
    await page.getByRole("navigation").waitFor();
    await addDrone(page);
    await editBoth(page);
    await saveOverALostAnswer(page);
    await removeAndUndo(page);
    await keepDraft(page);
  });
} finally {
  await browser.close();
}

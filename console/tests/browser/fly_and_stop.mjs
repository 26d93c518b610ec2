/** A farmer uploads a plan and may not fly it; an operator flies it, stops it, replays it and
 * looks at its picture.
 *
 *     node tests/browser/fly_and_stop.mjs
 *
 * FARMER_LINK and OPERATOR_LINK sign each in, PLAN is the file, OUT takes what a failure leaves.
 */
import { COARSE, hold, journey, picture, requireAccessible, startBrowser, waitUntilAbove } from "./chromium.mjs";

const { FARMER_LINK, OPERATOR_LINK, PLAN } = process.env;
const NAME = "Stopped on its way";
const WATCHED_MS = 2_000;
/** Of a status, in the meantime. */
const CHANGES_AT_MOST = 1;
const screenLink = (page, name) => page.getByRole("navigation").getByRole("link", { name });

async function uploadAsFarmer(page) {
  await page.goto(FARMER_LINK);
  await screenLink(page, "Plans").click();
  await page.getByRole("button", { name: "Upload a file" }).click();
  await page.locator("input[type=file]").setInputFiles(PLAN);
  await requireAccessible(page, "the upload");
  await page.getByRole("dialog").getByRole("button", { name: "Upload a file" }).click();
  await page.getByRole("heading", { name: NAME }).waitFor();
  await page.getByText("Only an operator may dispatch or cancel this plan.").waitFor();
  if (await page.getByRole("button", { name: "Fly now" }).count()) {
    throw new Error("a farmer is offered to fly");
  }
  // What the page does not offer, the edge server refuses too
  const refusal = await page.evaluate(async () => {
    const { csrf_token: token } = await (await fetch("/session/")).json();
    const id = location.pathname.split("/").at(-1);
    const headers = { "X-CSRF-Token": token };
    const answer = await fetch(`/plans/${id}/dispatch`, { method: "POST", headers });
    return { status: answer.status, ...(await answer.json()) };
  });
  if (refusal.status !== 403 || !refusal.message.includes("farmer")) {
    throw new Error(`a farmer's dispatch: ${JSON.stringify(refusal)}`);
  }
  await requireAccessible(page, "the plan of a farmer");
  await screenLink(page, "System").waitFor({ state: "detached" });
}

/** The live picture comes through the edge server, changes, and ends when it is hidden. */
async function lookAtLivePicture(page) {
  await page.getByRole("button", { name: "Live picture" }).click();
  const image = await page.getByRole("img", { name: "Live picture of drone 1" }).elementHandle();
  await page.waitForFunction((one) => one.naturalWidth > 0, image);
  const frame = () => page.evaluate((one) => {
    const canvas = new OffscreenCanvas(64, 48).getContext("2d");
    canvas.drawImage(one, 0, 0, 64, 48);
    return canvas.getImageData(0, 0, 64, 48).data.join();
  }, image);
  if (new Set((await frame()).split(",")).size < 8) throw new Error("the live picture is empty");
}

/** Counts what the map's worker is given, by the name of its source. */
function countDrawings() {
  globalThis.drawings = {};
  const post = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (message, ...more) {
    const name = message?.data?.source;
    if (name !== undefined) globalThis.drawings[name] = (globalThis.drawings[name] ?? 0) + 1;
    return post.call(this, message, ...more);
  };
}

/** States of the drone come all the time; what they do not change is not drawn again. */
async function requireRestingMap(page) {
  await page.evaluate(() => { globalThis.drawings = {}; });
  await page.waitForTimeout(WATCHED_MS);
  const drawings = await page.evaluate(() => globalThis.drawings);
  for (const name of ["fields", "routes"]) {
    if ((drawings[name] ?? 0) > CHANGES_AT_MOST) {
      throw new Error(`${name} were drawn again without a change: ${JSON.stringify(drawings)}`);
    }
  }
}

/** The order is followed to its end, and the page leads to the flight with the times of its steps. */
async function changeSpeed(page) {
  await page.getByRole("button", { name: "Change the speed" }).click();
  const speed = page.getByLabel("Maximum speed (km/h)");
  await speed.fill("90");
  await page.getByText("Allowed: 0.4 to 43.2").waitFor();
  if (await page.getByRole("button", { name: "Change", exact: true }).isEnabled()) {
    throw new Error("a speed above the limit can be ordered");
  }
  await speed.fill("7.2");
  await page.getByRole("button", { name: "Change", exact: true }).click();
  await page.locator(".speed-outcome").getByText("Done", { exact: true }).waitFor();
  await page.getByText(/^Ordered maximum speed: 7.2 km\/h, since \d+:\d\d:\d\d/).waitFor();
  await page.getByText("(planned: ").waitFor();
  await page.getByRole("link", { name: /^Flight / }).waitFor();
  await page.locator(".timeline li:nth-child(3) .flown-times").waitFor();
}

async function flyAndStop(page) {
  await page.addInitScript(countDrawings);
  await page.goto(OPERATOR_LINK);
  const drone = page.getByRole("article", { name: "Drone 1" });
  await drone.getByText("Ready", { exact: true }).waitFor();
  await requireAccessible(page, "the fleet");

  await screenLink(page, "Plans").click();
  await page.getByRole("link", { name: NAME }).waitFor();
  await requireAccessible(page, "the plans");
  await page.getByRole("link", { name: NAME }).click();
  await page.getByRole("button", { name: "Fly now" }).click();
  const dialog = page.getByRole("dialog");
  await requireAccessible(page, "the dispatch");
  await hold(page, dialog.getByRole("button", { name: "Fly now" }),
    page.getByText("With the drone").or(page.locator("[data-status='2']")));
  await page.locator(".timeline li:nth-child(3)[data-status='2']").waitFor();
  await changeSpeed(page);
  await lookAtLivePicture(page);
  await requireAccessible(page, "a plan in flight");
  await picture(page, "live-picture");

  await screenLink(page, "Fleet").click();
  await drone.getByText("On mission", { exact: true }).waitFor();
  await requireAccessible(page, "the fleet in flight");
  await requireRestingMap(page);
  const size = page.viewportSize();
  await page.setViewportSize({ width: 390, height: 664 });
  await page.getByRole("button", { name: "STOP", exact: true }).click();
  await requireAccessible(page, "the stop");
  const orders = page.locator(".stop-orders li");
  for (const [index, name] of [/Pause here/, /Fly on/, /Land here/].entries()) {
    const order = orders.nth(index);  // The newest one comes first, so that many exist
    await hold(page, dialog.getByRole("button", { name }), order);
    await orders.first().getByText("Done", { exact: true }).waitFor();
    await page.waitForFunction(() => {
      const { top, bottom } = document.querySelector(".stop-orders li").getBoundingClientRect();
      return top >= 0 && bottom <= innerHeight;
    });
  }
  await requireAccessible(page, "the stop that was done");
  await dialog.getByRole("button", { name: "Close" }).last().click();
  await page.setViewportSize(size);
  await drone.getByText("Ready", { exact: true }).waitFor();
}

/** The picture of the flight opens in its full size. */
async function lookAtPicture(page) {
  await page.locator(".pictures button").first().click();
  const full = page.getByRole("dialog").locator("img");
  const element = await full.elementHandle();
  await page.waitForFunction((one) => one.naturalWidth > 320, element);
  await requireAccessible(page, "a picture of the flight");
}

async function lookBack(page) {
  await screenLink(page, "Flights").click();
  await page.locator(".rows").getByText("Aborted").waitFor();
  await requireAccessible(page, "the flights");
  await page.getByRole("link", { name: /^Flight / }).click();
  await page.getByRole("button", { name: "Replay" }).click();
  const slider = page.getByRole("slider");
  await waitUntilAbove(page, slider, 0.05);
  await page.getByRole("button", { name: "Pause" }).click();
  await page.locator(".timeline [aria-current='step']").waitFor();
  await requireAccessible(page, "a flight");
  await lookAtPicture(page);
}

const browser = await startBrowser();
try {
  await journey(browser, "farmer", uploadAsFarmer, COARSE);
  await journey(browser, "operator", async (page) => {
    await flyAndStop(page);
    await lookBack(page);
  }, COARSE);
} finally {
  await browser.close();
}

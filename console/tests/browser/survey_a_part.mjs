/** An operator surveys a part of a field: its corners are dragged, moved by keys, and entered.
 *
 *     node tests/browser/survey_a_part.mjs
 *
 * ANA_LINK signs the person in, FIELD is a rectangle. OUT takes what a failure leaves.
 */
import { COARSE, journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, FIELD } = process.env;
const origin = new URL(ANA_LINK).origin;
const button = (page, text) => page.getByRole("button", { name: text, exact: true });
const corner = (page, number) => button(page, `Corner ${number}`);
const figure = (page, name) => page.locator(".survey-figures div", { hasText: name }).locator("dd");
const isIdle = (page) => page.locator('section[aria-busy="false"] > .survey-figures').waitFor();
const whole = (page) => page.getByText("The whole field is covered.").waitFor();
const part = (page) => page.getByText(/^Only a part of the field is covered/).waitFor();

/** Waits until a figure is there and another one than before. */
async function changed(page, name, before) {
  const element = await figure(page, name).elementHandle();
  await page.waitForFunction(([shown, old]) => shown.textContent !== "–" && shown.textContent !== old, [element, before]);
  return figure(page, name).textContent();
}

/** Figures and lines follow before the corner is let go, with few requests. */
async function dragCorner(page) {
  let requests = 0;
  page.on("request", (request) => {
    if (request.url().endsWith("/surveys/?preview=true")) requests += 1;
  });
  const before = await figure(page, "Area").textContent();
  const first = await page.locator(".flight-marker").first().boundingBox();
  const { x, y, width, height } = await corner(page, 1).boundingBox();
  const opposite = await corner(page, 3).boundingBox();
  const steps = 25;
  await button(page, "Make the plan").scrollIntoViewIfNeeded();
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  const begun = Date.now();
  for (let step = 1; step <= steps; step += 1) {
    const share = (0.5 * step) / steps;
    await page.mouse.move(
      x + width / 2 + (opposite.x - x) * share, y + height / 2 + (opposite.y - y) * share * 0.4);
    await page.waitForTimeout(20);
  }
  const took_ms = Date.now() - begun;
  const midway = await changed(page, "Area", before);
  const asked = requests;
  if (asked < 2 || asked > 2 + took_ms / 200) throw new Error(`${asked} previews in ${took_ms} ms`);
  const shown = await figure(page, "Area").boundingBox();
  const side = await page.locator(".split-side").boundingBox();
  if (shown.y < side.y) throw new Error("the figures are scrolled away while a corner is dragged");
  await page.mouse.up();
  await isIdle(page);
  const last = await page.locator(".flight-marker").first().boundingBox();
  if (Math.hypot(last.x - first.x, last.y - first.y) < 5) throw new Error("the lines have not moved");
  console.log(`${asked} previews in ${took_ms} ms, area ${before}, ${midway}, ${await figure(page, "Area").textContent()}`);
  await part(page);
}

async function stepBackAndForward(page) {
  await button(page, "Undo").click();
  await whole(page);
  await button(page, "Redo").click();
  await part(page);
  await button(page, "Cover the whole field").click();
  await whole(page);
  await button(page, "Undo").click();
  await part(page);
  await isIdle(page);
}

async function moveByKeysAndNumbers(page) {
  await corner(page, 3).click();
  const latitude = page.getByLabel("Latitude");
  const before = await latitude.inputValue();
  // A preview of the step before may still be on its way
  const moved = (one) =>
    one.url().endsWith("/surveys/?preview=true") && String(one.postDataJSON().area?.[2][0]) < before;
  await Promise.all([page.waitForRequest(moved), corner(page, 3).press("Shift+ArrowDown")]);
  await page.waitForFunction(([input, old]) => input.value < old, [await latitude.elementHandle(), before]);
  await isIdle(page);
  await latitude.fill(String(Number(before) + 0.001));
  await page.locator("li", { hasText: /^Corner 3: is \d+ m outside of the field/ }).waitFor();
  await page.locator(".map-hint", { hasText: /^Corner 3: is \d+ m outside of the field/ }).waitFor();
  await page.locator(".corner-marker.has-error").waitFor();
  if (await button(page, "Make the plan").isEnabled()) throw new Error("an area outside of the field becomes a plan");
  await requireAccessible(page, "an area that leaves its field");
  await picture(page, "part-outside");
  await latitude.fill(before);
  await page.locator(".corner-marker.has-error").waitFor({ state: "detached" });
  await isIdle(page);
}

/** The area is there again after a reload; its field has not changed. */
async function keptArea(page) {
  await page.reload();
  await part(page);
  await page.locator(".flight-marker").first().waitFor();
  await isIdle(page);
  await page.waitForTimeout(500);
  await requireAccessible(page, "a survey of a part");
  await picture(page, "part");
}

const browser = await startBrowser();
try {
  await journey(browser, "part", async (page) => {
    await page.goto(ANA_LINK);
    await page.getByRole("navigation").waitFor();
    await page.goto(`${origin}/console/fields/${FIELD}/survey`);
    await page.locator(".flight-marker").first().waitFor();
    await corner(page, 4).waitFor();
    await whole(page);
    await isIdle(page);
    await dragCorner(page);
    await stepBackAndForward(page);
    await moveByKeysAndNumbers(page);
    await keptArea(page);
    await button(page, "Make the plan").click();
    await page.getByText("Draft", { exact: true }).first().waitFor();
  }, COARSE);
} finally {
  await browser.close();
}

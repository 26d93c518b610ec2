/** An operator looks back at a flight: its pictures, measurements, log and maps.
 *
 *     node tests/browser/look_back.mjs
 *
 * OPERATOR_LINK signs in; flight 1 has three pictures; OUT takes what a failure leaves.
 */
import { journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { OPERATOR_LINK } = process.env;
const BASE = OPERATOR_LINK.split("#")[0];
/** Small pictures in the list and beside a place of the map, and no large one before it is opened. */
async function requireThumbnails(page) {
  const small = page.locator(".pictures button");
  const asked = [];
  page.on("request", (request) => asked.push(new URL(request.url()).pathname));
  page.on("response", (response) => {
    if (response.status() === 429) throw new Error(`refused: ${response.url()}`);
  });
  await small.first().scrollIntoViewIfNeeded();
  await page.waitForFunction(() => {
    const pictures = [...document.querySelectorAll(".pictures img")];
    return pictures.length === 3 && pictures.every((one) => one.naturalWidth === 320);
  });
  await page.locator(".picture-marker").first().hover();
  await page.locator(".picture-marker img").first().waitFor();
  const large = asked.filter((path) => /\/pictures\/\d+$/.test(path));
  if (large.length > 0) throw new Error(`asked for large pictures: ${large}`);
}

/** A measurement shows its value and its time on the map, below which a legend gives the colours. */
async function readMeasurements(page) {
  const row = page.locator(".measurements tbody tr").last();
  const [time, , value] = await row.locator("td").allInnerTexts();
  await row.getByRole("button").click();
  await page.locator(".value-marker", { hasText: `${value.trim()} · ${time.trim()}` }).waitFor();
  const map = page.getByRole("region", { name: "Track" });
  await map.getByText("Temperature", { exact: true }).waitFor();
  await requireAccessible(page, "a measurement on the map");
}

/** The drone's own log is shown with its size, and downloaded as it was sent. */
async function downloadLog(page) {
  const link = page.getByRole("link", { name: /^ULog of the drone, .*MiB$/ });
  await link.scrollIntoViewIfNeeded();
  const [download] = await Promise.all([page.waitForEvent("download"), link.click()]);
  if (!/^flight-1-vehicle-1-.*\.ulg$/.test(download.suggestedFilename())) throw new Error(download.suggestedFilename());
  const chunks = [];
  for await (const chunk of await download.createReadStream()) chunks.push(chunk);
  const log = Buffer.concat(chunks);
  if (log.length !== 100_000 || log.subarray(0, 4).toString() !== "ULog") throw new Error(`a log of ${log.length} bytes`);
  await picture(page, "flight-log");
}

/** How many pixels of the map are nearly of a colour. */
async function countPixels(page, map, colour) {
  const picture = (await map.screenshot()).toString("base64");
  return page.evaluate(async ([data, [red, green, blue]]) => {
    const bytes = Uint8Array.from(atob(data), (one) => one.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    canvas.drawImage(bitmap, 0, 0);
    const pixels = canvas.getImageData(0, 0, bitmap.width, bitmap.height).data;
    let count = 0;
    for (let at = 0; at < pixels.length; at += 4) {
      const differences = [pixels[at] - red, pixels[at + 1] - green, pixels[at + 2] - blue];
      if (differences.every((one) => Math.abs(one) < 12)) count += 1;
    }
    return count;
  }, [picture, colour]);
}

/** The pictures that look down lie on the ground that they show. */
async function showPicturesOnMap(page) {
  const map = page.getByRole("region", { name: "Track" });
  await page.getByLabel("Show 3 pictures on the map").check();
  const last = [120, 120, 60];
  for (let attempt = 0; await countPixels(page, map, last) < 10_000; attempt += 1) {
    if (attempt > 60) throw new Error("the pictures are not on the map");
    await page.waitForTimeout(500);
  }
  await page.getByLabel("Opacity of the pictures").waitFor();
  await requireAccessible(page, "pictures on the map");
  await page.getByLabel("Show 3 pictures on the map").uncheck();
  for (let attempt = 0; await countPixels(page, map, last) > 1_000; attempt += 1) {
    if (attempt > 60) throw new Error("the pictures stay on the map");
    await page.waitForTimeout(500);
  }
}

/** The edge server makes one map of the pictures, in which each has its own part of the ground. */
async function showSurveyMap(page) {
  const map = page.getByRole("region", { name: "Track" });
  const [first, last] = [[0, 120, 60], [120, 120, 60]];
  await page.getByRole("button", { name: "Make the map" }).click();
  const show = page.getByLabel("Show the map of the survey");
  await show.check();
  for (const colour of [first, last]) {
    for (let attempt = 0; await countPixels(page, map, colour) < 3_000; attempt += 1) {
      if (attempt > 60) throw new Error(`the map of the survey does not show ${colour}`);
      await page.waitForTimeout(500);
    }
  }
  await page.getByLabel("Opacity of the map of the survey").waitFor();
  await requireAccessible(page, "the map of a survey");
  await picture(page, "survey-map");
  await show.uncheck();
  for (let attempt = 0; await countPixels(page, map, first) > 1_000; attempt += 1) {
    if (attempt > 60) throw new Error("the map of the survey stays");
    await page.waitForTimeout(500);
  }
}

/** The map takes the colours of a theme at once. */
async function changeTheme(page) {
  const map = page.getByRole("region", { name: "Track" });
  for (const [theme, ground] of [["Dark", [19, 26, 22]], ["Light", [238, 241, 234]]]) {
    await chooseTheme(page, theme);
    for (let attempt = 0; await countPixels(page, map, ground) < 10_000; attempt += 1) {
      if (attempt > 60) throw new Error(`the map does not take the theme ${theme}`);
      await page.waitForTimeout(500);
    }
  }
}

async function chooseTheme(page, theme) {
  await page.locator(".header-person").click();
  await page.getByRole("radio", { name: theme }).or(page.getByRole("button", { name: theme })).first().click();
  await page.keyboard.press("Escape");
}

/** A base map is drawn below the track, also in another theme and after a reload. */
async function showBaseMap(page) {
  const map = page.getByRole("region", { name: "Track" });
  const isDrawn = async (when, colour = [200, 80, 160]) => {
    for (let attempt = 0; attempt < 60; attempt += 1) {
      if (await countPixels(page, map, colour) > 10_000) return;
      await page.waitForTimeout(500);
    }
    throw new Error(`the base map is not drawn ${when}`);
  };
  await map.getByRole("button", { name: "Base maps" }).click();
  await map.getByText("it is not a PMTiles archive").waitFor();
  await requireAccessible(page, "the base maps");
  await map.getByLabel("Aerial", { exact: true }).check();
  await map.getByLabel("Opacity of Aerial").waitFor();
  await isDrawn("at first");
  await map.getByLabel("North", { exact: true }).check();
  await map.getByText("Vegetation (NDVI)").waitFor();
  await isDrawn("of the vegetation", [26, 152, 80]);
  await requireAccessible(page, "a map of the vegetation");
  await map.getByLabel("North", { exact: true }).uncheck();
  await map.getByLabel("Lake", { exact: true }).check();
  await isDrawn("of vector tiles", [156, 196, 221]);
  await map.getByLabel("Lake", { exact: true }).uncheck();
  await isDrawn("without the vegetation");
  // Chosen later than what lies below and above them
  const surveyed = [0, 120, 60];
  await map.getByLabel(/^Survey of flight 1 \(Drone 1/).check();
  for (let attempt = 0; await countPixels(page, map, surveyed) < 3_000; attempt += 1) {
    if (attempt > 60) throw new Error("the survey is not drawn above the tiles");
    await page.waitForTimeout(500);
  }
  await map.getByLabel("Aerial", { exact: true }).uncheck();
  await map.getByLabel("Aerial", { exact: true }).check();
  await isDrawn("below the survey");
  if (await countPixels(page, map, surveyed) < 3_000) throw new Error("tiles cover the survey");
  await requireAccessible(page, "a survey as a base map");
  await map.getByLabel(/^Survey of flight 1 \(Drone 1/).uncheck();
  await page.evaluate(() => localStorage.setItem("farm-console", JSON.stringify({ theme: "dark", language: "en" })));
  await page.reload();
  await isDrawn("after a reload");
  await chooseTheme(page, "Outdoor");
  await isDrawn("in another theme");
}

const browser = await startBrowser();
try {
  await journey(browser, "operator", async (page) => {
    await page.goto(OPERATOR_LINK);
    await page.locator(".shell").waitFor();
    await page.goto(`${BASE}flights/1`);
    await requireThumbnails(page);
    await readMeasurements(page);
    await downloadLog(page);
    await showPicturesOnMap(page);
    await showSurveyMap(page);
    await changeTheme(page);
    await showBaseMap(page);
  });
} finally {
  await browser.close();
}

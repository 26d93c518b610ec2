/** A farmer gives a field an entry, and looks at the survey that begins there.
 *
 *     node tests/browser/enter_a_field.mjs
 *
 * ANA_LINK signs the person in, FIELD is the field, SHAPEFILE a zip with two. OUT takes what a failure leaves.
 */
import { journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, FIELD, SHAPEFILE } = process.env;
const origin = new URL(ANA_LINK).origin;
const button = (page, text) => page.getByRole("button", { name: text, exact: true });

async function addEntry(page) {
  await page.goto(`${origin}/console/fields/${FIELD}`);
  await button(page, "Add an entry point").click();
  const marker = page.locator(".entry-marker");
  await marker.waitFor();
  const latitude = page.getByLabel("Latitude");
  const before = await latitude.inputValue();
  await marker.press("Shift+ArrowUp");
  await page.waitForFunction(([input, old]) => input.value > old, [await latitude.elementHandle(), before]);
  await requireAccessible(page, "the entry of a field");
  await picture(page, "entry");
  // What is not taken stays, with the reason
  for (const [text, reason] of [["91", "Allowed: -90 to 90"], ["40.4434, -3.7382", "Enter a number."]]) {
    await latitude.fill(text);
    await latitude.blur();
    await page.locator(".corner-form .has-error", { hasText: reason }).waitFor();
    if ((await latitude.inputValue()) !== text) throw new Error(`${text} is replaced without a word`);
  }
  await requireAccessible(page, "a place that is none");
  await latitude.fill("41");
  await page.locator(".corner-form .has-error", { hasText: "Enter a number." }).waitFor({ state: "detached" });
  await button(page, "Save the field").click();
  await page.getByText("m from the field").waitFor();
  await button(page, "Undo").click();
  await button(page, "Save the field").click();
  await page.getByRole("heading", { name: "Fields" }).waitFor();
}

/** A zipped Shapefile becomes fields with its names. */
async function importShapefile(page) {
  await page.goto(`${origin}/console/fields`);
  await button(page, "Upload a file").click();
  const dialog = page.getByRole("dialog");
  await dialog.locator("input[type=file]").setInputFiles(SHAPEFILE);
  await dialog.getByRole("button", { name: "Upload a file" }).click();
  await page.getByRole("link", { name: "East meadow" }).first().waitFor();
  await page.getByRole("link", { name: "West meadow" }).first().waitFor();
  await picture(page, "shapefile");
}

async function lookAtSurvey(page) {
  await page.goto(`${origin}/console/fields/${FIELD}/survey`);
  await page.locator(".flight-marker").first().waitFor();
  await page.locator(".entry-marker").waitFor();
  await page.locator(".map-tools").waitFor();
  await page.waitForTimeout(500);
  await picture(page, "survey");
}

/** A folder as of Google Earth: its area becomes a field, and its pin is named as left out. */
async function uploadFolder(page) {
  await page.goto(`${origin}/console/fields`);
  await button(page, "Upload a file").click();
  const dialog = page.getByRole("dialog");
  const buffer = Buffer.from(`<kml xmlns="http://www.opengis.net/kml/2.2"><Folder>
    <Placemark><name>Gate</name><Point><coordinates>-3.75,40.45</coordinates></Point></Placemark>
    <Placemark><name>South meadow</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
      -3.75,40.45 -3.749,40.45 -3.749,40.451 -3.75,40.451 -3.75,40.45
    </coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></Folder></kml>`);
  await dialog.locator("input[type=file]").setInputFiles({ name: "farm.kml", mimeType: "application/vnd.google-earth.kml+xml", buffer });
  await dialog.getByRole("button", { name: "Upload a file" }).click();
  await dialog.getByText("One area is stored.").waitFor();
  await dialog.getByText("Gate").waitFor();
  await requireAccessible(page, "what of a file is no area");
  await dialog.locator(".dialog-actions").getByRole("button", { name: "Close" }).click();
  await page.waitForURL(/fields\/\d+$/);
  if ((await page.getByLabel("Name", { exact: true }).inputValue()) !== "South meadow") throw new Error("another field is shown");
}

/** What is no number is said at its input. */
async function enterNoNumber(page) {
  for (const label of ["Resolution", "Height", "Speed"]) {
    const input = page.getByLabel(label).first();
    const before = await input.inputValue();
    await input.fill("12abc");
    const fault = page.locator(".has-error", { hasText: "Enter a number." });
    await fault.first().waitFor();
    await input.fill(before);
    await fault.first().waitFor({ state: "detached" });
  }
}

/** A fault that no input shows is a sentence with the name that the person sees. */
async function namedFault(page) {
  await page.route("**/surveys/?preview=true", (route) => route.fulfill({
    status: 422,
    json: { message: "cannot be used", detail: { json: {
      angle: ["must be a bearing"], "camera.focal_length_mm": ["must be larger"], exclusions: ["cut the field in two"],
    } } },
  }));
  await page.getByLabel("Height").fill("41");
  await page.getByText("Focal length: must be larger").waitFor();
  await page.getByText("No-fly areas of the field: cut the field in two").waitFor();
  await page.locator(".fault", { hasText: "must be a bearing" }).waitFor();
  await requireAccessible(page, "a survey with faults");
  await picture(page, "survey-faults");
}

/** What was chosen for a survey is there again after a reload. */
async function keptChoices(page) {
  await page.unroute("**/surveys/?preview=true");
  await page.reload();
  await page.locator(".flight-marker").first().waitFor();
  const height = await page.getByLabel("Height").inputValue();
  if (height !== "41") throw new Error(`the height is ${height} after the reload`);
}

const browser = await startBrowser();
try {
  await journey(browser, "entry", async (page) => {
    await page.goto(ANA_LINK);
    await page.getByRole("navigation").waitFor();
    await addEntry(page);
    await importShapefile(page);
    await uploadFolder(page);
    await lookAtSurvey(page);
    await enterNoNumber(page);
    await namedFault(page);
    await keptChoices(page);
  });
} finally {
  await browser.close();
}

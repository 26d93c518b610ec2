/** An operator edits a draft in the editor and flies it from there.
 *
 *     node tests/browser/edit_a_plan.mjs
 *
 * ANA_LINK signs the operator in; DRAFT is the plan, FENCED one with a fence up to 60 m, FIELD a field without no-fly areas. OUT takes what a failure leaves.
 */
import { COARSE, hold, journey, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, DRAFT, FENCED, FIELD } = process.env;
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

/** The editor's map shows the fence of the plan, and saving keeps it. */
async function showTheFence(page) {
  await page.goto(`${origin}/console/plans/${FENCED}/edit`);
  const legend = page.locator(".fence-legend");
  await legend.getByText("the drones stay inside").waitFor();
  await legend.getByText("at most 60 m high").waitFor();
  await page.getByLabel("Name", { exact: true }).fill("Still fenced");
  await button(page, "Save draft").click();
  await page.getByRole("heading", { name: "Still fenced" }).waitFor();
  await legend.getByText("the drones stay inside").waitFor();
}

/** A stored survey without a fence has its field for one. */
async function checkAgainstTheField(page) {
  await page.goto(`${origin}/console/fields/${FIELD}/survey`);
  await button(page, "Make the plan").click();
  await button(page, "Fly now").click();
  const dialog = page.getByRole("dialog", { name: "Fly now" });
  await dialog.getByRole("listitem").filter({ hasText: "inside the fence or the field" }).getByText("Good").waitFor();
  await page.keyboard.press("Escape");
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

/** What is wrong with a step is marked on the map and in the form, whoever has found it. */
async function showFaults(page) {
  await page.goto(`${origin}/console/plans/new`);
  await page.locator(".farm-map canvas").click();
  await page.getByLabel("Add a step").selectOption({ label: "Circle around a point ⌖" });
  await page.locator(".step-title").nth(1).click();
  const rate = page.getByLabel("Turn rate (°/s)");
  const marker = (index) => page.locator(".waypoint-marker", { hasText: String(index) });
  const marked = page.locator(".waypoint-marker.has-error");
  await rate.fill("99");
  await marked.waitFor();
  if (!(await button(page, "Save draft").isDisabled())) throw new Error("a rate out of its range can be saved");
  await rate.fill("59");
  await marked.waitFor({ state: "detached" });
  await button(page, "Save draft").click();
  await marked.waitFor();
  if ((await marker(2).getAttribute("class")).includes("has-error") === false) throw new Error("another step is marked");
  if (!/faster than the plan's/.test(await marker(2).getAttribute("aria-label"))) throw new Error("the marker does not say what is wrong");
  await page.locator(".step.has-error .field.has-error").waitFor();
  await rate.fill("5");
  await page.getByLabel("Maximum speed").fill("999");
  await button(page, "Save draft").click();
  await page.locator(".form-line .field.has-error").waitFor();
}

/** A step that is open stays open where it is moved to, and is still the same step. */
async function moveAnOpenStep(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  const titles = page.locator(".step-title");
  await titles.first().click();
  const name = (await titles.first().innerText()).replace(/^\d+\s*/, "");
  await button(page, "Move step 1 down").click();
  const open = page.locator('.step-title[aria-expanded="true"]');
  if ((await open.innerText()).replace(/\s+/g, " ") !== `2 ${name}`.replace(/\s+/g, " ")) {
    throw new Error(`open is ${await open.allInnerTexts()}, not ${name}`);
  }
  await button(page, "Undo").click();
}

/** The keys move a step by a metre, with Shift by ten, and remove it. */
async function moveByKeys(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  await page.locator(".step-title").first().click();
  const latitude = page.getByLabel("Latitude (°)");
  const before = Number(await latitude.inputValue());
  const steps = await page.locator(".step").count();
  await page.locator(".waypoint-marker").first().focus();
  await page.keyboard.press("ArrowUp");
  await page.keyboard.press("Shift+ArrowUp");
  const moved_m = (Number(await latitude.inputValue()) - before) * 111_195;
  if (Math.abs(moved_m - 11) > 0.1) throw new Error(`the step was moved by ${moved_m} m`);
  await page.keyboard.press("Delete");
  await page.waitForFunction((count) => document.querySelectorAll(".step").length === count, steps - 1);
  for (let undone = 0; undone < 3; undone += 1) await button(page, "Undo").click();
  await page.locator(".step-title").first().click();
  if (Number(await latitude.inputValue()) !== before) throw new Error("the step is not where it was");
}

/** What is typed into a field until it is left is one step back, and what is typed there later another. */
async function undoTyping(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  await page.locator(".step-title").first().click();
  const height = page.getByLabel("Height (m)");
  const before = await height.inputValue();
  const type = async (text) => {
    await height.selectText();
    await height.pressSequentially(text);
    await page.locator("h1").click();
  };
  const undoTo = async (text) => {
    await button(page, "Undo").click(); // The step stays open
    const shown = await height.inputValue();
    if (shown !== text) throw new Error(`one step back from what was typed is ${shown}, not ${text}`);
  };
  await type("17.25");
  await type("123");
  await undoTo("17.25");
  await undoTo(before);
}

/** The keys of undo take back a drag on the map, also where a field was being typed in before. */
async function undoADragBehindTyping(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  const first = page.locator(".step-title").first();
  await first.click();
  await page.getByLabel("Height (m)").fill("17");
  const marker = page.locator(".waypoint-marker", { hasText: "2" });
  const placeOf = async () => {
    const { x, y, width, height } = await marker.boundingBox();
    return [x + width / 2, y + height / 2];
  };
  const isNear = ([x, y], [toX, toY]) => Math.hypot(x - toX, y - toY) < 3;
  const before = await placeOf();
  const wanted = [before[0] + 60, before[1] - 60];
  await page.mouse.move(...before);
  await page.mouse.down();
  await page.mouse.move(...wanted, { steps: 4 });
  await page.mouse.up();
  if (!isNear(await placeOf(), wanted)) throw new Error("the step was not dragged");
  await page.keyboard.press("Control+z");
  await first.getByText("17 m").waitFor();
  if (!isNear(await placeOf(), before)) throw new Error("the drag was not undone");
  await button(page, "Undo").click();
  await first.getByText("17 m").waitFor({ state: "detached" });
}

/** Heights and speeds are entered in the chosen units, and stored in metres and seconds. */
async function enterImperialUnits(page) {
  const choose = async (name) => {
    await page.locator(".header-person").click();
    await page.getByRole("dialog").getByRole("radio", { name }).check();
    await page.getByRole("dialog").getByRole("button", { name: "Done" }).click();
  };
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  await choose("Imperial");
  await page.getByLabel("Maximum speed (mph)").fill("10");
  await page.locator(".step-title").first().click();
  await page.getByLabel("Height (ft)").fill("50");
  await page.locator(".step-title").first().getByText("50 ft").waitFor();
  await button(page, "Save draft").click();
  await page.locator(".timeline").waitFor();
  const mission = await page.evaluate(async (id) => (await (await fetch(`/plans/${id}`)).json()).missions[0], DRAFT);
  const stored = [mission.maximum_speed.toFixed(2), mission.command_array[0].parameters.altitude];
  if (`${stored}` !== "4.47,15.24") throw new Error(`stored are ${stored}`);
  await choose("Metric");
}

/** In Spanish a value has a comma, whatever the language of the browser; a point is read as well. */
async function enterWithAComma(page) {
  await page.evaluate(() => localStorage.setItem("farm-console", JSON.stringify({ language: "es" })));
  const requireStored = async (field, text, read, wanted) => {
    await field.fill("");
    await field.pressSequentially(text);
    if ((await field.inputValue()) !== text) throw new Error(`${text} became ${await field.inputValue()}`);
    await field.blur();
    const shown = await read();
    if (shown !== wanted) throw new Error(`${text} is ${shown}, not ${wanted}`);
  };
  await page.goto(`${origin}/console/fields/${FIELD}/survey`);
  const height = page.getByLabel("Altura (m)");
  const resolution = page.getByLabel("Resolución (cm/px)");
  await requireStored(height, "18,5", () => height.inputValue(), "18,5");
  await requireStored(height, "17.5", () => height.inputValue(), "17.5");
  await requireStored(height, "17,255", () => height.inputValue(), "17,255");
  await requireStored(height, "-", () => height.inputValue(), "");
  await requireStored(resolution, "1,25", () => resolution.inputValue(), "1,25");
  await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
  const speed = page.getByLabel("Velocidad máxima (km/h)");
  await requireStored(speed, "12,5", () => speed.inputValue(), "12,5");
  await page.locator(".step-title").first().click();
  const step = page.getByLabel("Altura (m)");
  await requireStored(step, "4,25", () => step.inputValue(), "4,25");
  const latitude = page.getByLabel("Latitud (°)");
  await requireStored(latitude, "40,4435", () => latitude.inputValue(), "40,4435");
  await page.evaluate(() => localStorage.removeItem("farm-console"));
}

/** Nothing runs off the right edge where texts are long and the screen is small, nor STOP's orders below it. */
async function fitsOnSmallScreens(page) {
  await page.setViewportSize({ width: 1024, height: 768 });
  for (const theme of ["light", "outdoor"]) {
    await page.evaluate((chosen) => localStorage.setItem("farm-console", JSON.stringify({ language: "es", theme: chosen })), theme);
    await page.goto(`${origin}/console/plans/${DRAFT}/edit`);
    for (const title of await page.locator(".step-title").all()) {
      await title.click();
      const [wide, room] = await page.locator(".split-side").evaluate((one) => [one.scrollWidth, one.clientWidth]);
      if (wide > room) throw new Error(`the editor is ${wide} px wide in ${room} px (${theme})`);
    }
  }
  await page.setViewportSize({ width: 740, height: 360 });
  await page.locator(".header .stop-button").click();
  const land = page.getByRole("dialog").getByRole("button", { name: "Aterrizar aquí" });
  await land.waitFor();
  const bottom = await land.evaluate((one) => one.getBoundingClientRect().bottom);
  if (bottom > 360) throw new Error(`the order to land ends ${bottom} px below the top of 360 px`);
  await page.keyboard.press("Escape");
  await page.setViewportSize({ width: 1280, height: 800 });
  await page.evaluate(() => localStorage.removeItem("farm-console"));
}

/** What a screen says of itself: its title, a flight that is none, how long a plan lives. */
async function readTitlesAndTimes(page) {
  await page.goto(`${origin}/console/flights/NaN`);
  await page.getByText("There is nothing at this address").waitFor();
  await page.goto(`${origin}/console/flights/999`);
  await page.getByText("Flight 999 is not in the archive").waitFor();
  if (await page.getByText("GPX").count()) throw new Error("a flight that does not exist has files");
  if ((await page.title()) !== "Flights - Farm console") throw new Error(`the title is ${await page.title()}`);
  await page.goto(`${origin}/console/plans/${DRAFT}`);
  await page.getByText(/^Can be flown until .*\d\d:\d\d\. After that it expires/).waitFor();
  const brand = await page.locator(".brand").evaluate((one) => one.getBoundingClientRect().width);
  if (brand < 44) throw new Error(`the link with the name is ${brand} px wide`);
}

const browser = await startBrowser();
try {
  await journey(browser, "edit-a-plan", async (page) => {
    await page.goto(ANA_LINK);
    await page.getByRole("navigation").waitFor();
    await addEachKind(page);
    await showFaults(page);
    await moveAnOpenStep(page);
    await moveByKeys(page);
    await undoTyping(page);
    await undoADragBehindTyping(page);
    await enterImperialUnits(page);
    await enterWithAComma(page);
    await readTitlesAndTimes(page);
    await fitsOnSmallScreens(page);
    await showTheFence(page);
    await checkAgainstTheField(page);
    await saveAndFly(page);
  }, COARSE);
} finally {
  await browser.close();
}

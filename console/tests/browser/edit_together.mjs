/** Two people edit one field and one plan; one of them leaves, reloads, and signs out in between.
 *
 *     node tests/browser/edit_together.mjs
 *
 * ANA_LINK and JUAN_LINK sign an operator each in, and so do those AGAIN; FIELD and DRAFT are what they edit. OUT takes
 * what a failure leaves.
 */
import { hold, journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, JUAN_LINK, FIELD, DRAFT } = process.env;
const origin = new URL(ANA_LINK).origin;
const open = async (page, address) => {
  await page.goto(`${origin}/console/${address}`);
  await page.getByLabel("Name", { exact: true }).waitFor();
};
const name = (page) => page.getByLabel("Name", { exact: true });
const button = (page, text) => page.getByRole("button", { name: text, exact: true });
const requireValue = async (page, value) => {
  await page.waitForFunction(
    ([input, wanted]) => input.value === wanted, [await name(page).elementHandle(), value]);
};

/** Ana saves while Juan types; what he may do then. */
async function editField(ana, juan) {
  await open(ana, `fields/${FIELD}`);
  await open(juan, `fields/${FIELD}`);
  await name(ana).fill("Ana's field");
  await name(juan).fill("Juan's field");
  await button(ana, "Save the field").click();
  await ana.getByRole("link", { name: "Ana's field" }).first().waitFor();
  await button(juan, "Delete").click();
  await juan.getByRole("dialog").getByRole("button", { name: "Delete" }).click();
  await juan.getByRole("dialog").getByText("Somebody else changed this in the meantime.").waitFor();
  await juan.keyboard.press("Escape");
  await button(juan, "Save the field").click();
  await juan.getByText("The name is now “Ana's field”.").waitFor();
  await juan.getByText(/^ana has changed this field since you opened it/).waitFor();
  await requireValue(juan, "Juan's field");
  await requireAccessible(juan, "a field that somebody else has changed");
  await picture(juan, "conflict-field");
  await button(juan, "Load the other version").click();
  await requireValue(juan, "Ana's field");
  await button(juan, "Undo").click();
  await requireValue(juan, "Juan's field");
  await button(juan, "Save the field").click();
  await juan.getByRole("link", { name: "Juan's field" }).first().waitFor();
}

async function editPlan(ana, juan) {
  await open(ana, `plans/${DRAFT}/edit`);
  await open(juan, `plans/${DRAFT}/edit`);
  await ana.getByLabel("Maximum speed (km/h)").fill("25.2");
  await button(ana, "Save draft").click();
  await ana.getByRole("heading", { level: 1 }).waitFor();
  await name(juan).fill("Juan's plan");
  await button(juan, "Save draft").click();
  await juan.getByText("The maximum speed is now 25 km/h.").waitFor();
  await picture(juan, "conflict-plan");
  await button(juan, "Save mine as a copy").click();
  await juan.getByRole("heading", { name: "Juan's plan (copy)" }).waitFor();
}

/** Ana flies the plan that her dialog shows, not what Juan makes of it meanwhile. */
async function dispatchOld(ana, juan) {
  await ana.goto(`${origin}/console/plans/${DRAFT}`);
  await button(ana, "Fly now").click();
  const dialog = ana.getByRole("dialog", { name: "Fly now" });
  await dialog.waitFor();
  await open(juan, `plans/${DRAFT}/edit`);
  await juan.getByLabel("Maximum speed (km/h)").fill("36");
  const loaded = ana.waitForResponse((answer) => answer.url().endsWith(`/plans/${DRAFT}`));
  await button(juan, "Save draft").click();
  await loaded; // What has changed is read behind the dialog
  const refusal = ana.getByText("Somebody else changed this in the meantime.");
  await hold(ana, dialog.getByRole("button", { name: "Fly now" }), refusal);
}

/** Nobody leaves unsaved changes by mistake, and nobody is kept from the STOP button by them. */
async function leave(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}`);
  await button(page, "Edit").click();
  await name(page).fill("Not saved");
  await page.getByRole("navigation").getByRole("link", { name: "Fields" }).click();
  const warning = page.getByRole("alertdialog");
  await warning.waitFor();
  await requireAccessible(page, "the warning about unsaved changes");
  await picture(page, "leave");
  await page.getByRole("button", { name: "STOP" }).click();
  await page.getByRole("dialog", { name: "Stop" }).waitFor();
  await page.getByRole("dialog").getByRole("button", { name: "Close" }).first().click();
  await button(page, "Stay here").click();
  await requireValue(page, "Not saved");
  await page.goBack();
  await warning.waitFor();
  await page.keyboard.press("Escape");
  await warning.waitFor({ state: "detached" });
  if (!page.url().endsWith("/edit")) throw new Error(`the address is ${page.url()}`);
  await requireValue(page, "Not saved");
}

/** What is not saved is there again after a reload, and after the session has ended. */
async function comeBack(page) {
  let asked = 0;
  page.on("dialog", (dialog) => {
    asked += 1;
    return dialog.accept();
  });
  await page.reload();
  if (asked !== 1) throw new Error(`the browser has asked ${asked} times`);
  await requireValue(page, "Not saved");
  await page.getByText("which were not saved").waitFor();
  await picture(page, "restored");
  await page.getByRole("button", { name: /^Settings/ }).click();
  await button(page, "Sign out").click();
  await page.getByLabel("Password").waitFor();
  await page.goto(process.env.ANA_LINK_AGAIN);
  await page.getByRole("navigation").waitFor();
  await open(page, `plans/${DRAFT}/edit`);
  await requireValue(page, "Not saved");
  await page.getByRole("navigation").getByRole("link", { name: "Alarms" }).click();
  await button(page, "Leave without saving").click();
  await page.getByRole("heading", { name: "Alarms", exact: true }).waitFor();
  await open(page, `plans/${DRAFT}/edit`);
  if ((await name(page).inputValue()) === "Not saved") throw new Error("the draft is still there");
}

/** The tabs of a browser have one cookie: who signs in in one of them is signed in in all, and can stop. */
async function signInInAnotherTab(page) {
  const context = page.context();
  const deaf = await context.newPage();
  await deaf.addInitScript(() => delete window.BroadcastChannel);
  for (const tab of [page, deaf]) {
    await tab.goto(`${origin}/console/fleet`);
    await tab.getByRole("button", { name: "Settings: ana" }).waitFor();
  }
  const other = await context.newPage();
  await other.goto(process.env.JUAN_LINK_AGAIN);
  await page.getByRole("button", { name: "Settings: juan" }).waitFor();
  await deaf.getByRole("button", { name: "Settings: ana" }).waitFor();
  for (const tab of [page, deaf]) {
    await tab.bringToFront();
    await tab.locator(".header .stop-button").click();
    const dialog = tab.getByRole("dialog", { name: "Stop a flight" });
    await hold(tab, dialog.getByRole("button", { name: "Land here" }), dialog.getByText("Nothing to stop").first());
    await tab.keyboard.press("Escape");
    await tab.getByRole("button", { name: "Settings: juan" }).waitFor();
  }
}

const browser = await startBrowser();
try {
  await journey(browser, "ana", async (ana) => {
    await ana.goto(ANA_LINK);
    await ana.getByRole("navigation").waitFor();
    await journey(browser, "juan", async (juan) => {
      await juan.goto(JUAN_LINK);
      await juan.getByRole("navigation").waitFor();
      await editField(ana, juan);
      await editPlan(ana, juan);
      await dispatchOld(ana, juan);
    });
    await leave(ana);
    await comeBack(ana);
    await signInInAnotherTab(ana);
  });
} finally {
  await browser.close();
}

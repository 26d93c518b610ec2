/** An operator copies a plan, keeps it as each kind of file, and brings the files back.
 *
 *     node tests/browser/keep_plans.mjs
 *
 * ANA_LINK signs the operator in; DRAFT is the plan. OUT takes what a failure leaves.
 */
import { readFile } from "node:fs/promises";
import { journey, picture, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, DRAFT } = process.env;
const origin = new URL(ANA_LINK).origin;
const button = (page, text) => page.getByRole("button", { name: text, exact: true });

async function copy(page) {
  await page.goto(`${origin}/console/plans/${DRAFT}`);
  await button(page, "Make a copy").click();
  const name = page.getByLabel("Name", { exact: true });
  await name.waitFor();
  if ((await name.inputValue()) !== "Draft (copy)") throw new Error(`the copy is ${await name.inputValue()}`);
}

/** The library shows what has the words that are typed, among the older plans too. */
async function search(page) {
  await page.goto(`${origin}/console/plans`);
  const names = page.locator(".row-main strong");
  await names.nth(1).waitFor();
  const field = page.getByLabel("Search by name, drone or date");
  await field.fill("copy DRAFT drone");
  await names.nth(1).waitFor({ state: "detached" });
  if ((await names.allInnerTexts()).join() !== "Draft (copy)") throw new Error(`found ${await names.allInnerTexts()}`);
  await field.fill("meadow");
  await page.getByText("No plan has these words").waitFor();
  await requireAccessible(page, "a search without a find");
  await field.fill("");
  await button(page, "Show plans older than 30 days").click();
  await button(page, "Show plans older than 30 days").waitFor({ state: "detached" });
  await names.nth(1).waitFor();
}

/** Downloads a file of the plan; gives its path. */
async function download(page, text) {
  await page.goto(`${origin}/console/plans/${DRAFT}`);
  await button(page, "Download").click();
  const link = page.getByRole("dialog").getByRole("link", { name: text });
  const [file] = await Promise.all([page.waitForEvent("download"), link.click()]);
  const path = `${await file.path()}`;
  return { name: file.suggestedFilename(), mimeType: "", buffer: await readFile(path) };
}

/** Uploads a file; it becomes a draft of three steps. */
async function upload(page, file) {
  await page.goto(`${origin}/console/plans`);
  await button(page, "Upload a file").click();
  await page.getByRole("dialog").locator("input[type=file]").setInputFiles(file);
  await page.getByRole("dialog").getByRole("button", { name: "Upload a file" }).click();
  await page.locator(".timeline li").first().waitFor();
  const steps = await page.locator(".timeline li").count();
  if (steps !== 3) throw new Error(`${file.name} has become ${steps} steps`);
}

const browser = await startBrowser();
try {
  await journey(browser, "keep", async (page) => {
    await page.goto(ANA_LINK);
    await page.getByRole("navigation").waitFor();
    await copy(page);
    await search(page);
    for (const [text, ending] of [["JSON", "json"], [".plan", "plan"], [".waypoints", "waypoints"]]) {
      const file = await download(page, text);
      if (!file.name.endsWith(`.${ending}`)) throw new Error(`the file is ${file.name}`);
      await upload(page, file);
    }
    await page.goto(`${origin}/console/plans/${DRAFT}`);
    await button(page, "Download").click();
    await page.getByRole("dialog").waitFor();
    await requireAccessible(page, "the files of a plan");
    await picture(page, "downloads");
  });
} finally {
  await browser.close();
}

/** An administrator makes an account, changes it, signs it in by link, ends its session, deletes it; makes a key.
 *
 *     node tests/browser/run_accounts.mjs
 *
 * ADMIN_LINK signs the administrator in; OUT takes what a failure leaves.
 */
import { COARSE, journey, requireAccessible, startBrowser } from "./chromium.mjs";

const { ADMIN_LINK } = process.env;
const BASE = ADMIN_LINK.split("#")[0];
const NAME = "lucia";

/** Gives the address of the link. */
async function makeAccount(page) {
  await page.goto(`${BASE}system/users`);
  await page.getByLabel("Name").fill(NAME);
  await page.getByRole("button", { name: "Add a person" }).click();
  const change = page.getByRole("button", { name: `Change the account of ${NAME}` });
  await change.waitFor();
  const left = await page.getByLabel("Name").inputValue();
  if (left !== "") throw new Error(`the form still has the name ${left}`);
  await change.click();
  const dialog = page.getByRole("dialog");
  await dialog.getByLabel("Role").selectOption("farmer");
  await dialog.getByRole("button", { name: "Change the role" }).click();
  await dialog.getByText("The new role holds").waitFor();
  await dialog.getByLabel("New password").fill("nine words are better than one");
  await dialog.getByRole("button", { name: "Set the password" }).click();
  await dialog.getByText("The new password holds").waitFor();
  await dialog.getByRole("button", { name: "Make a link" }).click();
  const link = await dialog.getByLabel("Sign-in link").inputValue();
  await dialog.getByRole("button", { name: "Copy" }).click();
  await dialog.getByRole("button", { name: "Copied" }).waitFor();
  await requireAccessible(page, "the account");
  await dialog.getByRole("button", { name: "Close" }).last().click();
  return link;
}

async function endSession(page) {
  await page.goto(`${BASE}system/sessions`);
  await page.getByText("This browser").waitFor();
  await requireAccessible(page, "the sessions");
  await page.getByRole("button", { name: `End the session of ${NAME}` }).click();
  await page.getByRole("dialog").getByRole("button", { name: "End", exact: true }).click();
  await page.locator(".rows").getByText(NAME).waitFor({ state: "detached" });
}

async function deleteAccount(page) {
  await page.goto(`${BASE}system/users`);
  await page.getByRole("button", { name: `Change the account of ${NAME}` }).click();
  const dialog = page.getByRole("dialog");
  await dialog.getByRole("button", { name: "Delete the account" }).click();
  await dialog.getByText("This cannot be undone").waitFor();
  await dialog.getByRole("button", { name: "Delete now" }).click();
  await page.locator(".rows").getByText(NAME).waitFor({ state: "detached" });
}

async function makeKey(page) {
  await page.goto(`${BASE}system/keys`);
  await page.getByLabel("Name").fill("north-broker");
  await page.getByLabel("Expires at the end of").fill("2099-01-31");
  await page.getByRole("button", { name: "Make a key" }).click();
  const key = page.getByRole("dialog").getByRole("textbox", { name: "Key" });
  await key.waitFor();
  const secret = await key.inputValue();
  await requireAccessible(page, "the new key");
  const role = await page.evaluate(async (bearer) => {
    const answer = await fetch("/session/", { headers: { Authorization: `Bearer ${bearer}` } });
    return (await answer.json()).role;
  }, secret);
  if (role !== "broker") throw new Error(`the key has the role ${role}`);
  await page.getByRole("button", { name: "Done" }).click();
  await page.locator(".rows").getByText("north-broker").waitFor();
  if ((await page.content()).includes(secret)) throw new Error("the key is still on the page");
}

const browser = await startBrowser();
try {
  await journey(browser, "admin", async (page) => {
    await page.goto(ADMIN_LINK);
    await page.locator(".shell").waitFor();
    const link = await makeAccount(page);
    await journey(browser, "person", async (other) => {
      await other.goto(link);
      await other.locator(".shell").waitFor();
      await endSession(page);
      await other.locator(".sign-in-card").waitFor();
    }, COARSE);
    await deleteAccount(page);
    await makeKey(page);
  }, COARSE);
} finally {
  await browser.close();
}

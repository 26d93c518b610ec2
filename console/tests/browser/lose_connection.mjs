/** A lost connection, or an update of the server, leaves STOP and the navigation on the screen.
 *
 *     node tests/browser/lose_connection.mjs
 *
 * ANA_LINK and JUAN_LINK sign in; drone 2 was lost 25 h ago. OUT takes what a failure leaves.
 */
import { COARSE, journey, requireAccessible, startBrowser } from "./chromium.mjs";

const { ANA_LINK, JUAN_LINK } = process.env;
const SCREENS = /\/assets\/(Alarms|Plans|PlanView|Flights|FlightView|Fields|PlanEditor|FieldEditor|SurveyEditor|System)-[^/]+\.js$/;
const open = (page, name) => page.getByRole("navigation").getByRole("link", { name }).click();
const button = (page, name) => page.getByRole("button", { name, exact: true });

/** Requires that STOP opens its orders, and that each entry of the navigation is there. */
async function requireStop(page) {
  await page.locator(".header .stop-button").click();
  await page.getByRole("dialog", { name: "Stop a flight" }).getByRole("button", { name: "Close" }).last().click();
  if ((await page.getByRole("navigation").getByRole("link").count()) < 5) throw new Error("the navigation is gone");
}

async function opensAScreenThatWasLoadedBefore(page) {
  const wanted = new Set(["Plans", "Flights", "Fields", "Alarms"]);
  const isLoaded = new Promise((resolve) => page.on("requestfinished", (request) => {
    wanted.delete(SCREENS.exec(request.url())?.[1]);
    if (wanted.size === 0) resolve();
  }));
  await page.addInitScript(() => {
    const now = Date.now;
    Date.now = () => now() - 7_200_000;
  });
  await page.goto(ANA_LINK);
  await page.locator(".farm-map canvas").waitFor();
  // Its last report, not the last one of its broker, and not by a clock that is 2 h slow
  await page.getByRole("article", { name: "Drone 2" }).getByText("25 h 0 min").waitFor();
  await isLoaded;
  await page.context().setOffline(true);
  for (const name of ["Plans", "Flights", "Fields", "Alarms"]) {
    await open(page, name);
    await page.getByRole("heading", { level: 1, name }).waitFor();
  }
  await requireStop(page);
  await open(page, "Flights");
  await button(page, "Try again").waitFor();
  await page.context().setOffline(false);
  await button(page, "Try again").waitFor({ state: "detached" });
}

async function waitsForTheConnection(page) {
  await page.route(SCREENS, (route) => route.abort("internetdisconnected"));
  await page.goto(JUAN_LINK);
  await page.locator(".farm-map canvas").waitFor();
  await page.context().setOffline(true);
  await open(page, "Plans");
  await page.getByText("the edge server cannot be reached. It opens by itself").waitFor();
  await requireAccessible(page, "a screen that could not be loaded");
  await requireStop(page);
  await open(page, "Fleet");
  await page.locator(".farm-map canvas").waitFor();
  await open(page, "Plans");
  await page.getByText("It opens by itself").waitFor();
  await page.unroute(SCREENS);
  await page.context().setOffline(false);
  await page.getByRole("heading", { level: 1, name: "Plans" }).waitFor();

  // The server is updated: the files of this page are gone
  await page.route(SCREENS, (route) => route.fulfill({ status: 404 }));
  await page.reload();
  await page.getByText("This part of the console could not be loaded.").waitFor();
  await page.route("**/console/", (route) =>
    route.request().resourceType() === "fetch"
      ? route.fulfill({ contentType: "text/html", body: '<script type="module" src="/console/assets/index-new.js"></script>' })
      : route.continue());
  await open(page, "Flights");
  await page.getByText("The edge server has a newer console.").waitFor();
  await requireStop(page);
  await page.unroute(SCREENS);
  await button(page, "Load the page again").click();
  await page.getByRole("heading", { level: 1, name: "Flights" }).waitFor();

  // The server hangs: it takes requests and does not answer
  await page.route(/\d\/plans\/(\?|$)/, () => undefined);
  await open(page, "Plans");
  await page.getByText("The edge server does not answer yet.").waitFor();
}

const browser = await startBrowser();
try {
  await journey(browser, "preloaded", opensAScreenThatWasLoadedBefore, COARSE);
  await journey(browser, "not-preloaded", waitsForTheConnection, COARSE);
} finally {
  await browser.close();
}

/** What stops, or comes, while a person looks: a camera, a broker, a warning, a second rejection.
 *
 *     node tests/browser/notice_changes.mjs
 *
 * ADMIN_LINK signs in; BROKER_KEY reports vehicle 1, whose camera this serves at CAMERA_PORT with the
 * picture in the file FRAME. OUT takes what a failure leaves.
 */
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { journey, startBrowser } from "./chromium.mjs";

const { ADMIN_LINK, BROKER_KEY, CAMERA_PORT, FRAME } = process.env;
const origin = new URL(ADMIN_LINK).origin;
const BOUNDARY = "frame";
const LETTER = {
  id: 1, kind: "pose", vehicle_id: 1, reason: "latitude is wrong", rejected_at: "2026-05-01T10:01:00Z",
  report: { vehicle_id: 1, received_at: "2026-05-01T10:00:00Z" },
};

async function report(state = {}) {
  const answer = await fetch(`${origin}/vehicles/1`, {
    method: "PUT",
    headers: { "Content-Type": "application/json", "X-API-Key": BROKER_KEY },
    body: JSON.stringify({ link_state: "connected", latitude: 40.4434, longitude: -3.7382, ...state }),
  });
  if (!answer.ok) throw new Error(`the report was answered ${answer.status}`);
}

/** Serves the camera; returns what ends it at once, with its connections. */
function startCamera() {
  const frame = readFileSync(FRAME);
  const server = createServer((_request, answer) => {
    answer.writeHead(200, { "Content-Type": `multipart/x-mixed-replace; boundary=${BOUNDARY}` });
    const timer = setInterval(() => {
      answer.write(`--${BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: ${frame.length}\r\n\r\n`);
      answer.write(frame);
      answer.write("\r\n");
    }, 200);
    answer.on("close", () => clearInterval(timer));
  }).listen(Number(CAMERA_PORT), "127.0.0.1");
  return () => {
    server.close();
    server.closeAllConnections();
  };
}

/** The last picture of a camera that has stopped is not shown as live, and the next one comes by itself. */
async function loseTheCamera(page) {
  const isShown = () => page.waitForFunction(() => {
    const image = document.querySelector(".live-picture img");
    return image !== null && !image.hidden && image.naturalWidth > 0;
  });
  let stop = startCamera();
  try {
    await page.locator(".vehicle-name").click();
    await page.getByRole("button", { name: "Live picture" }).click();
    await isShown();
    stop();
    await page.getByRole("button", { name: "Try again" }).waitFor();
    if (await page.locator(".live-picture img").isVisible()) throw new Error("the last picture stays");
    stop = startCamera();
    await isShown();
  } finally {
    stop();
  }
}

/** A drone of which no broker reports any more is not shown as ready. */
async function loseTheBroker(page, reports) {
  const pill = (text) => page.locator(".vehicle-card header .pill", { hasText: text }).waitFor();
  await pill("Ready");
  reports.stop();
  await pill("Weak connection");
  await pill("Connection lost");
  reports.start();
  await pill("Ready");
}

/** A warning that comes while a button of STOP is held leaves the button where it is held. */
async function warnDuringAHold(page, reports) {
  reports.stop();
  await report();
  await page.locator(".header .stop-button").click();
  const dialog = page.getByRole("dialog", { name: "Stop a flight" });
  const land = dialog.getByRole("button", { name: "Land here" });
  const warning = dialog.getByText("the battery is cold");
  await land.hover();
  const before = await land.boundingBox();
  await page.mouse.down();
  await report({ warning: "the battery is cold" });
  await page.waitForTimeout(500);
  const held = await land.boundingBox();
  if (held.y !== before.y) throw new Error(`the held button was moved by ${held.y - before.y} px`);
  await dialog.getByText("Nothing to stop").waitFor();
  await page.mouse.up();
  await warning.waitFor();
  await page.keyboard.press("Escape");
}

/** A record that the cloud rejects once more is listed again. */
async function rejectAgain(page) {
  let lists = 0;
  await page.route("**/dead_letters/**", (route) => {
    if (route.request().method() !== "GET") return route.fulfill({ json: LETTER });
    lists += 1;
    return route.fulfill({ json: lists === 2 ? [] : [LETTER] });
  });
  await page.goto(`${origin}/console/system/dead_letters`);
  const row = page.getByText(LETTER.reason);
  await row.waitFor();
  await page.getByRole("button", { name: "Send again" }).click();
  await row.waitFor({ state: "detached" });
  await row.waitFor();
}

/** Reports the vehicle each second, as its broker does. */
function repeatedReports() {
  let timer;
  const stop = () => clearInterval(timer);
  const start = () => {
    stop();
    timer = setInterval(() => void report().catch(() => undefined), 1000);
  };
  start();
  return { start, stop };
}

const browser = await startBrowser();
await report();
const reports = repeatedReports();
try {
  await journey(browser, "changes", async (page) => {
    await page.goto(ADMIN_LINK);
    await page.locator(".vehicle-card").waitFor();
    await loseTheCamera(page);
    await loseTheBroker(page, reports);
    await warnDuringAHold(page, reports);
    await rejectAgain(page);
  });
} finally {
  reports.stop();
  await browser.close();
}

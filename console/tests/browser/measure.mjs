/** Measures the console in Chromium: first load, time until the map answers, memory, frames.
 *
 *     LINK=... VEHICLES=50 MINUTES=10 OUT=measured.json node tests/browser/measure.mjs
 *
 * The vehicles move meanwhile; whoever starts this updates them.
 */
import { writeFileSync } from "node:fs";
import { startBrowser } from "./chromium.mjs";

const VEHICLES = Number(process.env.VEHICLES ?? 50);
const MINUTES = Number(process.env.MINUTES ?? 10);
const THROTTLE = 4;
const SETTLED_MS = 20_000;
const FRAMES_MS = 20_000;

const browser = await startBrowser();
try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, locale: "en-GB" });
  const signIn = await context.newPage();
  await signIn.goto(process.env.LINK);
  await signIn.getByRole("button", { name: "STOP", exact: true }).waitFor();
  await signIn.close();
  const page = await context.newPage();
  const devtools = await context.newCDPSession(page);
  const first = await firstLoad(page, devtools);
  await devtools.send("Emulation.setCPUThrottlingRate", { rate: 1 });
  await page.waitForTimeout(SETTLED_MS);
  const before = await heapBytes(devtools);
  const frames = [];
  const end = Date.now() + MINUTES * 60_000;
  while (Date.now() < end) frames.push(...(await frameTimes(page)));
  const after = await heapBytes(devtools);
  frames.sort((a, b) => a - b);
  writeFileSync(process.env.OUT, JSON.stringify({
    ...first,
    heap_before_bytes: before,
    heap_after_bytes: after,
    frame_p50_ms: frames[Math.floor(frames.length * 0.5)],
    frame_p95_ms: frames[Math.floor(frames.length * 0.95)],
    frames: frames.length,
  }));
} finally {
  await browser.close();
}

/** Loads the console with an empty cache on a slowed processor, until the map zooms. */
async function firstLoad(page, devtools) {
  let bytes = 0;
  await devtools.send("Network.enable");
  await devtools.send("Network.setCacheDisabled", { cacheDisabled: true });
  devtools.on("Network.loadingFinished", ({ encodedDataLength }) => { bytes += encodedDataLength; });
  await devtools.send("Emulation.setCPUThrottlingRate", { rate: THROTTLE });
  const url = new URL(process.env.LINK);
  const began = Date.now();
  await page.goto(`${url.origin}${url.pathname}`);
  await page.waitForFunction((count) => document.querySelectorAll(".vehicle-card").length >= count, VEHICLES);
  const listed = Date.now();
  await page.waitForFunction(() => {
    const scale = document.querySelector(".maplibregl-ctrl-scale");
    if (scale === null) return false;
    globalThis.scaleBefore ??= scale.textContent;
    if (scale.textContent !== globalThis.scaleBefore) return true;
    document.querySelector(".maplibregl-ctrl-zoom-in, [aria-label='Zoom in']")?.click();
    return false;
  }, undefined, { polling: 100 });
  return { listed_ms: listed - began, interactive_ms: Date.now() - began, first_load_bytes: bytes };
}

async function heapBytes(devtools) {
  await devtools.send("HeapProfiler.collectGarbage");
  const { usedSize } = await devtools.send("Runtime.getHeapUsage");
  return usedSize;
}

/** Gives the times between frames [ms] for a while. */
function frameTimes(page) {
  return page.evaluate((lasting) => new Promise((resolve) => {
    const found = [];
    const began = performance.now();
    let before = began;
    const frame = (now) => {
      found.push(now - before);
      before = now;
      if (now - began < lasting) requestAnimationFrame(frame);
      else resolve(found);
    };
    requestAnimationFrame(frame);
  }), FRAMES_MS);
}

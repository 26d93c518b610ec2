/** Measures the console in Chromium: first load, time until the map answers, memory, frames.
 *
 *     LINK=... VEHICLES=50 LOADS=1 MINUTES=10 OUT=measured.json node tests/browser/measure.mjs
 *
 * The vehicles move meanwhile; whoever starts this updates them.
 */
import { writeFileSync } from "node:fs";
import { startBrowser } from "./chromium.mjs";

const VEHICLES = Number(process.env.VEHICLES ?? 50);
const MINUTES = Number(process.env.MINUTES ?? 10);
const LOADS = Number(process.env.LOADS ?? 1);
const THROTTLE = 4;
/** A browser that opens a window is busy with its own parts of it. */
const OPENED_MS = 6_000;
/** The browser compiles what runs often in the first minutes: that memory is not the vehicles'. */
const SETTLED_MS = 120_000;
/** One collection leaves what waits for a callback or a task to be let go. */
const COLLECTIONS = 3;
const FRAMES_MS = 20_000;
const HEAP_EVERY_MS = 60_000;

const browser = await startBrowser();
try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, locale: "en-GB" });
  const signIn = await context.newPage();
  await signIn.goto(process.env.LINK);
  await signIn.getByRole("button", { name: "STOP", exact: true }).waitFor();
  await signIn.close();
  const loads = [];
  while (loads.length < LOADS - 1) loads.push(await inNewPage(context, firstLoad));
  const rest = await inNewPage(context, async (page, devtools) => {
    loads.push(await firstLoad(page, devtools));
    return MINUTES === 0 ? {} : watch(page, devtools);
  });
  writeFileSync(process.env.OUT, JSON.stringify({ loads, ...rest }));
} finally {
  await browser.close();
}

async function inNewPage(context, act) {
  const page = await context.newPage();
  await page.waitForTimeout(OPENED_MS);
  const found = await act(page, await context.newCDPSession(page));
  await page.close();
  return found;
}

/** Gives the memory that is used, by time: [[min, bytes], ...], and the times of the frames [ms]. */
async function watch(page, devtools) {
  await devtools.send("Emulation.setCPUThrottlingRate", { rate: 1 });
  await page.waitForTimeout(SETTLED_MS);
  const frames = [];
  const began = Date.now();
  const sample = async () => [(Date.now() - began) / 60_000, await heapBytes(devtools)];
  const heap = [await sample()];
  while (Date.now() - began < MINUTES * 60_000) {
    frames.push(...(await frameTimes(page)));
    if (Date.now() - began >= heap.length * HEAP_EVERY_MS) heap.push(await sample());
  }
  frames.sort((a, b) => a - b);
  return {
    heap,
    frame_p50_ms: frames[Math.floor(frames.length * 0.5)],
    frame_p95_ms: frames[Math.floor(frames.length * 0.95)],
    frames: frames.length,
  };
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
  const answered = await page.waitForFunction(() => {
    const bar = document.querySelector(".maplibregl-ctrl-scale");
    const showAll = document.querySelector("[aria-label='Show everything']");
    if (bar === null || showAll === null || showAll.disabled) return false;
    // The text alone changes only where a rounded distance does, in the middle of the zoom
    const scale = `${bar.textContent} ${bar.style.width}`;
    const hasChanged = scale !== globalThis.scaleBefore;
    globalThis.scaleBefore = scale;
    if (globalThis.hasClicked) return hasChanged && Date.now();
    if (hasChanged) return false;
    // The map has been moved to its vehicles; what changes now is the answer to this click
    globalThis.hasClicked = true;
    document.querySelector("[aria-label='Zoom in']").click();
    return false;
  }, undefined, { polling: "raf" });
  // By the page's clock, which is this machine's: the way of the answer to here is not the map's
  const interactive_ms = (await answered.jsonValue()) - began;
  await page.waitForFunction((count) => document.querySelectorAll(".vehicle-card").length >= count, VEHICLES);
  return { interactive_ms, first_load_bytes: bytes };
}

async function heapBytes(devtools) {
  for (let count = 0; count < COLLECTIONS; count += 1) {
    await devtools.send("HeapProfiler.collectGarbage");
    await new Promise((resolve) => setTimeout(resolve, 500));
  }
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

// Renders SVG files as documents in headless Chromium, in one process:
//
//   node render.mjs <requests.json
//
// A request is {"file": ..., "out": ..., "perMm": ...} or {"file": ..., "out": ..., "side": ...}: pixels of a millimetre
// of the page, or of the longer side of the page. Prints one JSON line for each request, in their order: {"page": [w, h]}
// in CSS pixels, or {"error": ...}. The PNG holds the page in its upper left corner and may be larger by a pixel or more.
//
// Each file is navigated to, so that processing instructions, entities, media and scripts have the effect that a user
// sees: English, on a screen, in light colours, on white, without a network. Animations stand at their beginning. A page without
// a size of its own takes that of its viewBox; without a viewBox it is an error.
import { readFileSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { launch } from "./chromium.mjs";

const PX_PER_MM = 96 / 25.4;
/** Pages of one browser that render side by side. */
const PAGES = 2;

/** Runs in the page: the box of the root element and its viewBox. */
function measured() {
  const root = document.documentElement;
  if (document.querySelector("parsererror")) return { error: document.querySelector("parsererror").textContent };
  if (!(root instanceof SVGSVGElement)) return { error: `the root is ${root.nodeName}` };
  const { width, height } = root.getBoundingClientRect();
  const view = root.viewBox.baseVal;
  return { box: [width, height], view: view && view.width > 0 && view.height > 0 ? [view.width, view.height] : null };
}

/** Runs in the page: no animation has begun. */
function halt() {
  for (const animation of document.getAnimations()) animation.cancel();
  document.documentElement.pauseAnimations();
  document.documentElement.setCurrentTime(0);
}

/** Runs in the page: ends once it has been laid out and painted in the window that it has now. */
function painted() {
  return new Promise((done) => {
    requestAnimationFrame(() => requestAnimationFrame(done));
    // A page that never paints is shown as it is; one on a busy machine may paint late.
    setTimeout(done, 20000);
  });
}

/** Size of the page in CSS pixels and the window that shows it: a box that follows the window is one without a size. */
function layout(small, large) {
  const [a, b] = [small.box, large.box];
  const own = [0, 1].map((i) => (Math.abs(a[i] - b[i]) < 0.01 ? b[i] : null));
  const view = large.view;
  if (own[0] === null && own[1] === null) {
    if (!view) throw new Error("the page has neither a size nor a viewBox");
    return view;
  }
  if (own.includes(null) && !view) throw new Error("the page has one side and no viewBox");
  const page = [own[0] ?? (own[1] * view[0]) / view[1], own[1] ?? (own[0] * view[1]) / view[0]];
  if (!(page[0] > 0 && page[1] > 0)) throw new Error(`the page measures ${page.join(" x ")}`);
  return page;
}

/** The picture of a page, base64: the second of two equal ones, as a busy browser shows tiles that are not drawn yet. */
async function finished(page, session) {
  let last;
  for (let tries = 0; tries < 20; tries++) {
    await page.evaluate(painted);
    const { data } = await session.send("Page.captureScreenshot", { format: "png", optimizeForSpeed: true });
    if (data === last) return data;
    last = data;
  }
  throw new Error("the page is never the same twice");
}

async function render(page, session, { file, out, perMm, side }) {
  const window = async (width, height, deviceScaleFactor) => {
    await session.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor, mobile: false });
  };
  await window(400, 300, 1);
  await page.goto(pathToFileURL(resolve(file)).href, { timeout: 120000 });
  const small = await page.evaluate(measured);
  if (small.error) throw new Error(small.error.trim().replace(/\s+/g, " ").slice(0, 300));
  await window(700, 800, 1);
  const large = await page.evaluate(measured);
  const size = layout(small, large);
  const scale = perMm ? perMm / PX_PER_MM : side / Math.max(...size);
  const follows = [0, 1].some((i) => Math.abs(small.box[i] - large.box[i]) >= 0.01);
  if (follows && size.some((v) => v !== Math.round(v))) {
    // The window is a whole number of CSS pixels: take them as small as the picture's.
    await window(Math.round(size[0] * scale), Math.round(size[1] * scale), 1);
  } else {
    await window(Math.ceil(size[0] - 1e-3), Math.ceil(size[1] - 1e-3), scale);
  }
  await page.evaluate(halt);
  writeFileSync(out, Buffer.from(await finished(page, session), "base64"));
  return { page: size };
}

const requests = JSON.parse(readFileSync(0, "utf8"));
const browser = await launch({ documents: true });
const context = await browser.newContext({ offline: true, locale: "en-US", colorScheme: "light" });
const answers = new Array(requests.length);
let next = 0;
async function work() {
  let page, session;
  while (next < requests.length) {
    const i = next++;
    try {
      if (!page) {
        page = await context.newPage();
        session = await context.newCDPSession(page);
      }
      answers[i] = await render(page, session, requests[i]);
    } catch (e) {
      answers[i] = { error: String(e.message ?? e) };
      // A page that hangs or crashed is not used again.
      await page?.close().catch(() => {});
      page = null;
    }
  }
}
await Promise.all(Array.from({ length: PAGES }, work));
await browser.close();
for (const answer of answers) console.log(JSON.stringify(answer));

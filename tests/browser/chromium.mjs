// Chromium without a window, as all scripts of this folder use it, and a page with the view.html of a job folder.
import { mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const installed = process.env.TERRACE_BROWSER ?? join(here, "../../.venv/browser");
const { chromium } = createRequire(join(installed, "package.json"))("playwright-core");

const ARGUMENTS = [
  "--no-sandbox",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--force-color-profile=srgb",
];
/** A page that draws with WebGL, without a graphics card. */
const WEBGL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--font-render-hinting=none"];
/** A document by itself, in English. */
const DOCUMENT = ["--disable-gpu", "--hide-scrollbars", "--lang=en-US"];

/** A browser for pages with WebGL, or for documents; its profile is its own, and gone when it is closed. */
export async function launch({ documents = false } = {}) {
  const profile = mkdtempSync(join(tmpdir(), "terrace-browser-"));
  const browser = await chromium.launch({
    executablePath: process.env.TERRACE_CHROMIUM ?? "/usr/bin/chromium",
    headless: true,
    args: [...ARGUMENTS, ...(documents ? DOCUMENT : WEBGL)],
    env: { ...process.env, HOME: profile },
  });
  const close = browser.close.bind(browser);
  browser.close = async () => {
    await close();
    rmSync(profile, { recursive: true, force: true });
  };
  return browser;
}

/** A page with the job open; `noise` holds what it said on the console and what it asked for. */
export async function open(browser, folder, width, height, more = {}) {
  const context = await browser.newContext({ viewport: { width, height }, offline: true, ...more });
  const page = await context.newPage();
  const noise = [];
  const url = pathToFileURL(join(folder, "view.html")).href;
  page.on("console", (m) => noise.push(`${m.type()}: ${m.text()}`));
  page.on("pageerror", (e) => noise.push(`error: ${e.message}`));
  page.on("request", (r) => {
    if (r.url() !== url && !r.url().startsWith("data:")) noise.push(`request: ${r.url().slice(0, 100)}`);
  });
  if (more.before) await page.addInitScript(more.before);
  await page.goto(url);
  const error = await page.evaluate(() => globalThis.terraceView.ready.then((e) => (e ? String(e) : null)));
  return { context, page, noise, error };
}

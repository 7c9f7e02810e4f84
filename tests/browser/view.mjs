// Opens the view.html of job folders in headless Chromium, drives every control and compares what is shown with
// manifest.json of the same folder:
//
//   node view.mjs [--shots FOLDER] [--golden FOLDER [--update]] [--paint-ms N] [--quick] [--pictures] JOB...
//
// One line for each check; exits with 1 if one fails. A golden picture is compared where there is one by the name of
// the job folder. --quick leaves the pictures out; --pictures checks nothing else; --update makes them anew.
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, join, resolve } from "node:path";
import { checks } from "./checks.mjs";
import { launch, open } from "./chromium.mjs";

/** Width and height of the window in CSS pixels, and the width of the golden picture. */
const SIZES = [
  [420, 900, 180],
  [1280, 800, 380],
  [3840, 2160, 420],
];

/** Largest mean difference of a channel from the golden picture, of 255. */
const GOLDEN_DIFFERENCE = 3;

function options() {
  const o = { jobs: [], paintMs: 3000 };
  const words = process.argv.slice(2);
  while (words.length > 0) {
    const word = words.shift();
    if (word === "--shots") o.shots = words.shift();
    else if (word === "--golden") o.golden = words.shift();
    else if (word === "--update") o.update = true;
    else if (word === "--quick") o.quick = true;
    else if (word === "--pictures") o.pictures = true;
    else if (word === "--paint-ms") o.paintMs = Number(words.shift());
    else if (word.startsWith("-")) throw new Error(`there is no option ${word}`);
    else o.jobs.push(resolve(word));
  }
  if (o.jobs.length === 0) throw new Error("give the job folders");
  return o;
}

let failures = 0;
function report(job, name, ok, detail = "") {
  if (!ok) failures += 1;
  console.log(`${ok ? "ok  " : "FAIL"} ${job}: ${name}${detail ? ` (${detail})` : ""}`);
}

/** A picture made smaller, as JPEG, and its mean difference from another; the browser does both. */
async function reduced(page, png, width, other) {
  const answer = await page.evaluate(
    async ([source, w, golden]) => {
      const load = async (src) => {
        const image = new Image();
        image.src = src;
        await image.decode();
        return image;
      };
      const pixels = (image, w, h) => {
        const canvas = Object.assign(document.createElement("canvas"), { width: w, height: h });
        const c = canvas.getContext("2d", { willReadFrequently: true });
        c.imageSmoothingQuality = "high";
        c.drawImage(image, 0, 0, w, h);
        return [canvas, c.getImageData(0, 0, w, h).data];
      };
      const image = await load(source);
      const h = Math.round((image.height * w) / image.width);
      const [canvas] = pixels(image, w, h);
      const jpeg = canvas.toDataURL("image/jpeg", 0.66);
      if (!golden) return { jpeg };
      const [, a] = pixels(await load(jpeg), w, h);
      const [, b] = pixels(await load(golden), w, h);
      return { jpeg, difference: a.reduce((sum, v, i) => sum + Math.abs(v - b[i]), 0) / (a.length * 0.75) };
    },
    [`data:image/png;base64,${png.toString("base64")}`, width, other],
  );
  return { jpeg: Buffer.from(answer.jpeg.split(",")[1], "base64"), difference: answer.difference };
}

async function pictures(browser, folder, name, o) {
  const blank = await (await browser.newContext()).newPage();
  for (const [width, height, small] of SIZES) {
    const { context, page, noise } = await open(browser, folder, width, height, { reducedMotion: "reduce" });
    await page.evaluate(() => {
      const v = globalThis.terraceView;
      v.goToBlock(Math.floor(v.app.head.blocks.count / 2));
      return v.drawn();
    });
    const png = await page.screenshot();
    if (o.shots) {
      mkdirSync(o.shots, { recursive: true });
      writeFileSync(join(o.shots, `${name}-${width}.png`), png);
    }
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    report(name, `page fits ${width} px`, wide <= 0, `${wide} px too wide`);
    report(name, `no message at ${width} px`, noise.length === 0, noise[0]);
    const golden = o.golden && join(o.golden, `${name}-${width}.jpg`);
    if (golden && o.update) {
      mkdirSync(o.golden, { recursive: true });
      writeFileSync(golden, (await reduced(blank, png, small)).jpeg);
    } else if (golden && existsSync(golden)) {
      const other = `data:image/jpeg;base64,${readFileSync(golden).toString("base64")}`;
      const { difference } = await reduced(blank, png, small, other);
      report(
        name,
        `picture at ${width} px as before`,
        difference < GOLDEN_DIFFERENCE,
        `mean difference ${difference.toFixed(2)}`,
      );
    }
    await context.close();
  }
  await blank.context().close();
}

/** What must hold where nothing can be drawn, and that the page itself forbids the network. */
async function refusals(browser, folder, name) {
  const without = await open(browser, folder, 1280, 800, {
    before: () => {
      const original = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
        return kind === "webgl2" ? null : original.call(this, kind, ...more);
      };
    },
  });
  const words = await without.page.locator("#failure").innerText();
  const figures = await without.page.locator("#figures tr").count();
  report(
    name,
    "without WebGL 2 it says so and shows the figures",
    /WebGL 2/.test(words) && figures > 0 && without.noise.length === 0,
    without.noise[0],
  );
  await without.context.close();

  const { context, page } = await open(browser, folder, 800, 600, { offline: false });
  const refused = await page.evaluate(async () => {
    const blocked = [];
    document.addEventListener("securitypolicyviolation", (e) => blocked.push(e.effectiveDirective));
    await fetch("https://localhost:9/").catch(() => null);
    const image = new Image();
    image.src = "https://localhost:9/x.png";
    const script = Object.assign(document.createElement("script"), { src: "https://localhost:9/x.js" });
    document.body.append(script);
    await new Promise((done) => setTimeout(done, 300));
    return blocked.sort();
  });
  report(name, "its policy refuses the network", refused.length >= 3, refused.join(", "));
  await context.close();
}

const o = options();
const browser = await launch();
try {
  for (const folder of o.jobs) {
    const name = basename(folder).replace(/\.job$/, "");
    const manifest = JSON.parse(readFileSync(join(folder, "manifest.json"), "utf8"));
    try {
      if (o.update || o.pictures) {
        await pictures(browser, folder, name, o);
        continue;
      }
      const opened = await open(browser, folder, 960, 640);
      report(name, "opens offline", opened.error === null, opened.error ?? "");
      if (opened.error === null) {
        await checks(opened.page, manifest, (check, ok, detail) => report(name, check, ok, detail), o);
        report(
          name,
          "no message on the console, no request",
          opened.noise.length === 0,
          opened.noise.slice(0, 3).join("; "),
        );
      }
      await opened.context.close();
      await refusals(browser, folder, name);
      if (!o.quick) await pictures(browser, folder, name, o);
    } catch (error) {
      report(name, "all checks ran", false, String(error.stack ?? error).slice(0, 900));
    }
  }
} finally {
  await browser.close();
}
console.log(failures === 0 ? "all checks hold" : `${failures} checks fail`);
process.exit(failures === 0 ? 0 : 1);

// Holds the texture that view.html shows against the marks of program.txt of the same folder, at five zooms from the
// whole texture to a third of the spot a pixel, straight from above:
//
//   node zooms.mjs [--shots FOLDER] [--least 0.9] [--tone] JOB...
//
// Consumes jobs without tilts on level parts. The expected picture is drawn here: what share of each pixel the marks of
// the program cover, a mark being as wide as the spot, but no thinner than a pixel. One line for each zoom with the
// correlation of both pictures over the pixels of the texture; exits with 1 where one is less than asked for, and with
// --tone where the whole texture is not drawn as tone.
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, join, resolve } from "node:path";
import { launch, open } from "./chromium.mjs";

/** Samples of a pixel along each side. */
const SAMPLES = 4;
const ZOOMS = 5;
/** Where closer looks are aimed at: shares of the box of all marks. */
const AIM = [0.43, 0.56];

const words = process.argv.slice(2);
const jobs = [];
let [least, shots, tone] = [0.9, null, false];
while (words.length > 0) {
  const word = words.shift();
  if (word === "--least") least = Number(words.shift());
  else if (word === "--shots") shots = words.shift();
  else if (word === "--tone") tone = true;
  else jobs.push(resolve(word));
}
if (jobs.length === 0) throw new Error("give the job folders");

/** The marks of a program, part frame, mm: each a list of x, y, x, y ... */
function marksOf(folder) {
  const marks = [];
  let centre = [0, 0];
  for (const line of readFileSync(join(folder, "program.txt"), "utf8").split("\n")) {
    const fields = line.split(" ");
    if (fields[0] === "block") centre = [Number(fields[7]), Number(fields[8])];
    else if (/^\d+$/.test(fields[0])) marks.push(fields.slice(4).map((v, i) => (Number(v) + centre[i % 2]) / 1e6));
  }
  return marks;
}

/** The share of each pixel that marks cover. `place` gives the pixel of a place. */
function expected(marks, place, width, height, spot_px) {
  const [w, h] = [width * SAMPLES, height * SAMPLES];
  const hit = new Uint8Array(w * h);
  const half = (Math.max(spot_px, 1) / 2) * SAMPLES;
  const segment = (ax, ay, bx, by) => {
    const [x0, x1] = [Math.max(Math.ceil(Math.min(ax, bx) - half), 0), Math.min(Math.floor(Math.max(ax, bx) + half), w - 1)];
    const [y0, y1] = [Math.max(Math.ceil(Math.min(ay, by) - half), 0), Math.min(Math.floor(Math.max(ay, by) + half), h - 1)];
    const [dx, dy] = [bx - ax, by - ay];
    const square = dx * dx + dy * dy;
    for (let y = y0; y <= y1; y++)
      for (let x = x0; x <= x1; x++) {
        const share = square > 0 ? Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / square, 0), 1) : 0;
        const [u, v] = [x - ax - share * dx, y - ay - share * dy];
        if (u * u + v * v <= half * half) hit[y * w + x] = 1;
      }
  };
  for (const mark of marks) {
    const points = [];
    for (let i = 0; i < mark.length; i += 2)
      points.push(place(mark[i], mark[i + 1]).map((v) => v * SAMPLES - 0.5));
    if (points.length === 1) segment(...points[0], ...points[0]);
    for (let i = 1; i < points.length; i++) segment(...points[i - 1], ...points[i]);
  }
  const shares = new Float64Array(width * height);
  for (let y = 0; y < h; y++)
    for (let x = 0; x < w; x++)
      if (hit[y * w + x]) shares[Math.floor(y / SAMPLES) * width + Math.floor(x / SAMPLES)] += SAMPLES ** -2;
  return shares;
}

function correlation(a, b) {
  const mean = (v) => v.reduce((s, x) => s + x, 0) / v.length;
  const [ma, mb] = [mean(a), mean(b)];
  let [ab, aa, bb] = [0, 0, 0];
  for (let i = 0; i < a.length; i++) {
    const [u, v] = [a[i] - ma, b[i] - mb];
    ab += u * v;
    aa += u * u;
    bb += v * v;
  }
  return ab / Math.sqrt(aa * bb);
}

let failures = 0;
const browser = await launch();
try {
  for (const folder of jobs) {
    const name = basename(folder).replace(/\.job$/, "");
    const marks = marksOf(folder);
    const { page, error } = await open(browser, folder, 1200, 760);
    if (error) throw new Error(error);
    const whole = await page.evaluate(async () => {
      const v = globalThis.terraceView;
      for (const layer of ["blocks", "borders", "field", "lens", "labels", "skipped"]) v.app.layers[layer] = false;
      // The block at work has a border.
      const look = v.app.look.bind(v.app);
      v.app.look = (...of) => ({ ...look(...of), present: -1 });
      v.app.camera.fromAbove();
      v.app.set({});
      await v.drawn();
      const { camera, head } = v.app;
      return { px: camera.pixel_mm(), distance: camera.distance, box: camera.subject, spot: head.spot_mm };
    });
    const [low, high] = whole.box;
    for (let k = 0; k < ZOOMS; k++) {
      const px = whole.px * (whole.spot / 3 / whole.px) ** (k / (ZOOMS - 1));
      const share = k === 0 ? [0.5, 0.5] : AIM;
      const at = [0, 1, 2].map((i) => low[i] + (high[i] - low[i]) * (share[i] ?? 0.5));
      const shown = await page.evaluate(
        async ([p, distance]) => {
          const v = globalThis.terraceView;
          v.lookAt(p, distance);
          await v.drawn();
          const scene = document.getElementById("scene");
          const c = Object.assign(document.createElement("canvas"), { width: scene.width, height: scene.height });
          const d = c.getContext("2d");
          d.drawImage(scene, 0, 0);
          const rgba = d.getImageData(0, 0, c.width, c.height).data;
          const dark = Array.from({ length: rgba.length / 4 }, (_, i) => 255 - (rgba[4 * i] + rgba[4 * i + 1] + rgba[4 * i + 2]) / 3);
          const [o, x, y] = [p, [p[0] + 1, p[1], p[2]], [p[0], p[1] + 1, p[2]]].map((q) => v.project(q));
          const { drawsTone } = v.state();
          return { dark, width: c.width, height: c.height, o, x, y, drawsTone, png: c.toDataURL("image/png") };
        },
        [at, (whole.distance * px) / whole.px],
      );
      const { o, x, y, width, height } = shown;
      const place = (u, v) =>
        [0, 1].map((i) => o[i] + (x[i] - o[i]) * (u - at[0]) + (y[i] - o[i]) * (v - at[1]));
      const shares = expected(marks, place, width, height, whole.spot / px);
      // Beside the texture there is ground, or bare part.
      const [[x0, y1], [x1, y0]] = [place(low[0], low[1]), place(high[0], high[1])];
      const isInside = (i) => {
        const [u, v] = [i % width, Math.floor(i / width)];
        return u > x0 && u < x1 && v > y0 && v < y1;
      };
      const r = correlation(shown.dark.filter((_, i) => isInside(i)), Array.from(shares).filter((_, i) => isInside(i)));
      const how = shown.drawsTone ? "tone" : "lines";
      const holds = r > least && (k > 0 || !tone || shown.drawsTone);
      if (!holds) failures += 1;
      console.log(`${holds ? "ok  " : "FAIL"} ${name}: ${(px * 1000).toFixed(1)} um a pixel, ${how}, correlation ${r.toFixed(3)}`);
      if (shots) {
        mkdirSync(shots, { recursive: true });
        writeFileSync(join(shots, `${name}-${k}.png`), Buffer.from(shown.png.split(",")[1], "base64"));
        const grey = await page.evaluate(([s, w, h]) => {
          const c = Object.assign(document.createElement("canvas"), { width: w, height: h });
          const d = c.getContext("2d");
          const image = d.createImageData(w, h);
          s.forEach((v, i) => image.data.set([255 * (1 - v), 255 * (1 - v), 255 * (1 - v), 255], 4 * i));
          d.putImageData(image, 0, 0);
          return c.toDataURL("image/png");
        }, [Array.from(shares), width, height]);
        writeFileSync(join(shots, `${name}-${k}-expected.png`), Buffer.from(grey.split(",")[1], "base64"));
      }
    }
    await page.context().close();
  }
} finally {
  await browser.close();
}
process.exit(failures === 0 ? 0 : 1);

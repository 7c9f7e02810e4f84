// How long view.html takes to show a job, and how smoothly it turns, without a graphics card:
//
//   node time.mjs JOB...
//
// One line of JSON for each job: `picture_ms` from the call of the page to its first complete picture, the median of
// three calls; `frames_per_s` while the part is turned for three seconds, as it is first seen and from near enough to
// see lines; `marks`.
import { basename, resolve } from "node:path";
import { launch, open } from "./chromium.mjs";

const CALLS = 3;

/** Frames a second while the part turns. */
const turning = (page) =>
  page.evaluate(async () => {
    const v = globalThis.terraceView;
    const begun = performance.now();
    let frames = 0;
    while (performance.now() - begun < 3000) {
      v.app.camera.orbit(4, 0);
      v.app.cameraMoved();
      await new Promise((drawn) => requestAnimationFrame(drawn));
      frames += 1;
    }
    return (frames / (performance.now() - begun)) * 1000;
  });

const browser = await launch();
try {
  for (const folder of process.argv.slice(2).map((word) => resolve(word))) {
    const times = [];
    let opened;
    for (let k = 0; k < CALLS; k++) {
      await opened?.context.close();
      opened = await open(browser, folder, 1280, 800);
      if (opened.error) throw new Error(opened.error);
      times.push(
        await opened.page.evaluate(async () => {
          await globalThis.terraceView.drawn();
          return performance.now();
        }),
      );
    }
    const { page } = opened;
    const marks = await page.evaluate(() => globalThis.terraceView.app.head.marks);
    const far = await turning(page);
    await page.evaluate(async () => {
      const v = globalThis.terraceView;
      v.app.camera.zoom(0.1);
      v.app.cameraMoved();
      await v.drawn();
    });
    const near = await turning(page);
    const round = (v) => Number(v.toFixed(1));
    const picture_ms = Math.round(times.sort((a, b) => a - b)[Math.floor(CALLS / 2)]);
    console.log(JSON.stringify({ job: basename(folder), marks, picture_ms, frames_per_s: [round(far), round(near)] }));
    await opened.context.close();
  }
} finally {
  await browser.close();
}

// Opens a page of `terrace diff` and holds what it promises: both views, one camera as long as its box is checked:
//
//   node both.mjs PAGE
//
// One line for each check; exits with 1 if one fails.
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { launch } from "./chromium.mjs";

let failures = 0;
function check(name, ok, detail = "") {
  if (!ok) failures += 1;
  console.log(`${ok ? "ok  " : "FAIL"} ${name}${detail ? ` (${detail})` : ""}`);
}

const browser = await launch();
try {
  const page = await (await browser.newContext({ viewport: { width: 1600, height: 800 }, offline: true })).newPage();
  const noise = [];
  page.on("console", (m) => noise.push(m.text()));
  page.on("pageerror", (e) => noise.push(e.message));
  await page.goto(pathToFileURL(resolve(process.argv[2])).href);
  const views = page.frames().slice(1);
  check("there are two views", views.length === 2);
  for (const view of views) await view.evaluate(() => globalThis.terraceView.ready.then(() => globalThis.terraceView.drawn()));
  const yaws = () => Promise.all(views.map((v) => v.evaluate(() => globalThis.terraceView.app.camera.yaw)));
  const turn = async (view, yaw) => {
    await view.evaluate(async (to) => {
      const v = globalThis.terraceView;
      v.app.camera.yaw = to;
      v.app.cameraMoved();
      await v.drawn();
    }, yaw);
    await page.waitForTimeout(400);
    return yaws();
  };
  const near = (a, b) => Math.abs(a - b) < 1e-9;
  let [first, second] = await turn(views[0], 0.5);
  check("the second camera follows the first", near(first, 0.5) && near(second, 0.5), `${first}, ${second}`);
  [first, second] = await turn(views[1], 1.25);
  check("the first camera follows the second", near(first, 1.25) && near(second, 1.25), `${first}, ${second}`);
  await page.locator("#together").uncheck();
  [first, second] = await turn(views[0], 0.1);
  check("apart each has its own", near(first, 0.1) && near(second, 1.25), `${first}, ${second}`);
  check("no message on the console", noise.length === 0, noise[0]);
} finally {
  await browser.close();
}
process.exit(failures === 0 ? 0 : 1);

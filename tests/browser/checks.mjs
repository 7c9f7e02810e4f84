// What must hold on the page of one job. `manifest` is that of the job folder; `check(name, ok, detail)` takes results.
// Colours are computed here from the manifest, apart from the page's own arithmetic.

const RAMP = [
  [80, 46, 142],
  [59, 79, 172],
  [0, 112, 182],
  [0, 141, 173],
  [2, 167, 170],
  [9, 194, 158],
  [110, 213, 131],
  [186, 224, 108],
  [252, 231, 101],
];
const DIVERGING = [
  [23, 84, 186],
  [52, 120, 211],
  [101, 157, 225],
  [152, 184, 219],
  [178, 184, 190],
  [224, 178, 134],
  [232, 146, 72],
  [220, 106, 24],
  [178, 66, 6],
];
const SERIES = [
  [31, 108, 196],
  [236, 146, 28],
  [205, 38, 112],
  [38, 160, 112],
  [110, 198, 236],
  [124, 66, 182],
  [214, 204, 60],
  [150, 92, 48],
];

/** Rotation by rows and shift of a part that is not turned. */
const STANDS = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];

/** The colour at a share of a ramp. */
function along(anchors, value, low, high) {
  const share = high > low ? Math.min(Math.max((value - low) / (high - low), 0), 1) * 8 : 4;
  const k = Math.min(Math.floor(share), 7);
  return anchors[k].map((a, i) => a + (anchors[k + 1][i] - a) * (share - k));
}

const apart = (a, b) => Math.max(...a.map((v, i) => Math.abs(v - b[i])));
const span = (values) => [
  values.reduce((a, b) => Math.min(a, b), Infinity),
  values.reduce((a, b) => Math.max(a, b), -Infinity),
];
const turned = (m, p) => [0, 1, 2].map((r) => m[3 * r] * p[0] + m[3 * r + 1] * p[1] + m[3 * r + 2] * p[2] + m[9 + r]);

export async function checks(page, manifest, check, options) {
  const isFly = manifest.mode === "on-the-fly";
  const total = isFly ? manifest.summary.time_s : manifest.summary.time_s.total;
  const view = (f, ...a) =>
    page.evaluate(
      ([text, args]) => new Function("v", "args", `return (${text})(v, ...args)`)(globalThis.terraceView, args),
      [f.toString(), a],
    );
  const state = () => view((v) => v.state());
  const drawn = () => view((v) => v.drawn());
  const head = await view((v) => v.app.head);
  const blocks = await view((v) => v.app.blocks);

  // --- what is there at once
  const paint = await page.evaluate(
    () => performance.getEntriesByType("paint").find((e) => e.name === "first-contentful-paint")?.startTime,
  );
  check("first paint", paint < options.paintMs, `${Math.round(paint)} ms`);
  await drawn();
  const ready = await page.evaluate(() => Math.round(performance.now()));
  check("marks of the first picture are drawn", true, `${ready} ms`);
  check(
    "title and figures are words",
    (await page.title()).length > 0 && (await page.locator("#figures tr").count()) === head.figures.length,
  );
  check("its approximations are stated", /triangles/.test(await page.locator("#accuracy").innerText()));
  const nameless = await page.evaluate(() =>
    [...document.querySelectorAll("button, select, input")]
      .filter(
        (e) => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent?.trim() || e.id === "block-id"),
      )
      .map((e) => e.id),
  );
  check("every control has a name", nameless.length === 0, nameless.join(" "));

  // --- the first look: all texture, marked or not, but for what lies beside the part
  const lost = head.skipped.filter((s) => s.reason !== "beyond").map((s) => s.box);
  if (lost.length > 0) {
    const corners = lost.flatMap(([x0, y0, x1, y1]) => [
      [x0, y0],
      [x1, y0],
      [x0, y1],
      [x1, y1],
    ]);
    const heights = span(head.chunks.flatMap((c) => c.box.map((end) => end[2])));
    const places = corners.flatMap((p) => heights.map((z) => [...p, z]));
    // Of the part before a table turns it.
    const seen = await view(({ app: { camera } }, ps) => ps.map((p) => camera.project(camera.matrices().both, p)), places);
    const size = await page.locator("#scene").boundingBox();
    const inside = seen.filter(([x, y]) => x >= 0 && x <= size.width && y >= 0 && y <= size.height);
    const marked = span(head.chunks.flatMap((c) => c.box.map((end) => end[0])));
    const beside = lost.some(([x0, , x1]) => x0 < marked[0] || x1 > marked[1]);
    check(
      "the first look takes in texture that is not marked",
      inside.length === seen.length,
      `${inside.length} of ${seen.length} corners${beside ? ", beside all marks" : ""}`,
    );
  }

  /** The part of the picture that is not background, as one number for each of some pixels. */
  const picture = async () => {
    await drawn();
    return view((v) => {
      const c = document.createElement("canvas");
      [c.width, c.height] = [160, 110];
      const d = c.getContext("2d");
      d.drawImage(document.getElementById("scene"), 0, 0, 160, 110);
      d.drawImage(document.getElementById("overlay"), 0, 0, 160, 110);
      return [...d.getImageData(0, 0, 160, 110).data];
    });
  };
  const differs = (a, b) => a.some((v, i) => Math.abs(v - b[i]) > 3);

  // --- the clock
  const seconds = async () => Number(/([\d.]+) s of/.exec(await page.locator("#time").innerText())[1]);
  const slide = (id, value) =>
    page.locator(id).evaluate((e, v) => {
      e.value = String(v);
      e.dispatchEvent(new Event("input"));
    }, value);
  await slide("#seek", total);
  await drawn();
  check(
    "the clock ends at the manifest's time",
    Math.abs((await seconds()) - total) <= 0.1,
    `${await seconds()} s, manifest ${total.toFixed(3)} s`,
  );
  check("the page's time is the manifest's", Math.abs(head.time_s - total) < 1e-3);
  if (!isFly) {
    let [worst, marking] = [0, 0];
    manifest.blocks.forEach((b, i) => {
      worst = Math.max(worst, Math.abs(blocks.end[i] - blocks.start[i] - b.time_s));
      marking += b.time_s;
    });
    const moving = blocks.begin.reduce((sum, t, i) => sum + blocks.start[i] - t, 0);
    check(
      "the time of each block is the manifest's",
      blocks.id.length === manifest.blocks.length && worst < 1e-3,
      `${blocks.id.length} blocks`,
    );
    check(
      "blocks follow each other to the end",
      Math.abs(marking + moving - total) <= 0.1,
      `${(marking + moving - total).toFixed(4)} s`,
    );
  }
  let worst = 0;
  const count = head.blocks.count;
  const chosen = [...new Set(Array.from({ length: 20 }, (_, k) => Math.round((k * (count - 1)) / 19)))];
  for (const i of chosen) {
    await slide("#stops", i + 1);
    await drawn();
    const s = await state();
    if (s.block !== i || s.id !== blocks.id[i]) worst = Infinity;
    worst = Math.max(worst, Math.abs((await seconds()) - blocks.start[i]));
  }
  check(
    "the slider over stops shows each stop's clock",
    worst <= 0.1,
    `within ${worst.toFixed(3)} s of ${chosen.length} stops`,
  );

  // --- play, pause, step, keys
  await view((v) => v.setTime(0));
  await page.locator("#play").click();
  await page.waitForFunction(() => globalThis.terraceView.state().time > 0);
  const playing = await state();
  check("play moves the clock and hides what is not marked yet", playing.playing && playing.time > 0 && playing.soFar);
  await page.locator("#play").click();
  await drawn();
  const paused = (await state()).time;
  await page.waitForTimeout(150);
  check("pause holds the clock", (await state()).time === paused && paused > 0);
  await page.locator("#scene").focus();
  await page.keyboard.press(" ");
  const spaced = (await state()).playing;
  await page.keyboard.press(" ");
  check("the space bar plays and pauses", spaced && !(await state()).playing);
  for (const value of await page.locator("#speed option").evaluateAll((o) => o.map((e) => e.value))) {
    await page.locator("#speed").selectOption(value);
    await view((v) => {
      v.setTime(0);
      v.app.play(true);
    });
    await page.waitForFunction(
      () => globalThis.terraceView.state().time > 0 || !globalThis.terraceView.state().playing,
    );
    const s = await state();
    await view((v) => v.app.play(false));
    check(`speed ${value}`, s.time > 0, `${s.time.toFixed(2)} s`);
  }
  await page.locator("#so-far").uncheck();
  await view((v) => v.goToBlock(0));
  await page.locator("#next").click();
  const second = (await state()).block;
  await page.locator("#previous").click();
  check("step forward and back", second === Math.min(1, count - 1) && (await state()).block === 0);
  await page.locator("#scene").focus();
  await page.keyboard.press("ArrowRight");
  const right = (await state()).block;
  await page.keyboard.press("End");
  const end = (await state()).block;
  await page.keyboard.press("Home");
  check(
    "arrow keys, Home and End step",
    right === Math.min(1, count - 1) && end === count - 1 && (await state()).block === 0,
  );
  const camera = async () => JSON.stringify((await state()).camera);
  for (const [key, words] of [
    ["+", "nearer"],
    ["-", "farther"],
    ["Shift+ArrowLeft", "turn"],
    ["Alt+ArrowUp", "move"],
    ["t", "above"],
    ["w", "part"],
    ["b", "block"],
    ["r", "texture"],
  ]) {
    const before = await camera();
    await page.keyboard.press(key);
    check(`key ${key}: ${words}`, (await camera()) !== before || (key === "w" && head.chunks.length === 0));
  }
  for (const id of ["#nearer", "#farther", "#above", "#whole", "#to-block", "#texture"]) {
    const before = await camera();
    await page.locator(id).click();
    check(`button ${id.slice(1)}`, (await camera()) !== before);
  }
  await page.locator("#scene").focus();
  await page.keyboard.press("?");
  const isOpen = await page.locator("#keys").evaluate((d) => d.open);
  await page.keyboard.press("Escape");
  await page.locator("#help").click();
  const again = await page.locator("#keys").evaluate((d) => d.open);
  await page.locator("#keys button").click();
  check("help opens and closes", isOpen && again && !(await page.locator("#keys").evaluate((d) => d.open)));

  // --- pointer
  const canvas = await page.locator("#scene").boundingBox();
  const middle = [canvas.x + canvas.width / 2, canvas.y + canvas.height / 2];
  const drag = async (button, modifier) => {
    const before = await camera();
    if (modifier) await page.keyboard.down(modifier);
    await page.mouse.move(...middle);
    await page.mouse.down({ button });
    await page.mouse.move(middle[0] + 60, middle[1] + 25, { steps: 3 });
    await page.mouse.up({ button });
    if (modifier) await page.keyboard.up(modifier);
    return (await camera()) !== before;
  };
  check(
    "dragging turns, the right button and Shift move",
    (await drag("left")) && (await drag("right")) && (await drag("left", "Shift")),
  );
  const far = (await state()).camera.distance;
  await page.mouse.move(...middle);
  await page.mouse.wheel(0, -300);
  await page.waitForTimeout(100);
  check("the wheel comes nearer", (await state()).camera.distance < far);
  await page.locator("#texture").click();

  // --- blocks: typed, clicked
  const wanted = Math.floor(count / 2);
  await page.keyboard.press("/");
  await page.keyboard.type(blocks.id[wanted]);
  await page.keyboard.press("Enter");
  await drawn();
  check(
    "a typed block is shown",
    (await state()).block === wanted && (await page.locator("#block-id").inputValue()) === blocks.id[wanted],
  );
  await page.locator("#block-id").fill("B99999");
  await page.locator("#find button").click();
  check("an unknown block is said to be unknown", /no block/.test(await page.locator("#find-note").innerText()));
  if (!isFly) {
    const text = await page.locator("#block").innerText();
    const b = manifest.blocks[(await state()).block];
    const files = Object.values(b.files);
    check(
      "the data of the block is the manifest's",
      text.includes(`${b.lpfl_mm.toFixed(3).replace(/^-(0\.0*)$/, "$1")} mm`) &&
        text.includes(String(b.strokes)) &&
        files.every((f) => text.includes(f)),
    );
    const near = page.locator("#neighbours button");
    if ((await near.count()) > 0) {
      const id = await near.first().innerText();
      await near.first().click();
      check("a neighbour is one click away", (await state()).id === id);
    } else check("a neighbour is one click away", count < 3, "the block has none");
  }
  const samples = await view((v) => v.sampleMarks(50));
  check("marks can be sampled", samples.length > 0, `${samples.length}`);
  const clicks = samples.filter((_, i) => i % 5 === 2);
  let [hits, draped, asked] = [0, 0, 0];
  const misses = [];
  for (const mark of clicks) {
    if (!isFly)
      await view((v, i) => {
        v.app.pass = v.app.blocks.pass[i];
        v.app.setup = v.app.blocks.setup[i];
      }, mark.block);
    await view((v, m) => {
      v.goToBlock(m.block);
      v.lookAt(m.middle, v.app.head.field.size[0] * 0.15);
    }, mark);
    await drawn();
    const [x, y] = await view((v, p) => v.project(p), mark.middle);
    await view((v, i) => v.goToBlock(i === 0 ? 1 : 0), mark.block);
    if (blocks.turn?.[mark.block])
      await view((v, m) => {
        v.goToBlock(m.block);
        v.lookAt(m.middle, v.app.head.field.size[0] * 0.15);
      }, mark);
    await drawn();
    await page.mouse.click(canvas.x + x, canvas.y + y);
    await drawn();
    const s = await state();
    const named = await page.locator("#block-id").inputValue();
    if (s.block === mark.block && named === mark.id) hits += 1;
    else misses.push(`${mark.id} shown as ${named}`);
    if (head.maps.length > 0) {
      asked += 1;
      await page.locator("#layer-marks").uncheck();
      await drawn();
      const picked = await view((v, px, py) => v.pick(px, py), x, y);
      await page.mouse.click(canvas.x + x, canvas.y + y);
      await drawn();
      if (picked < 0 || (await state()).block === picked) draped += 1;
      await page.locator("#layer-marks").check();
    }
  }
  await view((v) => {
    v.app.pass = 0;
    v.app.setup = 0;
  });
  check(
    "the block clicked is the block named",
    hits === clicks.length,
    `${hits} of ${clicks.length} marks; ${misses.slice(0, 3).join(", ")}`,
  );
  if (asked > 0) check("a click on the part names the block draped there", draped === asked, `${draped} of ${asked}`);
  await page.locator("#texture").click();

  // --- the table turns the part
  if (!isFly) {
    let out = 0;
    for (const mark of samples) {
      const b = manifest.blocks[mark.block];
      const q = turned(blocks.turn?.[mark.block] ?? STANDS, mark.at);
      // Marks of a later pass are drawn on the part as it was, above the surface that this pass marks.
      q[2] -= manifest.passes?.[b.pass - 1]?.lowered_mm ?? 0;
      const reach = head.field.size.map((s) => s / 2 + 0.01);
      if (q[2] < b.z_lo_mm - 0.002 || q[2] > b.z_hi_mm + 0.002) out += 1;
      else if ([0, 1].some((k) => Math.abs(q[k] - b.centre_mm[k]) > reach[k])) out += 1;
      else if (Math.abs(mark.defocus_um - (q[2] - b.lpfl_mm) * 1000) > 1.5) out += 1;
    }
    check("marks lie in the field and heights of their turned block", out === 0, `${out} do not`);
    const tilted = blocks.turn?.findIndex((t) => t) ?? -1;
    if (tilted >= 0) {
      await view((v, i) => v.goToBlock(i), tilted);
      const s = await state();
      const up = blocks.turn[tilted].slice(6, 9);
      if (head.head_tilts)
        check(
          "at a tilted stop the head leans and the part stands",
          JSON.stringify(s.turn) === JSON.stringify(STANDS) && apart(s.up, up) < 1e-6 && up[2] < 1,
        );
      else
        check(
          "at a tilted stop the part is turned",
          JSON.stringify(s.turn) === JSON.stringify(blocks.turn[tilted]) && s.up[2] === 1,
        );
      const i = blocks.turn.findIndex(
        (t, k) =>
          k > 0 && blocks.start[k] > blocks.begin[k] && JSON.stringify(t) !== JSON.stringify(blocks.turn[k - 1]),
      );
      if (i > 0) {
        await view((v, t) => v.setTime(t), (blocks.begin[i] + blocks.start[i]) / 2);
        const half = await state();
        const ends = [i - 1, i].map((k) => (blocks.turn[k] ?? STANDS).slice(6, 9));
        if (head.head_tilts)
          check(
            "between stops the head leans as between their turns",
            half.does === "moves" && ends.every((up) => apart(half.up, up) <= apart(...ends) && apart(half.up, up) > 0),
          );
        else
          check(
            "between stops the part is between their turns",
            half.does === "moves" && JSON.stringify(half.turn) !== JSON.stringify(blocks.turn[i]),
          );
      }
    }
  } else {
    await view((v) => v.setTime(v.app.head.time_s * 0.31));
    const a = await state();
    await view((v) => v.setTime(v.app.head.time_s * 0.63));
    const b = await state();
    const reach = Math.hypot(...head.field.size) / 2 + 0.5;
    const off = (s) => Math.hypot(s.beam.at[0] - s.centre[0], s.beam.at[1] - s.centre[1]);
    check(
      "on the fly the head moves and the beam stays in its field",
      Math.hypot(...a.centre.map((v, k) => v - b.centre[k])) > 0 && off(a) <= reach && off(b) <= reach,
    );
  }

  // --- colours
  await view((v) => v.goToBlock(0));
  const base = await picture();
  const lpfl = isFly ? null : span(manifest.blocks.map((b) => b.lpfl_mm));
  for (const by of await page.locator("#by option").evaluateAll((o) => o.map((e) => e.value))) {
    await page.locator("#by").selectOption(by);
    const shown = await view((v) => v.sampleMarks(50));
    const deviations = shown.map((m) => {
      if (m.colour === null) return 999;
      const b = isFly ? null : manifest.blocks[m.block];
      if (by === "height")
        return isFly
          ? apart(m.colour, along(RAMP, m.at[2] - m.defocus_um / 1000, ...head.ranges.height_mm))
          : apart(m.colour, along(RAMP, b.lpfl_mm, ...lpfl).map(Math.round));
      if (by === "defocus") {
        const reach = Math.max(...head.ranges.defocus_um.map(Math.abs));
        return apart(m.colour, along(DIVERGING, m.defocus_um, -reach, reach));
      }
      if (by === "incidence") return apart(m.colour, along(RAMP, m.incidence_deg, ...head.ranges.incidence_deg));
      if (by === "dose") return isFly ? 0 : apart(m.colour, along(RAMP, b.dose[0], ...head.ranges.dose));
      if (by === "pen") return apart(m.colour, SERIES[m.pen % 8]);
      if (by === "pass") return apart(m.colour, SERIES[((b?.pass ?? 1) - 1) % 8]);
      if (by === "time") return apart(m.colour, along(RAMP, m.time_s, 0, total));
      return Math.min(...[[134, 142, 150], ...SERIES.slice(0, 4)].map((c) => apart(m.colour, c)));
    });
    const most = Math.max(...deviations);
    check(
      `colour by ${by}: 50 marks as the manifest's values`,
      most <= (by === "height" || by === "pen" || by === "pass" ? 1 : 3),
      `${shown.length} marks, within ${most.toFixed(2)} of 255`,
    );
    check(`legend of ${by}`, (await page.locator("#legend").innerText()).length > 3);
    if (["incidence", "time"].includes(by)) check(`the picture changes with ${by}`, differs(base, await picture()));
  }
  if (!isFly) {
    const within = samples.every((m) => {
      const b = manifest.blocks[m.block];
      const reach = Math.max(Math.abs(b.z_lo_mm - b.lpfl_mm), Math.abs(b.z_hi_mm - b.lpfl_mm)) * 1000;
      return (
        Math.abs(m.defocus_um) <= reach + 0.6 &&
        m.incidence_deg <= b.incidence_deg[1] + 0.3 &&
        b.pens.includes(head.pens[m.pen].name) &&
        m.time_s >= blocks.start[m.block] - 1e-3 &&
        m.time_s <= blocks.end[m.block] + 1e-3
      );
    });
    check("defocus, incidence, pen and time of marks within those of the manifest's blocks", within);
  }
  await page.locator("#by").selectOption("height");

  // --- layers
  await view((v) => v.goToBlock(Math.min(2, v.app.head.blocks.count - 1)));
  for (const id of await page.locator("#layers input").evaluateAll((b) => b.map((e) => e.id))) {
    if (id === "layer-labels" || id === "layer-field") await page.locator("#to-block").click();
    const one = await picture();
    await page.locator(`#${id}`).click();
    const two = await picture();
    await page.locator(`#${id}`).click();
    const three = await picture();
    // What lies under marks, or out of the picture, changes little.
    const mayHide = [
      "layer-borders",
      "layer-blocks",
      "layer-seams",
      "layer-skipped",
      "layer-travel",
      "layer-path",
    ].includes(id);
    check(
      `layer ${id.slice(6)}`,
      (mayHide || differs(one, two)) && !differs(one, three),
      differs(one, two) ? "" : "no difference in sight",
    );
    if (id === "layer-labels" || id === "layer-field") await page.locator("#texture").click();
  }

  // --- measuring and the section
  await page.locator("#above").click();
  await drawn();
  const measured = async (...ends) => {
    await page.locator("#measure").click();
    for (const p of ends) {
      const [x, y] = await view((v, q) => v.project(q), p);
      await page.locator("#scene").click({ position: { x, y } });
    }
    return { ends: (await state()).measured, words: await page.locator("#measured").innerText() };
  };
  // Not at the rim, beside which there is no part, and not below buttons and words.
  const marked = (await view((v) => v.sampleMarks(400))).map((m) => m.at).sort((a, b) => a[0] - b[0]);
  const places = await view((v, all) => all.map((p) => v.project(p)), marked);
  const { width, height } = await page.locator("#scene").boundingBox();
  const free = marked.filter((_, i) => {
    const [u, v] = [places[i][0] / width, places[i][1] / height];
    return u > 0.1 && u < 0.9 && v > 0.2 && v < 0.5;
  });
  const [first, last] = [0.1, 0.9].map((share) => free[Math.floor(share * (free.length - 1))]);
  const { ends, words } = await measured(first, last);
  const off = ends.map((p, i) => Math.hypot(p[0] - [first, last][i][0], p[1] - [first, last][i][1]));
  const pixel = await view((v) => v.app.camera.pixel_mm());
  const length = ends.length === 2 ? Math.hypot(...[0, 1, 2].map((k) => ends[1][k] - ends[0][k])) : NaN;
  check(
    "two clicks measure between two places of the part",
    ends.length === 2 && Math.max(...off) < 3 * pixel + head.part.within_mm && words.startsWith(length.toFixed(3)),
    `${words} (${off.map((v) => v.toFixed(3)).join(", ")} mm off)`,
  );
  const inked = await page.locator("#profile").evaluate((c) => {
    const pixels = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
    const colours = new Set();
    for (let i = 0; i < pixels.length; i += 4) if (pixels[i + 3] > 200) colours.add(pixels.slice(i, i + 3).join());
    return colours.size;
  });
  check("the section is drawn", inked > (isFly ? 2 : 3), `${inked} colours`);
  await page.keyboard.press("Escape");
  check("Escape ends measuring", !(await page.locator("#section").isVisible()));
  await page.locator("#texture").click();

  // --- histograms
  for (const which of ["defocus", "incidence"]) {
    const bars = page.locator(`#${which} .bars button`);
    const histogram = head.histograms[which === "defocus" ? "defocus_um" : "incidence_deg"];
    const longest = histogram.length_mm.indexOf(Math.max(...histogram.length_mm));
    await bars.nth(longest).click();
    const interval = (await state())[which];
    const [low, high] = [histogram.edges[longest], histogram.edges[longest + 1]];
    const shown = await view((v) => v.sampleMarks(50));
    const value = (m) =>
      which === "defocus" ? (histogram.edges[0] >= 0 ? Math.abs(m.defocus_um) : m.defocus_um) : m.incidence_deg;
    const margin = 1e-3 + (high - low) * 1e-4;
    const wrong = shown.filter(
      (m) =>
        (value(m) > low + margin && value(m) < high - margin && m.colour === null) ||
        ((value(m) < low - margin || value(m) > high + margin) && m.colour !== null),
    );
    check(
      `a bar of ${which} shows only its marks`,
      interval?.[0] === low && interval[1] === high && wrong.length === 0,
      `${shown.filter((m) => m.colour).length} of ${shown.length} marks`,
    );
    const other = longest === histogram.length_mm.length - 1 ? longest - 1 : longest + 1;
    await bars.nth(other).click({ modifiers: ["Shift"] });
    const wider = (await state())[which];
    check(`Shift adds a bar of ${which}`, wider[1] - wider[0] > high - low);
    await bars.nth(longest).click();
    await bars.nth(longest).click();
    check(`the same bar of ${which} again shows all`, (await state())[which] === null);
  }

  // --- set-ups, passes, pens, what is marked so far
  for (const [id, key, of] of [
    ["#pass", "pass", "pass"],
    ["#setup", "setup", "setup"],
  ]) {
    if (!(await page.locator(id).isVisible())) continue;
    await page.locator(id).selectOption("2");
    const shown = await view((v) => v.sampleMarks(50));
    check(
      `${key} 2 alone is shown`,
      shown.every((m) => (m.colour !== null) === (manifest.blocks[m.block][of] === 2)),
    );
    await page.locator(id).selectOption("0");
  }
  if (await page.locator("#pen").isVisible()) {
    await page.locator("#pen").selectOption("0");
    const shown = await view((v) => v.sampleMarks(50));
    check(
      "one pen alone is shown",
      shown.every((m) => (m.colour !== null) === (m.pen === 0)),
    );
    await page.locator("#pen").selectOption("-1");
  }
  await page.locator("#so-far").check();
  await view((v) => v.setTime(v.app.head.time_s / 2));
  const shown = await view((v) => v.sampleMarks(50));
  check(
    "only what is marked so far is shown",
    shown.every((m) => Math.abs(m.time_s - total / 2) < 1e-3 || (m.colour !== null) === m.time_s < total / 2),
  );
  await page.locator("#so-far").uncheck();
  await page.locator("#follow").check();
  const followed = await camera();
  await view((v) => v.setTime(v.app.head.time_s * 0.9));
  await drawn();
  await view((v) => v.setTime(v.app.head.time_s * 0.1));
  await drawn();
  check("the camera follows the field", (await camera()) !== followed || count < 2);
  await page.locator("#follow").uncheck();

  // --- light and dark, speech
  await drawn();
  const theme = () => page.evaluate(() => document.documentElement.dataset.theme);
  const before = await theme();
  await page.locator("#theme").click();
  const after = await theme();
  await page.locator("#theme").click();
  check("light and dark by the switch", before !== after && (await theme()) === before);
  await page.emulateMedia({ colorScheme: "dark" });
  const dark = await page.waitForFunction(() => document.documentElement.dataset.theme === "dark").then(() => "dark");
  await page.emulateMedia({ colorScheme: "light" });
  check("light and dark by the system", dark === "dark");
  check("the present stop is said in words", (await page.locator("#spoken").innerText()).includes((await state()).id));
}

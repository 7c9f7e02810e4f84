// @ts-check
/**
 * The page as a whole: what is shown, when it is drawn, and what buttons, keys and pointers do.
 *
 * Draws only when something changed. `window.terraceView` is the same for scripts and tests; see `Api`.
 */

class App {
  /** @param {Head} head @param {Blocks} blocks */
  constructor(head, blocks) {
    this.head = head;
    this.blocks = blocks;
    this.scene = new Scene(element("scene", HTMLCanvasElement), head, blocks, (stale) => this.changed(stale));
    this.probe = new Probe(this.scene);
    this.timeline = new Timeline(head, blocks);
    this.overlay = new Overlay(element("overlay", HTMLCanvasElement), head, this.timeline, this.scene.block_mm);
    this.camera = new Camera(head.box, boxOfTexture(head));
    this.measure = new Measure(this);
    /** Where the camera stood when another page was last told. */
    this.told = "";
    /** @type {Theme} */
    this.theme = { ground: [0, 0, 0], part: [0, 0, 0], ink: [0, 0, 0], accent: [0, 0, 0] };
    /** @type {Strokes} */
    this.strokes = { ink: "", halo: "", path: "", field: "" };
    this.size = 1;
    /** Of a folder that holds the rest of a job the blocks that are left. @type {Set<string>|null} */
    this.left = head.left ? new Set(head.left) : null;
    this.readStyle();
    /** The clock, s. */
    this.time = 0;
    this.playing = false;
    /** @type {ColourBy} */
    this.by = "height";
    /** @type {[number, number]|null} */
    this.defocus = null;
    /** @type {[number, number]|null} */
    this.incidence = null;
    this.pass = 0;
    this.setup = 0;
    this.pen = -1;
    this.soFar = false;
    this.follow = false;
    this.layers = /** @type {Record<Layer, boolean>} */ (Object.fromEntries(LAYERS.map(([l, , on]) => [l, on])));
    /** @type {Map<number, Set<number>>[]} */
    this.touching = [];
    /** Until when the picture counts as moving, ms. */
    this.movingUntil = 0;
    /** Whether the camera moved since the last frame, which on a slow computer is longer ago than that. */
    this.hasMoved = false;
    /** Whether pictures are drawn with half the pixels, and the part roughly, while something moves: the graphics card
     * is slow. */
    this.isCoarse = this.scene.isSoftware;
    this.wasMoving = false;
    this.isDue = false;
    this.isStale = true;
    /** Centre of the field to which the camera was last moved. @type {Vec3|null} */
    this.followed = null;
    this.lastFrame = 0;
    /** Times of frames while something moves, ms. @type {number[]} */
    this.frames = [];
    this.shownBlock = -1;
    this.spokenAt = 0;
    /** What the palette was made for. */
    this.paletteKey = "";
    this.histograms = [
      new HistogramView(
        place("defocus"),
        head.histograms.defocus_um,
        "µm",
        (v) => ofValue(DIVERGING, v, aboutZero(head.ranges.defocus_um)),
        (v) => this.set({ defocus: v }),
      ),
      new HistogramView(
        place("incidence"),
        head.histograms.incidence_deg,
        "deg",
        (v) => ofValue(RAMP, v, head.ranges.incidence_deg),
        (v) => this.set({ incidence: v }),
      ),
    ];
  }

  /** What the scene is to show at this moment. @param {Moment} moment @param {boolean} moving @returns {Look} */
  look(moment, moving) {
    const { blocks, pass, setup, left } = this;
    return {
      camera: this.camera,
      turn: moment.turn,
      by: this.by,
      now: this.soFar ? this.time : Infinity,
      present: moment.block,
      pen: this.pen,
      defocus: this.defocus,
      incidence: this.incidence,
      layers: this.layers,
      pass: pass || blocks.pass[moment.block],
      isShown: (i) =>
        (pass === 0 || blocks.pass[i] === pass) &&
        (setup === 0 || blocks.setup[i] === setup) &&
        (left === null || left.has(blocks.id[i])),
      theme: this.theme,
      moving,
      rough: moving && this.isCoarse,
      size: this.size,
    };
  }

  /** What the style sheet says of colours and of the size of text. */
  readStyle() {
    const style = getComputedStyle(document.documentElement);
    /** @param {string} name @returns {Colour} */
    const colour = (name) => {
      const n = parseInt(style.getPropertyValue(name).trim().slice(1), 16);
      return [n >> 16, (n >> 8) & 255, n & 255];
    };
    this.theme = {
      ground: colour("--ground"),
      part: colour("--part"),
      ink: colour("--ink"),
      accent: colour("--accent"),
    };
    /** @param {string} name */
    const line = (name) => style.getPropertyValue(name).trim();
    this.strokes = { ink: line("--ink"), halo: line("--halo"), path: line("--path"), field: line("--field") };
    this.size = parseFloat(style.fontSize) / 15;
  }

  /** Where the machine is at the clock's time. */
  moment() {
    return this.timeline.at(this.time, (block) => {
      const k = this.scene.chunkOf(block);
      if (k < 0) return null;
      if (!this.scene.loads[k]) this.scene.load(k).catch((e) => reportError(e));
      return this.scene.chunks[k]?.data ?? null;
    });
  }

  /** Changes what is shown. @param {Partial<App>} values */
  set(values) {
    Object.assign(this, values);
    this.changed();
  }

  /** The next frame is to draw: the picture anew, or what is still to be added. @param {boolean} [isStale] */
  changed(isStale = true) {
    this.isStale ||= isStale;
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame((now) => this.frame(now));
  }

  /** The camera moved: pictures are drawn within the budget until it rests. */
  cameraMoved() {
    this.movingUntil = performance.now() + 160;
    this.hasMoved = true;
    this.changed();
  }

  /** Draws what has changed, and asks for the next frame while there is more. @param {number} now ms */
  frame(now) {
    this.isDue = false;
    const past = now - this.lastFrame;
    this.lastFrame = now;
    if (this.playing) this.advance(past / 1000);
    const moving = this.playing || this.hasMoved || now < this.movingUntil;
    this.hasMoved = false;
    this.resize(moving && this.isCoarse ? 0.5 : 1);
    const moment = this.moment();
    if (this.follow && this.followField(moment)) this.isStale = true;
    const look = this.look(moment, moving);
    let isMore = false;
    if (this.isStale || moving) {
      this.isStale = false;
      const key = `${look.by} ${this.pass} ${this.setup} ${look.now}`;
      if (key !== this.paletteKey) this.scene.setPalette(look);
      this.paletteKey = key;
      this.scene.draw(look);
      this.overlay.draw(look, moment, this.strokes, this.measure);
      this.showClock(moment);
      this.tell();
    }
    if (moving && this.wasMoving) {
      this.frames.push(past);
      if (this.frames.length > 120) this.frames.shift();
      // Frames are kept between 20 and 40 ms by how many lines they draw.
      if (past > 40) this.scene.budget = Math.max(BUDGET[0], this.scene.budget * Math.max(30 / past, 0.1));
      if (past > 120) this.isCoarse = true;
      if (past < 20) this.scene.budget = Math.min(BUDGET[1], this.scene.budget * 1.1);
    }
    this.wasMoving = moving;
    if (!moving) isMore = this.scene.drawMore(look);
    place("progress").textContent = this.scene.loading > 0 || isMore ? "Drawing marks" : this.scene.said();
    // What was drawn within a budget is drawn in full once it rests.
    if (moving || isMore) this.changed(moving);
  }

  /** Tells a page that shows two jobs side by side where the camera stands. */
  tell() {
    if (window.parent === window) return;
    const { yaw, pitch, distance, target } = this.camera;
    const stand = this.camera.stand();
    // As long as nobody has moved it, each job is looked at as it lies.
    if (stand === (this.told || this.camera.first)) return;
    this.told = stand;
    window.parent.postMessage({ terraceLook: { yaw, pitch, distance, target } }, "*");
  }

  /** The camera of the other job moved. @param {{yaw: number, pitch: number, distance: number, target: Vec3}} look */
  follows(look) {
    Object.assign(this.camera, look);
    this.told = this.camera.stand();
    this.cameraMoved();
  }

  /** Moves the clock. @param {number} seconds of the user */
  advance(seconds) {
    const speed = choice("speed").value;
    const factor = speed === "whole" ? this.head.time_s / 60 : Number(speed);
    this.time = Math.min(this.time + Math.min(seconds, 1) * factor, this.head.time_s);
    if (this.time >= this.head.time_s) this.play(false);
  }

  /** Moves the camera with the field; whether it moved. @param {Moment} moment */
  followField(moment) {
    const last = this.followed;
    this.followed = moment.centre;
    if (!last) return false;
    const by = minus(moment.centre, last);
    if (Math.hypot(...by) < 1e-9) return false;
    this.camera.target = add(this.camera.target, by);
    return true;
  }

  /** Fits the canvases to their place. @param {number} share of the pixels of a side that are drawn */
  resize(share) {
    const view = place("view");
    const ratio = Math.min(window.devicePixelRatio || 1, 3);
    const [w, h] = [Math.max(view.clientWidth, 1), Math.max(view.clientHeight, 1)];
    for (const [canvas, r] of /** @type {[HTMLCanvasElement, number][]} */ ([
      [this.scene.canvas, ratio * share],
      [this.overlay.canvas, ratio],
    ])) {
      const [pw, ph] = [Math.round(w * r), Math.round(h * r)];
      if (canvas.width === pw && canvas.height === ph) continue;
      [canvas.width, canvas.height] = [pw, ph];
      this.isStale = true;
    }
    this.camera.resize(w, h);
  }

  /** @param {Moment} moment */
  showClock(moment) {
    const { head, blocks } = this;
    input("seek").value = String(this.time);
    input("stops").value = String(moment.block + 1);
    const exact = `${this.time.toFixed(1)} s of ${head.time_s.toFixed(1)} s`;
    const bold = Object.assign(document.createElement("b"), { textContent: `${duration(this.time)} ` });
    const small = Object.assign(document.createElement("small"), { textContent: exact });
    element("time", HTMLOutputElement).replaceChildren(bold, small);
    const id = blocks.id[moment.block];
    input("seek").setAttribute("aria-valuetext", `${duration(this.time)} of ${duration(head.time_s)}`);
    input("stops").setAttribute("aria-valuetext", `${id}, ${moment.block + 1} of ${head.blocks.count}`);
    const isFly = head.mode === "on-the-fly";
    if (this.shownBlock !== moment.block) {
      this.shownBlock = moment.block;
      this.showBlock(moment.block);
    }
    // Speech is given time to end: while playing, one sentence in three seconds.
    const now = performance.now();
    if (!this.playing || now - this.spokenAt > 3000) {
      this.spokenAt = now;
      const words = { moves: isFly ? "jumps" : "the stage moves", marks: "marks", done: "done" }[moment.does];
      const which = `${isFly ? "Run" : "Block"} ${id}, ${moment.block + 1} of ${head.blocks.count}`;
      const spoken = `${which}, ${words}, ${duration(this.time)}.`;
      if (place("spoken").textContent !== spoken) place("spoken").textContent = spoken;
    }
  }

  /** @param {number} i */
  showBlock(i) {
    const { head, blocks } = this;
    if (document.activeElement !== input("block-id")) input("block-id").value = blocks.id[i] ?? "";
    fillTable("block", rowsOfBlock(head, blocks, i));
    const pass = head.maps.findIndex((m) => m.pass === blocks.pass[i]);
    const touching = [...(this.touching[pass]?.get(i) ?? [])].sort((a, b) => a - b);
    const words = Object.assign(document.createElement("span"), { textContent: "Neighbours:" });
    const list = touching.map((k) => {
      const b = Object.assign(document.createElement("button"), { type: "button", textContent: blocks.id[k] });
      b.addEventListener("click", () => this.goToBlock(k));
      return b;
    });
    place("neighbours").replaceChildren(...(list.length > 0 ? [words, ...list] : []));
  }

  /** @param {boolean} on */
  play(on) {
    if (on && this.time >= this.head.time_s) this.time = 0;
    this.playing = on;
    button("play").textContent = on ? "Pause" : "Play";
    if (on && !this.soFar) {
      this.soFar = true;
      input("so-far").checked = true;
    }
    this.lastFrame = performance.now();
    this.changed();
  }

  /** @param {number} s */
  setTime(s) {
    this.time = Math.min(Math.max(s, 0), this.head.time_s);
    this.changed();
  }

  /** To the moment when a block begins to be marked. @param {number} i */
  goToBlock(i) {
    const k = Math.min(Math.max(i, 0), this.head.blocks.count - 1);
    place("find-note").textContent = "";
    // What was typed gives way to the name of the block.
    this.shownBlock = -1;
    this.setTime(this.blocks.start[k]);
  }

  /** The block that is written so, or as its number alone. @param {string} text */
  goToName(text) {
    const wanted = text.trim().toUpperCase();
    const number = wanted.replace(/^B?0*/, "");
    const i = this.blocks.id.findIndex((id) => id.toUpperCase() === wanted || id.replace(/^B?0*/, "") === number);
    if (i >= 0) this.goToBlock(i);
    else
      place("find-note").textContent =
        `There is no block ${text.trim()}: they are ${this.blocks.id[0]} to ${this.blocks.id.at(-1)}.`;
    return i;
  }

  /** Brings the present field into the picture. */
  showPresent() {
    this.camera.target = this.moment().centre;
    this.camera.distance = (Math.max(...this.head.field.size) * 1.7) / (2 * Math.tan(this.camera.angle / 2));
    this.cameraMoved();
  }

  /** @param {number} x CSS pixels @param {number} y */
  pick(x, y) {
    return this.probe.pick(this.look(this.moment(), false), x, y);
  }
}

/** Figures and words, where the job cannot be drawn. @param {unknown} error */
function showFailure(error) {
  const words = error instanceof Error ? error.message : String(error);
  const failure = place("failure");
  failure.hidden = false;
  failure.textContent = `The job cannot be drawn: ${words}. The figures of the job are beside or below.`;
}

/** Shows the words, then the picture; throws if there can be none. */
async function begin() {
  setTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  try {
    const head = readHead();
    fillPage(head);
    // Words are painted before the graphics card is asked for anything, which may take it a second.
    await new Promise((painted) => requestAnimationFrame(() => setTimeout(painted)));
    if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old to unpack the data");
    const app = new App(head, await readBlocks(head));
    connect(app);
    fillLegend(head, app.by);
    app.changed();
    await readRest(app);
    return app;
  } catch (error) {
    showFailure(error);
    throw error;
  }
}

/** The part first, then what lies on it. @param {App} app */
async function readRest(app) {
  const { head, scene } = app;
  const mesh = await readMesh();
  scene.setMesh(mesh);
  app.measure.solid = new Solid(mesh, head.part.box);
  app.changed();
  for (let k = 0; k < head.tones.maps.length; k++) scene.setTone(k, await readTone(head.tones.maps[k]));
  app.changed();
  for (let k = 0; k < head.maps.length; k++) {
    const labels = await readMap(head.maps[k]);
    scene.setMap(k, labels);
    app.measure.labels[k] = labels;
    const { touching, width } = neighboursIn(labels, head.maps[k].columns);
    app.touching[k] = touching;
    scene.width_mm = Math.min(scene.width_mm, width * head.maps[k].cell);
    app.changed();
  }
  if (head.motion) app.timeline.motion = await readMotion(head.motion);
  if (head.measured) scene.setMeasured(await readMeasured(head.measured));
  if (head.fixtures) scene.setFixtures(await readFixtures(head.fixtures));
  if (head.skipped_lines) scene.setSkipped(await readSkipped(head.skipped_lines, head.skipped));
  app.shownBlock = -1;
  app.changed();
}

Object.assign(window, { terraceView: new Api(begin()) });

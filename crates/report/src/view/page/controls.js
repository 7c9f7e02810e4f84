// @ts-check
/**
 * Connects buttons, keys, pointers and the window to the page, and offers the same to scripts.
 */

/** @param {"light"|"dark"} theme */
function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  button("theme").textContent = theme === "dark" ? "Light" : "Dark";
}

/** @param {App} app */
function connect(app) {
  const { head, blocks, camera } = app;
  const move = (/** @type {() => void} */ change) => () => {
    change();
    app.cameraMoved();
  };
  button("texture").addEventListener(
    "click",
    move(() => camera.reset()),
  );
  button("whole").addEventListener(
    "click",
    move(() => camera.whole()),
  );
  button("above").addEventListener(
    "click",
    move(() => camera.fromAbove()),
  );
  button("nearer").addEventListener(
    "click",
    move(() => camera.zoom(1 / 1.5)),
  );
  button("farther").addEventListener(
    "click",
    move(() => camera.zoom(1.5)),
  );
  button("to-block").addEventListener("click", () => app.showPresent());
  button("measure").addEventListener("click", () => app.measure.set(!app.measure.isOn));
  button("measure-end").addEventListener("click", () => app.measure.set(false));
  window.addEventListener("message", (e) => {
    if (e.source === window.parent && e.data?.terraceLook) app.follows(e.data.terraceLook);
  });
  button("play").addEventListener("click", () => app.play(!app.playing));
  button("previous").addEventListener("click", () => step(app, -1));
  button("next").addEventListener("click", () => step(app, 1));
  const [seek, stops] = [input("seek"), input("stops")];
  seek.max = String(head.time_s);
  seek.addEventListener("input", () => app.setTime(Number(seek.value)));
  stops.max = String(head.blocks.count);
  stops.addEventListener("input", () => app.goToBlock(Number(stops.value) - 1));
  input("so-far").addEventListener("change", () => app.set({ soFar: input("so-far").checked }));
  input("follow").addEventListener("change", () => {
    app.followed = app.moment().centre;
    app.set({ follow: input("follow").checked });
  });
  choice("by").addEventListener("change", () => setColour(app, /** @type {ColourBy} */ (choice("by").value)));
  place("by-note").textContent = noteOf(head, app.by);
  choice("pass").addEventListener("change", () => app.set({ pass: Number(choice("pass").value) }));
  choice("setup").addEventListener("change", () => app.set({ setup: Number(choice("setup").value) }));
  choice("pen").addEventListener("change", () => app.set({ pen: Number(choice("pen").value) }));
  for (const [layer] of LAYERS) {
    const box = document.getElementById(`layer-${layer}`);
    if (!(box instanceof HTMLInputElement)) continue;
    // A browser may have kept what was chosen before the page was loaded again.
    app.layers[layer] = box.checked;
    box.addEventListener("change", () => app.set({ layers: { ...app.layers, [layer]: box.checked } }));
  }
  place("find").addEventListener("submit", (e) => {
    e.preventDefault();
    if (app.goToName(input("block-id").value) >= 0) {
      input("block-id").blur();
    }
  });
  button("theme").addEventListener("click", () => {
    setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    app.readStyle();
    app.changed();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (e) => {
    setTheme(e.matches ? "dark" : "light");
    app.readStyle();
    app.changed();
  });
  button("help").addEventListener("click", () => element("keys", HTMLDialogElement).showModal());
  new ResizeObserver(() => {
    app.readStyle();
    if (app.measure.isOn) app.measure.show();
    app.changed();
  }).observe(place("view"));
  app.scene.canvas.addEventListener("webglcontextlost", (e) => {
    e.preventDefault();
    showFailure("the browser took the graphics card away; load the page again");
  });
  connectPointers(app);
  document.addEventListener("keydown", (e) => onKey(app, e));
  input("block-id").placeholder = blocks.id[0] ?? "";
}

/** @param {App} app @param {number} by */
function step(app, by) {
  app.play(false);
  const present = app.timeline.blockAt(app.time);
  app.goToBlock(present + by);
}

/** @param {App} app @param {ColourBy} by */
function setColour(app, by) {
  choice("by").value = by;
  place("by-note").textContent = noteOf(app.head, by);
  fillLegend(app.head, by);
  app.set({ by });
}

/** @param {App} app @param {KeyboardEvent} e */
function onKey(app, e) {
  const target = /** @type {Element} */ (e.target);
  if (e.ctrlKey || e.metaKey || document.querySelector("dialog[open]")) return;
  if (target.matches("select, input:not([type=range]):not([type=checkbox])")) return;
  const isControl = target.matches("input, button, a");
  const { camera } = app;
  /** @type {Record<string, () => void>} */
  const arrows = {
    ArrowLeft: () => (e.shiftKey ? camera.orbit(-20, 0) : e.altKey ? camera.pan(40, 0) : step(app, -1)),
    ArrowRight: () => (e.shiftKey ? camera.orbit(20, 0) : e.altKey ? camera.pan(-40, 0) : step(app, 1)),
    ArrowUp: () => (e.shiftKey ? camera.orbit(0, 20) : camera.pan(0, 40)),
    ArrowDown: () => (e.shiftKey ? camera.orbit(0, -20) : camera.pan(0, -40)),
    Home: () => app.goToBlock(0),
    End: () => app.goToBlock(app.head.blocks.count - 1),
  };
  /** @type {Record<string, () => void>} */
  const keys = {
    "+": () => camera.zoom(1 / 1.5),
    "=": () => camera.zoom(1 / 1.5),
    "-": () => camera.zoom(1.5),
    r: () => camera.reset(),
    w: () => camera.whole(),
    t: () => camera.fromAbove(),
    b: () => app.showPresent(),
    m: () => app.measure.set(!app.measure.isOn),
    Escape: () => app.measure.set(false),
    "?": () => element("keys", HTMLDialogElement).showModal(),
    "/": () => input("block-id").select(),
  };
  let action = keys[e.key];
  // A slider has the arrows for itself, a control the space bar.
  const isRange = target.matches("input[type=range]");
  const needsModifier = e.key === "ArrowUp" || e.key === "ArrowDown";
  if (!isRange && (!needsModifier || e.shiftKey || e.altKey)) action ??= arrows[e.key];
  if (e.key === " " && (!isControl || isRange)) action = () => app.play(!app.playing);
  if (!action) return;
  e.preventDefault();
  action();
  app.cameraMoved();
}

/** @param {App} app */
function connectPointers(app) {
  const { canvas } = app.scene;
  const { camera } = app;
  /** @type {Map<number, [number, number]>} */
  const down = new Map();
  let [travelled, pinch] = [0, 0];
  const spread = () => {
    const [[ax, ay], [bx, by]] = [...down.values()];
    return Math.hypot(ax - bx, ay - by);
  };
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    down.set(e.pointerId, [e.offsetX, e.offsetY]);
    travelled = down.size > 1 ? Infinity : 0;
    if (down.size === 2) pinch = spread();
  });
  canvas.addEventListener("pointermove", (e) => {
    const last = down.get(e.pointerId);
    if (!last) return;
    const [dx, dy] = [e.offsetX - last[0], e.offsetY - last[1]];
    down.set(e.pointerId, [e.offsetX, e.offsetY]);
    travelled += Math.hypot(dx, dy);
    if (travelled < 4) return;
    if (down.size === 2) {
      camera.pan(dx / 2, dy / 2);
      const now = spread();
      if (now > 0) camera.zoom(pinch / now);
      pinch = now;
    } else if (e.shiftKey || e.buttons & 6) camera.pan(dx, dy);
    else camera.orbit(dx, dy);
    app.cameraMoved();
  });
  canvas.addEventListener("pointerup", (e) => {
    if (down.delete(e.pointerId) && travelled < 4 && e.button === 0) {
      if (app.measure.isOn) return app.measure.click(e.offsetX, e.offsetY);
      const block = app.pick(e.offsetX, e.offsetY);
      if (block >= 0) app.goToBlock(block);
    }
  });
  canvas.addEventListener("pointercancel", (e) => down.delete(e.pointerId));
  canvas.addEventListener(
    "wheel",
    (e) => {
      e.preventDefault();
      const lines = e.deltaMode === 1 ? 16 : 1;
      camera.zoom(Math.exp(Math.min(Math.max(e.deltaY * lines, -240), 240) * 0.0022), e.offsetX, e.offsetY);
      app.cameraMoved();
    },
    { passive: false },
  );
}

/**
 * The page for scripts and tests: `window.terraceView`. Blocks are indices in machining order, times s, places mm in
 * the part frame, pixels CSS pixels from the upper left corner of the picture.
 */
class Api {
  /** @type {App|undefined} */
  opened;

  /** @param {Promise<App>} app */
  constructor(app) {
    /** Fulfilled when all but the marks is read, with what was thrown if the job cannot be drawn. */
    this.ready = app.then(
      (a) => void (this.opened = a),
      (/** @type {unknown} */ error) => error,
    );
  }

  /** What all else works on, once `ready` is fulfilled. */
  get app() {
    if (!this.opened) throw new Error("the page is not ready");
    return this.opened;
  }

  /** What is shown. */
  state() {
    const { app } = this;
    const moment = app.moment();
    return {
      time: app.time,
      playing: app.playing,
      by: app.by,
      block: moment.block,
      id: app.blocks.id[moment.block],
      does: moment.does,
      turn: moment.turn,
      centre: moment.centre,
      up: moment.up,
      beam: moment.beam,
      camera: { ...app.camera },
      layers: { ...app.layers },
      defocus: app.defocus,
      incidence: app.incidence,
      pass: app.pass,
      setup: app.setup,
      pen: app.pen,
      soFar: app.soFar,
      drawsMarks: app.scene.drawsMarks,
      drawsTone: app.scene.drawsTone,
      said: app.scene.said(),
      measured: app.measure.ends,
      chunks: app.scene.chunks.filter(Boolean).length,
      budget: app.scene.budget,
      frames: [...app.frames],
      idle: !app.isDue && app.scene.loading === 0,
    };
  }

  /** @param {ColourBy} by */
  setColour(by) {
    setColour(this.app, by);
  }

  /** @param {number} i */
  goToBlock(i) {
    this.app.goToBlock(i);
  }

  /** @param {number} s */
  setTime(s) {
    this.app.setTime(s);
  }

  /** The block at a place of the picture, -1 for none. @param {number} x @param {number} y */
  pick(x, y) {
    return this.app.pick(x, y);
  }

  /** Where a place of the part is in the picture. @param {Vec3} p */
  project(p) {
    const { camera } = this.app;
    return camera.project(camera.matrices().both, turned(this.app.moment().turn, p));
  }

  /** Looks at a place of the part from a distance of mm; from above, unless angles are given in rad.
   * @param {Vec3} p @param {number} distance @param {number} [yaw] @param {number} [pitch] */
  lookAt(p, distance, yaw = 0, pitch = Math.PI / 2) {
    Object.assign(this.app.camera, { target: turned(this.app.moment().turn, p), distance, yaw, pitch });
    this.app.changed();
  }

  /** Fulfilled when the picture is complete. */
  async drawn() {
    do await new Promise((done) => requestAnimationFrame(done));
    while (this.app.isDue || this.app.scene.loading > 0);
  }

  /** Reads all marks. */
  async loadAll() {
    for (let k = 0; k < this.app.head.chunks.length; k++) await this.app.scene.load(k);
  }

  /**
   * Points of marks evenly spread over the job, each with its data and the colour that the shader gives it (null where
   * it is not drawn).
   * @param {number} n
   */
  async sampleMarks(n) {
    const { app } = this;
    const { head, blocks, scene } = app;
    const look = app.look(app.moment(), false);
    scene.setPalette(look);
    const total = head.chunks.reduce((sum, c) => sum + c.points, 0);
    const out = [];
    let [k, before] = [0, 0];
    for (let s = 0; s < Math.min(n, total); s++) {
      const wanted = Math.floor(((s + 0.5) * total) / Math.min(n, total));
      while (wanted >= before + head.chunks[k].points) before += head.chunks[k++].points;
      await scene.load(k);
      const { data } = /** @type {{data: Chunk}} */ (scene.chunks[k]);
      const { words, shorts } = data;
      const point = wanted - before;
      const block = head.chunks[k].first + (shorts[8 * point + 3] & 0xffff);
      const at = pointInPart(blocks, data, point);
      const isLast = (words[4 * point + 3] & LAST_OF_MARK) !== 0;
      out.push({
        block,
        id: blocks.id[block],
        at,
        /** Half way to the next point of the mark, or to the one before. */
        middle:
          words[4 * point + 3] & IS_DOT ? at : between(at, pointInPart(blocks, data, point + (isLast ? -1 : 1)), 0.5),
        defocus_um: shorts[8 * point + 4] * head.defocus_um_per_step,
        incidence_deg: ((words[4 * point + 2] >>> 16) & 255) * head.incidence_deg_per_step,
        pen: words[4 * point + 2] >>> 24,
        time_s: ((words[4 * point + 3] >>> 2) / CLOCK_STEPS) * head.time_s,
        colour: app.probe.colourOfPoint(look, k, point),
      });
    }
    app.changed();
    return out;
  }
}

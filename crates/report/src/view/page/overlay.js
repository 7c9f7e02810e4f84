// @ts-check
/**
 * What is drawn over the picture in lines: stage path, field, lens, travel limits, beam, names of blocks, scale.
 *
 * Consumes the camera and the moment of the machine. These lines are not hidden by the part, so that the machine can be
 * seen wherever it is.
 */

/** Colours of lines, as CSS. @typedef {{ink: string, halo: string, path: string, field: string}} Strokes */

/** Most pieces of the path that are drawn. */
const PATH_PIECES = 6000;

class Overlay {
  /** @param {HTMLCanvasElement} canvas @param {Head} head @param {Timeline} timeline
   * @param {number} block_mm mean side of a block */
  constructor(canvas, head, timeline, block_mm) {
    this.block_mm = block_mm;
    const context = canvas.getContext("2d");
    if (!context) throw new Error("this browser does not draw on a canvas");
    this.canvas = canvas;
    this.head = head;
    this.timeline = timeline;
    this.c = context;
    this.camera = new Camera(head.box);
    this.both = /** @type {Matrix} */ ([]);
    /** Text of the page relative to that of a small screen. */
    this.size = 1;
  }

  /**
   * @param {Look} look @param {Moment} moment @param {Strokes} colours @param {Measure} measure
   */
  draw(look, moment, colours, measure) {
    const { c, canvas } = this;
    this.camera = look.camera;
    this.both = look.camera.matrices().both;
    const ratio = canvas.width / look.camera.width;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, look.camera.width, look.camera.height);
    // Lines and words grow with the text of the page, on large screens.
    this.size = look.size;
    c.lineJoin = "round";
    if (look.layers.travel) this.travel(moment, colours);
    if (look.layers.path) this.path(look, moment, colours);
    if (look.layers.lens) this.lens(moment, colours);
    if (look.layers.field) this.field(moment, colours);
    if (moment.beam && look.layers.field) this.beam(moment.beam);
    if (look.by === "correction" || look.by === "kept") this.points(look, moment, colours);
    if (look.layers.labels) this.labels(look, moment, colours);
    measure.drawLine(this, moment, colours);
    this.scale(look, colours);
  }

  /** A line through points of the world. @param {Vec3[]} points @param {boolean} [closed] */
  trace(points, closed = false) {
    const { c } = this;
    c.beginPath();
    let isDown = false;
    for (const p of points) {
      const at = this.camera.project(this.both, p);
      if (!at || Math.abs(at[0]) > 1e5 || Math.abs(at[1]) > 1e5) {
        isDown = false;
        continue;
      }
      if (isDown) c.lineTo(at[0], at[1]);
      else c.moveTo(at[0], at[1]);
      isDown = true;
    }
    if (closed) c.closePath();
  }

  /** A dot at a place of the world. @param {Vec3} p @param {string} colour */
  place(p, colour) {
    const at = this.camera.project(this.both, p);
    if (!at) return;
    this.c.beginPath();
    this.c.arc(at[0], at[1], 4 * this.size, 0, 2 * Math.PI);
    this.c.fillStyle = colour;
    this.c.fill();
  }

  /** @param {string} colour @param {number} width @param {number[]} [dash] */
  stroke(colour, width, dash = []) {
    this.c.strokeStyle = colour;
    this.c.lineWidth = width * this.size;
    this.c.setLineDash(dash.map((d) => d * this.size));
    this.c.stroke();
    this.c.setLineDash([]);
  }

  /** Two directions across the beam. @param {Moment} moment @returns {[Vec3, Vec3]} */
  across(moment) {
    const x = moment.right ?? unit(minus([1, 0, 0], scaled(moment.up, moment.up[0])));
    return [x, cross(moment.up, x)];
  }

  /** The rim of a circle or a rectangle across the beam. @param {Moment} moment @param {Vec3} centre
   * @param {number} w @param {number} h @param {boolean} round @returns {Vec3[]} */
  rim(moment, centre, w, h, round) {
    const [x, y] = this.across(moment);
    const place = (/** @type {number} */ u, /** @type {number} */ v) => add(centre, add(scaled(x, u), scaled(y, v)));
    if (!round) return [place(-w / 2, -h / 2), place(w / 2, -h / 2), place(w / 2, h / 2), place(-w / 2, h / 2)];
    return Array.from({ length: 48 }, (_, k) => {
      const a = (k / 48) * 2 * Math.PI;
      return place((Math.cos(a) * w) / 2, (Math.sin(a) * h) / 2);
    });
  }

  /** @param {Moment} moment @param {Strokes} colours */
  field(moment, colours) {
    const { size, shape } = this.head.field;
    this.trace(this.rim(moment, moment.centre, size[0], size[1], shape === "circle"), true);
    this.c.fillStyle = "rgb(194 65 12 / 0.07)";
    this.c.fill();
    this.stroke(colours.halo, 4);
    this.stroke(colours.field, 2);
  }

  /** @param {Moment} moment @param {Strokes} colours */
  lens(moment, colours) {
    const { lens, field } = this.head;
    const isKnown = lens.working_distance_mm !== null;
    const away = lens.working_distance_mm ?? 2 * Math.max(...field.size);
    const d = lens.diameter_mm;
    const low = add(moment.centre, scaled(moment.up, away));
    const high = add(low, scaled(moment.up, 0.35 * d));
    const [a, b] = [this.rim(moment, low, d, d, true), this.rim(moment, high, d, d, true)];
    const { c } = this;
    const dash = isKnown ? [] : [5, 4];
    // The silhouette of the barrel: the two sides that lie farthest apart in the picture.
    const { right } = this.camera.axes();
    const sides = [0, 1].map((s) => {
      const best = a.map((p, k) => [dot(minus(p, low), right) * (s ? 1 : -1), k]).sort((u, v) => v[0] - u[0])[0][1];
      return [a[best], b[best]];
    });
    for (const [p, q] of sides) {
      this.trace([p, q]);
      this.stroke(colours.ink, 1.2, dash);
    }
    for (const rim of [a, b]) {
      this.trace(rim, true);
      c.fillStyle = "rgb(128 150 180 / 0.12)";
      c.fill();
      this.stroke(colours.ink, 1.2, dash);
    }
    const { size, shape } = field;
    const at = this.rim(moment, moment.centre, size[0], size[1], shape === "circle");
    const through = this.rim(moment, low, size[0], size[1], shape === "circle");
    for (let k = 0; k < at.length; k += shape === "circle" ? 12 : 1) {
      this.trace([at[k], through[k]]);
      this.stroke(colours.field, 0.8, [2, 4]);
    }
  }

  /** @param {{at: Vec3, on: boolean}} beam */
  beam(beam) {
    const at = this.camera.project(this.both, beam.at);
    if (!at) return;
    const { c } = this;
    c.beginPath();
    c.arc(at[0], at[1], 5 * this.size, 0, 2 * Math.PI);
    if (beam.on) {
      c.fillStyle = "#ff2a12";
      c.fill();
    }
    this.stroke("#fff", 3);
    this.stroke(beam.on ? "#b00000" : "#555", 1.5);
  }

  /** @param {Moment} moment @param {Strokes} colours */
  travel(moment, colours) {
    const box = this.head.travel[(this.timeline.blocks.setup[moment.block] ?? 1) - 1];
    if (!box) return;
    const corner = (/** @type {number} */ k) =>
      /** @type {Vec3} */ ([box[k & 1][0], box[(k >> 1) & 1][1], box[(k >> 2) & 1][2]]);
    for (let k = 0; k < 8; k++)
      for (const bit of [1, 2, 4]) {
        if (k & bit) continue;
        this.trace([corner(k), corner(k | bit)]);
        this.stroke(colours.ink, 1, [7, 5]);
      }
  }

  /** @param {Look} look @param {Moment} moment @param {Strokes} colours */
  path(look, moment, colours) {
    const { timeline } = this;
    const motion = timeline.motion;
    const { blocks } = timeline;
    if (motion && motion.t.length > 1) {
      const every = Math.max(1, Math.ceil(motion.t.length / PATH_PIECES));
      /** @type {Vec3[]} */
      const points = [];
      for (let i = 0; i < motion.t.length && motion.t[i] <= look.now; i += every)
        points.push([motion.centre[0][i], motion.centre[1][i], motion.centre[2][i]]);
      this.trace(points);
      this.stroke(colours.path, 1.3);
      return;
    }
    // Each stop is where the part has it, whatever the table does at the moment.
    /** @type {Vec3[][]} */
    const runs = [[]];
    for (let i = 0; i < this.head.blocks.count && blocks.begin[i] <= look.now; i++) {
      if (i > 0 && (blocks.setup[i] !== blocks.setup[i - 1] || blocks.pass[i] !== blocks.pass[i - 1])) runs.push([]);
      if (!look.isShown(i)) continue;
      runs[runs.length - 1].push(turned(moment.turn, inPart(timeline.turnOf(i), timeline.centreOf(i))));
    }
    for (const run of runs) {
      this.trace(run);
      this.stroke(colours.halo, 3);
      this.stroke(colours.path, 1.3);
    }
    if (this.block_mm / this.camera.pixel_mm() < 14 * this.size) return;
    this.c.fillStyle = colours.path;
    for (const run of runs)
      for (const p of run) {
        const at = this.camera.project(this.both, p);
        if (!at) continue;
        this.c.beginPath();
        this.c.arc(at[0], at[1], 2.6 * this.size, 0, 2 * Math.PI);
        this.c.fill();
      }
  }

  /** Measured points by what is left of them; a cross where one does not count. @param {Look} look
   * @param {Moment} moment @param {Strokes} colours */
  points(look, moment, colours) {
    const { c, head, size } = this;
    if (!head.measured) return;
    const { points, most_um } = head.measured;
    const r = (points.length > 400 ? 2 : 4.5) * size;
    for (const point of points) {
      const at = this.camera.project(this.both, turned(moment.turn, point.at));
      if (!at) continue;
      const value = look.by === "correction" ? point.before_um : point.after_um;
      c.beginPath();
      if (value === null) {
        for (const side of [-r, r]) {
          c.moveTo(at[0] - r, at[1] - side);
          c.lineTo(at[0] + r, at[1] + side);
        }
        this.stroke(colours.ink, 1.5);
        continue;
      }
      c.arc(at[0], at[1], r, 0, 2 * Math.PI);
      c.fillStyle = css(ofValue(DIVERGING, value, [-most_um, most_um]));
      c.fill();
      this.stroke(colours.ink, 1);
    }
  }

  /** Names of blocks on their marks, where there is room. @param {Look} look @param {Moment} moment
   * @param {Strokes} colours */
  labels(look, moment, colours) {
    const { c, timeline, head } = this;
    if (head.mode === "on-the-fly") return;
    c.textAlign = "center";
    c.font = `600 ${12 * this.size}px system-ui, sans-serif`;
    c.lineWidth = 3 * this.size;
    /** Middles of names that are written. @type {[number, number][]} */
    const written = [];
    const order = [moment.block];
    if (this.block_mm / this.camera.pixel_mm() > 32 * this.size)
      for (let i = 0; i < head.blocks.count; i++) if (i !== moment.block) order.push(i);
    for (const i of order) {
      if (!look.isShown(i) || timeline.blocks.pass[i] !== look.pass) continue;
      const named = timeline.blocks.name_at[i];
      const at = named && this.camera.project(this.both, turned(moment.turn, named));
      if (!at || at[0] < 0 || at[1] < 0 || at[0] > this.camera.width || at[1] > this.camera.height) continue;
      if (written.some(([u, v]) => Math.abs(u - at[0]) < 54 * this.size && Math.abs(v - at[1]) < 17 * this.size))
        continue;
      written.push(at);
      c.strokeStyle = colours.halo;
      c.strokeText(timeline.blocks.id[i], at[0], at[1] + 4 * this.size);
      c.fillStyle = colours.ink;
      c.fillText(timeline.blocks.id[i], at[0], at[1] + 4 * this.size);
    }
  }

  /** A length of a round number of mm, at the depth of the camera's target. @param {Look} look
   * @param {Strokes} colours */
  scale(look, colours) {
    const { c } = this;
    const px = look.camera.pixel_mm();
    const wanted = 110 * this.size * px;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const mm = [5, 2, 1].map((k) => k * power).find((v) => v <= wanted) ?? power;
    const [x, y] = [look.camera.width - 16 * this.size, look.camera.height - 16 * this.size];
    c.beginPath();
    c.moveTo(x - mm / px, y - 5 * this.size);
    c.lineTo(x - mm / px, y);
    c.lineTo(x, y);
    c.lineTo(x, y - 5 * this.size);
    this.stroke(colours.halo, 4);
    this.stroke(colours.ink, 1.5);
    c.textAlign = "right";
    c.font = `${12 * this.size}px system-ui, sans-serif`;
    const text = mm >= 1 ? `${mm} mm` : `${Number((mm * 1000).toPrecision(3))} µm`;
    c.lineWidth = 3 * this.size;
    c.strokeStyle = colours.halo;
    c.strokeText(text, x, y - 8 * this.size);
    c.fillStyle = colours.ink;
    c.fillText(text, x, y - 8 * this.size);
  }
}

/** The place in the part frame of a place in the turned frame. @param {Turn} t @param {Vec3} p @returns {Vec3} */
function inPart(t, p) {
  const [u, v, w] = minus(p, [t[9], t[10], t[11]]);
  return [t[0] * u + t[3] * v + t[6] * w, t[1] * u + t[4] * v + t[7] * w, t[2] * u + t[5] * v + t[8] * w];
}

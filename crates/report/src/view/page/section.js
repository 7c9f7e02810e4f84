// @ts-check
/**
 * Measuring between two places of the part, and the section along the line between them: the surface, the focal planes
 * of the blocks, and how far marks may lie from them.
 *
 * Consumes the part as it is drawn, in fewer triangles; what is measured is as exact as it is. Places are in the part
 * frame, mm. The section is upright, through both places; `s` runs along it from the first, mm.
 */

/** @typedef {[[number, number], [number, number]]} Piece of a section: from (s, z) to (s, z) */

/** How far the section goes beyond the two places, of their distance. */
const BEYOND_ENDS = 0.08;
/** Places along the section at which blocks are looked up. */
const LOOKED_UP = 900;

/** The part in triangles, part frame. */
class Solid {
  /** @param {Mesh} mesh @param {Box} box */
  constructor(mesh, box) {
    const [low, high] = box;
    this.corners = mesh.corners;
    this.places = new Float64Array((mesh.positions.length / 4) * 3);
    for (let i = 0; i < mesh.positions.length / 4; i++)
      for (let k = 0; k < 3; k++)
        this.places[3 * i + k] = low[k] + (mesh.positions[4 * i + k] / 65535) * (high[k] - low[k]);
  }

  /** @param {number} i @returns {Vec3} */
  place(i) {
    const at = 3 * this.corners[i];
    return [this.places[at], this.places[at + 1], this.places[at + 2]];
  }

  /** Where a ray first meets the part, null if nowhere. @param {Vec3} from @param {Vec3} along @returns {Vec3|null} */
  hit(from, along) {
    let nearest = Infinity;
    for (let i = 0; i < this.corners.length; i += 3) {
      const a = this.place(i);
      const [u, v] = [minus(this.place(i + 1), a), minus(this.place(i + 2), a)];
      const across = cross(along, v);
      const area = dot(u, across);
      if (area === 0) continue;
      const off = minus(from, a);
      const p = dot(off, across) / area;
      const turn = cross(off, u);
      const q = dot(along, turn) / area;
      const t = dot(v, turn) / area;
      if (p >= 0 && q >= 0 && p + q <= 1 && t > 0 && t < nearest) nearest = t;
    }
    return nearest < Infinity ? add(from, scaled(along, nearest)) : null;
  }

  /** The upright section through two places. @param {Vec3} a @param {Vec3} b @param {[number, number]} reach of s
   * @returns {Piece[]} */
  section(a, b, reach) {
    const [ux, uy] = directionOf(a, b);
    /** @param {Vec3} p */
    const side = (p) => (p[1] - a[1]) * ux - (p[0] - a[0]) * uy;
    /** @param {Vec3} p */
    const along = (p) => (p[0] - a[0]) * ux + (p[1] - a[1]) * uy;
    /** @type {Piece[]} */
    const pieces = [];
    for (let i = 0; i < this.corners.length; i += 3) {
      const corners = [this.place(i), this.place(i + 1), this.place(i + 2)];
      const sides = corners.map(side);
      if (sides.every((d) => d >= 0) || sides.every((d) => d < 0)) continue;
      /** @type {[number, number][]} */
      const ends = [];
      for (const [m, n] of [
        [0, 1],
        [1, 2],
        [2, 0],
      ]) {
        if (sides[m] < 0 === sides[n] < 0) continue;
        const p = between(corners[m], corners[n], sides[m] / (sides[m] - sides[n]));
        ends.push([along(p), p[2]]);
      }
      const [p, q] = ends;
      if (Math.max(p[0], q[0]) >= reach[0] && Math.min(p[0], q[0]) <= reach[1]) pieces.push([p, q]);
    }
    return pieces;
  }
}

/** Direction from one place to another, seen along z. @param {Vec3} a @param {Vec3} b */
function directionOf(a, b) {
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  return [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
}

/** The block at a place seen along z, -1 for none. @param {MapHead} map @param {Uint32Array} labels
 * @param {number} x @param {number} y */
function blockAt(map, labels, x, y) {
  const column = Math.floor((x - map.origin[0]) / map.cell);
  const row = Math.floor((y - map.origin[1]) / map.cell);
  const isIn = column >= 0 && row >= 0 && column < map.columns && row < map.rows;
  return isIn ? labels[row * map.columns + column] - 1 : -1;
}

/** Height of the focal plane of a block at a place, and half the depth range along z there.
 * @param {Blocks} blocks @param {number} i @param {number} x @param {number} y @param {number} half_depth */
function focalPlane(blocks, i, x, y, half_depth) {
  const frame = blocks.frame?.[i];
  const [ox, oy, oz] = blocks.origin[i];
  if (!frame) return { z: oz, half: half_depth };
  const beam = [frame[2], frame[5], frame[8]];
  return { z: oz - (beam[0] * (x - ox) + beam[1] * (y - oy)) / beam[2], half: half_depth / beam[2] };
}

/** The two places and what is said and drawn of them. */
class Measure {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.isOn = false;
    /** @type {Vec3[]} */
    this.ends = [];
    /** @type {Solid|null} */
    this.solid = null;
    /** The labels of each map. @type {Uint32Array[]} */
    this.labels = [];
  }

  /** @param {boolean} on */
  set(on) {
    this.isOn = on;
    this.ends = [];
    button("measure").setAttribute("aria-pressed", String(on));
    place("view").classList.toggle("measuring", on);
    this.show();
  }

  /** Takes the place of the part that is seen at a place of the picture. @param {number} x CSS pixels
   * @param {number} y */
  click(x, y) {
    const { app } = this;
    const { right, up, eye } = app.camera.axes();
    const px = app.camera.pixel_mm();
    const aim = add(
      app.camera.target,
      add(scaled(right, (x - app.camera.width / 2) * px), scaled(up, (app.camera.height / 2 - y) * px)),
    );
    const turn = app.moment().turn;
    const from = inPart(turn, eye);
    const at = this.solid?.hit(from, minus(inPart(turn, aim), from));
    if (!at) {
      place("measured").textContent = "There is no part. Click on the part.";
      return;
    }
    if (this.ends.length === 2) this.ends = [];
    this.ends.push(at);
    this.show();
  }

  show() {
    const { ends, isOn } = this;
    place("section").hidden = !isOn;
    place("measured").textContent = ends.length === 2 ? distanceText(ends[0], ends[1]) : this.asked();
    const hasSection = ends.length === 2 && Math.hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]) > 1e-6;
    place("profile").hidden = !hasSection;
    place("profile-note").hidden = !hasSection;
    if (hasSection) this.drawSection(ends[0], ends[1]);
    this.app.changed();
  }

  asked() {
    const [first] = this.ends;
    return first ? `From (${places(first)}) mm. Click on the second place.` : "Click on two places of the part.";
  }

  /** The blocks that the section passes, each with its ends, focal heights and half its depth range there.
   * @param {Vec3} a @param {Vec3} b @param {[number, number]} reach */
  planes(a, b, reach) {
    const { head, blocks } = this.app;
    const pass = this.app.look(this.app.moment(), false).pass;
    const k = head.maps.findIndex((m) => m.pass === pass);
    const [ux, uy] = directionOf(a, b);
    /** @type {{block: number, from: number, to: number}[]} */
    const runs = [];
    if (k < 0 || !this.labels[k]) return [];
    const step = (reach[1] - reach[0]) / LOOKED_UP;
    for (let i = 0; i < LOOKED_UP; i++) {
      const s = reach[0] + (i + 0.5) * step;
      const block = blockAt(head.maps[k], this.labels[k], a[0] + ux * s, a[1] + uy * s);
      const last = runs[runs.length - 1];
      if (last?.block === block) last.to = s + step / 2;
      else runs.push({ block, from: s - step / 2, to: s + step / 2 });
    }
    return runs
      .filter((run) => run.block >= 0)
      .map((run) => {
        const [from, to] = [run.from, run.to].map((s) =>
          focalPlane(blocks, run.block, a[0] + ux * s, a[1] + uy * s, head.half_depth_mm),
        );
        return { ...run, z: [from.z, to.z], half: from.half };
      });
  }

  /** @param {Vec3} a @param {Vec3} b */
  drawSection(a, b) {
    const canvas = element("profile", HTMLCanvasElement);
    const ratio = Math.min(window.devicePixelRatio || 1, 3);
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [Math.round(w * ratio), Math.round(h * ratio)];
    const c = canvas.getContext("2d");
    if (!c || !this.solid) return;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const { app } = this;
    const { strokes } = app;
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    /** @type {[number, number]} */
    const reach = [-BEYOND_ENDS * length, (1 + BEYOND_ENDS) * length];
    const pieces = this.solid.section(a, b, reach);
    const planes = this.planes(a, b, reach);
    let [low, high] = [Math.min(a[2], b[2]), Math.max(a[2], b[2])];
    for (const z of pieces.flat().filter(([s]) => s >= reach[0] && s <= reach[1]).map(([, z]) => z)) {
      [low, high] = [Math.min(low, z), Math.max(high, z)];
    }
    for (const { z, half } of planes)
      [low, high] = [Math.min(low, z[0] - half, z[1] - half), Math.max(high, z[0] + half, z[1] + half)];
    const tall = Math.max(high - low, 1e-3 * length);
    const [left, top] = [8, 8];
    const scaleS = (w - 2 * left) / (reach[1] - reach[0]);
    const scaleZ = (h - 2 * top) / tall;
    const x = (/** @type {number} */ s) => left + (s - reach[0]) * scaleS;
    const y = (/** @type {number} */ z) => top + ((low + high + tall) / 2 - z) * scaleZ;
    for (const { block, from, to, z, half } of planes) {
      const colour = css(ofBlock("height", app.head, app.blocks, block));
      c.beginPath();
      c.moveTo(x(from), y(z[0] + half));
      c.lineTo(x(to), y(z[1] + half));
      c.lineTo(x(to), y(z[1] - half));
      c.lineTo(x(from), y(z[0] - half));
      c.closePath();
      c.globalAlpha = 0.22;
      c.fillStyle = colour;
      c.fill();
      c.globalAlpha = 1;
      line(c, [x(from), y(z[0])], [x(to), y(z[1])], colour, 2);
    }
    for (const [p, q] of pieces) line(c, [x(p[0]), y(p[1])], [x(q[0]), y(q[1])], strokes.ink, 1.4);
    for (const [s, z] of [
      [0, a[2]],
      [length, b[2]],
    ]) {
      line(c, [x(s), top], [x(s), h - top], strokes.path, 0.8);
      c.beginPath();
      c.arc(x(s), y(z), 3.5, 0, 2 * Math.PI);
      c.fillStyle = strokes.path;
      c.fill();
    }
    const names = planes.length > 0 ? "Coloured: focal planes of the blocks, and the depth range about them. " : "";
    const times = shortNumber(scaleZ / scaleS);
    place("profile-note").textContent =
      `${names}Heights are drawn ${times} times as tall; from ${fixed(low, 3)} to ${fixed(high, 3)} mm.`;
  }

  /** The line between the places, over the picture. @param {Overlay} overlay @param {Moment} moment
   * @param {Strokes} colours */
  drawLine(overlay, moment, colours) {
    const at = this.ends.map((p) => turned(moment.turn, p));
    overlay.trace(at);
    overlay.stroke(colours.halo, 4);
    overlay.stroke(colours.path, 1.8, [6, 3]);
    for (const p of at) overlay.place(p, colours.path);
  }
}

/** @param {CanvasRenderingContext2D} c @param {[number, number]} from @param {[number, number]} to
 * @param {string} colour @param {number} width */
function line(c, from, to, colour, width) {
  c.beginPath();
  c.moveTo(...from);
  c.lineTo(...to);
  c.strokeStyle = colour;
  c.lineWidth = width;
  c.stroke();
}

/** @param {Vec3} a @param {Vec3} b */
function distanceText(a, b) {
  const d = minus(b, a);
  const level = Math.hypot(d[0], d[1]);
  return (
    `${fixed(Math.hypot(...d), 3)} mm apart: ${places(d)} mm along x, y, z; ` +
    `${fixed(level, 3)} mm level, from (${places(a)}) to (${places(b)})`
  );
}

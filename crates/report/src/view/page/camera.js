// @ts-check
/**
 * Vectors, turns and the camera.
 *
 * Matrices have 16 numbers in columns, as WebGL takes them. Turns have 12: a rotation in rows, then a shift in mm. The
 * camera looks at `target` from `distance` mm; `yaw` turns it about z, `pitch` is its height above the horizon, rad.
 */

/** @typedef {number[]} Matrix 16 numbers, by columns */
/** @typedef {number[]} Turn 12 numbers: rotation by rows, shift in mm */

const NO_TURN = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];

/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
/** @param {Vec3} a @param {number} s @returns {Vec3} */
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
/** @param {Vec3} a @param {Vec3} b */
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @param {Vec3} a @returns {Vec3} */
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
/** @param {Vec3} a @param {Vec3} b @param {number} s @returns {Vec3} */
const between = (a, b, s) => add(scaled(a, 1 - s), scaled(b, s));

/** @param {Turn} turn @param {Vec3} p @returns {Vec3} */
function turned(turn, p) {
  const [a, b, c, d, e, f, g, h, i, x, y, z] = turn;
  const [u, v, w] = p;
  return [a * u + b * v + c * w + x, d * u + e * v + f * w + y, g * u + h * v + i * w + z];
}

/** The matrix of a turn. @param {Turn} t @returns {Matrix} */
function matrixOfTurn(t) {
  return [t[0], t[3], t[6], 0, t[1], t[4], t[7], 0, t[2], t[5], t[8], 0, t[9], t[10], t[11], 1];
}

/** @param {Matrix} a @param {Matrix} b @returns {Matrix} */
function product(a, b) {
  const out = new Array(16).fill(0);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

/** Unit quaternion (w, x, y, z) of a rotation. @param {Turn} m */
function quaternion(m) {
  const w = Math.sqrt(Math.max(0, 1 + m[0] + m[4] + m[8])) / 2;
  const x = Math.sqrt(Math.max(0, 1 + m[0] - m[4] - m[8])) / 2;
  const y = Math.sqrt(Math.max(0, 1 - m[0] + m[4] - m[8])) / 2;
  const z = Math.sqrt(Math.max(0, 1 - m[0] - m[4] + m[8])) / 2;
  return [w, m[7] < m[5] ? -x : x, m[2] < m[6] ? -y : y, m[3] < m[1] ? -z : z];
}

/**
 * The turn at a share of the way from one to another, during which the point `pivot` of the part moves straight.
 * @param {Turn} a @param {Turn} b @param {number} share @param {Vec3} pivot @returns {Turn}
 */
function turnBetween(a, b, share, pivot) {
  const [p, q] = [quaternion(a), quaternion(b)];
  const sign = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0 ? -1 : 1;
  const mixed = p.map((v, i) => v * (1 - share) + sign * q[i] * share);
  const size = Math.hypot(...mixed);
  const [w, x, y, z] = mixed.map((v) => v / size);
  const turn = [
    1 - 2 * (y * y + z * z),
    2 * (x * y - w * z),
    2 * (x * z + w * y),
    2 * (x * y + w * z),
    1 - 2 * (x * x + z * z),
    2 * (y * z - w * x),
    2 * (x * z - w * y),
    2 * (y * z + w * x),
    1 - 2 * (x * x + y * y),
    0,
    0,
    0,
  ];
  const at = minus(between(turned(a, pivot), turned(b, pivot), share), turned(turn, pivot));
  return [...turn.slice(0, 9), ...at];
}

/** The camera about a box of the world. */
class Camera {
  /** @param {Box} box all that is drawn @param {Box} [subject] what is looked at first */
  constructor(box, subject = box) {
    this.box = box;
    this.subject = subject;
    this.width = 1;
    this.height = 1;
    /** Angle of view from top to bottom, rad. */
    this.angle = 0.42;
    this.yaw = 0;
    this.pitch = 0;
    /** @type {Vec3} */
    this.target = [0, 0, 0];
    this.distance = 1;
    this.first = "";
    this.reset();
  }

  /** Shows the subject, from the front and above. */
  reset() {
    this.look(-0.45, 0.9, this.subject);
    this.first = this.stand();
  }

  /** Where it stands. */
  stand() {
    return [this.yaw, this.pitch, this.distance, ...this.target].join();
  }

  /** The picture has this size now, CSS pixels: as long as nobody has moved the camera it shows the subject.
   * @param {number} width @param {number} height */
  resize(width, height) {
    const isChanged = width !== this.width || height !== this.height;
    const isFirst = this.stand() === this.first;
    [this.width, this.height] = [width, height];
    if (isChanged && isFirst) this.reset();
  }

  /** Shows all from the same side. */
  whole() {
    this.look(this.yaw, this.pitch, this.box);
  }

  /** Shows the subject from above, as drawings show it. */
  fromAbove() {
    this.look(0, Math.PI / 2, this.subject);
  }

  /** Shows a box. @param {number} yaw @param {number} pitch @param {Box} box */
  look(yaw, pitch, box) {
    this.yaw = yaw;
    this.pitch = pitch;
    const [low, high] = box;
    this.target = between(low, high, 0.5);
    this.distance = 1;
    // The least distance at which each corner lies within the picture.
    const { right, up, back } = this.axes();
    const tall = Math.tan(this.angle / 2);
    const wide = (tall * this.width) / this.height;
    let distance = 0.01;
    for (let k = 0; k < 8; k++) {
      const p = minus([k & 1 ? high[0] : low[0], k & 2 ? high[1] : low[1], k & 4 ? high[2] : low[2]], this.target);
      const reach = Math.max(Math.abs(dot(p, right)) / wide, Math.abs(dot(p, up)) / tall);
      distance = Math.max(distance, dot(p, back) + reach * 1.16);
    }
    this.distance = distance;
  }

  /** Directions of the picture in the world, and the place of the eye. */
  axes() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    /** @type {Vec3} */
    const back = [sy * cp, -cy * cp, sp];
    /** @type {Vec3} */
    const right = [cy, sy, 0];
    const up = cross(back, right);
    return { right, up, back, eye: add(this.target, scaled(back, this.distance)) };
  }

  /** The length that a CSS pixel shows at the target, mm. */
  pixel_mm() {
    return (2 * this.distance * Math.tan(this.angle / 2)) / this.height;
  }

  /** From the world to clip space; view and projection apart. */
  matrices() {
    const { right, up, back, eye } = this.axes();
    const view = [
      right[0],
      up[0],
      back[0],
      0,
      right[1],
      up[1],
      back[1],
      0,
      right[2],
      up[2],
      back[2],
      0,
      -dot(right, eye),
      -dot(up, eye),
      -dot(back, eye),
      1,
    ];
    const middle = between(this.box[0], this.box[1], 0.5);
    const radius = Math.hypot(...minus(this.box[1], this.box[0])) * 0.75 + 1;
    const depth = dot(minus(eye, middle), back);
    const near = Math.max(this.distance * 0.01, depth - radius);
    const far = Math.max(depth + radius, 2 * near);
    const f = 1 / Math.tan(this.angle / 2);
    const projection = [
      (f * this.height) / this.width,
      0,
      0,
      0,
      0,
      f,
      0,
      0,
      0,
      0,
      -(far + near) / (far - near),
      -1,
      0,
      0,
      (-2 * far * near) / (far - near),
      0,
    ];
    return { view, projection, both: product(projection, view) };
  }

  /** @param {number} dx CSS pixels @param {number} dy */
  orbit(dx, dy) {
    this.yaw -= dx * 0.006;
    this.pitch = Math.min(Math.max(this.pitch + dy * 0.006, -1.5), Math.PI / 2);
  }

  /** @param {number} dx CSS pixels @param {number} dy */
  pan(dx, dy) {
    const { right, up } = this.axes();
    const s = this.pixel_mm();
    this.target = add(this.target, add(scaled(right, -dx * s), scaled(up, dy * s)));
  }

  /** Nearer by a factor; what lies below the pointer stays there.
   * @param {number} factor @param {number} [x] CSS pixels from the left @param {number} [y] from the top */
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const size = Math.hypot(...minus(this.box[1], this.box[0]));
    const distance = Math.min(Math.max(this.distance * factor, size * 2e-5), size * 8);
    const { right, up } = this.axes();
    const s = this.pixel_mm() * (1 - distance / this.distance);
    const [dx, dy] = [x - this.width / 2, y - this.height / 2];
    this.target = add(this.target, add(scaled(right, dx * s), scaled(up, -dy * s)));
    this.distance = distance;
  }

  /** Where a point of the world is in the picture, CSS pixels; null behind the eye.
   * @param {Matrix} both @param {Vec3} p @returns {[number, number]|null} */
  project(both, p) {
    const [x, y, z] = p;
    const w = both[3] * x + both[7] * y + both[11] * z + both[15];
    if (w <= 0) return null;
    const u = (both[0] * x + both[4] * y + both[8] * z + both[12]) / w;
    const v = (both[1] * x + both[5] * y + both[9] * z + both[13]) / w;
    return [((u + 1) / 2) * this.width, ((1 - v) / 2) * this.height];
  }
}

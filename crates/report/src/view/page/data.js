// @ts-check
/**
 * Reads what the page carries: the head (JSON) and the data elements (base64 of raw deflate).
 *
 * Consumes the elements `head` and `data-*` of the document. Promises typed arrays in the units of the head: lengths in
 * mm, angles in degrees, times in s unless a name says otherwise. The text of an element is dropped once it is read.
 * All binary is little endian; a plane holds one byte of every value.
 */

/** @typedef {[number, number, number]} Vec3 */
/** @typedef {[Vec3, Vec3]} Box lowest and highest corner, mm */
/** @typedef {{name: string, speed_mm_s: number, power: string|number, frequency_khz: number, passes: number,
 *   dwell_us: number|null}} Pen */
/** @typedef {{name: string, pass: number, origin: [number, number], cell: number, columns: number,
 *   rows: number}} MapHead */
/**
 * How dense marks lie: one byte a cell and, with `has_pens`, the pen of most of the length of each.
 * @typedef {{name: string, pass: number, origin: [number, number], cell: number, columns: number, rows: number,
 *   has_pens: boolean}} ToneHead
 */
/**
 * Densities in mm/mm²: that of a byte of 255, and that of dense marks over squares of 1, 2, 4 ... cells a side.
 * @typedef {{maps: ToneHead[], most_per_mm: number, dense_per_mm: number[]}} Tones
 */
/** @typedef {{name: string, first: number, last: number, marks: number, points: number, box: Box, xy_mm: number,
 *   z_mm: number}} ChunkHead */
/** @typedef {{reason: string, text?: string, texture: number, length_mm: number, share_percent: number, dots: number,
 *   box: [number, number, number, number]}} Skipped */
/** @typedef {{name: string, setups: number[], triangles: number}} FixtureHead set-ups by number, none: all */
/** A point that was measured: what the rigid fit leaves of it, and what the correction does.
 * @typedef {{name: string, at: Vec3, before_um: number|null, after_um: number|null}} MeasuredPoint */
/** Maps of a measured part; `most_um` is the end of what is added to its height, and of what is left of points.
 * @typedef {{name: string, origin: [number, number], size: [number, number], columns: number, rows: number,
 *   kept_um: [number, number], most_um: number, is_warped: boolean, points: MeasuredPoint[]}} MeasuredHead */
/** @typedef {{edges: number[], length_mm: number[], of_dots: boolean}} Histogram */
/**
 * @typedef {object} Head
 * @property {number} schema
 * @property {string} job
 * @property {string} machine
 * @property {"stepped"|"on-the-fly"} mode
 * @property {string} terrace
 * @property {number} time_s
 * @property {Box} box
 * @property {{triangles: number, of: number, within_mm: number, vertices: number, box: Box}} part
 * @property {{size: [number, number], shape: "rectangle"|"circle"}} field
 * @property {{working_distance_mm: number|null, diameter_mm: number}} lens
 * @property {Vec3|null} pivot
 * @property {boolean} head_tilts whether the head tilts and the part stays
 * @property {Box[]} travel
 * @property {Pen[]} pens
 * @property {{jump_speed_mm_s: number, jump_delay_us: number, mark_delay_us: number, polygon_delay_us: number}} scanner
 * @property {number} passes
 * @property {number} setups
 * @property {MapHead[]} maps
 * @property {Tones} tones
 * @property {number} spot_mm
 * @property {number} half_depth_mm how far marks may lie from their focal plane
 * @property {{name: string, count: number}} blocks
 * @property {ChunkHead[]} chunks
 * @property {number} incidence_deg_per_step
 * @property {number} defocus_um_per_step
 * @property {Skipped[]} skipped
 * @property {{name: string, lines: number, points: number, left_out?: number}|null} skipped_lines
 * @property {FixtureHead[]} [fixtures] what holds the part
 * @property {MeasuredHead} [measured] of a part that was measured
 * @property {{name: string, samples: number}|null} motion
 * @property {{height_mm: [number, number], defocus_um: [number, number], incidence_deg: [number, number],
 *   dose: [number, number]}} ranges
 * @property {{defocus_um: Histogram, incidence_deg: Histogram}} histograms
 * @property {{within_um: number, points_left_out: number}} thinned
 * @property {number} marks
 * @property {number} mark_mm
 * @property {{code: string, message: string, place?: string|null, help?: string|null}[]} warnings
 * @property {[string, string][]} figures
 * @property {string[]} [left] of a folder that holds the rest of a job: the names of its blocks
 */
/**
 * Columns of the blocks in machining order; of an on-the-fly job, of its runs of marks, which lack some columns.
 * @typedef {object} Blocks
 * @property {string[]} id
 * @property {number[]} pass
 * @property {number[]} setup
 * @property {([number, number]|null)[]|null} section
 * @property {(number|null)[]|null} level
 * @property {([number, number]|null)[]|null} centre
 * @property {(number|null)[]|null} focus
 * @property {([number, number]|null)[]|null} tilt
 * @property {(number[]|null)[]|null} turn
 * @property {(number[]|null)[]|null} frame
 * @property {Vec3[]} origin
 * @property {(Vec3|null)[]} name_at where its name stands: on a mark
 * @property {(Vec3|null)[]|null} stage
 * @property {(number|null)[]|null} lift
 * @property {(number|null)[]|null} shift
 * @property {([number, number]|null)[]|null} z
 * @property {number[]} begin
 * @property {number[]} start
 * @property {number[]} end
 * @property {number[]} strokes
 * @property {number[]} mark_mm
 * @property {(number|null)[]|null} jump_mm
 * @property {([number, number]|null)[]|null} incidence
 * @property {([number, number]|null)[]|null} stretch
 * @property {([number, number]|null)[]|null} dose
 * @property {number[][]} pens
 * @property {(Record<string, string>|null)[]|null} files
 */
/**
 * The marks of some blocks as the shader reads them, `STRIDE` bytes for each point: x, y, z (i16, steps), block (u16,
 * from `first`), defocus (i16, steps), incidence (u8, steps), pen (u8), clock (u32: upper 30 bits of the job's time,
 * then `LAST_OF_MARK` and `IS_DOT`). At least one point more than there are, so that each has a next; whole rows of the
 * texture that they become.
 * @typedef {{head: ChunkHead, words: Uint32Array<ArrayBuffer>, shorts: Int16Array<ArrayBuffer>, points: number,
 *   pointOfBlock: Uint32Array<ArrayBuffer>, hasDots: boolean}} Chunk
 */
/** @typedef {{positions: Uint16Array<ArrayBuffer>, normals: Int8Array<ArrayBuffer>,
 *   corners: Uint32Array<ArrayBuffer>}} Mesh */
/** @typedef {{t: Float32Array, centre: Float32Array[], up: Float32Array[], spot: Float32Array[],
 *   on: Uint8Array}} Motion */

/** Bytes of a point of a mark. */
const STRIDE = 16;
/** The point is the last one of its mark. */
const LAST_OF_MARK = 1;
/** The mark is a dot. */
const IS_DOT = 2;
/** Steps of the clock in a point: the job's time. */
const CLOCK_STEPS = 2 ** 30 - 1;

/**
 * The bytes that standard base64 stands for.
 * @param {string} text
 * @returns {Uint8Array<ArrayBuffer>}
 */
function bytesFromBase64(text) {
  const tail = text.endsWith("==") ? 2 : text.endsWith("=") ? 1 : 0;
  const bytes = new Uint8Array((text.length / 4) * 3 - tail);
  // Piece by piece: a second copy of a large text would cost more memory than its data.
  const piece = 1 << 20;
  let at = 0;
  for (let from = 0; from < text.length; from += piece) {
    const binary = atob(text.slice(from, from + piece));
    for (let i = 0; i < binary.length; i++) bytes[at++] = binary.charCodeAt(i);
  }
  return bytes;
}

/**
 * The bytes of a data element, whose text is dropped.
 * @param {string} name
 * @returns {Promise<Uint8Array<ArrayBuffer>>}
 */
async function inflate(name) {
  const element = document.getElementById(`data-${name}`);
  if (!element) throw new Error(`the file lacks its part "data-${name}"`);
  const bytes = bytesFromBase64((element.textContent ?? "").trim());
  element.remove();
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Reads arrays one after another. */
class Reader {
  /** @param {Uint8Array<ArrayBuffer>} bytes */
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  /** The next `n` bytes.
   * @param {number} n */
  take(n) {
    if (this.at + n > this.bytes.length) throw new Error("a data element of the file is cut short");
    this.at += n;
    return this.bytes.subarray(this.at - n, this.at);
  }

  /** One number of 32 bits. */
  u32() {
    const b = this.take(4);
    return (b[0] | (b[1] << 8) | (b[2] << 16) | (b[3] << 24)) >>> 0;
  }

  /** Numbers of 16 bits in two planes.
   * @param {number} n */
  u16s(n) {
    const [low, high] = [this.take(n), this.take(n)];
    const values = new Uint16Array(n);
    for (let i = 0; i < n; i++) values[i] = low[i] | (high[i] << 8);
    return values;
  }

  /** Numbers of 16 bits, each stored as its difference to the one before.
   * @param {number} n */
  u16Deltas(n) {
    const values = this.u16s(n);
    for (let i = 1; i < n; i++) values[i] += values[i - 1];
    return values;
  }

  /** Numbers of 32 bits in four planes.
   * @param {number} n */
  u32s(n) {
    const values = new Uint32Array(n);
    for (let shift = 0; shift < 32; shift += 8) {
      const plane = this.take(n);
      for (let i = 0; i < n; i++) values[i] |= plane[i] << shift;
    }
    return values;
  }

  /** Numbers of 32 bits, each stored as its difference to the one before.
   * @param {number} n */
  u32Deltas(n) {
    const values = this.u32s(n);
    for (let i = 1; i < n; i++) values[i] += values[i - 1];
    return values;
  }

  /** Real numbers.
   * @param {number} n */
  f32s(n) {
    return new Float32Array(this.take(4 * n).slice().buffer);
  }
}

/** @returns {Head} */
function readHead() {
  const head = JSON.parse(document.getElementById("head")?.textContent ?? "");
  if (head.schema !== 1) throw new Error(`this page reads data of schema 1, and the file has schema ${head.schema}`);
  return head;
}

/** @param {Head} head @returns {Promise<Blocks>} */
async function readBlocks(head) {
  return JSON.parse(new TextDecoder().decode(await inflate(head.blocks.name)));
}

/** @returns {Promise<Mesh>} */
async function readMesh() {
  const reader = new Reader(await inflate("mesh"));
  const [vertices, triangles] = [reader.u32(), reader.u32()];
  const positions = new Uint16Array(4 * vertices);
  for (let k = 0; k < 3; k++) {
    const axis = reader.u16Deltas(vertices);
    for (let i = 0; i < vertices; i++) positions[4 * i + k] = axis[i];
  }
  const normals = new Int8Array(4 * vertices);
  for (let k = 0; k < 3; k++) {
    const axis = reader.take(vertices);
    for (let i = 0; i < vertices; i++) normals[4 * i + k] = axis[i];
  }
  return { positions, normals, corners: reader.u32Deltas(3 * triangles) };
}

/** Cells along the longest side of the part, at most one corner in each of a rough mesh. */
const ROUGH_CELLS = 64;

/** The mesh with the corners of each cell of a grid taken together: a few thousand triangles, as far off as a cell.
 * @param {Mesh} mesh @param {Vec3} size of the box of the part, mm @returns {Mesh} */
function roughMesh(mesh, size) {
  const cell = Math.max(...size) / ROUGH_CELLS;
  const cells = size.map((s) => Math.max(Math.ceil(s / cell), 1));
  /** Sums of place and normal, and of how many. @type {Map<number, {rough: number, sums: number[]}>} */
  const taken = new Map();
  const roughOf = new Uint32Array(mesh.positions.length / 4);
  for (let i = 0; i < roughOf.length; i++) {
    const [x, y, z] = cells.map((n, k) => Math.min(Math.floor((mesh.positions[4 * i + k] / 65536) * n), n - 1));
    const key = x + cells[0] * (y + cells[1] * z);
    let one = taken.get(key);
    if (!one) taken.set(key, (one = { rough: taken.size, sums: [0, 0, 0, 0, 0, 0, 0] }));
    for (let k = 0; k < 3; k++) {
      one.sums[k] += mesh.positions[4 * i + k];
      one.sums[3 + k] += mesh.normals[4 * i + k];
    }
    one.sums[6] += 1;
    roughOf[i] = one.rough;
  }
  const positions = new Uint16Array(4 * taken.size);
  const normals = new Int8Array(4 * taken.size);
  for (const { rough, sums } of taken.values()) {
    const length = Math.hypot(sums[3], sums[4], sums[5]) || 1;
    for (let k = 0; k < 3; k++) {
      positions[4 * rough + k] = sums[k] / sums[6];
      normals[4 * rough + k] = (127 * sums[3 + k]) / length;
    }
  }
  /** @type {number[]} */
  const corners = [];
  for (let i = 0; i < mesh.corners.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => roughOf[mesh.corners[i + k]]);
    if (a !== b && b !== c && c !== a) corners.push(a, b, c);
  }
  return { positions, normals, corners: new Uint32Array(corners) };
}

/**
 * Which block marks each cell: 0 for none, else its index plus 1.
 * @param {MapHead} map
 */
async function readMap(map) {
  return new Reader(await inflate(map.name)).u32s(map.columns * map.rows);
}

/** Densities of a map, of 255, and the pens of its cells. @param {ToneHead} tone */
async function readTone(tone) {
  const reader = new Reader(await inflate(tone.name));
  const cells = tone.columns * tone.rows;
  return { density: reader.take(cells), pens: tone.has_pens ? reader.take(cells) : null };
}

/**
 * @param {Head} head @param {Blocks} blocks @param {ChunkHead} chunk
 * @returns {Promise<Chunk>}
 */
async function readChunk(head, blocks, chunk) {
  const reader = new Reader(await inflate(chunk.name));
  const [marks, points] = [reader.u32(), reader.u32()];
  const [blockOf, penOf, lengthOf] = [reader.u16s(marks), reader.take(marks), reader.u16s(marks)];
  const [x, y, z] = [reader.u16Deltas(points), reader.u16Deltas(points), reader.u16Deltas(points)];
  const incidence = reader.take(points);
  const onTheFly = head.mode === "on-the-fly";
  const defocus = onTheFly ? reader.u16Deltas(points) : z;
  const clock_us = onTheFly ? reader.u32Deltas(points) : null;
  const toSteps = (chunk.z_mm * 1000) / head.defocus_um_per_step;

  const words = new Uint32Array(Math.ceil((points + 1) / POINTS_PER_ROW) * POINTS_PER_ROW * (STRIDE / 4));
  const shorts = new Int16Array(words.buffer);
  const bytes = new Uint8Array(words.buffer);
  const pointOfBlock = new Uint32Array(chunk.last - chunk.first + 1).fill(points);
  const hasDots = lengthOf.includes(1);
  let at = 0;
  for (let m = 0, block = 0; m < marks; m++) {
    for (; block <= blockOf[m]; block++) pointOfBlock[block] = at;
    const flags = lengthOf[m] === 1 ? LAST_OF_MARK | IS_DOT : 0;
    for (const end = at + lengthOf[m]; at < end; at++) {
      const s = at * (STRIDE / 2);
      shorts[s] = x[at];
      shorts[s + 1] = y[at];
      shorts[s + 2] = z[at];
      shorts[s + 3] = blockOf[m];
      shorts[s + 4] = onTheFly ? defocus[at] : Math.round(((z[at] << 16) >> 16) * toSteps);
      bytes[2 * s + 10] = incidence[at];
      bytes[2 * s + 11] = penOf[m];
      words[s / 2 + 3] = flags | (at === end - 1 ? LAST_OF_MARK : 0);
    }
  }
  const steps = CLOCK_STEPS / Math.max(head.time_s, 1e-9);
  /** @param {number} point @param {number} t */
  const setClock = (point, t) => {
    const step = Math.min(Math.max(Math.round(t * steps), 0), CLOCK_STEPS);
    words[4 * point + 3] = ((step << 2) | (words[4 * point + 3] & 3)) >>> 0;
  };
  if (clock_us) {
    for (let i = 0; i < points; i++) setClock(i, clock_us[i] / 1e6);
  } else {
    const out = { head: chunk, words, shorts, points, pointOfBlock, hasDots };
    for (let b = 0; b + chunk.first < chunk.last; b++) setBlockClock(head, blocks, out, b, setClock);
  }
  return { head: chunk, words, shorts, points, pointOfBlock, hasDots };
}

/**
 * Gives each point of a block its time: jumps, marks and delays as the scanner makes them, scaled to the time that the
 * machine marks there.
 * @param {Head} head @param {Blocks} blocks @param {Chunk} chunk @param {number} block index in the chunk
 * @param {(point: number, t: number) => void} setClock
 */
function setBlockClock(head, blocks, chunk, block, setClock) {
  const [from, to] = [chunk.pointOfBlock[block], chunk.pointOfBlock[block + 1]];
  if (from === to) return;
  const { shorts, words } = chunk;
  const scanner = head.scanner;
  const raw = new Float64Array(to - from);
  let [t, px, py, isFirst] = [0, 0, 0, true];
  for (let i = from; i < to; i++) {
    const qx = shorts[8 * i] * chunk.head.xy_mm;
    const qy = shorts[8 * i + 1] * chunk.head.xy_mm;
    const pen = head.pens[words[4 * i + 2] >>> 24];
    const flags = words[4 * i + 3];
    const length = Math.hypot(qx - px, qy - py);
    if (isFirst) t += length / scanner.jump_speed_mm_s + scanner.jump_delay_us / 1e6;
    else t += (length / pen.speed_mm_s) * pen.passes;
    raw[i - from] = t;
    if (flags & IS_DOT) t += ((pen.dwell_us ?? 0) / 1e6) * pen.passes;
    isFirst = (flags & LAST_OF_MARK) !== 0;
    t += (isFirst ? scanner.mark_delay_us : scanner.polygon_delay_us) / 1e6;
    [px, py] = [qx, qy];
  }
  const index = chunk.head.first + block;
  const [start, end] = [blocks.start[index], blocks.end[index]];
  for (let i = from; i < to; i++) setClock(i, start + ((end - start) * raw[i - from]) / t);
}

/**
 * Texture that is not marked: x, y, z (f32) and, in the fourth word, the two flags and above them whether the pattern
 * is meant to lie beyond the part.
 * @param {{name: string, lines: number, points: number}} skipped @param {Skipped[]} kinds
 */
async function readSkipped(skipped, kinds) {
  const reader = new Reader(await inflate(skipped.name));
  const rows = reader.take(skipped.lines);
  const lengths = reader.u16s(skipped.lines);
  const axes = [reader.f32s(skipped.points), reader.f32s(skipped.points), reader.f32s(skipped.points)];
  const values = new Float32Array((skipped.points + 1) * 4);
  const words = new Uint32Array(values.buffer);
  let at = 0;
  for (let l = 0; l < skipped.lines; l++) {
    const flags = (kinds[rows[l]].reason === "beyond" ? 4 : 0) | (lengths[l] === 1 ? IS_DOT : 0);
    for (const end = at + lengths[l]; at < end; at++) {
      for (let k = 0; k < 3; k++) values[4 * at + k] = axes[k][at];
      words[4 * at + 3] = flags | (at === end - 1 ? LAST_OF_MARK : 0);
    }
  }
  return { words, points: skipped.points };
}

/**
 * The triangles of all fixtures: place and direction of each corner, as the shader reads them.
 * @param {FixtureHead[]} fixtures
 * @returns {Promise<Float32Array<ArrayBuffer>>}
 */
async function readFixtures(fixtures) {
  const reader = new Reader(await inflate("fixtures"));
  const n = 3 * fixtures.reduce((sum, fixture) => sum + fixture.triangles, 0);
  const axes = [reader.f32s(n), reader.f32s(n), reader.f32s(n)];
  const values = new Float32Array(6 * n);
  for (let i = 0; i < n; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => /** @type {Vec3} */ ([axes[0][i + k], axes[1][i + k], axes[2][i + k]]));
    const [u, v] = [minus(b, a), minus(c, a)];
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...normal) || 1;
    [a, b, c].forEach((p, k) => values.set([...p, ...normal.map((x) => x / length)], 6 * (i + k)));
  }
  return values;
}

/**
 * What marks of a measured part keep free, and what is added to its height, null of a rigid part: bytes of cells.
 * @param {MeasuredHead} measured
 */
async function readMeasured({ name, columns, rows, is_warped }) {
  const reader = new Reader(await inflate(name));
  const n = columns * rows;
  return { kept: reader.take(n), correction: is_warped ? reader.take(n) : null };
}

/**
 * The motion of the head of an on-the-fly job.
 * @param {{name: string, samples: number}} motion
 * @returns {Promise<Motion>}
 */
async function readMotion(motion) {
  const reader = new Reader(await inflate(motion.name));
  const n = motion.samples;
  const three = () => [reader.f32s(n), reader.f32s(n), reader.f32s(n)];
  return { t: reader.f32s(n), centre: three(), up: three(), spot: three(), on: reader.take(n) };
}

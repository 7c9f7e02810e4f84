// @ts-check
/**
 * What WebGL draws: the part with the blocks draped on it, its fixtures, the marks, and the texture that is not marked.
 *
 * Consumes decoded data and, for each picture, a `Look`. Where marks lie denser than pixels the map of their density is
 * drawn as tone; elsewhere lines, so opaque that where several lie in a pixel they make the same tone. Promises that a
 * picture is drawn within a budget of lines: while something moves, every k-th line of the marks in sight; at rest all
 * of them, a piece in each frame. What is not drawn is told by `said`. Data of marks is asked for when it comes into
 * sight, nearest first.
 */

/**
 * @typedef {object} Look
 * @property {Camera} camera
 * @property {Turn} turn of the table
 * @property {ColourBy} by
 * @property {number} now time up to which marks are drawn, s; Infinity for all
 * @property {number} present index of the present block, -1 for none
 * @property {number} pen index, -1 for all
 * @property {[number, number]|null} defocus um, of what is shown
 * @property {[number, number]|null} incidence deg, of what is shown
 * @property {Record<Layer, boolean>} layers
 * @property {number} pass whose blocks are draped, from 1
 * @property {(block: number) => boolean} isShown
 * @property {Theme} theme
 * @property {number} size of words and lines, 1 on a small screen
 * @property {boolean} moving
 * @property {boolean} rough whether marks that are drawn as tone may lie on the rough mesh
 */
/** @typedef {{ground: Colour, part: Colour, ink: Colour, accent: Colour}} Theme */
/** @typedef {"part"|"fixtures"|"blocks"|"borders"|"marks"|"skipped"|"path"|"field"|"lens"|"travel"|"seams"|"labels"} Layer */

/** Fewest and most lines drawn in a frame while something moves. */
const BUDGET = [20_000, 3_000_000];
/** Lines that a frame adds at rest. */
const PIECE = 100_000;
/** Lines in sight from which on dense marks are tone, at rest, where the processor draws and where a graphics card
 * does: fewer are drawn at once, and sharper. */
const MANY = [100_000, 600_000];
/** Dense marks nearer to each other than this are tone, CSS pixels, */
const MERGED_PX = 0.9;
/** as long as cells of their map are not wider than this: at rest, and while something moves. */
const TONE_CELL_PX = [1.5, 6];
/** Least and largest diameter of a dot that is larger than its spot, CSS pixels. */
const DOT_PX = [1, 3];
/** Darkness of dense marks: how many layers of ink lie on a pixel that they cover. */
const DARKNESS = 1.5;

class Scene {
  /** @param {HTMLCanvasElement} canvas @param {Head} head @param {Blocks} blocks
   * @param {(isStale: boolean) => void} changed */
  constructor(canvas, head, blocks, changed) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true, alpha: false });
    if (!gl) throw new Error("this browser does not offer WebGL 2");
    this.gl = gl;
    /** Whether there is no graphics card: the processor draws. */
    this.isSoftware = /swiftshader|llvmpipe|software|basic render/i.test(rendererOf(gl));
    /** Lines in sight from which on dense marks are tone, at rest. */
    this.many = MANY[this.isSoftware ? 0 : 1];
    this.canvas = canvas;
    this.head = head;
    this.blocks = blocks;
    this.changed = changed;
    this.meshProgram = new Program(gl, MESH_VERTEX, MESH_FRAGMENT);
    this.markProgram = new Program(gl, MARK_VERTEX, MARK_FRAGMENT);
    this.fixtureProgram = new Program(gl, FIXTURE_VERTEX, FIXTURE_FRAGMENT);
    this.skippedProgram = new Program(gl, SKIPPED_VERTEX, SKIPPED_FRAGMENT);
    this.blockValues = new Values(gl, gl.RGBA32F, gl.RGBA, gl.FLOAT);
    this.palette = new Values(gl, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
    this.ramps = new Values(gl, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
    this.ramps.set(RAMP_TEXELS, 3, rampTexels());
    /** What the colours of the palette stand for. @type {ColourBy|null} */
    this.paletteBy = null;
    const rows = Math.max(1, Math.ceil(head.blocks.count / BLOCKS_PER_ROW));
    this.paletteTexels = new Uint8Array(BLOCKS_PER_ROW * rows * 4);
    this.blockValues.set(4 * BLOCKS_PER_ROW, rows, this.valuesOfBlocks(rows));
    /** @type {(Values|null)[]} */
    this.labels = head.maps.map(() => null);
    this.noLabels = new Values(gl, gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT);
    this.noLabels.set(1, 1, new Uint32Array(1));
    /** @type {{array: WebGLVertexArrayObject, corners: number}|null} */
    this.mesh = null;
    /** What stands for it where the computer is slow. @type {{array: WebGLVertexArrayObject, corners: number}|null} */
    this.rough = null;
    /** @type {({density: Means, pens: Values|null}|null)[]} */
    this.tones = head.tones.maps.map(() => null);
    this.noTone = new Means(gl, 1, 1, new Uint8Array(1));
    this.noPens = new Values(gl, gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE);
    this.noPens.set(1, 1, new Uint8Array(1));
    /** What was measured, by colour. @type {{kept: Means, correction: Means|null}|null} */
    this.measured = null;
    /** @type {WebGLVertexArrayObject|null} */
    this.fixtures = null;
    /** @type {{array: WebGLVertexArrayObject, points: number}|null} */
    this.skipped = null;
    /** @type {({data: Chunk, points: Values}|null)[]} */
    this.chunks = head.chunks.map(() => null);
    /** @type {(Promise<void>|null)[]} */
    this.loads = head.chunks.map(() => null);
    this.loading = 0;
    this.budget = this.isSoftware ? BUDGET[0] : 100_000;
    /** Chunks that are not drawn yet in the picture at rest. @type {number[]} */
    this.waiting = [];
    /** Chunks in sight that were not read when the picture was begun. @type {Set<number>} */
    this.wanted = new Set();
    /** Where the next piece of the first of them begins. */
    this.waitingAt = 0;
    /** Whether marks are drawn as lines of one device pixel. */
    this.isThin = false;
    /** Points of marks in sight. */
    this.inSight = 0;
    /** Whether marks are drawn as lines. */
    this.drawsMarks = false;
    /** Whether marks are drawn as tone. */
    this.drawsTone = false;
    /** Whether the part is drawn roughly. */
    this.drawsRough = false;
    /** Lines of which one is drawn. */
    this.every = 1;
    const size = minus(...boxOfMarks(head)).map(Math.abs);
    /** Mean side of a block, mm. */
    this.block_mm = Math.sqrt((size[0] * size[1] * head.passes) / Math.max(head.blocks.count, 1));
    /** Mean width of a block between its borders, mm. */
    this.width_mm = this.block_mm;
    /** Distance of dense lines, mm. */
    this.pitch_mm = 1 / (head.tones.dense_per_mm[0] ?? 1);
    /** Distance of dense marks, mm. A dot counts as a line of a spot's width that covers as much. */
    this.apart_mm = head.histograms.defocus_um.of_dots
      ? Math.sqrt((Math.PI / 4) * head.spot_mm * this.pitch_mm)
      : this.pitch_mm;
  }

  /** Four texels for each block. @param {number} rows */
  valuesOfBlocks(rows) {
    const values = new Float32Array(4 * 4 * BLOCKS_PER_ROW * rows);
    const { blocks } = this;
    /** @type {Map<string, number>} */
    const tilts = new Map();
    for (let i = 0; i < this.head.blocks.count; i++) {
      const m = blocks.frame?.[i] ?? [1, 0, 0, 0, 1, 0, 0, 0, 1, ...blocks.origin[i]];
      const tilt = String(blocks.tilt?.[i] ?? "");
      if (!tilts.has(tilt)) tilts.set(tilt, tilts.size);
      const section = blocks.section?.[i] ?? [i, 0];
      const key = [section[0] + 4096 * section[1], blocks.level?.[i] ?? 0, tilts.get(tilt) ?? 0, blocks.setup[i]];
      for (let r = 0; r < 3; r++) values.set([m[3 * r], m[3 * r + 1], m[3 * r + 2], m[9 + r]], 16 * i + 4 * r);
      values.set(key, 16 * i + 12);
    }
    return values;
  }

  /** @param {Mesh} mesh */
  setMesh(mesh) {
    this.mesh = this.uploaded(mesh);
    this.rough = this.uploaded(roughMesh(mesh, minus(this.head.part.box[1], this.head.part.box[0])));
  }

  /** @param {Mesh} mesh */
  uploaded(mesh) {
    const gl = this.gl;
    const array = /** @type {WebGLVertexArrayObject} */ (gl.createVertexArray());
    gl.bindVertexArray(array);
    bufferOf(gl, gl.ARRAY_BUFFER, mesh.positions);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 8, 0);
    bufferOf(gl, gl.ARRAY_BUFFER, mesh.normals);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 3, gl.BYTE, true, 4, 0);
    bufferOf(gl, gl.ELEMENT_ARRAY_BUFFER, mesh.corners);
    gl.bindVertexArray(null);
    return { array, corners: mesh.corners.length };
  }

  /** @param {number} k of `head.maps` @param {Uint32Array<ArrayBuffer>} labels */
  setMap(k, labels) {
    const gl = this.gl;
    const values = new Values(gl, gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT);
    values.set(this.head.maps[k].columns, this.head.maps[k].rows, labels);
    this.labels[k] = values;
  }

  /** @param {number} k of `head.tones.maps`
   * @param {{density: Uint8Array<ArrayBuffer>, pens: Uint8Array<ArrayBuffer>|null}} tone */
  setTone(k, tone) {
    const gl = this.gl;
    const { columns, rows } = this.head.tones.maps[k];
    const pens = tone.pens && new Values(gl, gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE);
    if (tone.pens) pens?.set(columns, rows, tone.pens);
    this.tones[k] = { density: new Means(gl, columns, rows, tone.density), pens };
  }

  /** @param {{kept: Uint8Array<ArrayBuffer>, correction: Uint8Array<ArrayBuffer>|null}} maps */
  setMeasured({ kept, correction }) {
    const { columns, rows } = /** @type {MeasuredHead} */ (this.head.measured);
    const texture = (/** @type {Uint8Array<ArrayBuffer>} */ bytes) => new Means(this.gl, columns, rows, bytes);
    this.measured = { kept: texture(kept), correction: correction && texture(correction) };
  }

  /** Density of dense marks over a square, mm/mm². @param {number} side mm */
  dense(side) {
    const { maps, dense_per_mm } = this.head.tones;
    const last = dense_per_mm.length - 1;
    if (last < 0) return 1;
    const level = Math.min(Math.max(Math.log2(side / maps[0].cell), 0), last);
    const [below, share] = [Math.floor(level), level % 1];
    return dense_per_mm[below] * (1 - share) + dense_per_mm[Math.min(below + 1, last)] * share;
  }

  /** The index of the map of the pass that is looked at, -1 where marks cannot be drawn as its tone: it is not read, or
   * they are filtered or coloured by what it does not hold. @param {Look} look */
  toneOf(look) {
    if (look.defocus !== null || look.incidence !== null || look.pen >= 0) return -1;
    // On the fly there is no map of what is marked when.
    if (this.head.maps.length === 0 && (look.now < Infinity || !["height", "pen"].includes(look.by))) return -1;
    return this.head.tones.maps.findIndex((t, k) => t.pass === look.pass && this.tones[k]);
  }

  /** What the picture does not show, in words; empty where it shows all. */
  said() {
    if (this.drawsRough) return "Marks as tone on a rough part while it moves";
    if (this.drawsTone) return "Marks as tone: they lie denser than pixels";
    if (this.drawsMarks && this.every > 1) return `1 of ${this.every} marks while it moves`;
    return "";
  }

  /** @param {Float32Array<ArrayBuffer>} values place and direction of each corner */
  setFixtures(values) {
    const gl = this.gl;
    this.fixtures = /** @type {WebGLVertexArrayObject} */ (gl.createVertexArray());
    gl.bindVertexArray(this.fixtures);
    bufferOf(gl, gl.ARRAY_BUFFER, values);
    for (const k of [0, 1]) {
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 24, 12 * k);
    }
    gl.bindVertexArray(null);
  }

  /** @param {{words: Uint32Array<ArrayBuffer>, points: number}} skipped */
  setSkipped(skipped) {
    const gl = this.gl;
    const array = /** @type {WebGLVertexArrayObject} */ (gl.createVertexArray());
    gl.bindVertexArray(array);
    bufferOf(gl, gl.ARRAY_BUFFER, skipped.words);
    for (const k of [0, 1, 2]) {
      gl.enableVertexAttribArray(k);
      gl.vertexAttribDivisor(k, 1);
    }
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, STRIDE, 0);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, STRIDE, 12);
    gl.vertexAttribPointer(2, 3, gl.FLOAT, false, STRIDE, STRIDE);
    gl.bindVertexArray(null);
    this.skipped = { array, points: skipped.points };
  }

  /** Reads a chunk, once. @param {number} k @returns {Promise<void>} */
  load(k) {
    this.loads[k] ??= this.read(k);
    return /** @type {Promise<void>} */ (this.loads[k]);
  }

  /** @param {number} k */
  async read(k) {
    const gl = this.gl;
    this.loading += 1;
    try {
      const data = await readChunk(this.head, this.blocks, this.head.chunks[k]);
      const points = new Values(gl, gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT);
      points.set(POINTS_PER_ROW, data.words.length / 4 / POINTS_PER_ROW, data.words);
      this.chunks[k] = { data, points };
    } finally {
      this.loading -= 1;
    }
    // It joins the picture at rest, or the next one.
    if (this.wanted.has(k)) this.waiting.push(k);
    this.changed(false);
  }

  /** The chunk of a block, -1 if it has no marks. @param {number} block */
  chunkOf(block) {
    return this.head.chunks.findIndex((c) => c.first <= block && block < c.last);
  }

  /** Colours of the blocks and which are shown. @param {Look} look */
  setPalette(look) {
    const { head, blocks, paletteTexels: texels } = this;
    if (this.paletteBy !== look.by)
      for (let i = 0; i < head.blocks.count; i++) texels.set(ofBlock(look.by, head, blocks, i), 4 * i);
    this.paletteBy = look.by;
    for (let i = 0; i < head.blocks.count; i++) {
      texels[4 * i + 3] = look.isShown(i) && blocks.start[i] <= look.now ? 255 : 0;
    }
    this.palette.set(BLOCKS_PER_ROW, texels.length / BLOCKS_PER_ROW / 4, texels);
  }

  /** Draws a picture from its beginning. @param {Look} look */
  draw(look) {
    const { gl, canvas, head } = this;
    const ratio = canvas.width / look.camera.width;
    gl.viewport(0, 0, canvas.width, canvas.height);
    this.setBlending(false);
    gl.clearColor(...unitColour(look.theme.ground), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const { projection } = look.camera.matrices();
    const chunks = look.layers.marks ? this.chunksInSight(look) : [];
    this.inSight = chunks.reduce((sum, k) => sum + head.chunks[k].points, 0);
    this.drawsTone = look.layers.marks && this.isTone(look);
    this.drawsMarks = look.layers.marks && !this.drawsTone;
    // Lines would sink into a rough part.
    this.drawsRough = look.rough && this.drawsTone;
    if (look.layers.part) this.drawMesh(look, projection, ratio, false);
    if (look.layers.fixtures) this.drawFixtures(look, projection);
    if (look.layers.skipped) this.drawSkipped(look, projection, ratio);
    this.waiting = this.drawsMarks ? chunks : [];
    this.waitingAt = 0;
    this.wanted = new Set(this.waiting.filter((k) => !this.chunks[k]));
    this.waiting = this.waiting.filter((k) => this.chunks[k]);
    this.readWanted();
    this.every = 1;
    if (look.moving) {
      const lines = this.waiting.reduce((sum, k) => sum + (this.chunks[k]?.data.points ?? 0), 0);
      this.every = Math.max(1, Math.ceil(lines / this.budget));
      this.beginMarks(look, projection, [canvas.width, canvas.height], ratio, false);
      for (const k of this.waiting) this.drawChunk(k, 0, Infinity, this.every);
      if (this.every === 1) this.waiting = [];
    }
  }

  /** Whether the marks of this picture are drawn as tone. @param {Look} look */
  isTone(look) {
    const tone = this.head.tones.maps[this.toneOf(look)];
    // The part is what tone lies on.
    if (!tone || !look.layers.part || !this.mesh) return false;
    const px = look.camera.pixel_mm();
    const [resting, moving] = TONE_CELL_PX;
    if (this.inSight > this.many && this.apart_mm / px < MERGED_PX && tone.cell / px < resting) return true;
    return look.moving && this.inSight > this.budget && tone.cell / px < moving;
  }

  /** Whether what is drawn lets through what lies below it; then it hides nothing that is drawn later.
   * @param {boolean} on */
  setBlending(on) {
    const gl = this.gl;
    gl.depthMask(!on);
    if (!on) return gl.disable(gl.BLEND);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Adds a piece of the marks to the picture at rest; false when it is complete. @param {Look} look */
  drawMore(look) {
    this.readWanted();
    this.every = 1;
    if (this.waiting.length === 0) return false;
    const { gl, canvas } = this;
    gl.viewport(0, 0, canvas.width, canvas.height);
    const { projection } = look.camera.matrices();
    this.beginMarks(look, projection, [canvas.width, canvas.height], canvas.width / look.camera.width, false);
    let left = PIECE;
    while (left > 0 && this.waiting.length > 0) {
      const k = this.waiting[0];
      const chunk = /** @type {{data: Chunk}} */ (this.chunks[k]);
      const to = Math.min(this.waitingAt + left, chunk.data.points);
      this.drawChunk(k, this.waitingAt, to, 1);
      left -= to - this.waitingAt;
      this.waitingAt = to;
      if (to === chunk.data.points) {
        this.waiting.shift();
        this.waitingAt = 0;
      }
    }
    return this.waiting.length > 0;
  }

  /** Reads what is in sight, two chunks at a time. */
  readWanted() {
    for (const k of this.wanted) {
      if (this.loading >= 2) break;
      if (!this.loads[k]) this.load(k).catch((error) => reportError(error));
    }
  }

  /** Chunks in the picture, nearest to its middle first.
   * @param {Look} look */
  chunksInSight(look) {
    const view = product(look.camera.matrices().both, matrixOfTurn(look.turn));
    /** @type {[number, number][]} */
    const seen = [];
    this.head.chunks.forEach((chunk, k) => {
      let [outside, distance] = [63, Infinity];
      for (let c = 0; c < 8; c++) {
        const [x, y, z] = [0, 1, 2].map((a) => chunk.box[(c >> a) & 1][a]);
        const [u, v, , w] = [0, 1, 2, 3].map((r) => view[r] * x + view[4 + r] * y + view[8 + r] * z + view[12 + r]);
        outside &= (u < -w ? 1 : 0) | (u > w ? 2 : 0) | (v < -w ? 4 : 0) | (v > w ? 8 : 0) | (w < 0 ? 16 : 0);
        distance = Math.min(distance, Math.hypot(u / w, v / w));
      }
      if (outside === 0) seen.push([distance, k]);
    });
    seen.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    return seen.map(([, k]) => k);
  }

  /** @param {Look} look @param {Matrix} projection @param {number} ratio device pixels of a CSS pixel
   * @param {boolean} pick whether blocks are drawn as their numbers */
  drawMesh(look, projection, ratio, pick) {
    const mesh = this.drawsRough && !pick ? this.rough : this.mesh;
    if (!mesh) return;
    const { gl, head, meshProgram: p } = this;
    this.setBlending(false);
    p.use();
    const { view } = look.camera.matrices();
    const [low, high] = head.part.box;
    const px = look.camera.pixel_mm();
    const k = this.drawsTone ? this.toneOf(look) : -1;
    const [tone, texels] = [head.tones.maps[k], this.tones[k]];
    (texels?.density ?? this.noTone).bind(5);
    (texels?.pens ?? this.noPens).bind(6);
    p.floats({
      uView: product(view, matrixOfTurn(look.turn)),
      uProjection: projection,
      uLow: low,
      uSize: minus(high, low),
      uPart: unitColour(look.theme.part),
      uInk: unitColour(look.theme.ink),
      uAccent: unitColour(look.theme.accent),
      uTint: this.tintOf(look),
      uToneMap: tone ? [...tone.origin, tone.cell] : [0, 0, 1],
      uDarkness: (DARKNESS * head.tones.most_per_mm) / this.dense(px),
      uRange: this.rangeOf(look.by),
      uPixels: ratio,
      // Where blocks are a few pixels wide, their borders would hide their colours.
      uBorders: look.layers.borders ? Math.min(Math.max((this.width_mm / px - 5) / 10, 0), 1) : 0,
    });
    p.ints({
      uPresent: look.present + 1,
      uSeams: look.layers.seams || look.by === "seam",
      uPick: pick,
      uAsTone: tone !== undefined,
      uHasBlocks: head.maps.length > 0,
      uHasPens: Boolean(texels?.pens),
      uTone: 5,
      uPens: 6,
      uMode: this.markMode(look.by),
    });
    gl.uniform2i(p.at("uToneCells"), tone?.columns ?? 1, tone?.rows ?? 1);
    this.bindBlocks(p, look);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.corners, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
  }

  /** Draws the fixtures of the set-up of the present block; of all set-ups where there is none.
   * @param {Look} look @param {Matrix} projection */
  drawFixtures(look, projection) {
    const { gl, fixtureProgram: p } = this;
    if (!this.fixtures) return;
    this.setBlending(false);
    p.use();
    p.floats({
      uView: product(look.camera.matrices().view, matrixOfTurn(look.turn)),
      uProjection: projection,
      uGrey: [0.42, 0.42, 0.42],
    });
    gl.bindVertexArray(this.fixtures);
    const setup = look.present < 0 ? 0 : this.blocks.setup[look.present];
    let first = 0;
    for (const { setups, triangles } of this.head.fixtures ?? []) {
      if (setup === 0 || setups.length === 0 || setups.includes(setup)) gl.drawArrays(gl.TRIANGLES, first, 3 * triangles);
      first += 3 * triangles;
    }
    gl.bindVertexArray(null);
  }

  /** @param {Program} p @param {Look} look */
  bindBlocks(p, { pass, by }) {
    const k = this.head.maps.findIndex((m, i) => m.pass === pass && this.labels[i]);
    const map = this.head.maps[k];
    this.blockValues.bind(0);
    this.palette.bind(1);
    (this.labels[k] ?? this.noLabels).bind(2);
    this.ramps.bind(3);
    const measured = by === "correction" ? this.measured?.correction : this.measured?.kept;
    (measured ?? this.noTone).bind(7);
    p.ints({ uBlocks: 0, uPalette: 1, uLabels: 2, uRamps: 3, uMeasured: 7, uMeasuredRamp: by === "correction" ? 1 : 0 });
    p.floats({ uMeasuredMap: [...(this.head.measured?.origin ?? [0, 0]), ...(this.head.measured?.size ?? [1, 1])] });
    p.floats({ uMap: map ? [...map.origin, map.cell] : [0, 0, 1] });
    this.gl.uniform2i(p.at("uMapCells"), map?.columns ?? 0, map?.rows ?? 0);
  }

  /** @param {Look} look @param {Matrix} projection @param {number} ratio */
  drawSkipped(look, projection, ratio) {
    if (!this.skipped) return;
    const { gl, canvas, skippedProgram: p } = this;
    p.use();
    p.floats({
      uView: product(look.camera.matrices().view, matrixOfTurn(look.turn)),
      uProjection: projection,
      uViewport: [canvas.width, canvas.height],
      uWidth: 1.2 * ratio,
      uBias: this.bias(look),
      uRed: unitColour(SKIPPED),
      uGrey: unitColour(BEYOND),
    });
    gl.bindVertexArray(this.skipped.array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.skipped.points);
    gl.bindVertexArray(null);
  }

  /** How far lines are moved towards the eye, mm: the decimated part must not hide them. @param {Look} look */
  bias(look) {
    const [low, high] = this.head.part.box;
    const rough = this.drawsRough ? Math.max(...minus(high, low)) / ROUGH_CELLS : 0;
    return 1.3 * this.head.part.within_mm + rough + 0.6 * look.camera.pixel_mm();
  }

  /** @param {Look} look @param {Matrix} projection @param {[number, number]} viewport @param {number} ratio
   * @param {boolean} pick */
  beginMarks(look, projection, viewport, ratio, pick) {
    const { head, markProgram: p } = this;
    this.setBlending(!pick);
    p.use();
    const { histograms } = head;
    const all = /** @type {[number, number]} */ ([-1e30, 1e30]);
    const [defocus, incidence] = [look.defocus ?? all, look.incidence ?? all];
    const isOpen = (/** @type {number} */ v, /** @type {number[]} */ edges) => Number(v >= edges[edges.length - 1]);
    const px = look.camera.pixel_mm();
    // Never thinner than the spot.
    const shown = Math.max(lineWidth(this.pitch_mm / px) * look.size, head.spot_mm / px);
    const width = (pick ? 2 : shown) * ratio;
    // Lines of the graphics card have no soft edges, but of very many nobody sees them.
    this.isThin = width < 1.2 && !pick && this.inSight > this.many / 2;
    // So much ink that dense lines, all together, are as dark as their tone.
    const dense = this.dense(px);
    const covered = dense * px * Math.max(width / ratio, 1 / ratio);
    // A dot of the map is a line of a spot's width that covers as much.
    const dotPitch = Math.sqrt((Math.PI / 4) * head.spot_mm * this.pitch_mm);
    const least = Math.min(Math.max((0.25 * dotPitch) / px, DOT_PX[0]), DOT_PX[1]) * look.size;
    const dot = Math.max(head.spot_mm / px, least);
    const covered_by_dots = (dense * (dot * px) ** 2) / head.spot_mm;
    /** @param {number} layers */
    const opacity = (layers) => (pick ? 1 : 1 - Math.exp((-DARKNESS * this.every) / layers));
    p.floats({
      uView: product(look.camera.matrices().view, matrixOfTurn(look.turn)),
      uProjection: projection,
      uViewport: viewport,
      uWidth: width,
      uDot: dot * ratio,
      uSize: [this.isThin ? 1 : width, dot * ratio],
      uBias: this.bias(look),
      uValueStep: [head.defocus_um_per_step, head.incidence_deg_per_step],
      uShownDefocus: defocus,
      uShownIncidence: incidence,
      uShownHalf: [
        isOpen(defocus[1], histograms.defocus_um.edges),
        isOpen(incidence[1], histograms.incidence_deg.edges),
        Number(histograms.defocus_um.edges[0] >= 0),
        0,
      ],
      uAccent: unitColour(look.theme.accent),
      uOpacity: [opacity(covered), opacity(covered_by_dots)],
      uRange: this.rangeOf(look.by),
      uSeamReach: (head.maps[0]?.cell ?? 0) * 0.5,
    });
    p.ints({
      uNow: Math.min(Math.floor((look.now / head.time_s) * CLOCK_STEPS), CLOCK_STEPS),
      uMode: this.markMode(look.by),
      uShownPen: look.pen,
      uPresentBlock: look.present,
      uPick: pick,
      uAsDot: false,
    });
    this.bindBlocks(p, look);
  }

  /** How much of the colours of blocks is laid over the part. @param {Look} look */
  tintOf(look) {
    const mode = this.markMode(look.by);
    if (!look.layers.blocks || mode === MARK_MODES.measured) return 0;
    return !look.layers.marks ? 1 : mode === MARK_MODES.palette ? 0.22 : 0;
  }

  /** The range of the values that colour marks. @param {ColourBy} by @returns {[number, number]} */
  rangeOf(by) {
    const { ranges } = this.head;
    switch (by) {
      case "defocus":
        return aboutZero(ranges.defocus_um);
      case "incidence":
        return ranges.incidence_deg;
      case "height":
        return ranges.height_mm;
      default:
        return [0, 1];
    }
  }

  /** @param {ColourBy} by */
  markMode(by) {
    // On the fly the focal plane moves while a run is marked.
    if (by === "height" && this.head.mode === "on-the-fly") return MARK_MODES.plane;
    if (by === "correction" || by === "kept") return MARK_MODES.measured;
    return MARK_MODES[/** @type {"pen"} */ (by)] ?? MARK_MODES.palette;
  }

  /** Lines from one point to another, or every k-th of them. @param {number} k of the chunk @param {number} from
   * @param {number} to @param {number} every */
  drawChunk(k, from, to, every) {
    const chunk = this.chunks[k];
    if (!chunk) return;
    const { gl, markProgram: p } = this;
    const { xy_mm, z_mm, first } = chunk.data.head;
    const count = Math.floor((Math.min(to, chunk.data.points) - from) / every);
    if (count <= 0) return;
    p.floats({ uStep: [xy_mm, z_mm] });
    chunk.points.bind(4);
    const isThin = this.isThin && !chunk.data.hasDots;
    p.ints({ uFirst: first, uPoints: 4, uFrom: from, uEvery: every, uThin: isThin });
    gl.drawArrays(isThin ? gl.LINES : gl.TRIANGLES, 0, (isThin ? 2 : 6) * count);
  }
}

/** What draws, as the browser names it. @param {WebGL2RenderingContext} gl */
function rendererOf(gl) {
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  return String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

/** The box of all marks; of the job where there are none. @param {Head} head @returns {Box} */
function boxOfMarks(head) {
  const boxes = head.chunks.map((c) => c.box);
  if (boxes.length === 0) return head.box;
  /** @param {0|1} end @param {(a: number, b: number) => number} pick @returns {Vec3} */
  const corner = (end, pick) =>
    boxes.map((b) => b[end]).reduce((a, b) => [pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2])]);
  return [corner(0, Math.min), corner(1, Math.max)];
}

/** The box of all marks and of the texture that is not marked though it should be. @param {Head} head @returns {Box} */
function boxOfTexture(head) {
  const [low, high] = boxOfMarks(head);
  const lost = head.skipped.filter((s) => s.reason !== "beyond").map((s) => s.box);
  /** @param {0|1|2|3} k @param {(...a: number[]) => number} pick @param {number} mark */
  const reach = (k, pick, mark) => pick(mark, ...lost.map((b) => b[k]));
  return [
    [reach(0, Math.min, low[0]), reach(1, Math.min, low[1]), low[2]],
    [reach(2, Math.max, high[0]), reach(3, Math.max, high[1]), high[2]],
  ];
}

/** @param {Colour} c @returns {Vec3} */
function unitColour(c) {
  return [c[0] / 255, c[1] / 255, c[2] / 255];
}

/** Width of marks whose mean distance is `pitch` CSS pixels: they must not grow together. @param {number} pitch */
function lineWidth(pitch) {
  return Math.min(Math.max(pitch * 0.22, 0.9), 2.4);
}

/** A point of a mark in the part frame, mm. @param {Blocks} blocks @param {Chunk} chunk @param {number} point
 * @returns {Vec3} */
function pointInPart(blocks, chunk, point) {
  const { shorts, head } = chunk;
  const block = head.first + (shorts[8 * point + 3] & 0xffff);
  /** @type {Vec3} */
  const local = [shorts[8 * point] * head.xy_mm, shorts[8 * point + 1] * head.xy_mm, shorts[8 * point + 2] * head.z_mm];
  const frame = blocks.frame?.[block];
  return frame ? turned(frame, local) : add(blocks.origin[block], local);
}

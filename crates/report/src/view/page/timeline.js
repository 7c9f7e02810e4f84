// @ts-check
/**
 * The machine's clock: which stop it is at, where the field and the beam are, how the axes turn the part or the head.
 *
 * Consumes the columns of the blocks (s from the start of the job) and, for on-the-fly jobs, the samples of the motion.
 * Promises places in the world: the part frame as the table turns it at that moment, mm.
 */

/**
 * @typedef {object} Moment
 * @property {number} block index of the stop
 * @property {"moves"|"marks"|"done"} does
 * @property {Turn} turn
 * @property {Vec3} centre of the field, on the focal plane
 * @property {Vec3} up towards the lens
 * @property {Vec3} [right] the field's x, where the head tilts
 * @property {{at: Vec3, on: boolean}|null} beam
 */

/** A time as the rest of the product writes it: `4.2 s`, `12 min 5 s`, `3 h 12 min`. @param {number} s */
function duration(s) {
  const whole = Math.round(Math.max(s, 0));
  if (s < 59.95) return `${Math.max(s, 0).toFixed(1)} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

/** Index of the last of ascending values that is not above `v`; 0 if all are.
 * @param {ArrayLike<number>} values @param {number} v */
function lastUpTo(values, v) {
  let [low, high] = [0, values.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= v) low = middle;
    else high = middle;
  }
  return low;
}

class Timeline {
  /** @param {Head} head @param {Blocks} blocks */
  constructor(head, blocks) {
    this.head = head;
    this.blocks = blocks;
    /** @type {Motion|null} */
    this.motion = null;
    /** @type {Vec3} */
    this.pivot = head.pivot ?? between(head.part.box[0], head.part.box[1], 0.5);
  }

  /** @param {number} t */
  blockAt(t) {
    return lastUpTo(this.blocks.begin, t);
  }

  /** How the table turns the part at a stop. @param {number} block */
  turnOf(block) {
    return this.blocks.turn?.[block] ?? NO_TURN;
  }

  /** The centre of the field at a stop. @param {number} block @returns {Vec3} */
  centreOf(block) {
    const centre = this.blocks.centre?.[block];
    const origin = this.blocks.origin[block];
    return centre ? [centre[0], centre[1], this.blocks.focus?.[block] ?? origin[2]] : origin;
  }

  /**
   * @param {number} t
   * @param {(block: number) => Chunk|null} marksOf the marks of a block, null as long as they are not read
   * @returns {Moment}
   */
  at(t, marksOf) {
    const { blocks } = this;
    const block = this.blockAt(t);
    const does = t < blocks.start[block] ? "moves" : t < blocks.end[block] ? "marks" : "done";
    if (this.motion && this.motion.t.length > 0) return { block, does, ...this.onTheFly(this.motion, t) };
    const wait = blocks.start[block] - blocks.begin[block];
    const share = wait > 0 ? Math.min(Math.max((t - blocks.begin[block]) / wait, 0), 1) : 1;
    if (this.head.head_tilts) return { block, does, ...this.leaning(block, block > 0 ? share : 1, t, does, marksOf) };
    /** @type {Vec3} */
    const up = [0, 0, 1];
    if (share < 1 && block > 0) {
      const s = share * share * (3 - 2 * share);
      const centre = between(this.centreOf(block - 1), this.centreOf(block), s);
      const [a, b] = [this.turnOf(block - 1), this.turnOf(block)];
      return { block, does, turn: a === b ? a : turnBetween(a, b, s, this.pivot), centre, up, beam: null };
    }
    const turn = this.turnOf(block);
    const chunk = does === "marks" ? marksOf(block) : null;
    const beam = chunk && this.beam(chunk, block, t);
    return {
      block,
      does,
      turn,
      centre: this.centreOf(block),
      up,
      beam: beam && { ...beam, at: turned(turn, beam.at) },
    };
  }

  /**
   * The moment of a head that tilts over a part that stays.
   * @param {number} block @param {number} share of the way to it @param {number} t
   * @param {Moment["does"]} does @param {(block: number) => Chunk|null} marksOf
   */
  leaning(block, share, t, does, marksOf) {
    /** @param {number} i @returns {Vec3[]} */
    const pose = (i) => {
      const turn = this.turnOf(i);
      return [inPart(turn, this.centreOf(i)), [turn[6], turn[7], turn[8]], [turn[0], turn[1], turn[2]]];
    };
    const s = share * share * (3 - 2 * share);
    const [from, to] = [pose(share < 1 ? block - 1 : block), pose(block)];
    const [centre, up, right] = to.map((p, k) => between(from[k], p, s));
    const chunk = does === "marks" ? marksOf(block) : null;
    return { turn: NO_TURN, centre, up: unit(up), right: unit(right), beam: chunk && this.beam(chunk, block, t) };
  }

  /** The beam in a block, part frame. @param {Chunk} chunk @param {number} block @param {number} t */
  beam(chunk, block, t) {
    const b = block - chunk.head.first;
    const [from, to] = [chunk.pointOfBlock[b], chunk.pointOfBlock[b + 1]];
    if (from === to) return null;
    const step = (t / this.head.time_s) * CLOCK_STEPS;
    const clock = (/** @type {number} */ i) => chunk.words[4 * i + 3] >>> 2;
    let [low, high] = [from, to];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (clock(middle) <= step) low = middle;
      else high = middle;
    }
    const flags = chunk.words[4 * low + 3];
    const here = pointInPart(this.blocks, chunk, low);
    if (low + 1 >= to || step < clock(from)) return { at: here, on: (flags & IS_DOT) !== 0 };
    const span = clock(low + 1) - clock(low);
    const share = span > 0 ? Math.min((step - clock(low)) / span, 1) : 0;
    return { at: between(here, pointInPart(this.blocks, chunk, low + 1), share), on: (flags & LAST_OF_MARK) === 0 };
  }

  /** @param {Motion} motion @param {number} t */
  onTheFly(motion, t) {
    const i = lastUpTo(motion.t, t);
    const j = Math.min(i + 1, motion.t.length - 1);
    const span = motion.t[j] - motion.t[i];
    const share = span > 0 ? Math.min(Math.max((t - motion.t[i]) / span, 0), 1) : 0;
    /** @param {Float32Array[]} axes @returns {Vec3} */
    const mix = ([x, y, z]) => between([x[i], y[i], z[i]], [x[j], y[j], z[j]], share);
    return {
      turn: NO_TURN,
      centre: mix(motion.centre),
      up: unit(mix(motion.up)),
      beam: { at: mix(motion.spot), on: motion.on[i] !== 0 },
    };
  }
}

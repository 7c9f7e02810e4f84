// @ts-check
/**
 * Values as colours.
 *
 * Promises colours of three whole numbers from 0 to 255. The ramp of heights is that of `layout.svg`, bit for bit:
 * evenly spaced in OKLCH lightness and hue, dark blue is low and light yellow high.
 */

/** @typedef {[number, number, number]} Colour */
/** @typedef {"height"|"defocus"|"incidence"|"dose"|"pen"|"pass"|"time"|"seam"|
 *   "correction"|"kept"} ColourBy */

/** @type {Colour[]} */
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

/** Below the focal plane blue, above it orange, near it grey. @type {Colour[]} */
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

/** Of pens, passes and kinds of seam: apart in lightness as well as in hue. @type {Colour[]} */
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

/** Kinds of seam, as the shader numbers them from 1. */
const SEAMS = ["between sections", "between levels", "between tilts", "between set-ups"];

/** @type {Colour} */
const SKIPPED = [224, 0, 0];
/** @type {Colour} */
const BEYOND = [134, 142, 150];
/** A value that is not known. @type {Colour} */
const SPARE = [120, 120, 120];

/** Texels of a ramp in the texture that the shader reads. */
const RAMP_TEXELS = 1024;

/**
 * The colour of a whole number within a range of whole numbers: the arithmetic of the printed layout.
 * @param {Colour[]} anchors @param {number} value @param {number} low @param {number} high
 * @returns {Colour}
 */
function ofWhole(anchors, value, low, high) {
  const span = high - low;
  const last = anchors.length - 1;
  if (span <= 0) return anchors[anchors.length >> 1];
  const along = Math.min(Math.max(value - low, 0), span) * last;
  const below = Math.min(Math.floor(along / span), last - 1);
  const part = along - below * span;
  const [a, b] = [anchors[below], anchors[below + 1]];
  /** @param {number} i */
  const mix = (i) => Math.floor((a[i] * (span - part) + b[i] * part + Math.floor(span / 2)) / span);
  return [mix(0), mix(1), mix(2)];
}

/**
 * The colour of a height in mm, taken to the nanometre.
 * @param {number} height @param {[number, number]} range @returns {Colour}
 */
function ofHeight(height, range) {
  const nm = (/** @type {number} */ mm) => Math.round(mm * 1e6);
  return ofWhole(RAMP, nm(height), nm(range[0]), nm(range[1]));
}

/** The colour of a value in a range, to one part of the texture's ramp.
 * @param {Colour[]} anchors @param {number} value @param {[number, number]} range @returns {Colour} */
function ofValue(anchors, value, range) {
  const span = range[1] - range[0];
  const share = span > 0 ? Math.min(Math.max((value - range[0]) / span, 0), 1) : 0.5;
  return ofWhole(anchors, Math.round(share * (RAMP_TEXELS - 1)), 0, RAMP_TEXELS - 1);
}

/** Defocus is drawn about the focal plane: the range that reaches as far below as above.
 * @param {[number, number]} range @returns {[number, number]} */
function aboutZero(range) {
  const reach = Math.max(Math.abs(range[0]), Math.abs(range[1]), 1e-6);
  return [-reach, reach];
}

/** The texture of ramps: RAMP, DIVERGING and SERIES, one row each. */
function rampTexels() {
  const texels = new Uint8Array(RAMP_TEXELS * 3 * 4).fill(255);
  for (let i = 0; i < RAMP_TEXELS; i++) {
    texels.set(ofWhole(RAMP, i, 0, RAMP_TEXELS - 1), 4 * i);
    texels.set(ofWhole(DIVERGING, i, 0, RAMP_TEXELS - 1), 4 * (RAMP_TEXELS + i));
    texels.set(SERIES[i % SERIES.length], 4 * (2 * RAMP_TEXELS + i));
  }
  return texels;
}

/**
 * The colour of a whole block; where marks differ within it, that of its mean (incidence, dose) or worst (defocus).
 * @param {ColourBy} by @param {Head} head @param {Blocks} blocks @param {number} i @returns {Colour}
 */
function ofBlock(by, head, blocks, i) {
  const ranges = head.ranges;
  switch (by) {
    case "height": {
      const height = blocks.focus?.[i];
      return height == null ? SPARE : ofHeight(height, ranges.height_mm);
    }
    case "defocus": {
      const [z, focus] = [blocks.z?.[i], blocks.focus?.[i]];
      if (!z || focus == null) return SPARE;
      const [low, high] = [(z[0] - focus) * 1000, (z[1] - focus) * 1000];
      return ofValue(DIVERGING, -low > high ? low : high, aboutZero(ranges.defocus_um));
    }
    case "incidence": {
      const incidence = blocks.incidence?.[i];
      return incidence ? ofValue(RAMP, incidence[0], ranges.incidence_deg) : SPARE;
    }
    case "dose": {
      const dose = blocks.dose?.[i];
      return dose ? ofValue(RAMP, dose[0], ranges.dose) : SPARE;
    }
    case "pen":
      return SERIES[(blocks.pens[i][0] ?? 0) % SERIES.length];
    case "pass":
      return SERIES[(blocks.pass[i] - 1) % SERIES.length];
    case "time":
      return ofValue(RAMP, blocks.start[i], [0, head.time_s]);
    case "seam":
    case "correction":
    case "kept":
      return BEYOND;
  }
}

/** @param {Colour} c */
function css(c) {
  return `rgb(${c[0]} ${c[1]} ${c[2]})`;
}

/** A gradient of anchors, for legends. @param {Colour[]} anchors */
function cssRamp(anchors) {
  return `linear-gradient(90deg, ${anchors.map(css).join(", ")})`;
}

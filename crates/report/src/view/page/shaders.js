// @ts-check
/**
 * The shaders. Lengths are in mm in the part frame until `uView`, which holds the turn of the table and the camera.
 *
 * A block is four texels of `uBlocks`: three rows of the matrix that takes local places into the part frame, then
 * section, level, tilt and set-up by number. Its colour is a texel of `uPalette`; alpha 0 hides it.
 */

/** Points of marks in one row of their texture. */
const POINTS_PER_ROW = 2048;

/** Blocks in one row of the textures. */
const BLOCKS_PER_ROW = 256;

/** How marks are coloured: from the palette, or by a value of their own. */
const MARK_MODES = { palette: 0, defocus: 1, incidence: 2, pen: 3, time: 4, seam: 5, plane: 6, measured: 7 };

const COMMON = `
uniform highp sampler2D uBlocks;
uniform highp sampler2D uPalette;
uniform highp usampler2D uLabels;
uniform vec3 uMap; // lowest corner, side of a cell
uniform ivec2 uMapCells;
uniform highp sampler2D uRamps;
uniform vec2 uRange;                // of the value that colours, in its unit
uniform highp sampler2D uMeasured;  // bytes of cells: 0 none, 1 least, 254 most, 255 less than is asked for
uniform vec4 uMeasuredMap;          // lowest corner, size
uniform int uMeasuredRamp;

vec3 ramp(float value, int row) {
  float span = uRange.y - uRange.x;
  float share = span > 0.0 ? clamp((value - uRange.x) / span, 0.0, 1.0) : 0.5;
  return texelFetch(uRamps, ivec2(floor(share * ${RAMP_TEXELS - 1}.0 + 0.5), row), 0).rgb;
}

// The colour of what was measured at a place; alpha 0 where there is nothing.
vec4 measuredColour(vec2 p) {
  vec2 place = (p - uMeasuredMap.xy) / uMeasuredMap.zw;
  float byte = 255.0 * texture(uMeasured, place).r;
  bool isIn = all(greaterThanEqual(place, vec2(0.0))) && all(lessThanEqual(place, vec2(1.0)));
  if (!isIn || byte < 0.5) return vec4(0.5, 0.5, 0.5, 0.0);
  if (byte > 254.5) return vec4(${SKIPPED.map((v) => (v / 255).toFixed(3)).join(", ")}, 1.0);
  return vec4(ramp((byte - 1.0) / 253.0, uMeasuredRamp), 1.0);
}

vec4 blockTexel(int block, int k) {
  return texelFetch(uBlocks, ivec2(4 * (block % ${BLOCKS_PER_ROW}) + k, block / ${BLOCKS_PER_ROW}), 0);
}

vec4 blockColour(int block) {
  return texelFetch(uPalette, ivec2(block % ${BLOCKS_PER_ROW}, block / ${BLOCKS_PER_ROW}), 0);
}

// 0 for none, else the block's index plus 1.
int labelAt(vec2 p) {
  ivec2 c = ivec2(floor((p - uMap.xy) / uMap.z));
  bool isIn = all(greaterThanEqual(c, ivec2(0))) && all(lessThan(c, uMapCells));
  return isIn ? int(texelFetch(uLabels, c, 0).r) : 0;
}

// 0 for none, else the kind of seam between two labels.
int seamBetween(int a, int b) {
  if (a == b || a == 0 || b == 0) return 0;
  vec4 p = blockTexel(a - 1, 3), q = blockTexel(b - 1, 3);
  return p.w != q.w ? 4 : p.z != q.z ? 3 : p.x == q.x && p.y != q.y ? 2 : 1;
}

// The kind of seam next to a place, looked for along two directions.
int seamNear(vec2 p, vec2 u, vec2 v) {
  int here = labelAt(p);
  int kind = max(seamBetween(here, labelAt(p + u)), seamBetween(here, labelAt(p - u)));
  return max(kind, max(seamBetween(here, labelAt(p + v)), seamBetween(here, labelAt(p - v))));
}

vec4 idColour(int id, float kind) {
  return vec4(float(id & 255), float((id >> 8) & 255), float((id >> 16) & 255), kind) / 255.0;
}
`;

const MESH_VERTEX = `
layout(location = 0) in vec3 aPlace;
layout(location = 1) in vec3 aNormal;
uniform mat4 uView;
uniform mat4 uProjection;
uniform vec3 uLow;
uniform vec3 uSize;
out vec3 vPart;
out vec3 vNormal;
out vec3 vLit;
void main() {
  vPart = uLow + aPlace * uSize;
  vNormal = aNormal;
  vLit = mat3(uView) * aNormal;
  gl_Position = uProjection * (uView * vec4(vPart, 1.0));
}`;

const MESH_FRAGMENT = `${COMMON}
in vec3 vPart;
in vec3 vNormal;
in vec3 vLit;
uniform vec3 uPart;    // colour of the part
uniform vec3 uInk;     // of borders
uniform vec3 uAccent;  // of the present block
uniform float uTint;   // how much of a block's colour is laid over the part
uniform float uPixels; // device pixels of a CSS pixel
uniform int uPresent;  // label, 0 for none
uniform float uBorders; // how dark borders are, 0 to 1
uniform bool uSeams;
uniform bool uPick;
uniform bool uAsTone;      // whether marks are drawn as tone
uniform bool uHasBlocks;   // whether there is a map of blocks
uniform bool uHasPens;     // whether cells of the tone have pens
uniform highp sampler2D uTone;  // density
uniform highp usampler2D uPens;
uniform vec3 uToneMap;     // lowest corner, side of a cell
uniform ivec2 uToneCells;
uniform float uDarkness;   // of a density of 1
uniform int uMode;
out vec4 colour;

// The colour that marks of a block have here.
vec3 markColour(int here) {
  if (uMode == ${MARK_MODES.plane}) return ramp(vPart.z, 0);
  if (uMode == ${MARK_MODES.measured}) return measuredColour(vPart.xy).rgb;
  if (uMode == ${MARK_MODES.pen} && uHasPens) {
    ivec2 cell = clamp(ivec2(floor((vPart.xy - uToneMap.xy) / uToneMap.z)), ivec2(0), uToneCells - 1);
    return texelFetch(uRamps, ivec2(int(texelFetch(uPens, cell, 0).r), 2), 0).rgb;
  }
  if (uMode == ${MARK_MODES.pen}) return texelFetch(uRamps, ivec2(0, 2), 0).rgb;
  if (here == 0) return uInk;
  if (uMode == ${MARK_MODES.defocus} || uMode == ${MARK_MODES.incidence}) {
    vec4 x = blockTexel(here - 1, 0), y = blockTexel(here - 1, 1), z = blockTexel(here - 1, 2);
    vec3 beam = vec3(x.z, y.z, z.z);
    if (uMode == ${MARK_MODES.defocus}) return ramp(1000.0 * dot(beam, vPart - vec3(x.w, y.w, z.w)), 1);
    return ramp(degrees(acos(clamp(dot(beam, normalize(vNormal)), -1.0, 1.0))), 0);
  }
  return blockColour(here - 1).rgb;
}

void main() {
  bool isUp = vNormal.z > 0.0;
  int here = isUp ? labelAt(vPart.xy) : 0;
  vec2 place = (vPart.xy - uToneMap.xy) / (uToneMap.z * vec2(uToneCells));
  float density = texture(uTone, place).r;
  if (uPick) {
    colour = idColour(here, 128.0);
    return;
  }
  vec3 n = normalize(vLit);
  if (n.z < 0.0) n = -n;
  float light = 0.5 + 0.42 * max(dot(n, normalize(vec3(-0.35, 0.55, 0.75))), 0.0) + 0.12 * n.z;
  vec3 c = uPart;
  vec2 dx = dFdx(vPart.xy) * uPixels, dy = dFdy(vPart.xy) * uPixels;
  if (here > 0) {
    vec4 block = blockColour(here - 1);
    c = mix(c, block.rgb, uTint * block.a);
    light = mix(light, 0.72 + 0.34 * (light - 0.2), uTint * block.a);
  }
  if (uMode == ${MARK_MODES.measured} && isUp) {
    vec4 measured = measuredColour(vPart.xy);
    c = mix(c, measured.rgb, measured.a);
    light = mix(light, 0.72 + 0.34 * (light - 0.2), measured.a);
  }
  c *= light;
  bool isShown = here > 0 ? blockColour(here - 1).a > 0.0 : !uHasBlocks;
  bool isOnMap = all(greaterThanEqual(place, vec2(0.0))) && all(lessThanEqual(place, vec2(1.0)));
  if (uAsTone && isUp && isShown && isOnMap) c = mix(c, markColour(here), 1.0 - exp(-uDarkness * density));
  // Whether a border passes within half a pixel, and that of the present block within a pixel and a half.
  bool isNear = isUp && (here > 0 || all(greaterThan(vPart.xy, uMap.xy)));
  if (isNear && (uBorders > 0.0 || uPresent > 0)) {
    bool isBorder = false, isEdge = false;
    for (int k = 0; k < 4; k++) {
      vec2 d = (k < 2 ? dx : dy) * ((k & 1) == 0 ? 1.0 : -1.0);
      isBorder = isBorder || labelAt(vPart.xy + d * 0.5) != here;
      isEdge = isEdge || (labelAt(vPart.xy + d * 1.5) == uPresent) != (here == uPresent);
    }
    if (isBorder) c = mix(c, uInk, 0.4 * uBorders);
    if (isEdge && uPresent > 0) c = uAccent;
  }
  if (here > 0 && uSeams) {
    int kind = seamNear(vPart.xy, dx * 0.9, dy * 0.9);
    if (kind > 0) c = texelFetch(uRamps, ivec2(kind - 1, 2), 0).rgb;
  }
  colour = vec4(c, 1.0);
}`;

const MARK_VERTEX = `${COMMON}
uniform highp usampler2D uPoints; // a texel for each point, as Chunk has them
uniform int uFrom;       // first point
uniform int uEvery;      // 1 for each line, k for every k-th
uniform bool uThin;      // lines of one device pixel: two vertices for each, else six
uniform mat4 uView;
uniform mat4 uProjection;
uniform vec2 uViewport;  // device pixels
uniform float uWidth;    // of a line, device pixels
uniform float uDot;      // diameter of a dot, device pixels
uniform float uBias;     // towards the eye, mm
uniform vec2 uStep;      // mm of a step of x and y, of z
uniform vec2 uValueStep; // um, deg
uniform int uFirst;      // block from which those of the chunk count
uniform int uNow;        // clock up to which marks are drawn
uniform bool uAsDot;
out float vDefocus;
out float vIncidence;
out float vAfter;        // clock later than now, steps
out float vTime;         // 0 to 1
out vec2 vPart;
out float vHeight;       // of the focal plane at that moment
out vec2 vAside;         // from the middle of a line, or of a dot, device pixels
flat out int vIsDot;
flat out int vPen;
flat out int vBlock;

uvec4 pointAt(int i) {
  return texelFetch(uPoints, ivec2(i % ${POINTS_PER_ROW}, i / ${POINTS_PER_ROW}), 0);
}

int signedLow(uint v) {
  return int(v << 16) >> 16;
}

vec3 placeInPart(uvec4 p, int block) {
  vec2 xy = vec2(float(signedLow(p.x)), float(int(p.x) >> 16)) * uStep.x;
  vec4 local = vec4(xy, float(signedLow(p.y)) * uStep.y, 1.0);
  return vec3(dot(blockTexel(block, 0), local), dot(blockTexel(block, 1), local), dot(blockTexel(block, 2), local));
}

vec4 projected(vec3 p) {
  vec4 e = uView * vec4(p, 1.0);
  vec4 c = uProjection * e;
  vec4 nearer = uProjection * vec4(e.xyz + vec3(0.0, 0.0, uBias), 1.0);
  c.z = nearer.z / nearer.w * c.w;
  return c;
}

void main() {
  int corners = uThin ? 2 : 6;
  int i = uFrom + gl_VertexID / corners * uEvery;
  int k = gl_VertexID % corners;
  // Corners of two triangles, by number: 0 and 1 at the first point, 2 and 3 at the second.
  int corner = uThin ? 2 * k : k == 3 ? 2 : k == 4 ? 1 : k == 5 ? 3 : k;
  uvec4 a = pointAt(i);
  int block = uFirst + int(a.y >> 16);
  bool isDot = (a.w & 2u) != 0u || uAsDot;
  bool isLast = (a.w & 1u) != 0u;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  vBlock = block;
  vPen = int(a.z >> 24);
  vIsDot = isDot ? 1 : 0;
  vAside = vec2(0.0);
  if ((isLast && !isDot) || blockColour(block).a == 0.0) return;

  uvec4 b = isDot ? a : pointAt(i + 1);
  uvec4 here = corner < 2 ? a : b;
  vDefocus = float(signedLow(here.z)) * uValueStep.x;
  vIncidence = float((here.z >> 16) & 255u) * uValueStep.y;
  vAfter = float(int(here.w >> 2) - uNow);
  vTime = float(here.w >> 2) / ${CLOCK_STEPS}.0;
  vec3 part = placeInPart(here, block);
  vPart = part.xy;
  vHeight = part.z - vDefocus / 1000.0;
  gl_Position = projected(part);
  if (uThin && !isDot) return;

  vec4 other = projected(placeInPart(corner < 2 ? b : a, block));
  if (gl_Position.w <= 0.0 || other.w <= 0.0) return;
  vec2 along = (other.xy / other.w - gl_Position.xy / gl_Position.w) * uViewport * (corner < 2 ? 1.0 : -1.0);
  along = isDot || length(along) < 1e-6 ? vec2(1.0, 0.0) : normalize(along);
  float side = (corner & 1) == 0 ? -1.0 : 1.0;
  // Half a pixel more on each side, in which it fades away.
  float reach = (isDot ? uDot : uWidth) * 0.5 + 0.5;
  vAside = vec2(isDot ? (corner < 2 ? -reach : reach) : 0.0, side * reach);
  vec2 offset = vec2(-along.y, along.x) * vAside.y + along * vAside.x;
  gl_Position.xy += 2.0 * offset / uViewport * gl_Position.w;
}`;

const MARK_FRAGMENT = `${COMMON}
in float vDefocus;
in float vIncidence;
in float vAfter;
in float vTime;
in vec2 vPart;
in float vHeight;
in vec2 vAside;
flat in int vIsDot;
flat in int vPen;
flat in int vBlock;
uniform int uMode;
uniform vec2 uShownDefocus;   // um
uniform vec2 uShownIncidence; // deg
uniform vec4 uShownHalf;      // 1 where the upper limit of defocus, incidence is open; 1 where defocus has no sign
uniform int uShownPen;        // -1 for all
uniform int uPresentBlock;    // -1 for none
uniform vec3 uAccent;
uniform float uSeamReach;     // mm
uniform vec2 uOpacity;        // of lines, of dots
uniform vec2 uSize;           // width of lines, diameter of dots, device pixels
uniform bool uPick;
out vec4 colour;

void main() {
  float covered = clamp(0.5 + 0.5 * (vIsDot == 1 ? uSize.y : uSize.x) - length(vAside), 0.0, 1.0);
  if (covered == 0.0 || (uPick && covered < 0.5)) discard;
  float defocus = uShownHalf.z > 0.0 ? abs(vDefocus) : vDefocus;
  if (vAfter > 0.0 || defocus < uShownDefocus.x || vIncidence < uShownIncidence.x) discard;
  if (defocus > uShownDefocus.y || (defocus == uShownDefocus.y && uShownHalf.x == 0.0)) discard;
  if (vIncidence > uShownIncidence.y || (vIncidence == uShownIncidence.y && uShownHalf.y == 0.0)) discard;
  if (uShownPen >= 0 && vPen != uShownPen) discard;
  if (uPick) {
    colour = idColour(vBlock + 1, 255.0);
    return;
  }
  vec3 c = blockColour(vBlock).rgb;
  if (uMode == ${MARK_MODES.defocus}) c = ramp(vDefocus, 1);
  if (uMode == ${MARK_MODES.incidence}) c = ramp(vIncidence, 0);
  if (uMode == ${MARK_MODES.pen}) c = texelFetch(uRamps, ivec2(vPen, 2), 0).rgb;
  if (uMode == ${MARK_MODES.time}) c = ramp(vTime, 0);
  if (uMode == ${MARK_MODES.plane}) c = ramp(vHeight, 0);
  if (uMode == ${MARK_MODES.measured}) c = measuredColour(vPart).rgb;
  if (uMode == ${MARK_MODES.seam}) {
    int kind = seamNear(vPart, vec2(uSeamReach, 0.0), vec2(0.0, uSeamReach));
    if (kind > 0) c = texelFetch(uRamps, ivec2(kind - 1, 2), 0).rgb;
  }
  colour = vec4(c, covered * (vIsDot == 1 ? uOpacity.y : uOpacity.x));
}`;

const SKIPPED_VERTEX = `
layout(location = 0) in vec3 aPlace;
layout(location = 1) in uint aFlags;
layout(location = 2) in vec3 bPlace;
uniform mat4 uView;
uniform mat4 uProjection;
uniform vec2 uViewport;
uniform float uWidth;
uniform float uBias;
flat out int vIsBeyond;
vec4 projected(vec3 p) {
  vec4 e = uView * vec4(p, 1.0);
  vec4 c = uProjection * e;
  vec4 nearer = uProjection * vec4(e.xyz + vec3(0.0, 0.0, uBias), 1.0);
  c.z = nearer.z / nearer.w * c.w;
  return c;
}
void main() {
  bool isDot = (aFlags & 2u) != 0u;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  vIsBeyond = int((aFlags >> 2) & 1u);
  if ((aFlags & 1u) != 0u && !isDot) return;
  vec4 a = projected(aPlace), b = projected(isDot ? aPlace : bPlace);
  if (a.w <= 0.0 || b.w <= 0.0) return;
  vec2 along = (b.xy / b.w - a.xy / a.w) * uViewport;
  along = isDot || length(along) < 1e-6 ? vec2(1.0, 0.0) : normalize(along);
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  vec2 offset = vec2(-along.y, along.x) * side * uWidth;
  if (isDot) offset += along * uWidth * (gl_VertexID < 2 ? -1.0 : 1.0);
  gl_Position = gl_VertexID < 2 ? a : b;
  gl_Position.xy += offset / uViewport * gl_Position.w;
}`;

const FIXTURE_VERTEX = `
layout(location = 0) in vec3 aPlace;
layout(location = 1) in vec3 aNormal;
uniform mat4 uView;
uniform mat4 uProjection;
out float vLight;
void main() {
  vLight = abs((mat3(uView) * aNormal).z);
  gl_Position = uProjection * (uView * vec4(aPlace, 1.0));
}`;

const FIXTURE_FRAGMENT = `
in float vLight;
uniform vec3 uGrey;
out vec4 colour;
void main() {
  colour = vec4(uGrey * (0.55 + 0.45 * vLight), 1.0);
}`;

const SKIPPED_FRAGMENT = `
flat in int vIsBeyond;
uniform vec3 uRed;
uniform vec3 uGrey;
out vec4 colour;
void main() {
  colour = vec4(vIsBeyond == 1 ? uGrey : uRed, 1.0);
}`;

// Makes job folders of a mathematical part, each with a view.html and what view.mjs compares of a manifest.json:
// node sample.mjs FOLDER [demo|tilt|passes|fly|large ...]
// The data is written as crates/report/src/view writes it, by other code, so the page can be developed and measured alone.
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { deflateRawSync } from "node:zlib";

const page = join(dirname(fileURLToPath(import.meta.url)), "../../crates/report/src/view/page");

// --- the binary forms of the data elements

class Writer {
  parts = [];
  u32(v) {
    this.parts.push(Buffer.from(Uint32Array.of(v).buffer));
  }
  u8s(values) {
    this.parts.push(Buffer.from(values));
  }
  planes(values, bytes) {
    for (let k = 0; k < bytes; k++) this.parts.push(Buffer.from(values.map((v) => (v >>> (8 * k)) & 255)));
  }
  deltas(values, bytes) {
    this.planes(
      values.map((v, i) => (i ? v - values[i - 1] : v) >>> 0),
      bytes,
    );
  }
  f32s(values) {
    this.parts.push(Buffer.from(Float32Array.from(values).buffer));
  }
  get bytes() {
    return Buffer.concat(this.parts);
  }
}

const dataElement = (name, bytes) =>
  `<script id="data-${name}" type="application/octet-stream">${deflateRawSync(bytes).toString("base64")}</script>\n`;

// --- a part: a height and a slope for each place

const SIZE = [160, 100];
const height = (x, y) =>
  7 * Math.sin(x / 24) * Math.cos(y / 19) + 0.02 * x + 3 * Math.exp(-((x - 110) ** 2 + (y - 60) ** 2) / 90);
const normal = (x, y) => {
  const e = 1e-4;
  const n = [-(height(x + e, y) - height(x - e, y)) / (2 * e), -(height(x, y + e) - height(x, y - e)) / (2 * e), 1];
  const size = Math.hypot(...n);
  return n.map((v) => v / size);
};
const deg = 180 / Math.PI;

const KINDS = {
  demo: { cell: 12, level: 0.8, pitch: 1, step: 0.4, passes: 1, setups: 1 },
  tilt: { cell: 14, level: 0.8, pitch: 1, step: 0.4, passes: 1, setups: 1, tilts: true },
  passes: { cell: 12, level: 1.2, pitch: 2, step: 0.5, passes: 3, setups: 2 },
  fly: { cell: 12, level: 0.8, pitch: 1.5, step: 0.4, passes: 1, setups: 1, fly: true },
  large: { cell: 4, level: 0.5, pitch: 0.08, step: 0.1, passes: 1, setups: 1 },
};

const PENS = [
  { name: "engrave", speed_mm_s: 800, power: "60 %", frequency_khz: 40, passes: 1, dwell_us: null },
  { name: "outline", speed_mm_s: 400, power: "80 %", frequency_khz: 40, passes: 2, dwell_us: 500 },
];
const SCANNER = { jump_speed_mm_s: 4000, jump_delay_us: 200, mark_delay_us: 150, polygon_delay_us: 0 };
const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];
const apply = (m, p) => [0, 1, 2].map((r) => m[3 * r] * p[0] + m[3 * r + 1] * p[1] + m[3 * r + 2] * p[2] + m[9 + r]);
const inverse = (m) => {
  const t = [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
  return [...t, ...[0, 1, 2].map((r) => -(t[3 * r] * m[9] + t[3 * r + 1] * m[10] + t[3 * r + 2] * m[11]))];
};

// A tilt about y, with the pivot held.
const PIVOT = [80, 50, -60];
function turnBy(a) {
  const [c, s] = [Math.cos(a), Math.sin(a)];
  const r = [c, 0, s, 0, 1, 0, -s, 0, c];
  const q = [0, 1, 2].map((k) => r[3 * k] * PIVOT[0] + r[3 * k + 1] * PIVOT[1] + r[3 * k + 2] * PIVOT[2]);
  return [...r, PIVOT[0] - q[0], PIVOT[1] - q[1], PIVOT[2] - q[2]];
}

function makeBlocks(kind) {
  const blocks = new Map();
  for (let pass = 1; pass <= kind.passes; pass++) {
    const shift = (pass - 1) * 4;
    let line = 0;
    for (let y = 2; y <= SIZE[1] - 2; y += kind.pitch, line++) {
      let open = null;
      for (let x = 2; x <= SIZE[0] - 2; x += kind.step) {
        const yy = y + 0.35 * Math.sin(x / 1.7) * Math.min(kind.pitch, 1);
        const section = [Math.floor((x + shift) / kind.cell), Math.floor((yy + shift) / kind.cell)];
        const tilt = kind.tilts ? Math.round(Math.atan(normal((section[0] + 0.5) * kind.cell, 50)[0]) * 6) / -6 : 0;
        const turn = tilt ? turnBy(tilt * -1) : null;
        const p = [x, yy, height(x, yy)];
        const q = turn ? apply(turn, p) : p;
        const level = Math.floor(q[2] / kind.level);
        const setup = kind.setups > 1 && section[0] * kind.cell - shift >= SIZE[0] / 2 ? 2 : 1;
        const key = [pass, setup, section[0], section[1], level].join();
        if (!blocks.has(key)) blocks.set(key, { pass, setup, section, level, tilt, turn, marks: [] });
        if (open && open.key !== key) {
          // Both blocks reach the cut, each as its own tilt has it.
          const { turn: other } = blocks.get(open.key);
          open.mark.points.push({ p, q: other ? apply(other, p) : p });
        }
        if (!open || open.key !== key) {
          open = { key, mark: { pen: line % 7 === 3 ? 1 : 0, points: [{ p, q }] } };
          blocks.get(key).marks.push(open.mark);
        } else open.mark.points.push({ p, q });
      }
    }
  }
  const order = (b) => [b.pass, b.setup, b.section[1], b.section[1] % 2 ? -b.section[0] : b.section[0], b.level];
  const list = [...blocks.values()].sort((a, b) => {
    const [u, v] = [order(a), order(b)];
    const k = u.findIndex((w, i) => w !== v[i]);
    return k < 0 ? 0 : u[k] - v[k];
  });
  return list;
}

const length = (points) =>
  points.slice(1).reduce((s, b, i) => s + Math.hypot(...b.p.map((v, k) => v - points[i].p[k])), 0);

function makeRuns(kind) {
  const all = makeBlocks({ ...kind, cell: 1e6, level: 1e6 }).flatMap((b) => b.marks);
  const runs = [];
  for (let i = 0; i < all.length; i += 6)
    runs.push({ pass: 1, setup: 1, section: null, level: null, tilt: 0, turn: null, marks: all.slice(i, i + 6) });
  return runs;
}

function writeJob(folder, name) {
  const kind = KINDS[name];
  const list = kind.fly ? makeRuns(kind) : makeBlocks(kind);
  const columns = Object.fromEntries(
    (
      "id pass setup section level centre focus tilt turn frame origin name_at stage lift shift z begin start end strokes " +
      "mark_mm jump_mm incidence stretch dose pens files"
    )
      .split(" ")
      .map((k) => [k, []]),
  );
  const round = (v, n = 6) => Number(v.toFixed(n));
  let t = 0;
  let before = null;
  const manifestBlocks = [];
  const motion = [];
  list.forEach((b, i) => {
    const points = b.marks.flatMap((m) => m.points);
    const zs = points.map((a) => a.q[2]);
    const [lo, hi] = [zs.reduce((a, c) => Math.min(a, c)), zs.reduce((a, c) => Math.max(a, c))];
    const xs = points.map((a) => a.q[0]),
      ys = points.map((a) => a.q[1]);
    const mid = (v) => round((v.reduce((a, c) => Math.min(a, c)) + v.reduce((a, c) => Math.max(a, c))) / 2, 3);
    const centre = [mid(xs), mid(ys)];
    const focus = round(kind.fly ? mid(zs) : (b.level + 0.5) * kind.level, 6);
    const mark = b.marks.reduce((s, m) => s + length(m.points), 0);
    const angles = points.map((a) => {
      const n = normal(a.p[0], a.p[1]);
      const v = b.turn ? apply([...b.turn.slice(0, 9), 0, 0, 0], n) : n;
      return Math.acos(Math.min(v[2], 1)) * deg;
    });
    angles.forEach((a, k) => (points[k].incidence = a));
    const mean = angles.reduce((a, c) => a + c) / angles.length;
    const worst = angles.reduce((a, c) => Math.max(a, c));
    const move = before ? 0.05 + Math.hypot(centre[0] - before[0], centre[1] - before[1]) / 100 : 0.2;
    const work = b.marks.reduce(
      (s, m) => s + (length(m.points) / PENS[m.pen].speed_mm_s) * PENS[m.pen].passes + 0.002,
      0,
    );
    const [begin, start, end] = kind.fly ? [t, t, t + work] : [t, t + move, t + move + work];
    t = end;
    before = centre;
    const inv = b.turn ? inverse(b.turn) : null;
    const local = [centre[0], centre[1], focus];
    const id = kind.fly ? String(i + 1) : `B${String(i + 1).padStart(4, "0")}`;
    const origin = inv ? apply(inv, local) : local;
    const row = {
      id,
      pass: b.pass,
      setup: b.setup,
      section: b.section,
      level: b.level,
      centre: kind.fly ? null : centre,
      focus: kind.fly ? null : focus,
      tilt: kind.fly ? null : [0, round(b.tilt * -deg, 3)],
      turn: b.turn,
      frame: inv ? [...inv.slice(0, 9), ...origin] : null,
      origin,
      name_at: points[Math.floor(points.length / 2)].p,
      stage: kind.fly ? null : [-centre[0], -centre[1], round(100 - focus)],
      lift: null,
      shift: 0,
      z: [round(lo), round(hi)],
      begin: round(begin),
      start: round(start),
      end: round(end),
      strokes: b.marks.length,
      mark_mm: round(mark, 3),
      jump_mm: round(mark / 3, 3),
      incidence: [round(mean, 2), round(worst, 2)],
      stretch: [round(1 / Math.cos(mean / deg), 4), round(1 / Math.cos(worst / deg), 4)],
      dose: [round(Math.cos(mean / deg), 4), round(Math.cos(worst / deg), 4)],
      pens: [...new Set(b.marks.map((m) => m.pen))].sort(),
      files: kind.fly ? null : { dxf: `blocks/${id}.dxf` },
    };
    for (const key of Object.keys(columns)) columns[key].push(row[key]);
    b.row = row;
    manifestBlocks.push({
      id,
      pass: row.pass,
      setup: row.setup,
      section: row.section,
      level: row.level,
      centre_mm: centre,
      lpfl_mm: focus,
      stage: row.stage,
      tilt_deg: row.tilt,
      z_lo_mm: row.z[0],
      z_hi_mm: row.z[1],
      pens: row.pens.map((p) => PENS[p].name),
      files: row.files,
      strokes: row.strokes,
      mark_mm: row.mark_mm,
      jump_mm: row.jump_mm,
      time_s: round(end - start),
      incidence_deg: row.incidence,
      stretch: row.stretch,
      dose: row.dose,
    });
  });
  const time = t;
  let data = "";

  // Marks: chunks of whole blocks.
  const chunks = [];
  const [xy_mm, z_mm] = [0.001, 0.0005];
  const defocusStep = kind.fly ? 1 : 0.5;
  const [all, weights] = [[], []];
  for (let first = 0; first < list.length; ) {
    let [last, count] = [first, 0];
    while (last < list.length && count < 40000) count += list[last++].marks.reduce((s, m) => s + m.points.length, 0);
    const w = new Writer();
    const columnsOf = { block: [], pen: [], len: [], x: [], y: [], z: [], incidence: [], defocus: [], time: [] };
    const box = [
      [1e9, 1e9, 1e9],
      [-1e9, -1e9, -1e9],
    ];
    for (let b = first; b < last; b++) {
      const { row, marks } = list[b];
      let clock = row.begin;
      const rate = (row.end - row.begin) / marks.reduce((s, m) => s + m.points.length, 0);
      for (const m of marks) {
        columnsOf.block.push(b - first);
        columnsOf.pen.push(m.pen);
        columnsOf.len.push(m.points.length);
        for (const [i, { p, q, incidence }] of m.points.entries()) {
          const o = row.frame || !kind.fly ? [...(row.centre ?? row.origin), row.focus ?? row.origin[2]] : row.origin;
          const at = row.turn ? q : p;
          const fit = (v, s) => Math.max(-32768, Math.min(32767, Math.round(v / s)));
          columnsOf.x.push(fit(at[0] - o[0], kind.fly ? 0.005 : xy_mm));
          columnsOf.y.push(fit(at[1] - o[1], kind.fly ? 0.005 : xy_mm));
          columnsOf.z.push(fit(at[2] - o[2], kind.fly ? 0.005 : z_mm));
          columnsOf.incidence.push(Math.min(Math.round(incidence / 0.25), 255));
          const defocus = kind.fly ? 250 * Math.sin(p[0] / 5) : (at[2] - o[2]) * 1000;
          columnsOf.defocus.push(Math.round(defocus / defocusStep));
          columnsOf.time.push(Math.round(clock * 1e6));
          if (kind.fly && columnsOf.time.length % 3 === 0)
            motion.push({
              t: clock,
              centre: [p[0] * 0.9 + 8, p[1] * 0.9 + 5, p[2] * 0.5],
              up: [0, 0, 1],
              spot: p,
              on: i < m.points.length - 1,
            });
          clock += rate;
          for (let k = 0; k < 3; k++) {
            box[0][k] = Math.min(box[0][k], p[k]);
            box[1][k] = Math.max(box[1][k], p[k]);
          }
          all.push([defocus, incidence]);
        }
      }
    }
    const c = columnsOf;
    w.u32(c.block.length);
    w.u32(c.x.length);
    w.planes(c.block, 2);
    w.u8s(c.pen);
    w.planes(c.len, 2);
    for (const axis of ["x", "y", "z"]) w.deltas(c[axis], 2);
    w.u8s(c.incidence);
    if (kind.fly) {
      w.deltas(c.defocus, 2);
      w.deltas(c.time, 4);
    }
    const chunk = `marks-${chunks.length}`;
    data += dataElement(chunk, w.bytes);
    chunks.push({
      name: chunk,
      first,
      last,
      marks: c.block.length,
      points: c.x.length,
      box,
      xy_mm: kind.fly ? 0.005 : xy_mm,
      z_mm: kind.fly ? 0.005 : z_mm,
    });
    first = last;
  }

  // The part.
  const [nx, ny] = [161, 101];
  const vertices = [];
  for (let j = 0; j < ny; j++)
    for (let i = 0; i < nx; i++) {
      const [x, y] = [(i / (nx - 1)) * SIZE[0], (j / (ny - 1)) * SIZE[1]];
      vertices.push({ p: [x, y, height(x, y)], n: normal(x, y) });
    }
  const partBox = [0, 1].map((e) =>
    [0, 1, 2].map((k) => vertices.reduce((a, v) => (e ? Math.max(a, v.p[k]) : Math.min(a, v.p[k])), e ? -1e9 : 1e9)),
  );
  const corners = [];
  for (let j = 0; j + 1 < ny; j++)
    for (let i = 0; i + 1 < nx; i++) {
      const a = j * nx + i;
      corners.push(a, a + 1, a + nx + 1, a, a + nx + 1, a + nx);
    }
  const mesh = new Writer();
  mesh.u32(vertices.length);
  mesh.u32(corners.length / 3);
  for (let k = 0; k < 3; k++)
    mesh.deltas(
      vertices.map((v) => Math.round(((v.p[k] - partBox[0][k]) / (partBox[1][k] - partBox[0][k])) * 65535)),
      2,
    );
  for (let k = 0; k < 3; k++) mesh.u8s(vertices.map((v) => Math.round(v.n[k] * 127) & 255));
  mesh.deltas(corners, 4);
  data += dataElement("mesh", mesh.bytes);

  // Maps of the blocks.
  const cell = 0.25;
  const [mc, mr] = SIZE.map((s) => Math.ceil(s / cell));
  const maps = [];
  for (let pass = 1; !kind.fly && pass <= kind.passes; pass++) {
    const labels = new Uint32Array(mc * mr);
    list.forEach((b, index) => {
      if (b.pass !== pass) return;
      for (const m of b.marks)
        for (const { p } of m.points.slice(0, -1)) {
          const half = Math.ceil(kind.pitch / cell / 2);
          const [c, r] = [Math.floor(p[0] / cell), Math.floor(p[1] / cell)];
          for (let d = -half; d <= half; d++)
            for (const e of [0, 1])
              if (r + d >= 0 && r + d < mr && c + e < mc) labels[(r + d) * mc + c + e] = index + 1;
        }
    });
    const w = new Writer();
    w.planes(labels, 4);
    const map = `map-${maps.length}`;
    data += dataElement(map, w.bytes);
    maps.push({ name: map, pass, origin: [0, 0], cell, columns: mc, rows: mr });
  }

  // How dense the marks lie.
  const tones = { maps: [], most_per_mm: 0, dense_per_mm: [] };
  const toneCell = 0.5;
  const [tc, tr] = SIZE.map((s) => Math.ceil(s / toneCell));
  for (let pass = 1; pass <= kind.passes; pass++) {
    const lengths = new Float64Array(tc * tr);
    const pens = new Uint8Array(tc * tr);
    for (const m of list.filter((b) => b.pass === pass).flatMap((b) => b.marks))
      m.points.slice(1).forEach(({ p: b }, i) => {
        const a = m.points[i].p;
        const at = Math.floor((a[1] + b[1]) / 2 / toneCell) * tc + Math.floor((a[0] + b[0]) / 2 / toneCell);
        lengths[at] += Math.hypot(b[0] - a[0], b[1] - a[1]);
        pens[at] = m.pen;
      });
    const densities = [...lengths].map((v) => v / toneCell ** 2);
    const marked = densities.filter((v) => v > 0).sort((a, b) => a - b);
    if (pass === 1) {
      tones.dense_per_mm = [marked[Math.floor(0.98 * marked.length)], 1 / kind.pitch];
      tones.most_per_mm = 2 * tones.dense_per_mm[0];
    }
    const w = new Writer();
    w.u8s(densities.map((v) => (v > 0 ? Math.min(Math.max(Math.round((255 * v) / tones.most_per_mm), 1), 255) : 0)));
    w.u8s(pens);
    data += dataElement(`tone-${pass}`, w.bytes);
    tones.maps.push({
      name: `tone-${pass}`,
      pass,
      origin: [0, 0],
      cell: toneCell,
      columns: tc,
      rows: tr,
      has_pens: true,
    });
  }

  // Texture beside the part and over a steep place.
  const skippedLines = [];
  for (let k = 0; k < 12; k++)
    skippedLines.push({
      row: 0,
      points: [
        [SIZE[0] - 2, 5 + 7 * k, height(158, 5 + 7 * k)],
        [SIZE[0] + 4, 5 + 7 * k, height(158, 5 + 7 * k)],
      ],
    });
  for (let k = 0; k < 20; k++)
    skippedLines.push({
      row: 1,
      points: [0, 1, 2, 3].map((s) => [20 + k * 0.6, 30 + s, height(20 + k * 0.6, 30 + s)]),
    });
  for (let k = 0; k < 8; k++)
    skippedLines.push({
      row: 2,
      points: [
        [-3, 10 + 10 * k, height(0, 10 + 10 * k)],
        [2, 10 + 10 * k, height(2, 10 + 10 * k)],
      ],
    });
  const flat = skippedLines.flatMap((l) => l.points);
  const skipped = new Writer();
  skipped.u8s(skippedLines.map((l) => l.row));
  skipped.planes(
    skippedLines.map((l) => l.points.length),
    2,
  );
  for (let k = 0; k < 3; k++) skipped.f32s(flat.map((p) => p[k]));
  data += dataElement("skipped", skipped.bytes);

  if (kind.fly) {
    const w = new Writer();
    w.f32s(motion.map((m) => m.t));
    for (const part of ["centre", "up", "spot"]) for (let k = 0; k < 3; k++) w.f32s(motion.map((m) => m[part][k]));
    w.u8s(motion.map((m) => Number(m.on)));
    data += dataElement("motion", w.bytes);
  }
  // What runs on the fly do not have.
  if (kind.fly)
    for (const key of [
      "section",
      "level",
      "stage",
      "lift",
      "files",
      "turn",
      "frame",
      "shift",
      "tilt",
      "stretch",
      "dose",
      "jump_mm",
    ])
      columns[key].fill(null);
  data += dataElement("blocks", Buffer.from(JSON.stringify(columns)));

  const range = (values) => [
    values.reduce((a, c) => Math.min(a, c), Infinity),
    values.reduce((a, c) => Math.max(a, c), -Infinity),
  ];
  const histogram = (values, low, high, n) => {
    const length_mm = new Array(n).fill(0);
    for (const v of values)
      length_mm[Math.max(0, Math.min(n - 1, Math.floor(((v - low) / (high - low)) * n)))] += kind.step;
    return {
      edges: Array.from({ length: n + 1 }, (_, k) => round(low + ((high - low) * k) / n)),
      length_mm,
      of_dots: false,
    };
  };
  const marks = chunks.reduce((s, c) => s + c.marks, 0);
  const mark_mm = round(
    columns.mark_mm.reduce((a, c) => a + c, 0),
    3,
  );
  const [d, inc] = [range(all.map((a) => a[0])), range(all.map((a) => a[1]))];
  const head = {
    schema: 1,
    job: `${name}.toml`,
    machine: "xyz-galvo-40",
    mode: kind.fly ? "on-the-fly" : "stepped",
    terrace: "0.1.0",
    time_s: time,
    box: [
      [-3, 0, partBox[0][2]],
      [SIZE[0] + 4, SIZE[1], partBox[1][2]],
    ],
    part: { triangles: corners.length / 3, of: 64000, within_mm: 0.02, vertices: vertices.length, box: partBox },
    field: { size: [kind.cell + 4, kind.cell + 4], shape: "rectangle" },
    lens: { working_distance_mm: 60, diameter_mm: 30 },
    pivot: kind.tilts ? PIVOT : null,
    travel: Array.from({ length: kind.setups }, (_, k) => [
      [k * 70 - 10, -10, -20],
      [kind.setups > 1 ? k * 70 + 100 : 170, 110, 40],
    ]),
    pens: PENS,
    scanner: SCANNER,
    passes: kind.passes,
    setups: kind.setups,
    maps,
    tones,
    spot_mm: 0.04,
    half_depth_mm: kind.level / 2,
    blocks: { name: "blocks", count: list.length },
    chunks,
    incidence_deg_per_step: 0.25,
    defocus_um_per_step: defocusStep,
    skipped: [
      { reason: "off-part", texture: 1, length_mm: 72, share_percent: 0.5, dots: 0, box: [158, 5, 164, 82] },
      { reason: "steep", texture: 1, length_mm: 60, share_percent: 0.4, dots: 0, box: [20, 30, 32, 33] },
      { reason: "beyond", texture: 1, length_mm: 40, share_percent: 0.2, dots: 0, box: [-3, 10, 2, 80] },
    ],
    skipped_lines: { name: "skipped", lines: skippedLines.length, points: flat.length },
    motion: kind.fly ? { name: "motion", samples: motion.length } : null,
    ranges: {
      height_mm: kind.fly ? [partBox[0][2], partBox[1][2]] : range(columns.focus),
      defocus_um: d,
      incidence_deg: inc,
      dose: kind.fly ? [1, 1] : range(columns.dose.map((v) => v[0])),
    },
    histograms: {
      defocus_um: histogram(
        all.map((a) => a[0]),
        ...d,
        24,
      ),
      incidence_deg: histogram(
        all.map((a) => a[1]),
        0,
        inc[1],
        24,
      ),
    },
    thinned: { within_um: 2, points_left_out: 1234 },
    marks,
    mark_mm,
    warnings: [{ code: "off-part", message: "72 mm of the texture lie beside the part and are not marked." }],
    figures: [
      ["stops", String(list.length)],
      ["marks", `${(mark_mm / 1000).toFixed(1)} m`],
      ["time", `${time.toFixed(1)} s`],
      ["worst defocus", `${range(d.map(Math.abs))[1].toFixed(0)} um`],
    ],
  };
  const text = (file) => readFileSync(join(page, file), "utf8");
  const scripts = JSON.parse(text("tsconfig.json")).files.map(text).join("\n");
  const fills = {
    title: `${name}.toml`,
    css: text("page.css"),
    head: JSON.stringify(head).replaceAll("<", "\\u003c"),
    data,
    js: `(() => {\n"use strict";\n${scripts}\n})();`,
  };
  mkdirSync(join(folder, `sample-${name}`), { recursive: true });
  writeFileSync(
    join(folder, `sample-${name}`, "view.html"),
    text("page.html").replaceAll(/\{\{(\w+)\}\}/g, (_, key) => fills[key]),
  );
  const summary = { time_s: kind.fly ? time : { total: time }, mark_mm };
  writeFileSync(
    join(folder, `sample-${name}`, "manifest.json"),
    JSON.stringify({ mode: head.mode, pens: PENS, blocks: kind.fly ? [] : manifestBlocks, summary }),
  );
  console.log(`${name}: ${list.length} blocks, ${marks} marks, ${all.length} points`);
}

const [folder, ...names] = process.argv.slice(2);
if (!folder) throw new Error("give the folder to write to");
for (const name of names.length ? names : ["demo", "tilt", "passes", "fly"]) writeJob(folder, name);

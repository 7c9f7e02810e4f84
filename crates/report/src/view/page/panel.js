// @ts-check
/**
 * The words beside the picture: controls, the data of the present block, the figures of the job, the legend.
 *
 * Consumes the elements of `page.html` by their ids. Promises that all that the picture shows can be read as text.
 */

/** @type {[ColourBy, string, string][]} */
const COLOURS = [
  ["height", "focus height", "Height of the focal plane of each block, coloured as in layout.svg."],
  [
    "defocus",
    "defocus",
    "Distance of each mark from the focal plane along the beam; a block has the colour of its worst.",
  ],
  ["incidence", "incidence", "Angle between beam and surface normal; a block has the colour of its mean."],
  ["dose", "dose", "Energy per area relative to a level surface, mean of each block."],
  ["pen", "pen", "Pen of each mark; a block has the colour of its first."],
  ["pass", "pass", "Pass over the texture."],
  ["time", "time", "When it is marked, from the start of the job to its end."],
  ["seam", "seam", "Borders between blocks, and the marks next to them, by what changes there."],
  ["correction", "correction of the height", "What the warp adds to the part; points: what the rigid fit leaves of them."],
  [
    "kept",
    "depth kept free",
    "Kept free above and below marks for what is not known, red where it is less than that; points: what is left of " +
      "them, below blue, above orange.",
  ],
];

/** @type {[Layer, string, boolean][]} */
const LAYERS = [
  ["part", "part", true],
  ["fixtures", "fixtures", true],
  ["blocks", "blocks", true],
  ["borders", "borders", true],
  ["marks", "marks", true],
  ["seams", "seams", false],
  ["skipped", "not marked", true],
  ["path", "stage path", false],
  ["field", "field and beam", true],
  ["lens", "lens", true],
  ["travel", "travel limits", false],
  ["labels", "block names", true],
];

/** @type {Record<string, string>} */
const REASONS = {
  "off-part": "off the part",
  beyond: "beyond the edge, as meant",
  steep: "too steep",
  small: "too short",
  focus: "out of focus",
};

/** Whether a job has what a colour shows. @param {Head} head @param {ColourBy} by */
function isOffered(head, by) {
  if (by === "correction") return head.measured?.is_warped === true;
  if (by === "kept") return head.measured !== undefined;
  return head.mode === "stepped" || !["seam", "dose", "pass"].includes(by);
}

/** What a colour stands for. @param {Head} head @param {ColourBy} by */
function noteOf(head, by) {
  if (by === "height" && head.mode === "on-the-fly") return "Height of the focal plane at the moment of each mark.";
  return COLOURS.find(([b]) => b === by)?.[2] ?? "";
}

/** @template {HTMLElement} T @param {string} id @param {new () => T} kind @returns {T} */
function element(id, kind) {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`the page lacks its element "${id}"`);
  return found;
}

/** @param {string} id */
const button = (id) => element(id, HTMLButtonElement);
/** @param {string} id */
const input = (id) => element(id, HTMLInputElement);
/** @param {string} id */
const choice = (id) => element(id, HTMLSelectElement);
/** @param {string} id */
const place = (id) => element(id, HTMLElement);

/** @param {string} id @param {(string|Node)[][]} rows the first of each row heads it */
function fillTable(id, rows) {
  const body = /** @type {HTMLTableSectionElement} */ (place(id).querySelector("tbody"));
  body.replaceChildren(
    ...rows.map((cells) => {
      const row = document.createElement("tr");
      cells.forEach((cell, k) => {
        const box = row.appendChild(document.createElement(k === 0 ? "th" : "td"));
        if (k === 0) box.setAttribute("scope", "row");
        box.append(cell);
      });
      return row;
    }),
  );
}

/** @param {HTMLSelectElement} select @param {[string, string][]} options */
function fillChoice(select, options) {
  select.replaceChildren(...options.map(([value, words]) => new Option(words, value)));
}

/** What of the page never changes. @param {Head} head */
function fillPage(head) {
  const isFly = head.mode === "on-the-fly";
  place("job").textContent = head.job;
  place("subtitle").textContent = `${head.mode} job for ${head.machine}, ${duration(head.time_s)}`;
  place("block-word").textContent = isFly ? "Run of marks" : "Block";
  place("stop-word").textContent = isFly ? "Run" : "Stop";
  /** @type {[string, string][]} */
  const left = head.left ? [["blocks left", `${head.left.length} of ${head.blocks.count}`]] : [];
  fillTable("figures", [...left, ...head.figures]);
  const { part, thinned } = head;
  const whole = part.triangles === part.of;
  place("accuracy").textContent =
    (whole
      ? `The part is drawn from all ${part.of} triangles.`
      : `The part is drawn from ${part.triangles} of ${part.of} triangles, ` +
        `within ${micrometres(part.within_mm * 1000)}.`) +
    (thinned.points_left_out > 0
      ? ` ${thinned.points_left_out} points of marks within ${micrometres(thinned.within_um)} of their lines ` +
        "are left out."
      : " No point of the marks is left out.") +
    (head.lens.working_distance_mm === null
      ? " The machine file states no working distance: the lens is drawn at one of our own."
      : "") +
    ((head.skipped_lines?.left_out ?? 0) > 0
      ? ` ${head.skipped_lines?.left_out} pieces that are not marked are not drawn.`
      : "");
  place("skipped-section").hidden = head.skipped.length === 0;
  fillTable(
    "skipped",
    head.skipped.map((s) => {
      const swatch = document.createElement("span");
      swatch.className = "swatch";
      swatch.style.background = css(s.reason === "beyond" ? BEYOND : SKIPPED);
      const words = document.createElement("span");
      words.append(swatch, s.text ?? REASONS[s.reason] ?? s.reason);
      const dots = s.dots > 0 ? `${s.dots} dots` : "";
      const length = s.length_mm > 0 || !dots ? lengthText(s.length_mm) : "";
      return [words, String(s.texture), [length, dots].filter(Boolean).join(", "), `${shortNumber(s.share_percent)} %`];
    }),
  );
  place("warning-section").hidden = head.warnings.length === 0;
  place("warnings").replaceChildren(
    ...head.warnings.map((w) => {
      const item = document.createElement("li");
      const more = [w.place, w.help, w.code].filter(Boolean).join("; ");
      item.append(w.message, Object.assign(document.createElement("small"), { textContent: more }));
      return item;
    }),
  );
  fillChoice(
    choice("by"),
    COLOURS.filter(([by]) => isOffered(head, by)).map(([by, words]) => [by, words]),
  );
  const numbers = (/** @type {number} */ n) =>
    /** @type {[string, string][]} */ ([
      ["0", "all"],
      ...Array.from({ length: n }, (_, k) => [String(k + 1), `${k + 1}`]),
    ]);
  fillChoice(choice("pass"), numbers(head.passes));
  fillChoice(choice("setup"), numbers(head.setups));
  fillChoice(choice("pen"), [
    ["-1", "all"],
    ...head.pens.map((p, k) => /** @type {[string, string]} */ ([`${k}`, p.name])),
  ]);
  place("pass-filter").hidden = head.passes < 2;
  place("setup-filter").hidden = head.setups < 2;
  place("pen-filter").hidden = head.pens.length < 2;
  fillChoice(choice("speed"), [
    ["whole", "job in 60 s"],
    ["1", "real time"],
    ["10", "10 times"],
    ["100", "100 times"],
    ["1000", "1000 times"],
  ]);
  if (head.time_s < 60) choice("speed").value = "1";
  const absent = new Set(isFly ? ["blocks", "borders", "seams", "labels"] : []);
  if (!head.skipped_lines) absent.add("skipped");
  if (!head.fixtures) absent.add("fixtures");
  place("layers").replaceChildren(
    ...LAYERS.filter(([layer]) => !absent.has(layer)).map(([layer, words, isOn]) => {
      const label = document.createElement("label");
      const box = document.createElement("input");
      [box.type, box.id, box.checked] = ["checkbox", `layer-${layer}`, isOn];
      label.append(box, words);
      return label;
    }),
  );
}

/** @param {number} um */
function micrometres(um) {
  return um >= 1000 ? `${shortNumber(um / 1000)} mm` : `${shortNumber(um)} µm`;
}

/** @param {number} v @param {number} digits */
function fixed(v, digits) {
  return v.toFixed(digits).replace(/^-(0\.?0*)$/, "$1");
}

/** A short time. @param {number} s */
function seconds(s) {
  return s < 9.95 ? `${fixed(s, 3)} s` : duration(s);
}

/** @param {ArrayLike<number>} values @param {number} [digits] */
function places(values, digits = 3) {
  return Array.from(values, (v) => fixed(v, digits)).join(", ");
}

/** The data of a block as rows of words. @param {Head} head @param {Blocks} blocks @param {number} i
 * @returns {(string|Node)[][]} */
function rowsOfBlock(head, blocks, i) {
  /** @type {(string|Node)[][]} */
  const rows = [];
  /** @param {string} words @param {string|Node|null|undefined|false} value */
  const row = (words, value) => value && rows.push([words, value]);
  const [incidence, stretch, dose, z, tilt] = [
    blocks.incidence?.[i],
    blocks.stretch?.[i],
    blocks.dose?.[i],
    blocks.z?.[i],
    blocks.tilt?.[i],
  ];
  const [lift, shift, jump_mm] = [blocks.lift?.[i], blocks.shift?.[i], blocks.jump_mm?.[i]];
  const [section, stage, centre, focus] = [
    blocks.section?.[i],
    blocks.stage?.[i],
    blocks.centre?.[i],
    blocks.focus?.[i],
  ];
  row("Pass", head.passes > 1 && `${blocks.pass[i]} of ${head.passes}`);
  row("Set-up", head.setups > 1 && `${blocks.setup[i]} of ${head.setups}`);
  row("Focus height (LPFL)", focus != null && `${fixed(focus, 3)} mm`);
  row("Heights of marks", z && `${fixed(z[0], 3)} to ${fixed(z[1], 3)} mm`);
  row("Centre of field", centre && `${places(centre)} mm`);
  row("Section, level", section && `${section.join(", ")}; ${blocks.level?.[i] ?? "-"}`);
  row("Tilt", tilt && (tilt[0] !== 0 || tilt[1] !== 0) && `${places(tilt, 2)} deg`);
  row("Stage", stage && `${places(stage)} mm`);
  row("Lift of z", lift != null && `to ${fixed(lift, 3)} mm`);
  row("Focus shift", Boolean(shift) && `${fixed(shift ?? 0, 3)} mm`);
  row("Clock", `${fixed(blocks.start[i], 2)} to ${fixed(blocks.end[i], 2)} s`);
  row("Marking", seconds(blocks.end[i] - blocks.start[i]));
  row("Stage move", head.mode === "stepped" && `${seconds(blocks.start[i] - blocks.begin[i])} with settling`);
  row("Strokes", String(blocks.strokes[i]));
  row("Marks", lengthText(blocks.mark_mm[i]));
  row("Jumps", jump_mm != null && lengthText(jump_mm));
  row("Incidence", incidence && `mean ${fixed(incidence[0], 1)}, worst ${fixed(incidence[1], 1)} deg`);
  row("Stretch", stretch && `mean ${fixed(stretch[0], 3)}, worst ${fixed(stretch[1], 3)}`);
  row("Dose", dose && `mean ${fixed(dose[0], 3)}, least ${fixed(dose[1], 3)}`);
  row("Pens", blocks.pens[i].map((p) => head.pens[p].name).join(", "));
  const files = blocks.files?.[i];
  if (files && Object.keys(files).length > 0) {
    const list = document.createElement("span");
    Object.values(files).forEach((file, k) => {
      const link = document.createElement("a");
      link.href = file.split("/").map(encodeURIComponent).join("/");
      link.textContent = file;
      list.append(...(k > 0 ? [document.createElement("br"), link] : [link]));
    });
    row("Drawing files", list);
  }
  return rows;
}

/** What the colours mean. @param {Head} head @param {ColourBy} by */
function fillLegend(head, by) {
  const legend = place("legend");
  const words = COLOURS.find(([b]) => b === by)?.[1] ?? "";
  const title = document.createElement("div");
  /** @param {Colour[]} anchors @param {string[]} ends */
  const ramp = (anchors, ends) => {
    const bar = Object.assign(document.createElement("div"), { className: "ramp" });
    bar.style.background = cssRamp(anchors);
    const row = Object.assign(document.createElement("div"), { className: "ends" });
    row.append(...ends.map((e) => Object.assign(document.createElement("span"), { textContent: e })));
    legend.replaceChildren(title, bar, row);
  };
  /** @param {string[]} entries */
  const list = (entries) => {
    const items = document.createElement("ul");
    entries.forEach((entry, k) => {
      const item = items.appendChild(document.createElement("li"));
      const swatch = Object.assign(document.createElement("span"), { className: "swatch" });
      swatch.style.background = css(SERIES[k % SERIES.length]);
      item.append(swatch, entry);
    });
    legend.replaceChildren(title, items);
  };
  /** @param {[number, number]} r @param {number} digits @param {string} unitWords */
  const ends = ([a, b], digits, unitWords) => [
    fixed(a, digits),
    fixed((a + b) / 2, digits),
    `${fixed(b, digits)} ${unitWords}`,
  ];
  title.textContent = words[0].toUpperCase() + words.slice(1);
  const { ranges } = head;
  if (by === "height") ramp(RAMP, ends(ranges.height_mm, 2, "mm"));
  else if (by === "defocus") {
    const [a, b] = aboutZero(ranges.defocus_um);
    ramp(DIVERGING, [`${fixed(a, 0)} (below)`, "0", `${fixed(b, 0)} µm (above)`]);
  } else if (by === "incidence") ramp(RAMP, ends(ranges.incidence_deg, 1, "deg"));
  else if (by === "dose")
    ramp(
      RAMP,
      ends(ranges.dose, 3, "").map((e) => e.trim()),
    );
  else if (by === "correction") {
    const most = head.measured?.most_um ?? 0;
    ramp(DIVERGING, [`${fixed(-most, 0)} (lower)`, "0", `${fixed(most, 0)} µm (higher)`]);
  } else if (by === "kept") ramp(RAMP, ends(head.measured?.kept_um ?? [0, 0], 1, "µm"));
  else if (by === "time") ramp(RAMP, ["start", duration(head.time_s / 2), duration(head.time_s)]);
  else if (by === "pen") list(head.pens.map((p) => p.name));
  else if (by === "pass") list(Array.from({ length: head.passes }, (_, k) => `pass ${k + 1}`));
  else list(SEAMS);
}

/** Blocks that touch each block in a map of labels, and the mean width of blocks in cells.
 * @param {Uint32Array} labels @param {number} columns */
function neighboursIn(labels, columns) {
  /** @type {Map<number, Set<number>>} */
  const touching = new Map();
  let [borders, cells] = [0, 0];
  /** @param {number} a @param {number} b */
  const touch = (a, b) => {
    if (a === b || a === 0 || b === 0) return;
    borders += 1;
    for (const [p, q] of [
      [a - 1, b - 1],
      [b - 1, a - 1],
    ]) {
      let set = touching.get(p);
      if (!set) touching.set(p, (set = new Set()));
      set.add(q);
    }
  };
  for (let i = 0; i < labels.length; i++) {
    if (labels[i] > 0) cells += 1;
    if ((i + 1) % columns !== 0) touch(labels[i], labels[i + 1]);
    if (i + columns < labels.length) touch(labels[i], labels[i + columns]);
  }
  return { touching, width: cells / Math.max(borders, 1) };
}

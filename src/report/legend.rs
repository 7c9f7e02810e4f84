//! What `layout.svg` shows next to the part: axes and scale bar, and the legend.
//!
//! The legend is right of the part or, where the part is much wider than high, below it in columns; it never covers the
//! part. All positions in mm of the drawing.

use svg::Node;
use svg::node::element::Element;

use super::colour::{self, Colour, FIELD, FILLS, OFF_PART, PATH, hex};
use super::sheet::{Sheet, el, num, rectangle, text};
use super::{Layout, Shade, length_text, mm, plain, short};
use crate::geom::Nm;
use crate::manifest::duration;

/// Width of a column of the legend, in units of the sheet.
const COLUMN: f64 = 36.0;
/// Distance of two lines of text, and their font size.
const LINE: f64 = 2.3;
const FONT: f64 = 1.6;
/// Height of the colour ramp.
const RAMP: f64 = 26.0;
/// Characters that fit a line.
const CHARACTERS: usize = 38;

/// Axes at the lower left corner and a scale bar at the lower right, both below the part.
pub(super) fn measures(job: &Layout<'_>, sheet: &Sheet) -> Element {
    let (u, [x0, y0, x1, y1]) = (sheet.unit, sheet.view);
    let mut g =
        el("g", &[("id", "layer-measures"), ("inkscape:groupmode", "layer"), ("inkscape:label", "Axes, scale")]);
    let width = num(u * 0.25);
    let (x, y, arm) = (x0 - 3.4 * u, y1 + 6.0 * u, 4.6 * u);
    let axes = format!(
        "M{0} {1}V{2}M{3} {4}L{0} {2}L{5} {4}M{0} {1}H{6}M{7} {8}L{6} {1}L{7} {9}",
        num(x),
        num(y),
        num(y - arm),
        num(x - 0.6 * u),
        num(y - arm + 1.1 * u),
        num(x + 0.6 * u),
        num(x + arm),
        num(x + arm - 1.1 * u),
        num(y - 0.6 * u),
        num(y + 0.6 * u),
    );
    g.append(el(
        "path",
        &[("id", "axes"), ("fill", "none"), ("stroke", "#111"), ("stroke-width", &width), ("d", &axes)],
    ));
    g.append(text([x + arm + 0.5 * u, y + 0.5 * u], FONT * u, "start", "x"));
    g.append(text([x, y - arm - 0.6 * u], FONT * u, "middle", "y"));
    let zero = x0 <= 0.0 && 0.0 <= x1 && y0 <= 0.0 && 0.0 <= y1;
    if zero {
        let (gap, end, tick) = (1.4 * u, num(2.6 * u), num(0.12 * u));
        let (near, far) = (num(gap), num(-gap));
        let cross = format!("M-{end} 0H{far}M{near} 0H{end}M0 -{end}V{far}M0 {near}V{end}");
        let mut e = el("path", &[("id", "origin"), ("stroke", "#111"), ("stroke-width", &tick), ("d", &cross)]);
        e.append(title("origin of the part frame"));
        g.append(e);
    }
    scale_bar(&mut g, sheet);
    let frame = sheet.frame.as_ref();
    let [w, h] = frame.map_or([0.0; 2], |f| f.size).map(|v| plain(v, 2));
    let what = match frame.filter(|f| f.turned) {
        Some(_) => format!("marks {w} x {h} mm, turned by {} deg", num(job.turn_rad.to_degrees())),
        None => format!("texture {w} x {h} mm"),
    };
    let note = format!("{what}, part frame{}", if zero { ", + is its origin" } else { "" });
    g.append(text([x0 + 5.0 * u, y1 + 6.5 * u], FONT * u, "start", &note));
    g
}

fn title(words: &str) -> Element {
    let mut t = Element::new("title");
    t.append(svg::node::Text::new(words));
    t
}

/// A bar of 1, 2 or 5 times a power of ten mm, about a fifth of the part's width.
fn scale_bar(g: &mut Element, sheet: &Sheet) {
    let (u, [x0, _, x1, y1]) = (sheet.unit, sheet.view);
    let most = ((x1 - x0) / 4.0).max(f64::MIN_POSITIVE);
    let decade = 10f64.powf(most.log10().floor());
    let length = [5.0, 2.0, 1.0].into_iter().map(|k| k * decade).find(|&l| l <= most).unwrap_or(decade);
    let y = y1 + 4.2 * u;
    let mut bar = el("g", &[("id", "scale-bar"), ("stroke", "#111"), ("stroke-width", &num(0.12 * u))]);
    for (k, fill) in ["#111", "#fff", "#111", "#fff"].into_iter().enumerate() {
        let at = x1 - length + length * k as f64 / 4.0;
        bar.append(rectangle([at, y, at + length / 4.0, y + 0.8 * u], &[("fill", fill)]));
    }
    g.append(bar);
    let words = format!("{} mm", num(length));
    g.append(text([x1 - length / 2.0, y + 2.8 * u], FONT * u, "middle", &words));
}

/// The legend, and the box of part, measures and legend together.
pub(super) fn draw(job: &Layout<'_>, sheet: &Sheet) -> (Element, [f64; 4]) {
    let (u, [x0, y0, x1, y1]) = (sheet.unit, sheet.view);
    let mut g = el("g", &[("id", "layer-legend"), ("inkscape:groupmode", "layer"), ("inkscape:label", "Legend")]);
    let left = x0 - 5.0 * u;
    let foot = y1 + 8.0 * u;
    let below = x1 - x0 > 1.6 * (y1 - y0);
    let mut at = if below { [left + u, foot + 3.0 * u] } else { [x1 + 5.0 * u, y0] };
    let mut bounds = [left, y0, x1, foot];
    for card in [heading, ramp, times, key] {
        let mut pen = Column { g: &mut g, u, at };
        card(&mut pen, job, sheet);
        bounds[2] = bounds[2].max(at[0] + COLUMN * u);
        bounds[3] = bounds[3].max(pen.at[1]);
        if below {
            at[0] += (COLUMN + 3.0) * u;
        } else {
            at[1] = pen.at[1] + 1.6 * u;
        }
    }
    (g, bounds)
}

/// A column that is written from the top down.
struct Column<'a> {
    g: &'a mut Element,
    u: f64,
    at: [f64; 2],
}

impl Column<'_> {
    fn line(&mut self, words: &str) {
        self.put(words, FONT, "normal");
    }

    fn put(&mut self, words: &str, font: f64, weight: &str) {
        self.at[1] += LINE / FONT * font * self.u;
        let mut t = text(self.at, font * self.u, "start", words);
        if weight != "normal" {
            t.assign("font-weight", weight);
        }
        self.g.append(t);
    }

    /// A line with its value at the right end of the column.
    fn pair(&mut self, name: &str, value: &str) {
        self.line(name);
        self.g.append(text([self.at[0] + COLUMN * self.u, self.at[1]], FONT * self.u, "end", value));
    }
}

fn heading(pen: &mut Column<'_>, job: &Layout<'_>, sheet: &Sheet) {
    let s = job.summary;
    let name = short(job.job, 60);
    let font = (2.4 * 24.0 / name.chars().count().max(1) as f64).clamp(1.0, 2.4);
    pen.put(&name, font, "bold");
    pen.line(&short(&format!("machine {}", job.machine.name), CHARACTERS));
    pen.at[1] += 0.6 * pen.u;
    if job.passes > 1 {
        let pass = job.blocks().first().map_or(1, |b| b.pass.number());
        pen.pair("pass (lengths and times: of all)", &format!("{pass} of {}", job.passes));
    }
    if s.setups > 1 {
        pen.pair("set-ups, see the run sheet", &s.setups.to_string());
    }
    pen.pair("method", &short(&s.method, 24));
    let bound = s.lower_bound_stops.filter(|&n| n > 0).map(|n| format!(" (at least {n})")).unwrap_or_default();
    pen.pair("stops", &format!("{}{bound}", job.blocks().len()));
    let size = |size: [Nm; 2]| size.map(|v| num(v.mm())).join(" x ");
    if sheet.gridded {
        let [columns, rows] = job.sections.count;
        pen.pair("sections", &format!("{columns} x {rows} of {} mm", size(job.sections.pitch)));
    } else {
        pen.pair("windows, placed freely", &format!("{} mm", size(job.machine.usable_field())));
    }
    let [lo, hi] = job.range(|b| b.z_lo, |b| b.z_hi);
    pen.pair("marks from z to z, mm", &format!("{} to {}", mm(lo, 3), mm(hi, 3)));
    pen.pair("worst defocus", &format!("{} um", plain(s.worst_defocus_um, 1)));
    pen.pair("worst incidence", &format!("{} deg", plain(s.worst_incidence_deg, 1)));
    pen.pair("marked", &length_text(s.mark_mm));
    if s.dots.texture > 0 {
        pen.pair("dots", &format!("{} of {}", s.dots.marked, s.dots.texture));
    }
    pen.pair("skipped", &length_text(s.skipped_mm));
    let warnings = s.warnings.len();
    pen.pair("warnings", &if warnings == 0 { "none".to_owned() } else { format!("{warnings}, see report.html") });
}

/// The colours with the heights they stand for.
fn ramp(pen: &mut Column<'_>, job: &Layout<'_>, sheet: &Sheet) {
    let u = pen.u;
    let is_height = job.shade == Shade::Height;
    pen.put(if is_height { "focus height (LPFL), mm" } else { "mean incidence of the beam, deg" }, FONT, "bold");
    let range = job.shades();
    let [x, top] = [pen.at[0], pen.at[1] + 1.6 * u];
    let flat = range[0] == range[1];
    let height = if flat { 3.0 * u } else { RAMP * u };
    let mut gradient =
        el("linearGradient", &[("id", "ramp-colours"), ("x1", "0"), ("x2", "0"), ("y1", "1"), ("y2", "0")]);
    for k in 0..=16 {
        let offset = num(f64::from(k) / 16.0);
        let c = if flat { colour::of_height(0, [0, 0]) } else { colour::of_height(k.into(), [0, 16]) };
        gradient.append(el("stop", &[("offset", &offset), ("stop-color", &hex(c))]));
    }
    let mut defs = Element::new("defs");
    defs.append(gradient);
    pen.g.append(defs);
    let width = num(0.12 * u);
    let look = [("id", "ramp"), ("fill", "url(#ramp-colours)"), ("stroke", "#111"), ("stroke-width", width.as_str())];
    pen.g.append(rectangle([x, top, x + 4.0 * u, top + height], &look));
    let steps = if flat { 0 } else { 6 };
    for k in 0..=steps {
        let y = if flat { top + height / 2.0 } else { top + height * (1.0 - f64::from(k) / f64::from(steps)) };
        let d = format!("M{} {}h{}", num(x + 4.0 * u), num(y), num(0.8 * u));
        pen.g.append(el("path", &[("stroke", "#111"), ("stroke-width", &width), ("d", &d)]));
        let z = range[0] + (range[1] - range[0]) * i64::from(k) / i64::from(steps.max(1));
        pen.g.append(text([x + 5.4 * u, y + 0.55 * u], FONT * u, "start", &mm(Nm(z), 3)));
    }
    let levels = {
        let mut all: Vec<Nm> = job.blocks().iter().map(|b| b.stop.focus).collect();
        all.sort_unstable();
        all.dedup();
        all.len()
    };
    let other = if sheet.gridded { "every other level" } else { "every other block" };
    let note = [format!("{levels} heights"), other.into(), "a shade darker".into()];
    for (k, words) in note.iter().take(if flat || !is_height { 0 } else { 3 }).enumerate() {
        let y = top + height / 2.0 + (k as f64 - 0.4) * LINE * u;
        pen.g.append(text([x + 17.0 * u, y], FONT * u, "start", words));
    }
    pen.at[1] = top + height;
}

/// The parts of the job time as a bar and as lines.
pub(super) const PARTS: [(&str, Colour); 6] = [
    ("mark", FILLS[0]),
    ("jump", FILLS[1]),
    ("delay", FILLS[2]),
    ("stage", FILLS[3]),
    ("settle", FILLS[4]),
    ("zoom", FILLS[5]),
];

/// The parts that the machine of the job can have, and the seconds of each.
pub(super) fn seconds(job: &Layout<'_>) -> Vec<(&'static str, Colour, f64)> {
    let t = job.summary.time_s;
    let all = PARTS.into_iter().zip([t.mark, t.jump, t.delay, t.stage, t.settle, t.zoom]);
    let has = |name: &str| name != "zoom" || job.machine.zoom.is_some();
    all.filter(|((name, _), _)| has(name)).map(|((name, fill), s)| (name, fill, s)).collect()
}

fn times(pen: &mut Column<'_>, job: &Layout<'_>, _: &Sheet) {
    let u = pen.u;
    let total = job.summary.time_s.total;
    pen.put("estimated time", FONT, "bold");
    pen.g.append(text([pen.at[0] + COLUMN * u, pen.at[1]], FONT * u, "end", &duration(total)));
    let parts = seconds(job);
    let sum: f64 = parts.iter().map(|p| p.2).sum();
    let (mut x, y) = (pen.at[0], pen.at[1] + u);
    for &(_, fill, s) in &parts {
        let width = if sum > 0.0 { COLUMN * u * s / sum } else { 0.0 };
        if width > 0.0 {
            pen.g.append(rectangle([x, y, x + width, y + 1.6 * u], &[("fill", &hex(fill))]));
        }
        x += width;
    }
    pen.at[1] += 2.8 * u;
    for (name, fill, s) in parts {
        let x = pen.at[0];
        pen.at[0] = x + 2.2 * u;
        pen.line(name);
        pen.at[0] = x;
        let y = pen.at[1];
        pen.g.append(rectangle([x, y - 1.2 * u, x + 1.3 * u, y + 0.1 * u], &[("fill", &hex(fill))]));
        let share = if sum > 0.0 { 100.0 * s / sum } else { 0.0 };
        let words = format!("{}, {} %", duration(s), plain(share, 0));
        pen.g.append(text([x + COLUMN * u, y], FONT * u, "end", &words));
    }
}

fn key(pen: &mut Column<'_>, job: &Layout<'_>, sheet: &Sheet) {
    let u = pen.u;
    pen.put("how to read it", FONT, "bold");
    let turned = sheet.frame.as_ref().is_some_and(|f| f.turned);
    let rows: [(&str, &str, f64, &str); 5] = [
        ("#1a1a1a", "", 0.12, "split: border of two blocks"),
        ("#000", "dash", 0.14, "section line (number at the rim)"),
        ("#000", "", 0.3, if turned { "box of the marks, turned" } else { "box of the texture" }),
        (FIELD, "", 0.3, "field at the first stop"),
        (PATH, "arrow", 0.3, "stage path from ring to square"),
    ];
    for (stroke, kind, width, words) in rows.into_iter().filter(|row| sheet.gridded || row.1 != "dash") {
        let x = pen.at[0];
        pen.at[0] = x + 5.5 * u;
        pen.line(words);
        pen.at[0] = x;
        let y = pen.at[1] - 0.55 * u;
        let d = format!("M{} {}h{}", num(x), num(y), num(4.2 * u));
        let mut p = el("path", &[("stroke", stroke), ("stroke-width", &num(width * u)), ("d", &d)]);
        if kind == "dash" {
            p.assign("stroke-dasharray", format!("{} {}", num(0.9 * u), num(0.5 * u)));
        }
        pen.g.append(p);
        if kind == "arrow" {
            let tip = format!(
                "M{} {}l{w} {h}l0 {n}z",
                num(x + 2.8 * u),
                num(y),
                w = num(-1.3 * u),
                h = num(0.6 * u),
                n = num(-1.2 * u)
            );
            pen.g.append(el("path", &[("fill", stroke), ("d", &tip)]));
        }
    }
    if !job.off_part.is_empty() {
        let [x, u] = [pen.at[0], pen.u];
        pen.at[0] = x + 5.5 * u;
        pen.line("red: texture off the part, not marked");
        pen.at[0] = x;
        let y = pen.at[1];
        pen.g.append(rectangle([x, y - 1.2 * u, x + 4.2 * u, y + 0.1 * u], &[("fill", OFF_PART)]));
    }
    if !job.blocks().is_empty() {
        pen.line("number n: block Bn, in order of work");
    }
    pen.line(if sheet.gridded {
        "rest the pointer on a block for its data"
    } else {
        "rest the pointer on a block: data, window"
    });
}

//! What `layout.svg` shows next to the part: axes and scale bar, and the legend.
//!
//! The legend is right of the part and, where that is longer than the part is high, below it; of a part that is much
//! wider than high it is below it alone. It never covers the part. Its texts are measured in the widest of the usual
//! faces, so they fit in all.

use std::collections::BTreeSet;

use svg::Node;
use svg::node::element::Element;
use terrace_core::math;

use super::colour::{self, BEYOND, BORDER, Colour, FAULT, FIELD, FILLS, FIXTURE, OUTLINE, PART, PATH, TRAVEL, hex};
use super::marks::{self, grouped};
use super::part::Looks;
use super::sheet::{BESIDE, FONT, FOOT, GAP, LEAST_FONT, LEFT, RIM, Sheet, TOP, el, num, rectangle, text};
use super::travel::{self, Visibility};
use super::unmarked::{self, Lines};
use super::{Layout, Mode, OnTheFlyLayout, Picture, Shade, clean, length_text, mm, plain};
use terrace_core::duration::duration;
use terrace_core::geom::Nm;

/// Distance of two lines of text, of a font of 1.
const LINE: f64 = 1.42;
/// Between two cards of a column.
const CARDS: f64 = 1.8;
/// Rows of texture that is not marked, and pens, that are listed at most.
const MOST_ROWS: usize = 5;

/// Axes at the lower left corner and a scale bar at the lower right, both below the part.
pub(super) fn measures(sheet: &Sheet) -> Element {
    let (u, [x0, _, _, y1]) = (sheet.unit, sheet.view);
    let mut g =
        el("g", &[("id", "layer-measures"), ("inkscape:groupmode", "layer"), ("inkscape:label", "Axes, scale")]);
    let width = num(u * 0.2);
    let (x, y, arm) = (x0 - 3.0 * u, y1 + 8.0 * u, 4.2 * u);
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
    g.append(text([x + 0.8 * u, y - arm + 0.8 * u], FONT * u, "start", "y"));
    if has_origin(sheet) {
        let gap = 0.9 * u;
        let end = num(2.0 * u);
        let tick = num(0.14 * u);
        let (near, far) = (num(gap), num(-gap));
        let cross = format!("M-{end} 0H{far}M{near} 0H{end}M0 -{end}V{far}M0 {near}V{end}");
        let mut e = el("path", &[("id", "origin"), ("stroke", "#111"), ("stroke-width", &tick), ("d", &cross)]);
        let mut title = Element::new("title");
        title.append(svg::node::Text::new("origin of the part frame"));
        e.append(title);
        g.append(e);
    }
    scale_bar(&mut g, sheet);
    g
}

/// Whether the origin of the part frame lies in view.
fn has_origin(sheet: &Sheet) -> bool {
    let [x0, y0, x1, y1] = sheet.view;
    x0 <= 0.0 && 0.0 <= x1 && y0 <= 0.0 && 0.0 <= y1
}

/// A bar of 1, 2 or 5 times a power of ten mm, about a fifth of the part's width.
fn scale_bar(g: &mut Element, sheet: &Sheet) {
    let (u, [x0, _, x1, y1]) = (sheet.unit, sheet.view);
    let most = ((x1 - x0) / 4.0).max(f64::MIN_POSITIVE);
    let decade = math::pow(10f64, math::log10(most).floor());
    let length = [5.0, 2.0, 1.0].into_iter().map(|k| k * decade).find(|&l| l <= most).unwrap_or(decade);
    let y = y1 + 4.6 * u;
    let mut bar = el("g", &[("id", "scale-bar"), ("stroke", "#111"), ("stroke-width", &num(0.12 * u))]);
    for (k, fill) in ["#111", "#fff", "#111", "#fff"].into_iter().enumerate() {
        let at = x1 - length + length * k as f64 / 4.0;
        bar.append(rectangle([at, y, at + length / 4.0, y + 0.7 * u], &[("fill", fill)]));
    }
    g.append(bar);
    g.append(text([x1, y + 2.7 * u], FONT * u, "end", &format!("{} mm", num(length))));
}

/// A column of the legend.
#[derive(Clone, Copy)]
struct Slot {
    left: f64,
    top: f64,
    /// In units.
    width: f64,
}

/// The columns of the legend: right of the part and below it, or below it alone. `left` is the left end of the sheet.
fn slots(sheet: &Sheet, left: f64) -> Vec<Slot> {
    let (u, [_, y0, x1, _]) = (sheet.unit, sheet.view);
    let left = left + RIM * u;
    // The sheet is 100 units wide.
    let room = 100.0 - 2.0 * RIM;
    if sheet.below {
        return slots_below(sheet, left, room, 3);
    }
    let mut slots = vec![Slot { left: x1 + GAP * u, top: y0, width: BESIDE }];
    slots.extend(slots_below(sheet, left, room - GAP - BESIDE, 2));
    slots
}

/// Columns of equal width below the part, from `left` on, in so many units of room.
fn slots_below(sheet: &Sheet, left: f64, room: f64, count: usize) -> Vec<Slot> {
    let (u, [_, _, _, y1]) = (sheet.unit, sheet.view);
    let width = (room - GAP * (count - 1) as f64) / count as f64;
    let slot = |k: usize| Slot { left: left + k as f64 * (width + GAP) * u, top: y1 + FOOT * u, width };
    (0..count).map(slot).collect()
}

/// The cards of the legend, in the order in which they are laid out.
#[derive(Clone, Copy)]
enum Card {
    Heading,
    Colours,
    NotMarked,
    Times,
    Key,
}

impl Card {
    const ALL: [Self; 5] = [Self::Heading, Self::Colours, Self::NotMarked, Self::Times, Self::Key];

    /// The card in a column of so many units.
    fn written(self, job: &Picture<'_>, sheet: &Sheet, looks: &Looks, width: f64) -> Column {
        let u = sheet.unit;
        let mut column = Column { elements: Vec::new(), u, width: width * u, y: 0.0 };
        match self {
            Self::Heading => heading(&mut column, job, sheet),
            Self::Colours => colours(&mut column, job, sheet),
            Self::NotMarked => not_marked(&mut column, job),
            Self::Times => times(&mut column, job),
            Self::Key => key(&mut column, job, sheet, looks),
        }
        column
    }
}

/// The legend, and the box of the whole sheet.
pub(super) fn draw(job: &Picture<'_>, sheet: &Sheet, looks: &Looks) -> (Element, [f64; 4]) {
    let (u, [x0, y0, _, y1]) = (sheet.unit, sheet.view);
    let mut g = el("g", &[("id", "layer-legend"), ("inkscape:groupmode", "layer"), ("inkscape:label", "Legend")]);
    let left = x0 - (LEFT + RIM) * u;
    let top = y0 - if job.origins.len() > 1 { TOP } else { RIM } * u;
    let slots = slots(sheet, left);
    let heights: Vec<Vec<f64>> = Card::ALL
        .iter()
        .map(|card| slots.iter().map(|slot| card.written(job, sheet, looks, slot.width).y / u).collect())
        .collect();
    let begins: Vec<f64> = slots.iter().map(|slot| (slot.top - y0) / u).collect();
    // Where the next card of each column begins.
    let mut ends: Vec<f64> = slots.iter().map(|slot| slot.top).collect();
    let mut lowest = y1 + FOOT * u;
    for (card, k) in Card::ALL.into_iter().zip(shortest(&heights, &begins)) {
        let column = card.written(job, sheet, looks, slots[k].width);
        if column.elements.is_empty() {
            continue;
        }
        let place = format!("translate({} {})", num(slots[k].left), num(ends[k]));
        let mut moved = el("g", &[("transform", &place)]);
        column.elements.into_iter().for_each(|e| moved.append(e));
        g.append(moved);
        lowest = lowest.max(ends[k] + column.y);
        ends[k] += column.y + CARDS * u;
    }
    (g, [left, top, left + 100.0 * u, lowest + RIM * u])
}

/// The columns of cards with which the longest column ends highest; of equal ones that in which the first cards are in
/// the first columns. `heights` are by card and column.
fn shortest(heights: &[Vec<f64>], begins: &[f64]) -> Vec<usize> {
    // All ways are tried: three columns for five cards are 243.
    let ways = begins.len().pow(heights.len() as u32);
    let columns = (0..ways).map(|n| columns_of_way(n, heights.len(), begins.len()));
    columns.min_by_key(|columns| longest_end(columns, heights, begins)).unwrap_or_default()
}

/// The columns of cards as the digits of a number: the first card is the most significant.
fn columns_of_way(mut n: usize, cards: usize, count: usize) -> Vec<usize> {
    let mut columns = vec![0; cards];
    for k in columns.iter_mut().rev() {
        *k = n % count;
        n /= count;
    }
    columns
}

/// Where the longest column ends with the cards in these columns, in tenths of a unit: what no eye sees decides
/// nothing.
fn longest_end(columns: &[usize], heights: &[Vec<f64>], begins: &[f64]) -> i64 {
    let mut ends = begins.to_vec();
    for (card, &k) in columns.iter().enumerate().filter(|(card, k)| heights[*card][**k] > 0.0) {
        ends[k] += heights[card][k] + CARDS;
    }
    (ends.iter().fold(0.0f64, |a, &b| a.max(b)) * 10.0).round() as i64
}

/// Width of a text in DejaVu Sans, the widest of the faces, in its font size; never less.
fn width_of(words: &str) -> f64 {
    words.chars().map(width_of_letter).sum()
}

/// Width of a letter in its font size, rounded up by classes.
fn width_of_letter(c: char) -> f64 {
    match c {
        ' ' | '.' | ',' | ':' | ';' | 'i' | 'j' | 'l' | '\'' => 0.33,
        'f' | 't' | 'r' | '(' | ')' | '-' | '/' | 'I' | 'J' => 0.42,
        'm' | 'M' | 'W' | '%' | '@' | '\u{2026}' => 1.0,
        'w' | '+' | '=' | '<' | '>' | '~' => 0.84,
        'A'..='Z' | '&' => 0.79,
        c if c.is_ascii() => 0.64,
        _ => 1.05,
    }
}

/// The beginning of a text, as much of it as is no wider than `most` font sizes.
fn fitted(words: &str, most: f64) -> String {
    let mut words = clean(words);
    if width_of(&words) > most {
        while !words.is_empty() && width_of(&words) > most - 1.0 {
            words.pop();
        }
        words.push('\u{2026}');
    }
    words
}

/// A text in lines no wider than `most` font sizes.
fn wrapped(words: &str, most: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words.split(' ') {
        match lines.last_mut() {
            Some(line) if width_of(line) + width_of(word) + 0.33 <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(fitted(word, most)),
        }
    }
    lines
}

/// A card that is written from the top down; its upper left corner is the origin.
struct Column {
    elements: Vec<Element>,
    /// A unit of the sheet, mm.
    u: f64,
    /// Width, mm.
    width: f64,
    /// How far down it is written, mm.
    y: f64,
}

/// Where the words of a row with a symbol begin, in units.
const INDENT: f64 = 5.0;

impl Column {
    /// Goes to the next line, of a font in units; returns where its letters stand.
    fn next(&mut self, font: f64) -> f64 {
        self.y += LINE * font * self.u;
        // The base line, with room for what goes below it.
        self.y - 0.3 * font * self.u
    }

    fn put(&mut self, x: f64, y: f64, anchor: &str, words: &str) {
        self.elements.push(text([x, y], FONT * self.u, anchor, words));
    }

    /// Lines of words, as many as they take, from `indent` on.
    fn lines(&mut self, indent: f64, words: &str) {
        for line in wrapped(words, self.width / self.u / FONT - indent / FONT) {
            let y = self.next(FONT);
            self.put(indent * self.u, y, "start", &line);
        }
    }

    /// A line in bold, with a value at the right end.
    fn title(&mut self, words: &str, value: &str) {
        let y = self.next(FONT);
        let mut t = text([0.0, y], FONT * self.u, "start", words);
        t.assign("font-weight", "bold");
        self.elements.push(t);
        if !value.is_empty() {
            self.put(self.width, y, "end", value);
        }
    }

    /// A name with its value at the right end, on a line of its own where both do not fit.
    fn pair(&mut self, indent: f64, name: &str, value: &str) {
        let most = self.width / self.u / FONT - indent / FONT;
        let value = fitted(value, most);
        let mut y = self.next(FONT);
        self.put(indent * self.u, y, "start", &fitted(name, most));
        if width_of(name) + width_of(&value) + 0.6 > most {
            y = self.next(FONT);
        }
        self.put(self.width, y, "end", &value);
    }

    /// A row with a symbol, drawn by `symbol` around the middle of a line from 0 to 4 units; `words` go beside it.
    fn row(&mut self, symbol: impl FnOnce(f64, f64) -> Vec<Element>, words: &str) {
        let middle = self.y + 0.5 * LINE * FONT * self.u;
        self.elements.extend(symbol(self.u, middle));
        self.lines(INDENT, words);
    }
}

/// A line as the symbol of a row.
fn line(u: f64, y: f64, colour: &str, width: f64, dash: &str) -> Element {
    let d = format!("M0 {}h{}", num(y), num(4.0 * u));
    let mut p = el("path", &[("stroke", colour), ("stroke-width", &num(width * u)), ("d", &d)]);
    if !dash.is_empty() {
        p.assign("stroke-dasharray", dash);
    }
    p
}

/// A filled box as the symbol of a row.
fn swatch(u: f64, y: f64, fill: &str) -> Element {
    rectangle([0.0, y - 0.75 * u, 4.0 * u, y + 0.75 * u], &[("fill", fill)])
}

/// Name and figures of the job.
fn heading(c: &mut Column, job: &Picture<'_>, sheet: &Sheet) {
    // Bold letters are up to an eighth wider.
    let name = clean(job.job);
    let most = c.width / c.u / 1.13;
    let font = (most / width_of(&name).max(1.0)).clamp(LEAST_FONT, 2.4);
    let y = c.next(font);
    let mut t = text([0.0, y], font * c.u, "start", &fitted(&name, most / font));
    t.assign("font-weight", "bold");
    c.elements.push(t);
    c.lines(0.0, &format!("machine {}", fitted(&job.machine.name, 16.0)));
    c.y += 0.5 * c.u;
    if let Some(frame) = &sheet.frame {
        let [w, h] = frame.size.map(|v| plain(v, 1));
        let name = if frame.turned { "marks, turned" } else { "texture" };
        c.pair(0.0, name, &format!("{w} x {h} mm"));
        if frame.turned {
            c.pair(0.0, "part turned by", &format!("{} deg", num(job.turn_rad.to_degrees())));
        }
    }
    match job.mode {
        Mode::Stepped(layout) => stepped(c, layout, sheet),
        Mode::OnTheFly(layout) => on_the_fly(c, layout),
    }
}

/// The figures of a stepped job.
fn stepped(c: &mut Column, job: &Layout<'_>, sheet: &Sheet) {
    let s = job.summary;
    if job.passes > 1 {
        let pass = job.blocks().first().map_or(1, |b| b.pass.number());
        c.pair(0.0, "pass", &format!("{pass} of {}", job.passes));
        c.lines(0.0, "lengths and times: of all passes");
    }
    if s.setups > 1 {
        c.pair(0.0, "set-ups", &format!("{}, see run sheet", s.setups));
    }
    c.pair(0.0, "method", &s.method);
    let bound = s.lower_bound_stops.filter(|&n| n > 0).map(|n| format!(" (at least {n})")).unwrap_or_default();
    c.pair(0.0, "stops", &format!("{}{bound}", job.blocks().len()));
    let places: BTreeSet<[i64; 2]> = job.blocks().iter().map(|b| [b.stage.0[0], b.stage.0[1]]).collect();
    if places.len() < job.blocks().len() {
        c.pair(0.0, "places in x and y", &places.len().to_string());
    }
    let size = |size: [Nm; 2]| size.map(|v| num(v.mm())).join(" x ");
    if sheet.gridded {
        let [columns, rows] = job.sections.count;
        c.pair(0.0, "sections", &format!("{columns} x {rows} of {} mm", size(job.sections.pitch)));
    } else {
        c.pair(0.0, "free windows", &format!("{} mm", size(job.machine.usable_field())));
    }
    let [lo, hi] = job.range(|b| b.z_lo, |b| b.z_hi);
    c.pair(0.0, "marks at z", &format!("{} to {} mm", mm(lo, 2), mm(hi, 2)));
    c.pair(0.0, "worst defocus", &format!("{} um", plain(s.worst_defocus_um, 1)));
    c.pair(0.0, "worst incidence", &format!("{} deg", plain(s.worst_incidence_deg, 1)));
    let off = [s.off_axis_mm.largest, s.off_axis_mm.p95].map(|mm| plain(mm, 1));
    c.pair(0.0, "off axis", &format!("{} mm, 95 % to {} mm", off[0], off[1]));
    c.pair(0.0, "marked", &length_text(s.mark_mm));
    if s.dots.texture > 0 {
        c.pair(0.0, "dots", &format!("{} of {}", s.dots.marked, s.dots.texture));
    }
    c.pair(0.0, "skipped", &length_text(s.skipped_mm));
    warnings(c, s.warnings.len(), "report.html");
}

/// The figures of an on-the-fly job.
fn on_the_fly(c: &mut Column, job: &OnTheFlyLayout<'_>) {
    let s = job.summary;
    c.pair(0.0, "on the fly, axes", job.program.kind.letters());
    c.pair(0.0, "moves", &grouped(s.moves));
    c.pair(0.0, "marks", &grouped(s.marks));
    c.pair(0.0, "worst defocus", &format!("{} um", plain(s.deviations.worst_fod_um, 1)));
    c.pair(0.0, "worst incidence", &format!("{} deg", plain(s.deviations.worst_bia_deg, 1)));
    c.pair(0.0, "fastest mark", &format!("{} mm/s", plain(s.mark_speed_mm_s, 0)));
    c.pair(0.0, "marked", &length_text(s.mark_mm));
    c.pair(0.0, "skipped", &length_text(s.lengths.skipped_mm));
    warnings(c, s.warnings.len(), "the manifest");
}

fn warnings(c: &mut Column, count: usize, file: &str) {
    c.pair(0.0, "warnings", &if count == 0 { "none".to_owned() } else { format!("{count}, see {file}") });
}

/// The colours of blocks with the heights they stand for, and those of pens.
fn colours(c: &mut Column, job: &Picture<'_>, sheet: &Sheet) {
    if let Some(layout) = job.stepped().filter(|layout| !layout.blocks().is_empty()) {
        ramp(c, layout, sheet);
        c.y += 0.8 * c.u;
    }
    let pens = job.marks.pens();
    if pens.is_empty() {
        return;
    }
    c.title(if pens.len() == 1 { "pen" } else { "pens" }, "");
    let only_dots = job.stepped().is_some_and(|layout| layout.summary.mark_mm == 0.0 && layout.summary.dots.marked > 0);
    for (k, pen) in pens.iter().take(MOST_ROWS).enumerate() {
        let Some(pen) = job.pens.get(pen.index()) else { continue };
        let colour = hex(marks::colour(k));
        let dwell = pen.dwell.map(|dwell| format!("{} us a dot, ", num(dwell.as_us()))).unwrap_or_default();
        let speed = if only_dots { String::new() } else { format!("{} mm/s, ", num(pen.speed.as_mm_s())) };
        let words = format!("{}: {speed}{dwell}{}", pen.name, pen.power);
        c.row(|u, y| vec![line(u, y, &colour, 0.35, "")], &words);
    }
    if pens.len() > MOST_ROWS {
        c.lines(INDENT, &format!("and {} more", pens.len() - MOST_ROWS));
    }
    c.lines(0.0, &format!("drawn: {}", job.marks.words()));
}

/// The colours of blocks from the least to the greatest value, with values below them.
fn ramp(c: &mut Column, job: &Layout<'_>, sheet: &Sheet) {
    let u = c.u;
    let is_height = job.shade == Shade::Height;
    c.title(if is_height { "focus height (LPFL), mm" } else { "mean incidence, deg" }, "");
    let range = job.shades();
    let flat = range[0] == range[1];
    const PIECES: i64 = 48;
    let (top, bottom) = (c.y + 0.4 * u, c.y + 2.2 * u);
    // Each piece continues to the right end, so that no gap shows between two.
    for k in 0..if flat { 1 } else { PIECES } {
        let fill = if flat { colour::of_height(0, [0, 0]) } else { colour::of_height(k, [0, PIECES - 1]) };
        let x = c.width * k as f64 / PIECES as f64;
        c.elements.push(rectangle([x, top, c.width, bottom], &[("fill", &hex(colour::light(fill)))]));
    }
    let frame = [("id", "ramp"), ("fill", "none"), ("stroke", "#111"), ("stroke-width", &num(0.1 * u))];
    c.elements.push(rectangle([0.0, top, c.width, bottom], &frame));
    c.y = bottom;
    let y = c.next(FONT);
    let places: &[(f64, &str)] =
        if flat { &[(0.5, "middle")] } else { &[(0.0, "start"), (0.5, "middle"), (1.0, "end")] };
    for &(share, anchor) in places {
        let value = range[0] + ((range[1] - range[0]) as f64 * share).round() as i64;
        c.put(c.width * share, y, anchor, &mm(Nm(value), 3));
    }
    if is_height && !flat {
        let mut levels: Vec<Nm> = job.blocks().iter().map(|b| b.stop.lpfl).collect();
        levels.sort_unstable();
        levels.dedup();
        let other = if sheet.gridded { "level" } else { "block" };
        c.lines(0.0, &format!("{} heights; every other {other} darker", levels.len()));
    }
}

/// What is not marked, with reason, length, share and place.
fn not_marked(c: &mut Column, job: &Picture<'_>) {
    let rows = &job.scene.unmarked.rows;
    if rows.is_empty() {
        return;
    }
    c.title("not marked", "");
    for row in rows.iter().take(MOST_ROWS) {
        let colour = if row.reason.is_fault() { FAULT } else { BEYOND };
        let [why, share, place] = unmarked::words(row);
        c.row(|u, y| vec![line(u, y, colour, 0.4, "")], &why);
        c.lines(INDENT, &share);
        c.lines(INDENT, &place);
    }
    if rows.len() > MOST_ROWS {
        c.lines(INDENT, &format!("and {} more rows in the manifest", rows.len() - MOST_ROWS));
    }
    let drawn = [true, false].map(|is_fault| Lines::of(job, is_fault).one_of).into_iter().max().unwrap_or(1);
    if drawn > 1 || job.scene.unmarked.lines_left_out > 0 {
        c.lines(INDENT, "not every line of it is drawn");
    }
}

/// The parts of the job time and their colours.
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

/// The parts of the job time as a bar and as lines.
fn times(c: &mut Column, job: &Picture<'_>) {
    let u = c.u;
    let (total, parts) = match job.mode {
        Mode::Stepped(layout) => (layout.summary.time_s.total, seconds(layout)),
        Mode::OnTheFly(layout) => {
            let s = layout.summary;
            let parts = vec![("mark", FILLS[0], s.mark_s), ("between marks", FILLS[1], s.time_s - s.mark_s)];
            (s.time_s, parts)
        }
    };
    c.title("estimated time", &duration(total));
    let sum: f64 = parts.iter().map(|p| p.2).sum();
    let (mut x, y) = (0.0, c.y + 0.3 * u);
    for &(_, fill, s) in &parts {
        let width = if sum > 0.0 { c.width * s / sum } else { 0.0 };
        if width > 0.0 {
            c.elements.push(rectangle([x, y, x + width, y + 1.4 * u], &[("fill", &hex(fill))]));
        }
        x += width;
    }
    c.y += 2.2 * u;
    for (name, fill, s) in parts {
        let middle = c.y + 0.5 * LINE * FONT * u;
        c.elements.push(rectangle([0.0, middle - 0.6 * u, 1.2 * u, middle + 0.6 * u], &[("fill", &hex(fill))]));
        let share = if sum > 0.0 { 100.0 * s / sum } else { 0.0 };
        c.pair(2.2, name, &format!("{}, {} %", duration(s), plain(share, 0)));
    }
}

/// What lines and areas of the picture mean.
fn key(c: &mut Column, job: &Picture<'_>, sheet: &Sheet, looks: &Looks) {
    let dash = |a: f64, b: f64| format!("{} {}", num(a * sheet.unit), num(b * sheet.unit));
    c.title("how to read it", "");
    let heights = if looks.shading.factor > 1.0 { format!(", z x {}", looks.shading.factor) } else { String::new() };
    let beyond = if looks.silhouette.is_cut() { "; it extends beyond the picture" } else { "" };
    c.row(
        |u, y| vec![swatch(u, y, PART), line(u, y - 0.75 * u, OUTLINE, 0.16, "")],
        &format!("part, relief shaded{heights}{beyond}"),
    );
    let stepped = job.stepped().filter(|layout| !layout.blocks().is_empty());
    if stepped.is_some() {
        c.row(|u, y| vec![line(u, y, BORDER, 0.16, "")], "border of two blocks");
        if sheet.gridded {
            c.row(|u, y| vec![line(u, y, "#000", 0.14, &dash(0.9, 0.5))], "section, numbers at the rim");
        }
    }
    if let Some(frame) = &sheet.frame {
        let words = if frame.turned { "box of the marks, turned" } else { "box of the texture" };
        c.row(|u, y| vec![line(u, y, "#000", 0.24, "")], words);
    }
    let [w, h] = job.machine.usable_field();
    let first = if stepped.is_some() { "first field" } else { "field at the start" };
    c.row(|u, y| vec![line(u, y, FIELD, 0.24, "")], &format!("{first}, {} x {} mm", num(w.mm()), num(h.mm())));
    let what = if stepped.is_some() { "stage path" } else { "way of the field" };
    c.row(path, &format!("{what}, ring to square"));
    let rectangles: Vec<_> = job.origins.iter().map(|&origin| travel::rectangle(job.machine, origin)).collect();
    let [w, h] = rectangles.first().map_or([0.0; 2], |r| [r[2] - r[0], r[3] - r[1]]).map(num);
    let limit = match travel::visibility(job, sheet) {
        Visibility::Whole => "",
        Visibility::Partly => ", part of it beyond the picture",
        Visibility::None => ", beyond the picture",
    };
    c.row(|u, y| vec![line(u, y, TRAVEL, 0.2, &dash(1.1, 0.7))], &format!("machine travel, {w} x {h} mm{limit}"));
    if job.stepped().is_some_and(|layout| !layout.fixtures.is_empty()) {
        let square = |u: f64, y: f64| {
            rectangle([0.0, y - 0.8 * u, 4.0 * u, y + 0.6 * u], &[("fill", FIXTURE), ("fill-opacity", "0.55")])
        };
        c.row(|u, y| vec![square(u, y)], "fixture, never marked");
    }
    if has_origin(sheet) {
        c.row(
            |u, y| vec![el("path", &[("stroke", "#111"), ("stroke-width", &num(0.14 * u)), ("d", &plus(u, y))])],
            "origin of the part frame",
        );
    }
    if stepped.is_some() {
        c.lines(0.0, "number n is block Bn, in order of work, and stands on each of its pieces; a larger picture shows more numbers");
        c.lines(0.0, "rest the pointer on a block for its data");
    }
}

/// A cross in the middle of a symbol.
fn plus(u: f64, y: f64) -> String {
    let [x, arm] = [2.0 * u, 0.9 * u];
    format!("M{} {}h{}M{} {}v{}", num(x - arm), num(y), num(2.0 * arm), num(x), num(y - arm), num(2.0 * arm))
}

/// A ring, an arrow and a square on a line.
fn path(u: f64, y: f64) -> Vec<Element> {
    let stroke = num(0.2 * u);
    let look = [("fill", "none"), ("stroke", PATH), ("stroke-width", stroke.as_str())];
    let mut ring = el("circle", &[("cx", &num(0.5 * u)), ("cy", &num(y)), ("r", &num(0.5 * u))]);
    look.iter().for_each(|&(k, v)| ring.assign(k, v));
    let square = rectangle([3.0 * u, y - 0.5 * u, 4.0 * u, y + 0.5 * u], &look);
    let way = el(
        "path",
        &[("stroke", PATH), ("stroke-width", &stroke), ("d", &format!("M{} {}h{}", num(u), num(y), num(2.0 * u)))],
    );
    let tip = format!("M{} {}l{w} {h}v{n}z", num(2.5 * u), num(y), w = num(-u), h = num(0.45 * u), n = num(-0.9 * u));
    vec![way, ring, square, el("path", &[("fill", PATH), ("d", &tip)])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_are_laid_out_so_that_the_longest_column_is_shortest() {
        let heights = |h: &[f64]| h.iter().map(|&h| vec![h; 3]).collect::<Vec<_>>();
        assert_eq!(shortest(&heights(&[9.0, 5.0, 4.0]), &[0.0; 3]), [0, 1, 2]);
        assert_eq!(shortest(&heights(&[20.0, 5.0, 4.0, 9.0]), &[0.0; 3]), [0, 1, 1, 2]);
        // Columns that begin lower are used where the first is full.
        assert_eq!(shortest(&heights(&[20.0, 20.0, 20.0]), &[0.0, 30.0, 30.0]), [0, 0, 1]);
    }

    #[test]
    fn texts_are_cut_and_wrapped_to_their_room() {
        for most in [6.0, 11.0, 30.0] {
            for line in wrapped("machine travel, 500 x 500 mm, beyond averyveryverylongwordthatfitsnowhere", most) {
                assert!(width_of(&line) <= most, "{line:?} in {most}");
            }
        }
        assert_eq!(fitted("short", 9.0), "short");
        assert!(fitted("Wwwwwwwwwwwwwwwwwww", 9.0).ends_with('\u{2026}'));
    }
}

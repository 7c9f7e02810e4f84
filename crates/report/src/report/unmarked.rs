//! Texture that is not marked, on `layout.svg`: red where it may be taken for marked, grey where a pattern continues
//! beyond the part.

use svg::Node;
use svg::node::element::Element;

use super::Picture;
use super::colour::{BEYOND, FAULT};
use super::marks::grouped;
use super::sheet::{Sheet, el, layer, num, push_command, titled};
use super::{length_text, plain};
use crate::scene::{UnmarkedLine, UnmarkedRow};

/// Points that are drawn of red lines, and of grey ones; where there are more, lines are left out evenly.
const MOST: [usize; 2] = [60_000, 20_000];

/// The rows of one colour that are drawn, and how many lines stand for each that is.
pub(super) struct Lines<'a> {
    lines: Vec<&'a UnmarkedLine>,
    /// Of so many lines one is drawn.
    pub one_of: usize,
}

impl<'a> Lines<'a> {
    /// The unmarked lines that are drawn in red, or those in grey.
    pub(super) fn of(job: &Picture<'a>, is_fault: bool) -> Self {
        let unmarked = &job.scene.unmarked;
        let has_colour = |line: &&UnmarkedLine| unmarked.rows[line.row].reason.is_fault() == is_fault;
        let lines: Vec<&UnmarkedLine> = unmarked.lines.iter().filter(has_colour).collect();
        let points: usize = lines.iter().map(|line| line.points.len()).sum();
        let one_of = points.div_ceil(MOST[usize::from(!is_fault)]).max(1);
        Self { lines, one_of }
    }
}

/// The layer; one path for each row.
pub(super) fn draw(job: &Picture<'_>, sheet: &Sheet) -> Element {
    let u = sheet.unit;
    let mut g = layer(
        "layer-unmarked",
        "Texture that is not marked",
        &[("fill", "none"), ("stroke-linecap", "round"), ("stroke-linejoin", "round")],
    );
    for is_fault in [false, true] {
        let Lines { lines, one_of } = Lines::of(job, is_fault);
        let (colour, width) = if is_fault { (FAULT, 0.22 * u) } else { (BEYOND, 0.08 * u) };
        for (row, entry) in job.scene.unmarked.rows.iter().enumerate() {
            if entry.reason.is_fault() != is_fault {
                continue;
            }
            let mut d = String::new();
            let drawn = lines.iter().step_by(one_of).filter(|line| line.row == row);
            drawn.for_each(|line| push_line(&mut d, sheet, line));
            if d.is_empty() {
                continue;
            }
            let id = format!("unmarked-{}-{}", entry.reason.name(), entry.texture);
            let look = [("id", id.as_str()), ("stroke", colour), ("stroke-width", &num(width)), ("d", &d)];
            g.append(titled(el("path", &look), format!("not marked, {}", words(entry).join(", "))));
        }
    }
    g
}

/// Appends a line, in steps of the sheet; of one step or a dot its round ends are seen.
fn push_line(d: &mut String, sheet: &Sheet, line: &UnmarkedLine) {
    let mut last: Option<[i64; 2]> = None;
    let mut has_length = false;
    for p in &line.points {
        let at = [sheet.step_mm(p[0]), -sheet.step_mm(p[1])];
        match last {
            None => push_command(d, 'M', &at, sheet.decimals),
            Some(last) if last == at => continue,
            Some(last) => {
                push_command(d, 'l', &[at[0] - last[0], at[1] - last[1]], sheet.decimals);
                has_length = true;
            }
        }
        last = Some(at);
    }
    if !has_length && last.is_some() {
        push_command(d, 'h', &[1], sheet.decimals);
    }
}

/// What is not marked of a texture for a reason: why, how much, and where.
pub(super) fn words(row: &UnmarkedRow) -> [String; 3] {
    let mut much = Vec::new();
    if row.length_mm > 0.0 {
        let is_short = row.length_mm < 0.1;
        much.push(if is_short { format!("{} um", plain(1e3 * row.length_mm, 1)) } else { length_text(row.length_mm) });
    }
    if row.dots > 0 {
        much.push(format!("{} dots", grouped(row.dots as usize)));
    }
    let share = if row.share_percent < 0.05 { "under 0.1".into() } else { plain(row.share_percent, 1) };
    let ([x0, y0], [x1, y1]) = (row.area.lo.mm(), row.area.hi.mm());
    // As many digits as tell the ends apart.
    let digits = match (x1 - x0).max(y1 - y0) {
        100.0.. => 0,
        1.0.. => 1,
        _ => 3,
    };
    let short = |v: f64| {
        let text = plain(v, digits);
        if digits == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
    };
    let [x0, y0, x1, y1] = [x0, y0, x1, y1].map(short);
    [
        row.reason.text().into(),
        format!("texture {}: {}, {share} %", row.texture, much.join(", ")),
        format!("x {x0} to {x1}, y {y0} to {y1} mm"),
    ]
}

//! Where the stage stands, on `layout.svg`: its path and the field of the first stop; on the fly, the way of the
//! field's centre. The layers lie over the blocks and under the numbers, half transparent, and let the pointer through
//! to the blocks.

use std::fmt::Write;
use std::ops::Range;
use terrace_core::math;

use svg::Node;
use svg::node::element::Element;

use super::colour::{FIELD, PATH};
use super::outline::thin;
use super::sheet::{Detail, Sheet, el, field_box, layer, num, push_command, rectangle, sheet_box, titled};
use super::{Layout, Picture};
use terrace_core::geom::{P2, mm_from_nm};
use terrace_core::machine::FieldShape;

/// Share of the sheet that the line of the path covers at most: a path from window to window, with a move
/// for every block, becomes a hairline instead of a hairball.
const COVER: f64 = 0.03;

/// A way on the fly is drawn to this share of the sheet's width.
const NEAR: f64 = 1e-4;

/// A place where the field stays for some blocks.
struct Stay {
    centre: P2,
    /// The blocks, as numbers of [`Layout::blocks`]; on the fly samples of the way.
    blocks: Range<usize>,
}

impl Stay {
    /// Its place in the drawing.
    fn place(&self) -> [f64; 2] {
        [mm_from_nm(self.centre.x), -mm_from_nm(self.centre.y)]
    }

    /// How far it is to another, mm.
    fn distance_mm(&self, other: &Self) -> f64 {
        mm_from_nm(self.centre.distance(other.centre) as i64)
    }
}

/// Where the stage stands, in machining order, or on the fly its way: stays at one place are one dot.
pub(super) fn path(job: &Picture<'_>, sheet: &Sheet, detail: Detail) -> Element {
    let u = sheet.unit;
    let mut g = layer("layer-stage-path", "Stage path", &[("opacity", ".75")]);
    let stepped = job.stepped();
    let mut stays = stays(job);
    if stepped.is_none() {
        // The sheet is 100 units wide.
        thin_out(&mut stays, NEAR * 100.0 * u);
    }
    let length: f64 = stays.windows(2).map(|w| w[0].distance_mm(&w[1])).sum();
    let [x0, y0, x1, y1] = sheet.view;
    let full = u * 0.14;
    let width = (COVER * (x1 - x0) * (y1 - y0) / length.max(u)).clamp(full / 5.0, full);
    let is_thin = stepped.is_none() || width < full / 2.0;
    let line = num(width);
    g.append(el(
        "path",
        &[
            ("id", "stage-line"),
            ("fill", "none"),
            ("stroke", PATH),
            ("stroke-width", &line),
            ("stroke-linejoin", "round"),
            ("pointer-events", "none"),
            ("d", &line_through(&stays, sheet)),
        ],
    ));
    // An arrow on every move, or on moves far enough from each other.
    let [apart, least] = if is_thin { [length / ARROWS[usize::from(stepped.is_none())], u] } else { [0.0; 2] };
    let arrows = arrows(&stays, apart, least, u);
    g.append(el("path", &[("id", "stage-arrows"), ("fill", PATH), ("pointer-events", "none"), ("d", &arrows)]));
    if let Some(layout) = stepped.filter(|_| !is_thin) {
        g.append(dots(layout, &stays, u, detail));
    }
    if let (Some(first), Some(last)) = (stays.first(), stays.last()) {
        ends(&mut g, first.place(), last.place(), u);
    }
    g
}

/// The stays of a job, in order.
fn stays(job: &Picture<'_>) -> Vec<Stay> {
    let mut stays: Vec<Stay> = Vec::new();
    for (i, centre) in job.places().into_iter().enumerate() {
        match stays.last_mut() {
            Some(stay) if stay.centre == centre => stay.blocks.end = i + 1,
            _ => stays.push(Stay { centre, blocks: i..i + 1 }),
        }
    }
    stays
}

/// Leaves out what lies within `limit`, mm, of the way through the others.
fn thin_out(stays: &mut Vec<Stay>, limit: f64) {
    let points: Vec<[f64; 2]> = stays.iter().map(|stay| stay.centre.mm()).collect();
    let mut keep = Vec::new();
    thin(&points, limit, &mut keep, &mut Vec::new());
    let mut kept = keep.iter();
    stays.retain(|_| kept.next().is_some_and(|is_kept| *is_kept));
}

/// The path data of the line through all stays.
fn line_through(stays: &[Stay], sheet: &Sheet) -> String {
    let mut d = String::new();
    let mut last = [0; 2];
    for (k, stay) in stays.iter().enumerate() {
        let to = stay.place().map(|v| sheet.step_mm(v));
        push_command(&mut d, if k == 0 { 'M' } else { 'l' }, &[to[0] - last[0], to[1] - last[1]], sheet.decimals);
        last = to;
    }
    d
}

/// The path data of arrows on moves of at least `least` mm, after every `apart` mm of the way.
fn arrows(stays: &[Stay], apart: f64, least: f64, u: f64) -> String {
    let mut d = String::new();
    // Way since the last arrow; the first move has one.
    let mut since = f64::INFINITY;
    for w in stays.windows(2) {
        let move_mm = w[0].distance_mm(&w[1]);
        since += move_mm;
        if since >= apart && move_mm >= least {
            push_arrow(&mut d, w[0].place(), w[1].place(), u);
            since = 0.0;
        }
    }
    d
}

/// Arrows on a path that is drawn thin, and on a way on the fly.
const ARROWS: [f64; 2] = [60.0, 20.0];

/// The places where the stage stands, each with its blocks as a tooltip.
fn dots(job: &Layout<'_>, stays: &[Stay], u: f64, detail: Detail) -> Element {
    let mut stops = el("g", &[("id", "stage-stops"), ("fill", PATH)]);
    for (k, Stay { centre, blocks }) in stays.iter().enumerate() {
        let [x, y] = centre.mm();
        let dot = el("circle", &[("cx", &num(x)), ("cy", &num(-y)), ("r", &num(u * 0.2))]);
        let (first, last) = (job.id(blocks.start), job.id(blocks.end - 1));
        let title = format!("position {} of {}: {} blocks, {first} to {last}", k + 1, stays.len(), blocks.len());
        stops.append(if detail.full { titled(dot, title) } else { dot });
    }
    stops
}

/// A triangle in the middle of a move, pointing along it.
fn push_arrow(d: &mut String, a: [f64; 2], b: [f64; 2], u: f64) {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = math::hypot(dx, dy);
    let size = (length * 0.3).min(u * 1.0);
    let [ex, ey] = [dx / length * size, dy / length * size];
    let (x, y) = ((a[0] + b[0]) / 2.0 + ex / 2.0, (a[1] + b[1]) / 2.0 + ey / 2.0);
    let [lx, ly] = [-ex - ey * 0.45, -ey + ex * 0.45];
    let _ = write!(d, "M{} {}l{} {}l{} {}z", num(x), num(y), num(lx), num(ly), num(ey * 0.9), num(-ex * 0.9));
}

/// Start as a ring, end as a square.
fn ends(g: &mut Element, first: [f64; 2], last: [f64; 2], u: f64) {
    let width = num(u * 0.2);
    let line = [("fill", "none"), ("stroke", PATH), ("stroke-width", width.as_str())];
    let half = u * 0.95;
    let mut square = rectangle([last[0] - half, last[1] - half, last[0] + half, last[1] + half], &line);
    square.assign("id", "stage-end");
    g.append(square);
    let mut ring = el("circle", &[("cx", &num(first[0])), ("cy", &num(first[1])), ("r", &num(u * 0.8))]);
    line.iter().for_each(|&(k, v)| ring.assign(k, v));
    ring.assign("id", "stage-start");
    g.append(ring);
}

/// The usable field where the stage stands first.
pub(super) fn first_field(job: &Picture<'_>, sheet: &Sheet) -> Element {
    let mut g = layer("layer-field", "Field of the first stop", &[("pointer-events", "none"), ("fill", "none")]);
    let Some(&first) = job.places().first() else { return g };
    let u = sheet.unit;
    let [wide, narrow] = [0.4, 0.18].map(|v| num(u * v));
    let halo = [("stroke", "#fff"), ("stroke-opacity", ".7"), ("stroke-width", wide.as_str())];
    let line = [("stroke", FIELD), ("stroke-width", narrow.as_str())];
    let field = sheet_box(field_box(job.machine, first));
    g.append(rectangle(field, &halo));
    let mut frame = rectangle(field, &line);
    frame.assign("id", "field-frame");
    g.append(frame);
    if job.machine.lens.shape == FieldShape::Circle {
        let [x, y] = first.mm();
        let r = num(job.machine.field_reach());
        let mut c = el("circle", &[("cx", &num(x)), ("cy", &num(-y)), ("r", &r)]);
        line.iter().for_each(|&(k, v)| c.assign(k, v));
        g.append(c);
    }
    g
}

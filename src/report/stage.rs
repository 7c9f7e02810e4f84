//! Where the stage stands, on `layout.svg`: its path and the field of the first stop. The layers lie
//! over the blocks and under the numbers, half transparent, and let the pointer through to the blocks.

use std::fmt::Write;

use svg::Node;
use svg::node::element::Element;

use super::Layout;
use super::colour::{FIELD, PATH};
use super::sheet::{Detail, Sheet, caption, el, field_box, layer, num, rectangle, sheet_box, titled};
use crate::geom::{P2, Turn, mm_from_nm};
use crate::machine::FieldShape;

/// Share of the sheet that the line of the path covers at most: a path from window to window, with a move
/// for every block, becomes a hairline instead of a hairball.
const COVER: f64 = 0.03;

/// Where the stage stands, in machining order: stays at one place are one dot.
pub(super) fn path(job: &Layout<'_>, sheet: &Sheet, detail: Detail) -> Element {
    let u = sheet.unit;
    let mut g = layer("layer-stage-path", "Stage path", &[("opacity", ".7")]);
    let mut stays: Vec<(P2, std::ops::Range<usize>)> = Vec::new();
    for (i, block) in job.blocks().iter().enumerate() {
        let centre = Turn::drawn(block.stop.centre);
        match stays.last_mut() {
            Some((at, range)) if *at == centre => range.end = i + 1,
            _ => stays.push((centre, i..i + 1)),
        }
    }
    let at = |p: P2| [mm_from_nm(p.x), -mm_from_nm(p.y)];
    let mut d = String::new();
    for (k, (p, _)) in stays.iter().enumerate() {
        let [x, y] = at(*p);
        let _ = write!(d, "{}{} {}", if k == 0 { 'M' } else { 'L' }, num(x), num(y));
    }
    let length: f64 = stays.windows(2).map(|w| mm_from_nm(w[0].0.distance(w[1].0) as i64)).sum();
    let [x0, y0, x1, y1] = sheet.view;
    let full = u * 0.22;
    let width = (COVER * (x1 - x0) * (y1 - y0) / length.max(u)).clamp(full / 8.0, full);
    let is_thin = width < full / 2.0;
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
            ("d", &d),
        ],
    ));
    // An arrow on every move, or on moves far enough from each other.
    let (apart, mut since) = (if is_thin { length / ARROWS } else { 0.0 }, f64::INFINITY);
    let mut arrows = String::new();
    for w in stays.windows(2) {
        let move_mm = mm_from_nm(w[0].0.distance(w[1].0) as i64);
        since += move_mm;
        if since >= apart && (!is_thin || move_mm >= u) {
            push_arrow(&mut arrows, at(w[0].0), at(w[1].0), u);
            since = 0.0;
        }
    }
    g.append(el("path", &[("id", "stage-arrows"), ("fill", PATH), ("pointer-events", "none"), ("d", &arrows)]));
    if !is_thin {
        g.append(dots(job, &stays, u, detail));
    }
    if let (Some((first, _)), Some((last, _))) = (stays.first(), stays.last()) {
        ends(&mut g, at(*first), at(*last), u);
    }
    g
}

/// Arrows on a path that is drawn thin.
const ARROWS: f64 = 100.0;

/// The places where the stage stands, each telling its blocks.
fn dots(job: &Layout<'_>, stays: &[(P2, std::ops::Range<usize>)], u: f64, detail: Detail) -> Element {
    let mut stops = el("g", &[("id", "stage-stops"), ("fill", PATH)]);
    for (k, (p, range)) in stays.iter().enumerate() {
        let [x, y] = p.mm();
        let dot = el("circle", &[("cx", &num(x)), ("cy", &num(-y)), ("r", &num(u * 0.3))]);
        let (first, last) = (job.id(range.start), job.id(range.end - 1));
        let title = format!("position {} of {}: {} blocks, {first} to {last}", k + 1, stays.len(), range.len());
        stops.append(if detail.full { titled(dot, title) } else { dot });
    }
    stops
}

/// A triangle in the middle of a move, pointing along it.
fn push_arrow(d: &mut String, a: [f64; 2], b: [f64; 2], u: f64) {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = dx.hypot(dy);
    let size = (length * 0.3).min(u * 1.3);
    let [ex, ey] = [dx / length * size, dy / length * size];
    let (x, y) = ((a[0] + b[0]) / 2.0 + ex / 2.0, (a[1] + b[1]) / 2.0 + ey / 2.0);
    let [lx, ly] = [-ex - ey * 0.45, -ey + ex * 0.45];
    let _ = write!(d, "M{} {}l{} {}l{} {}z", num(x), num(y), num(lx), num(ly), num(ey * 0.9), num(-ex * 0.9));
}

/// Start as a ring, end as a square, each with its word.
fn ends(g: &mut Element, first: [f64; 2], last: [f64; 2], u: f64) {
    let width = num(u * 0.3);
    let line = [("fill", "none"), ("stroke", PATH), ("stroke-width", width.as_str())];
    let half = u * 0.95;
    let mut square = rectangle([last[0] - half, last[1] - half, last[0] + half, last[1] + half], &line);
    square.assign("id", "stage-end");
    g.append(square);
    let mut ring = el("circle", &[("cx", &num(first[0])), ("cy", &num(first[1])), ("r", &num(u * 0.8))]);
    line.iter().for_each(|&(k, v)| ring.assign(k, v));
    ring.assign("id", "stage-start");
    g.append(ring);
    for (at, word, down) in [(first, "start", -0.9), (last, "end", 2.0)] {
        g.append(caption([at[0] + u * 1.1, at[1] + u * down], u * 1.5, PATH, word));
    }
}

/// The usable field where the stage stands first.
pub(super) fn first_field(job: &Layout<'_>, sheet: &Sheet) -> Element {
    let mut g = layer("layer-field", "Field of the first stop", &[("pointer-events", "none")]);
    let Some(first) = job.blocks().first() else { return g };
    let u = sheet.unit;
    let width = num(u * 0.22);
    let line = [("fill", "none"), ("stroke", "#fff"), ("stroke-width", width.as_str())];
    let inner_width = num(u * 0.12);
    let inner = [("fill", "none"), ("stroke", FIELD), ("stroke-width", inner_width.as_str())];
    let field = sheet_box(field_box(job, first));
    g.append(rectangle(field, &line));
    let mut frame = rectangle(field, &inner);
    frame.assign("id", "field-frame");
    g.append(frame);
    let [w, h] = job.machine.usable_field();
    let mut words = format!("{} x {} mm field", num(w.mm()), num(h.mm()));
    if job.machine.lens.shape == FieldShape::Circle {
        let [fx, fy] = job.machine.lens.field.map(|f| f.as_mm() - 2.0 * job.machine.lens.margin.as_mm());
        let [x, y] = first.stop.centre.mm();
        let mut c = el("circle", &[("cx", &num(x)), ("cy", &num(-y)), ("r", &num(fx.min(fy) / 2.0))]);
        inner.iter().for_each(|&(k, v)| c.assign(k, v));
        g.append(c);
        words = format!("{} mm round field", num(fx.min(fy)));
    }
    let size = (u * 1.4).min((field[2] - field[0]) / words.chars().count() as f64 * 1.5);
    g.append(caption([field[0] + size * 0.5, field[1] + size * 1.25], size, FIELD, &words));
    g
}

//! Where the stage stands, on `layout.svg`: its path and the field of the first stop. The layers lie
//! over the blocks and under the numbers, half transparent, and let the pointer through to the blocks.

use std::fmt::Write;

use svg::Node;
use svg::node::element::Element;

use super::Layout;
use super::layout::{Detail, Sheet, caption, el, field_box, layer, num, rectangle, sheet_box, titled};
use crate::geom::{P2, mm_from_nm};
use crate::machine::FieldShape;
use crate::program::Program;

/// Colour of the stage path: far from every colour of the ramp, in hue and against its lightness.
pub(super) const PATH: &str = "#d5186b";

/// Colour of the field frame.
pub(super) const FIELD: &str = "#c2410c";

/// Where the stage stands, in machining order: stays at one place are one dot.
pub(super) fn path(job: &Layout<'_>, sheet: &Sheet, detail: Detail) -> Element {
    let u = sheet.unit;
    let mut g = layer("layer-stage-path", "Stage path", &[("opacity", ".7")]);
    let blocks = job.blocks();
    let mut stays: Vec<(P2, std::ops::Range<usize>)> = Vec::new();
    for (i, block) in blocks.iter().enumerate() {
        match stays.last_mut() {
            Some((at, range)) if *at == block.stop.centre => range.end = i + 1,
            _ => stays.push((block.stop.centre, i..i + 1)),
        }
    }
    let at = |p: P2| [mm_from_nm(p.x), -mm_from_nm(p.y)];
    let (mut d, mut arrows) = (String::new(), String::new());
    for (k, (p, _)) in stays.iter().enumerate() {
        let [x, y] = at(*p);
        let _ = write!(d, "{}{} {}", if k == 0 { 'M' } else { 'L' }, num(x), num(y));
    }
    for w in stays.windows(2) {
        push_arrow(&mut arrows, at(w[0].0), at(w[1].0), u);
    }
    let width = num(u * 0.22);
    g.append(el(
        "path",
        &[
            ("id", "stage-line"),
            ("fill", "none"),
            ("stroke", PATH),
            ("stroke-width", &width),
            ("stroke-linejoin", "round"),
            ("pointer-events", "none"),
            ("d", &d),
        ],
    ));
    g.append(el("path", &[("id", "stage-arrows"), ("fill", PATH), ("pointer-events", "none"), ("d", &arrows)]));
    let mut stops = el("g", &[("id", "stage-stops"), ("fill", PATH)]);
    for (k, (p, range)) in stays.iter().enumerate() {
        let [x, y] = at(*p);
        let dot = el("circle", &[("cx", &num(x)), ("cy", &num(y)), ("r", &num(u * 0.3))]);
        let (first, last) = (Program::block_id(range.start), Program::block_id(range.end - 1));
        let title = format!("position {} of {}: {} blocks, {first} to {last}", k + 1, stays.len(), range.len());
        stops.append(if detail.full { titled(dot, title) } else { dot });
    }
    g.append(stops);
    if let (Some((first, _)), Some((last, _))) = (stays.first(), stays.last()) {
        ends(&mut g, at(*first), at(*last), u);
    }
    g
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
    let mut words = format!("{} x {} mm field", num(mm_from_nm(w)), num(mm_from_nm(h)));
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

//! Where the stage stands, on `layout.svg`: its path and the field of the first stop; on the fly, the way of the
//! field's centre. The layers lie over the blocks and under the numbers, half transparent, and let the pointer through
//! to the blocks.

use std::fmt::Write;

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

/// Where the stage stands, in machining order, or on the fly its way: stays at one place are one dot.
pub(super) fn path(job: &Picture<'_>, sheet: &Sheet, detail: Detail) -> Element {
    let u = sheet.unit;
    let mut g = layer("layer-stage-path", "Stage path", &[("opacity", ".75")]);
    let mut stays: Vec<(P2, std::ops::Range<usize>)> = Vec::new();
    for (i, centre) in job.places().into_iter().enumerate() {
        match stays.last_mut() {
            Some((at, range)) if *at == centre => range.end = i + 1,
            _ => stays.push((centre, i..i + 1)),
        }
    }
    let stepped = job.stepped();
    if stepped.is_none() {
        let points: Vec<[f64; 2]> = stays.iter().map(|(p, _)| p.mm()).collect();
        let (mut keep, mut spans) = (Vec::new(), Vec::new());
        thin(&points, NEAR * 100.0 * u, &mut keep, &mut spans);
        let mut kept = keep.iter();
        stays.retain(|_| kept.next().is_some_and(|k| *k));
    }
    let at = |p: P2| [mm_from_nm(p.x), -mm_from_nm(p.y)];
    let mut d = String::new();
    let mut last = [0; 2];
    for (k, (p, _)) in stays.iter().enumerate() {
        let to = at(*p).map(|v| sheet.step_mm(v));
        push_command(&mut d, if k == 0 { 'M' } else { 'l' }, &[to[0] - last[0], to[1] - last[1]], sheet.decimals);
        last = to;
    }
    let length: f64 = stays.windows(2).map(|w| mm_from_nm(w[0].0.distance(w[1].0) as i64)).sum();
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
            ("d", &d),
        ],
    ));
    // An arrow on every move, or on moves far enough from each other.
    let (apart, mut since) =
        (if is_thin { length / ARROWS[usize::from(stepped.is_none())] } else { 0.0 }, f64::INFINITY);
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
    if let Some(layout) = stepped.filter(|_| !is_thin) {
        g.append(dots(layout, &stays, u, detail));
    }
    if let (Some((first, _)), Some((last, _))) = (stays.first(), stays.last()) {
        ends(&mut g, at(*first), at(*last), u);
    }
    g
}

/// Arrows on a path that is drawn thin, and on a way on the fly.
const ARROWS: [f64; 2] = [60.0, 20.0];

/// The places where the stage stands, each telling its blocks.
fn dots(job: &Layout<'_>, stays: &[(P2, std::ops::Range<usize>)], u: f64, detail: Detail) -> Element {
    let mut stops = el("g", &[("id", "stage-stops"), ("fill", PATH)]);
    for (k, (p, range)) in stays.iter().enumerate() {
        let [x, y] = p.mm();
        let dot = el("circle", &[("cx", &num(x)), ("cy", &num(-y)), ("r", &num(u * 0.2))]);
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

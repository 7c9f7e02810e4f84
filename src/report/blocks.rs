//! The blocks on `layout.svg`: coloured regions with their tooltips, their numbers and, where windows lie
//! freely, the window of the block under the pointer.

use svg::Node;
use svg::node::element::Element;

use super::outline::{self, Half, Outlines, Ring};
use super::sheet::{Detail, Sheet, caption, el, field_box, layer, num, rectangle, sheet_box, titled};
use super::{Layout, Shade, colour, label, mm, plain};
use crate::geom::{Nm, P2};
use crate::program::Block;

/// Width of block borders: thin against the blocks, so that the narrowest bands stay coloured.
fn border(job: &Layout<'_>, sheet: &Sheet) -> f64 {
    let cells = job.map.labels().iter().filter(|&&l| l != 0).count() as f64;
    let side = (cells / job.blocks().len().max(1) as f64).sqrt() * job.map.cell().mm();
    (side / 60.0).clamp(sheet.unit / 100.0, sheet.unit / 12.0)
}

/// The colours of the blocks: focus height or incidence on the ramp; with heights every other level or, where windows
/// lie freely and their levels are not numbered by height, every other block a shade darker.
fn fills(job: &Layout<'_>, sheet: &Sheet) -> Vec<colour::Colour> {
    let range = job.shades();
    let is_odd = |i: usize, block: &Block| {
        if sheet.gridded { block.stop.level.rem_euclid(2) == 1 } else { i % 2 == 1 }
    };
    let fill = |(i, block): (usize, &Block)| {
        let c = colour::of_height(job.shade_of(i), range);
        if job.shade == Shade::Height && is_odd(i, block) { colour::shaded(c) } else { c }
    };
    job.blocks().iter().enumerate().map(fill).collect()
}

/// The blocks as filled regions; those without a cell of the map as dots where their marks lie.
pub(super) fn regions(job: &Layout<'_>, sheet: &Sheet, outlines: &Outlines, detail: Detail) -> Element {
    let width = num(border(job, sheet));
    let mut g = layer(
        "layer-blocks",
        "Blocks",
        &[("stroke", "#1a1a1a"), ("stroke-width", &width), ("stroke-linejoin", "round"), ("fill-rule", "evenodd")],
    );
    let fills = fills(job, sheet);
    let mut rings = outlines.rings.as_slice();
    let mut points = Vec::new();
    for (i, block) in job.blocks().iter().enumerate() {
        let own = rings.iter().take_while(|r| r.block as usize == i).count();
        let mut d = String::new();
        let area2 = |r: &Ring| outline::area2(outlines.corners_of(r).iter().map(|c| c.at)).abs();
        let largest = (0..own).max_by_key(|&k| area2(&rings[k]));
        for (k, ring) in rings[..own].iter().enumerate() {
            if Some(k) != largest && !detail.shows(area2(ring)) {
                continue;
            }
            outline::simplify(outlines.corners_of(ring), detail.tolerance, &mut points);
            push_ring(&mut d, job, sheet, &points);
        }
        rings = &rings[own..];
        let mut e = if own > 0 { el("path", &[("d", &d)]) } else { dot(job, sheet, block) };
        e.assign("id", format!("block-{}", job.id(i)));
        e.assign("fill", colour::hex(fills[i]));
        g.append(if sheet.gridded { titled(e, tooltip(job, sheet, i, block, detail)) } else { e });
    }
    g
}

/// Where windows lie freely: over every block a copy of it that the pointer meets; it shows while the
/// pointer rests on it, above all other blocks and with the window of its stop. Nothing of it is seen on paper.
pub(super) fn windows(job: &Layout<'_>, sheet: &Sheet, detail: Detail) -> Element {
    let [line, frame_line] = [0.08, 0.2].map(|v| num(sheet.unit * v));
    let mut g = layer(
        "layer-windows",
        "Windows",
        &[
            ("visibility", "hidden"),
            ("pointer-events", "all"),
            ("stroke", "#1a1a1a"),
            ("stroke-width", &line),
            ("fill-rule", "evenodd"),
        ],
    );
    let Some(first) = job.blocks().first() else { return g };
    // The window is drawn once, around the origin of the drawing.
    let [x0, y0, x1, y1] = sheet_box(field_box(job, first));
    let [w, h] = [x1 - x0, y1 - y0];
    let frame = [
        ("id", "window"),
        ("fill", "none"),
        ("stroke", colour::FIELD),
        ("stroke-width", frame_line.as_str()),
        ("pointer-events", "none"),
    ];
    let mut defs = Element::new("defs");
    defs.append(rectangle([-w / 2.0, -h / 2.0, w / 2.0, h / 2.0], &frame));
    g.append(defs);
    for (i, block) in job.blocks().iter().enumerate() {
        let [x, y] = block.stop.centre.mm();
        let mut pair = Element::new("g");
        pair.append(el("use", &[("href", &format!("#block-{}", job.id(i)))]));
        pair.append(el("use", &[("href", "#window"), ("x", &num(x)), ("y", &num(-y))]));
        g.append(titled(pair, tooltip(job, sheet, i, block, detail)));
    }
    g
}

/// Appends a closed ring in absolute start and relative steps.
fn push_ring(d: &mut String, job: &Layout<'_>, sheet: &Sheet, points: &[Half]) {
    let cell = job.map.cell().f64();
    // The grid has a rim of one cell, two halves.
    let at = |half: i32, origin: i64| origin as f64 + f64::from(half - 2) * cell / 2.0;
    let step = |p: &Half| [sheet.step(at(p[0], job.map.bounds().lo.x)), -sheet.step(at(p[1], job.map.bounds().lo.y))];
    let mut last = [0, 0];
    for (k, p) in points.iter().map(step).enumerate() {
        let [dx, dy] = [p[0] - last[0], p[1] - last[1]];
        match (k, dx, dy) {
            (0, ..) => push_command(d, 'M', &[dx, dy], sheet.decimals),
            (_, 0, 0) => {}
            (_, _, 0) => push_command(d, 'h', &[dx], sheet.decimals),
            (_, 0, _) => push_command(d, 'v', &[dy], sheet.decimals),
            _ => push_command(d, 'l', &[dx, dy], sheet.decimals),
        }
        last = p;
    }
    d.push('z');
}

/// A path command with as few characters as possible.
pub(super) fn push_command(d: &mut String, command: char, values: &[i64], decimals: usize) {
    d.push(command);
    let scale = 10i64.pow(decimals as u32);
    for (k, &v) in values.iter().enumerate() {
        if k > 0 && v >= 0 {
            d.push(' ');
        }
        if v < 0 {
            d.push('-');
        }
        let (whole, part) = (v.abs() / scale, v.abs() % scale);
        let mut text = if whole > 0 || part == 0 { whole.to_string() } else { String::new() };
        if part > 0 {
            let digits = format!("{part:0decimals$}");
            text = format!("{text}.{}", digits.trim_end_matches('0'));
        }
        d.push_str(&text);
    }
}

/// The middle of the points of a block's marks, in mm of the drawing.
fn middle_of_marks(job: &Layout<'_>, block: &Block) -> [f64; 2] {
    let program = job.checked.program();
    let (mut sum, mut count) = ([0i64; 2], 0i64);
    for p in program.strokes_of(block).iter().flat_map(|s| program.points_of(s)) {
        sum = [sum[0] + i64::from(p.x), sum[1] + i64::from(p.y)];
        count += 1;
    }
    let c = block.stop.centre;
    let [x, y] = <P2>::new(c.x + sum[0] / count.max(1), c.y + sum[1] / count.max(1)).mm();
    [x, -y]
}

/// Radius of the dot that stands for a block too small for the map.
fn dot_radius(job: &Layout<'_>, sheet: &Sheet) -> f64 {
    (sheet.unit * 0.12).max(job.map.cell().mm())
}

fn dot(job: &Layout<'_>, sheet: &Sheet, block: &Block) -> Element {
    let [x, y] = middle_of_marks(job, block);
    let r = dot_radius(job, sheet);
    el("circle", &[("cx", &num(x)), ("cy", &num(y)), ("r", &num(r)), ("class", "sliver")])
}

/// What a pointer resting on a block shows.
fn tooltip(job: &Layout<'_>, sheet: &Sheet, i: usize, block: &Block, detail: Detail) -> String {
    let (id, s) = (job.id(i), &block.stop);
    if !detail.full {
        return format!("{id} z {}", mm(s.focus, 3));
    }
    let program = job.checked.program();
    let [x, y, z] = block.stage.0.map(|v| mm(Nm(v), 4));
    let zoom = job
        .machine
        .zoom
        .as_ref()
        .map_or_else(String::new, |_| format!(", focus shift {} mm", mm(block.focus_shift, 4)));
    let place = if sheet.gridded {
        format!("section {},{} level {}", s.section.0[0], s.section.0[1], s.level)
    } else {
        format!("window at x {} y {} mm", mm(Nm(s.centre.x), 3), mm(Nm(s.centre.y), 3))
    };
    format!(
        "{id}: {place}\nfocus (LPFL) {} mm, marks {} to {} mm\nstage x {x} y {y} z {z} mm{zoom}\n\
         {} strokes, mark {} mm, jump {} mm, {} s",
        mm(s.focus, 4),
        mm(block.z_lo, 4),
        mm(block.z_hi, 4),
        block.strokes.len(),
        plain(program.mark_mm(block), 2),
        plain(program.jump_mm(block), 2),
        plain(job.figures(i).time_s, 2),
    )
}

/// The numbers of the blocks: number n is block Bn.
pub(super) fn numbers(job: &Layout<'_>, sheet: &Sheet, spots: &[label::Spot]) -> Element {
    let mut g = layer(
        "layer-numbers",
        "Block numbers",
        &[("text-anchor", "middle"), ("fill", "#111"), ("pointer-events", "none")],
    );
    let fills = fills(job, sheet);
    let cell = job.map.cell().mm();
    let [ox, oy] = job.map.bounds().lo.mm();
    for spot in spots {
        let Some(&fill) = fills.get(spot.block as usize) else { continue };
        let font = spot.font * cell;
        let (x, y) = (ox + (spot.at[0] - 1.0) * cell, -(oy + (spot.at[1] - 1.0) * cell));
        // The base line lies 0.36 of the font below the middle, along the turned text.
        let (sin, cos) = f64::from(-spot.turn).to_radians().sin_cos();
        let [x, y] = [x - 0.36 * font * sin, y + 0.36 * font * cos].map(|v| plain(v, sheet.decimals));
        let mut t = el("text", &[("x", &x), ("y", &y), ("font-size", &num(font))]);
        if spot.turn != 0 {
            t.assign("transform", format!("rotate({} {x} {y})", -spot.turn));
        }
        if colour::is_dark(fill) {
            t.assign("class", "w");
        }
        t.append(svg::node::Text::new((job.blocks.start + spot.block as usize + 1).to_string()));
        g.append(t);
    }
    // Dots are numbered next to them; the spots are sorted by block.
    let r = dot_radius(job, sheet);
    for (i, block) in job.blocks().iter().enumerate() {
        if spots.binary_search_by_key(&i, |s| s.block as usize).is_err() {
            let [x, y] = middle_of_marks(job, block);
            g.append(caption([x + 1.3 * r, y - 1.3 * r], 2.0 * r, "#111", &(job.blocks.start + i + 1).to_string()));
        }
    }
    g
}

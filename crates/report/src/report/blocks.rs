//! The blocks on `layout.svg`: coloured regions with their tooltips, their numbers and, where windows lie
//! freely, the window of the block under the pointer.

use svg::Node;
use svg::node::element::Element;
use terrace_core::math;

use super::outline::{self, Outlines, Ring};
use super::sheet::{Detail, LEAST_FONT, Sheet, el, field_box, layer, num, rectangle, sheet_box, titled};
use super::{Layout, Shade, colour, label, mm, plain};
use terrace_core::geom::{Nm, P2, Turn};
use terrace_core::program::Block;

/// Width of block borders: thin against the blocks, so that the narrowest bands stay coloured.
fn border(job: &Layout<'_>, sheet: &Sheet) -> f64 {
    let cells = job.map.labels().iter().filter(|&&l| l != 0).count() as f64;
    let side = (cells / job.blocks().len().max(1) as f64).sqrt() * job.map.cell().mm();
    (side / 60.0).clamp(sheet.unit / 60.0, sheet.unit / 10.0)
}

/// The colours of the blocks: focus height or incidence on the ramp, light enough for marks and numbers to be seen on
/// them; with heights every other level or, where windows lie freely and their levels are not numbered by height, every
/// other block a shade darker.
fn fills(job: &Layout<'_>, sheet: &Sheet) -> Vec<colour::Colour> {
    let range = job.shades();
    let fill = |i: usize| {
        let c = colour::light(colour::of_height(job.shade_of(i), range));
        if is_darker(job, sheet, i) { colour::shaded(c) } else { c }
    };
    (0..job.blocks().len()).map(fill).collect()
}

/// Whether block `i` is a shade darker than its neighbours.
fn is_darker(job: &Layout<'_>, sheet: &Sheet, i: usize) -> bool {
    let is_odd = if sheet.gridded { job.blocks()[i].stop.level.rem_euclid(2) == 1 } else { i % 2 == 1 };
    job.shade == Shade::Height && is_odd
}

/// The blocks as filled regions; those without a cell of the map as dots where their marks lie.
pub(super) fn regions(job: &Layout<'_>, sheet: &Sheet, outlines: &Outlines, detail: Detail) -> Element {
    let width = num(border(job, sheet));
    let mut g = layer(
        "layer-blocks",
        "Blocks",
        &[("stroke", colour::BORDER), ("stroke-width", &width), ("stroke-linejoin", "round"), ("fill-rule", "evenodd")],
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
            outline::push_ring(&mut d, sheet, job.map.bounds().lo, job.map.cell(), &points);
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
    let [x0, y0, x1, y1] = sheet_box(field_box(job.machine, Turn::drawn(first.stop.centre)));
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

/// The middle of the points of a block's marks, in mm of the drawing.
fn middle_of_marks(job: &Layout<'_>, block: &Block) -> [f64; 2] {
    let program = job.checked.program();
    let mut sum = [0i64; 2];
    let mut count = 0i64;
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
        return format!("{id} z {}", mm(s.lpfl, 3));
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
        mm(s.lpfl, 4),
        mm(block.z_lo, 4),
        mm(block.z_hi, 4),
        block.strokes.len(),
        plain(program.mark_mm(block), 2),
        plain(program.jump_mm(block), 2),
        plain(job.figures(i).time_s, 2),
    )
}

/// Sizes of numbers: class, the least size in units of the sheet, and how wide the sheet must be, px, for 7 px of it.
/// A browser shows a class from that width on; what takes no notice of widths shows the first alone.
pub(super) const TIERS: [(&str, f64, u32); 6] = [
    ("n0", LEAST_FONT, 480),
    ("n1", 0.875, 800),
    ("n2", 0.59, 1200),
    ("n3", 0.4375, 1600),
    ("n4", 0.292, 2400),
    ("n5", 0.175, 4000),
];

/// The numbers of the blocks, by their sizes: number n is block Bn. A number that is not 7 px high where the sheet is
/// 4,000 px wide is left out.
pub(super) fn numbers(job: &Layout<'_>, sheet: &Sheet, spots: &[label::Spot]) -> Element {
    let mut g = layer(
        "layer-numbers",
        "Block numbers",
        &[
            ("text-anchor", "middle"),
            ("fill", "#111"),
            ("stroke", "#fff"),
            ("stroke-opacity", ".75"),
            ("stroke-linejoin", "round"),
            ("paint-order", "stroke"),
            ("pointer-events", "none"),
        ],
    );
    let cell = job.map.cell().mm();
    let [ox, oy] = job.map.bounds().lo.mm();
    let mut most = f64::INFINITY;
    for (class, least, _) in TIERS {
        let size = |spot: &&label::Spot| (least..most).contains(&(spot.font * cell / sheet.unit));
        let rim = num(0.2 * least * sheet.unit);
        let mut tier = el("g", &[("class", class), ("stroke-width", &rim)]);
        for spot in spots.iter().filter(size) {
            let font = spot.font * cell;
            let (x, y) = (ox + (spot.at[0] - 1.0) * cell, -(oy + (spot.at[1] - 1.0) * cell));
            // The base line lies 0.36 of the font below the middle, along the turned text.
            let (sin, cos) = math::sin_cos(f64::from(-spot.turn).to_radians());
            let [x, y] = [x - 0.36 * font * sin, y + 0.36 * font * cos].map(|v| plain(v, sheet.decimals));
            let mut t = el("text", &[("x", &x), ("y", &y), ("font-size", &num(font))]);
            if spot.turn != 0 {
                t.assign("transform", format!("rotate({} {x} {y})", -spot.turn));
            }
            t.append(svg::node::Text::new((job.blocks.start + spot.block as usize + 1).to_string()));
            tier.append(t);
        }
        g.append(tier);
        most = least;
    }
    g
}

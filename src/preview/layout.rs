//! `layout.svg`: the blocks on the part, in mm, y up.
//!
//! Consumes a [`Layout`], promises the properties of [`super`]. Layers, bottom to top, each a group
//! with an id and a name that Inkscape shows: texture box, blocks, sections, stage path, field of the
//! first stop, axes and scale, numbers, legend.
//!
//! Size: at most [`LIMIT`] bytes wherever that can be had. A drawing that would be larger is made
//! again with a coarser tolerance and, where that does not help, with short tooltips (see
//! [`DETAILS`]). The coarsest takes about 220 bytes a block, so beyond some 20,000 blocks the file is
//! larger than the limit.

use std::fmt::Write;

use svg::Node;
use svg::node::element::Element;

use super::outline::{self, Grid, Half, Outlines, Ring};
use super::{Layout, clean, colour, label, mm, plain};
use super::{legend, stage};
use crate::geom::{Box2, NM_PER_MM, P2, mm_from_nm};
use crate::program::{Block, Program};

/// Bytes that a drawing should not exceed.
pub(super) const LIMIT: usize = 5_000_000;

/// How much is drawn: tolerance of block borders in cells, and whether tooltips tell everything.
#[derive(Clone, Copy)]
pub(super) struct Detail {
    tolerance: f64,
    pub full: bool,
}

impl Detail {
    /// Whether a ring of this area (twice, in cells) is drawn: a coarse drawing leaves out the specks
    /// and holes below its tolerance, though never the largest ring of a block.
    fn shows(self, area2: i64) -> bool {
        self.tolerance <= 0.5 || area2 as f64 >= 2.0 * self.tolerance * self.tolerance
    }
}

/// Tried in turn until the drawing fits.
const DETAILS: [Detail; 7] = [
    Detail { tolerance: 0.5, full: true },
    Detail { tolerance: 1.0, full: true },
    Detail { tolerance: 2.0, full: true },
    Detail { tolerance: 4.0, full: true },
    Detail { tolerance: 1.0, full: false },
    Detail { tolerance: 4.0, full: false },
    Detail { tolerance: 16.0, full: false },
];

/// The layout as the text of an SVG file.
pub fn layout_svg(job: &Layout<'_>) -> String {
    within(job, LIMIT)
}

/// The layout in at most `limit` bytes, or as few as there can be.
pub(super) fn within(job: &Layout<'_>, limit: usize) -> String {
    let grid = Grid::of(job.map, job.blocks().len());
    let sheet = Sheet::of(job);
    let outlines = outline::trace(&grid);
    let spots = label::place(&grid, 2.6 * sheet.unit / mm_from_nm(job.map.cell()));
    let mut text = String::new();
    for detail in DETAILS {
        text = draw(job, &sheet, &outlines, &spots, detail);
        if text.len() <= limit {
            break;
        }
    }
    text
}

/// Where everything lies, in mm of the drawing: x as on the part, y negated.
pub(super) struct Sheet {
    /// The part of the drawing that shows the part: left, top, right, bottom.
    pub view: [f64; 4],
    /// The measure of captions and lines: a hundredth of the part's size.
    pub unit: f64,
    /// Places of nanometres in a coordinate: 10^decimals per mm.
    decimals: usize,
}

impl Sheet {
    fn of(job: &Layout<'_>) -> Self {
        let mut all = job.texture.union(grid_box(job)).union(job.map.bounds());
        if let Some(first) = job.blocks().first() {
            all = all.union(field_box(job, first));
        }
        job.blocks().iter().for_each(|b| all.add(b.stop.centre));
        let [w, h] = all.size().map(mm_from_nm);
        let unit = ((w * h).sqrt() / 100.0).max(w / 260.0).max(h / 400.0);
        // A coordinate keeps a twentieth of a cell: 0.01 mm at the usual cells of 0.25 mm.
        let decimals = match job.map.cell() {
            200_000.. => 2,
            20_000.. => 3,
            _ => 4,
        };
        let ([x0, y0], [x1, y1]) = (all.lo.mm(), all.hi.mm());
        Self { view: [x0, -y1, x1, -y0], unit, decimals }
    }

    /// nm to steps of the last place.
    fn step(&self, nm: f64) -> i64 {
        (nm / NM_PER_MM * 10f64.powi(self.decimals as i32)).round() as i64
    }
}

/// The grid of sections as a box.
fn grid_box(job: &Layout<'_>) -> Box2 {
    let s = job.sections;
    let end = |o: i64, k: usize| o + s.pitch[k] * i64::from(s.count[k]);
    Box2 { lo: s.origin, hi: P2::new(end(s.origin.x, 0), end(s.origin.y, 1)) }
}

/// The usable field at a block's stop.
pub(super) fn field_box(job: &Layout<'_>, block: &Block) -> Box2 {
    let [w, h] = job.machine.usable_field();
    let c = block.stop.centre;
    Box2 { lo: P2::new(c.x - w / 2, c.y - h / 2), hi: P2::new(c.x + w / 2, c.y + h / 2) }
}

/// An element of the drawing.
pub(super) fn el(name: &str, attributes: &[(&str, &str)]) -> Element {
    let mut e = Element::new(name);
    for &(key, value) in attributes {
        e.assign(key, value);
    }
    e
}

/// A group that Inkscape shows as a layer.
pub(super) fn layer(id: &str, name: &str, attributes: &[(&str, &str)]) -> Element {
    let mut g = el("g", &[("id", id), ("inkscape:groupmode", "layer"), ("inkscape:label", name)]);
    attributes.iter().for_each(|&(k, v)| g.assign(k, v));
    g
}

/// A coordinate in mm of the drawing.
pub(super) fn num(v: f64) -> String {
    let text = plain(v, 3);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Text at a point: `anchor` is start, middle or end.
pub(super) fn text(at: [f64; 2], size: f64, anchor: &str, content: &str) -> Element {
    let mut t = el("text", &[("x", &num(at[0])), ("y", &num(at[1])), ("font-size", &num(size))]);
    if anchor != "start" {
        t.assign("text-anchor", anchor);
    }
    t.append(svg::node::Text::new(clean(content)));
    t
}

/// A rectangle: left, top, right, bottom.
pub(super) fn rectangle([x0, y0, x1, y1]: [f64; 4], attributes: &[(&str, &str)]) -> Element {
    let mut r = el("rect", &[("x", &num(x0)), ("y", &num(y0)), ("width", &num(x1 - x0)), ("height", &num(y1 - y0))]);
    attributes.iter().for_each(|&(k, v)| r.assign(k, v));
    r
}

/// The element with a tooltip.
pub(super) fn titled(mut e: Element, title: String) -> Element {
    let mut t = Element::new("title");
    t.append(svg::node::Text::new(title));
    e.append(t);
    e
}

pub(super) fn sheet_box(b: Box2) -> [f64; 4] {
    let ([x0, y0], [x1, y1]) = (b.lo.mm(), b.hi.mm());
    [x0, -y1, x1, -y0]
}

/// Words on the blocks, told from them by a white rim.
pub(super) fn caption(at: [f64; 2], size: f64, fill: &str, words: &str) -> Element {
    let mut t = text(at, size, "start", words);
    t.assign("class", "halo");
    t.assign("fill", fill);
    t.assign("stroke-width", num(size * 0.2));
    t
}

fn draw(job: &Layout<'_>, sheet: &Sheet, outlines: &Outlines, spots: &[label::Spot], detail: Detail) -> String {
    let u = sheet.unit;
    let mut layers = vec![
        texture_box(job, sheet),
        blocks(job, sheet, outlines, detail),
        sections(job, sheet),
        stage::path(job, sheet, detail),
        stage::first_field(job, sheet),
        legend::measures(job, sheet),
        numbers(job, sheet, spots),
    ];
    let (legend, bounds) = legend::draw(job, sheet);
    layers.push(legend);
    let [x0, y0, x1, y1] = [bounds[0] - 2.0 * u, bounds[1] - 2.0 * u, bounds[2] + 2.0 * u, bounds[3] + 2.0 * u];
    let (width, height) = (num(x1 - x0), num(y1 - y0));
    let mut root = el(
        "svg",
        &[
            ("xmlns", "http://www.w3.org/2000/svg"),
            ("xmlns:inkscape", "http://www.inkscape.org/namespaces/inkscape"),
            ("width", &format!("{width}mm")),
            ("height", &format!("{height}mm")),
            ("viewBox", &format!("{} {} {width} {height}", num(x0), num(y0))),
        ],
    );
    root = titled(root, format!("Block layout of {}", clean(job.job)));
    let mut style = Element::new("style");
    style.append(svg::node::Text::new(style_text(u)));
    root.append(style);
    root.append(rectangle([x0, y0, x1, y1], &[("id", "paper"), ("fill", "#fff")]));
    layers.into_iter().for_each(|l| root.append(l));
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{root}\n")
}

fn style_text(u: f64) -> String {
    format!(
        "text{{font-family:Arial,\"Liberation Sans\",\"DejaVu Sans\",sans-serif;text-rendering:geometricPrecision}}\
         .w{{fill:#fff}}.halo{{paint-order:stroke;stroke:#fff;stroke-linejoin:round}}\
         #layer-blocks :hover{{stroke-width:{}}}",
        num(u * 0.3)
    )
}

/// Width of block borders: thin against the blocks, so that the narrowest bands stay coloured.
fn border(job: &Layout<'_>, sheet: &Sheet) -> f64 {
    let cells = job.map.labels().iter().filter(|&&l| l != 0).count() as f64;
    let side = (cells / job.blocks().len().max(1) as f64).sqrt() * mm_from_nm(job.map.cell());
    (side / 60.0).clamp(sheet.unit / 100.0, sheet.unit / 12.0)
}

/// The colour of a block: its focus height on the ramp, every other level a shade darker.
fn fill_of(block: &Block, range: [i64; 2]) -> colour::Colour {
    let c = colour::of_height(block.stop.focus, range);
    if block.stop.level.rem_euclid(2) == 1 { colour::shaded(c) } else { c }
}

/// The blocks as filled regions; those without a cell of the map as dots where their marks lie.
fn blocks(job: &Layout<'_>, sheet: &Sheet, outlines: &Outlines, detail: Detail) -> Element {
    let width = num(border(job, sheet));
    let mut g = layer(
        "layer-blocks",
        "Blocks",
        &[("stroke", "#1a1a1a"), ("stroke-width", &width), ("stroke-linejoin", "round"), ("fill-rule", "evenodd")],
    );
    let range = job.range(|b| b.stop.focus, |b| b.stop.focus);
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
        e.assign("id", format!("block-{}", Program::block_id(i)));
        e.assign("fill", colour::hex(fill_of(block, range)));
        g.append(titled(e, tooltip(job, i, block, detail)));
    }
    g
}

/// Appends a closed ring in absolute start and relative steps.
fn push_ring(d: &mut String, job: &Layout<'_>, sheet: &Sheet, points: &[Half]) {
    let cell = job.map.cell() as f64;
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
fn push_command(d: &mut String, command: char, values: &[i64], decimals: usize) {
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
        sum = [sum[0] + i64::from(p[0]), sum[1] + i64::from(p[1])];
        count += 1;
    }
    let c = block.stop.centre;
    let [x, y] = P2::new(c.x + sum[0] / count.max(1), c.y + sum[1] / count.max(1)).mm();
    [x, -y]
}

/// Radius of the dot that stands for a block too small for the map.
fn dot_radius(job: &Layout<'_>, sheet: &Sheet) -> f64 {
    (sheet.unit * 0.12).max(mm_from_nm(job.map.cell()))
}

fn dot(job: &Layout<'_>, sheet: &Sheet, block: &Block) -> Element {
    let [x, y] = middle_of_marks(job, block);
    let r = dot_radius(job, sheet);
    el("circle", &[("cx", &num(x)), ("cy", &num(y)), ("r", &num(r)), ("class", "sliver")])
}

/// What a pointer resting on a block shows.
fn tooltip(job: &Layout<'_>, i: usize, block: &Block, detail: Detail) -> String {
    let (id, s) = (Program::block_id(i), &block.stop);
    if !detail.full {
        return format!("{id} z {}", mm(s.focus, 3));
    }
    let program = job.checked.program();
    let [x, y, z] = block.stage.map(|v| mm(v, 4));
    format!(
        "{id}: section {},{} level {}\nfocus (LPFL) {} mm, marks {} to {} mm\nstage x {x} y {y} z {z} mm\n\
         {} strokes, mark {} mm, jump {} mm, {} s",
        s.section[0],
        s.section[1],
        s.level,
        mm(s.focus, 4),
        mm(block.z_lo, 4),
        mm(block.z_hi, 4),
        block.strokes.len(),
        plain(program.mark_mm(block), 2),
        plain(program.jump_mm(block), 2),
        plain(job.block_s(i), 2),
    )
}

/// Dashed section lines with the numbers of columns below and of rows at the left.
fn sections(job: &Layout<'_>, sheet: &Sheet) -> Element {
    let (u, s) = (sheet.unit, job.sections);
    let (width, dash) = (num(u * 0.14), format!("{} {}", num(u * 0.9), num(u * 0.5)));
    let mut g = layer("layer-sections", "Sections", &[("pointer-events", "none")]);
    let [x0, y0, x1, y1] = sheet_box(grid_box(job));
    let at = |o: f64, pitch: i64, k: f64| o + mm_from_nm(pitch) * k;
    let mut d = String::new();
    for k in 0..=s.count[0] {
        let _ = write!(d, "M{} {}V{}", num(at(x0, s.pitch[0], k.into())), num(y1), num(y0));
    }
    for k in 0..=s.count[1] {
        let _ = write!(d, "M{} {}H{}", num(x0), num(at(y1, -s.pitch[1], k.into())), num(x1));
    }
    let lines = [("fill", "none"), ("stroke", "#000"), ("stroke-opacity", ".75"), ("stroke-width", width.as_str())];
    let mut path = el("path", &lines);
    path.assign("stroke-dasharray", dash);
    path.assign("d", d);
    g.append(path);
    let mut captions = el("g", &[("id", "section-captions"), ("fill", "#444")]);
    let size = |pitch: i64| (mm_from_nm(pitch) * 0.35).clamp(u * 0.5, u * 1.5);
    for k in 0..s.count[0] {
        let x = at(x0, s.pitch[0], f64::from(k) + 0.5);
        captions.append(text([x, sheet.view[3] + u * 1.9], size(s.pitch[0]), "middle", &format!("{k}")));
    }
    for k in 0..s.count[1] {
        let (y, size) = (at(y1, -s.pitch[1], f64::from(k) + 0.5), size(s.pitch[1]));
        captions.append(text([sheet.view[0] - u, y + size * 0.36], size, "end", &format!("{k}")));
    }
    g.append(captions);
    g
}

/// Under the blocks, so that its line never hides the narrow ones at the rim.
fn texture_box(job: &Layout<'_>, sheet: &Sheet) -> Element {
    let width = num(sheet.unit * 0.3);
    let mut g = layer("layer-texture", "Texture box", &[("pointer-events", "none")]);
    if !job.texture.is_empty() {
        let line = [("id", "texture-box"), ("fill", "none"), ("stroke", "#000"), ("stroke-width", width.as_str())];
        g.append(rectangle(sheet_box(job.texture), &line));
    }
    g
}

/// The numbers of the blocks: number n is block Bn.
fn numbers(job: &Layout<'_>, sheet: &Sheet, spots: &[label::Spot]) -> Element {
    let mut g = layer(
        "layer-numbers",
        "Block numbers",
        &[("text-anchor", "middle"), ("fill", "#111"), ("pointer-events", "none")],
    );
    let range = job.range(|b| b.stop.focus, |b| b.stop.focus);
    let cell = mm_from_nm(job.map.cell());
    let [ox, oy] = job.map.bounds().lo.mm();
    for spot in spots {
        let Some(block) = job.blocks().get(spot.block as usize) else { continue };
        let font = spot.font * cell;
        let (x, y) = (ox + (spot.at[0] - 1.0) * cell, -(oy + (spot.at[1] - 1.0) * cell));
        // The base line lies 0.36 of the font below the middle, along the turned text.
        let (sin, cos) = f64::from(-spot.turn).to_radians().sin_cos();
        let [x, y] = [x - 0.36 * font * sin, y + 0.36 * font * cos].map(|v| plain(v, sheet.decimals));
        let mut t = el("text", &[("x", &x), ("y", &y), ("font-size", &num(font))]);
        if spot.turn != 0 {
            t.assign("transform", format!("rotate({} {x} {y})", -spot.turn));
        }
        if colour::is_dark(fill_of(block, range)) {
            t.assign("class", "w");
        }
        t.append(svg::node::Text::new((spot.block + 1).to_string()));
        g.append(t);
    }
    // Dots are numbered beside them; the spots are sorted by block.
    let r = dot_radius(job, sheet);
    for (i, block) in job.blocks().iter().enumerate() {
        if spots.binary_search_by_key(&i, |s| s.block as usize).is_err() {
            let [x, y] = middle_of_marks(job, block);
            g.append(caption([x + 1.3 * r, y - 1.3 * r], 2.0 * r, "#111", &(i + 1).to_string()));
        }
    }
    g
}

//! `layout.svg`: the blocks on the part, in mm, y up.
//!
//! Consumes a [`Layout`] or an [`OnTheFlyLayout`], promises the properties of [`super`]. Layers, bottom to top, each a
//! group with an id and a name that Inkscape shows: part, blocks, relief, sections, texture, texture that is not
//! marked, outline of the part, texture box, windows (where stops do not stand on the grid of sections),
//! fixtures, machine travel, stage path, field of the first stop, axes and scale, numbers, legend. On the fly those of blocks are absent.
//!
//! The sheet has no size of its own: it fills the window that shows it. All text on it is at least 7 px high where it
//! is 480 px wide; smaller numbers are in classes that a browser shows only where they are as high
//! ([`blocks::TIERS`]).
//!
//! Size: at most [`LIMIT`] bytes wherever that can be had. A drawing that would be larger is made
//! again with a coarser tolerance and, where that does not help, with short tooltips (see
//! [`DETAILS`]). The coarsest takes about 220 bytes a block, and marks up to 2.5 MB.

use std::fmt::Write;

use svg::Node;
use svg::node::element::Element;

use super::fixtures;
use super::legend;
use super::outline::{self, Outlines, PaddedMap};
use super::part::{self, Looks};
use super::sheet::{Detail, FONTS, LEAST_FONT, Sheet, el, grid_box, layer, num, rectangle, sheet_box, text, titled};
use super::{Layout, OnTheFlyLayout, Picture, Shade, blocks, clean, label, stage, travel, unmarked};
use terrace_core::geom::Nm;
use terrace_core::parallel;

/// Bytes that a drawing should not exceed.
pub(super) const LIMIT: usize = 5_000_000;

/// Tried in turn until the drawing fits: coarser borders of the blocks first, then short tooltips.
const DETAILS: [Detail; 7] = [
    Detail { tolerance: 0.5, full: true },
    Detail { tolerance: 1.0, full: true },
    Detail { tolerance: 2.0, full: true },
    Detail { tolerance: 4.0, full: true },
    Detail { tolerance: 1.0, full: false },
    Detail { tolerance: 4.0, full: false },
    Detail { tolerance: 16.0, full: false },
];

/// The layout of a stepped job as the text of an SVG file.
pub fn layout_svg(job: &Layout<'_>) -> String {
    within(job, &SharedShapes::of(job), LIMIT)
}

/// The layout of a stepped job in several shades.
pub fn layout_svgs<const N: usize>(job: &Layout<'_>, shades: [Shade; N]) -> [String; N] {
    let shapes = SharedShapes::of(job);
    let texts = parallel::map(N, |i| within(&Layout { shade: shades[i], ..job.clone() }, &shapes, LIMIT));
    texts.try_into().expect("a text for each shade")
}

/// The layout of an on-the-fly job as the text of an SVG file.
pub fn on_the_fly_svg(job: &OnTheFlyLayout<'_>) -> String {
    let picture = Picture::of_on_the_fly(job);
    let sheet = Sheet::of(&picture);
    draw(&Drawing { job: &picture, sheet: &sheet, blocks: None, looks: &Looks::of(&picture) }, DETAILS[0])
}

/// The layout at the first of [`DETAILS`] at which it fits in `limit` bytes; where it fits at none, at the last.
pub(super) fn within(job: &Layout<'_>, shapes: &SharedShapes, limit: usize) -> String {
    let picture = Picture::of_stepped(job);
    let sheet = Sheet::of(&picture);
    let blocks = Blocks { layout: job, outlines: &shapes.outlines, spots: &shapes.spots };
    let drawing = Drawing { job: &picture, sheet: &sheet, blocks: Some(&blocks), looks: &shapes.looks };
    let mut text = String::new();
    for detail in DETAILS {
        text = draw(&drawing, detail);
        if text.len() <= limit {
            break;
        }
    }
    text
}

/// What is drawn at every detail.
struct Drawing<'a> {
    job: &'a Picture<'a>,
    sheet: &'a Sheet,
    blocks: Option<&'a Blocks<'a>>,
    looks: &'a Looks,
}

/// The blocks of a stepped job, with what is the same for them in every shade.
struct Blocks<'a> {
    layout: &'a Layout<'a>,
    outlines: &'a Outlines,
    spots: &'a [label::Spot],
}

/// What is the same for a layout in every shade, made once.
pub(super) struct SharedShapes {
    outlines: Outlines,
    spots: Vec<label::Spot>,
    looks: Looks,
}

impl SharedShapes {
    pub(super) fn of(job: &Layout<'_>) -> Self {
        let picture = Picture::of_stepped(job);
        let grid = PaddedMap::of(job.map, job.blocks().len());
        let unit = Sheet::of(&picture).unit;
        let ((outlines, spots), looks) = parallel::both(
            || (outline::trace(&grid), label::place(&grid, 2.6 * unit / job.map.cell().mm())),
            || Looks::of(&picture),
        );
        Self { outlines, spots, looks }
    }
}

fn draw(drawing: &Drawing<'_>, detail: Detail) -> String {
    let Drawing { job, sheet, blocks, looks } = *drawing;
    let mut layers = vec![part::ground(job, sheet, &looks.silhouette)];
    layers.extend(blocks.map(|b| blocks::regions(b.layout, sheet, b.outlines, detail)));
    layers.push(looks.shading.draw(job));
    layers.extend(blocks.filter(|_| sheet.gridded).map(|b| sections(b.layout, sheet)));
    layers.push(job.marks.draw(sheet, job.machine.lens.spot.as_mm()));
    layers.push(unmarked::draw(job, sheet));
    layers.push(part::rim(job, sheet, &looks.silhouette));
    layers.push(texture_box(sheet));
    layers.extend(blocks.filter(|_| !sheet.gridded).map(|b| blocks::windows(b.layout, sheet, detail)));
    layers.extend(fixtures::draw(job, sheet));
    layers.push(travel::draw(job, sheet));
    layers.push(stage::path(job, sheet, detail));
    layers.push(stage::first_field(job, sheet));
    layers.push(legend::measures(sheet));
    layers.extend(blocks.map(|b| blocks::numbers(b.layout, sheet, b.spots)));
    let (legend, [x0, y0, x1, y1]) = legend::draw(job, sheet, looks);
    layers.push(legend);
    let (width, height) = (x1 - x0, y1 - y0);
    let mut root = el(
        "svg",
        &[
            ("xmlns", "http://www.w3.org/2000/svg"),
            ("xmlns:inkscape", "http://www.inkscape.org/namespaces/inkscape"),
            ("viewBox", &format!("{} {} {} {}", num(x0), num(y0), num(width), num(height))),
        ],
    );
    let what = if blocks.is_some() { "Block layout" } else { "Layout" };
    root = titled(root, format!("{what} of {}", clean(job.job)));
    let mut style = Element::new("style");
    style.append(svg::node::Text::new(style_text(sheet.unit, height / width)));
    root.append(style);
    // What `layout.svg#part` shows: the part without what is written about it.
    let [left, top, right, bottom] = sheet.view;
    let shown = format!("{} {} {} {}", num(left), num(top), num(right - left), num(bottom - top));
    root.append(el("view", &[("id", "part"), ("viewBox", &shown)]));
    root.append(rectangle([x0, y0, x1, y1], &[("id", "paper"), ("fill", "#fff")]));
    layers.into_iter().for_each(|l| root.append(l));
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{root}\n")
}

/// The rules that hide small numbers, and show them where the sheet is wide enough; `shape` is its height by its width.
fn style_text(u: f64, shape: f64) -> String {
    let mut style = format!(
        "text{{font-family:{FONTS};text-rendering:geometricPrecision}}\
         #layer-blocks :hover{{stroke-width:{}}}#layer-windows g:hover{{visibility:visible}}",
        num(u * 0.25)
    );
    for (class, _, width) in &blocks::TIERS[1..] {
        let height = (f64::from(*width) * shape).floor();
        let _ = write!(
            style,
            "{}@media(min-width:{width}px) and (min-height:{height}px){{.{class}{{display:inline}}}}",
            hidden(class)
        );
    }
    style
}

/// The rule that hides a class of numbers.
fn hidden(class: &str) -> String {
    format!(".{class}{{display:none}}")
}

/// The drawing with the numbers that a browser shows where it is so many px wide, for what takes no notice of widths.
pub(super) fn at_width(svg: &str, width: u32) -> String {
    let mut out = svg.to_owned();
    for (class, _, least) in &blocks::TIERS[1..] {
        if *least <= width {
            out = out.replacen(&hidden(class), "", 1);
        }
    }
    out
}

/// Dashed section lines with the numbers of columns below and of rows at the left.
fn sections(job: &Layout<'_>, sheet: &Sheet) -> Element {
    let (u, s) = (sheet.unit, job.sections);
    let width = num(u * 0.12);
    let dash = format!("{} {}", num(u * 0.9), num(u * 0.5));
    let mut g = layer("layer-sections", "Sections", &[("pointer-events", "none")]);
    let [x0, y0, x1, y1] = sheet_box(grid_box(job));
    let at = |o: f64, pitch: Nm, k: f64| o + pitch.mm() * k;
    let mut d = String::new();
    for k in 0..=s.count[0] {
        let _ = write!(d, "M{} {}V{}", num(at(x0, s.pitch[0], k.into())), num(y1), num(y0));
    }
    for k in 0..=s.count[1] {
        let _ = write!(d, "M{} {}H{}", num(x0), num(at(y1, -s.pitch[1], k.into())), num(x1));
    }
    let lines = [("fill", "none"), ("stroke", "#000"), ("stroke-opacity", ".6"), ("stroke-width", width.as_str())];
    let mut path = el("path", &lines);
    path.assign("stroke-dasharray", dash);
    path.assign("d", d);
    g.append(path);
    let mut captions = el("g", &[("id", "section-captions"), ("fill", "#444")]);
    // Numbers are left out evenly where there is no room for all.
    let font = LEAST_FONT * u;
    let every = |pitch: Nm, room: f64| (room / pitch.mm()).ceil().max(1.0) as usize;
    let wide = 0.66 * font * f64::from(s.count[0].max(1).ilog10() + 1) + 0.8 * u;
    for k in (0..s.count[0]).step_by(every(s.pitch[0], wide)) {
        let x = at(x0, s.pitch[0], f64::from(k) + 0.5);
        captions.append(text([x, sheet.view[3] + 2.1 * u], font, "middle", &format!("{k}")));
    }
    for k in (0..s.count[1]).step_by(every(s.pitch[1], 1.3 * font)) {
        let y = at(y1, -s.pitch[1], f64::from(k) + 0.5);
        captions.append(text([sheet.view[0] - 0.8 * u, y + font * 0.36], font, "end", &format!("{k}")));
    }
    g.append(captions);
    g
}

/// The frame around the texture.
fn texture_box(sheet: &Sheet) -> Element {
    let width = num(sheet.unit * 0.2);
    let mut g = layer("layer-texture", "Texture box", &[("pointer-events", "none")]);
    if let Some(frame) = &sheet.frame {
        let mut d = String::new();
        for (k, [x, y]) in frame.corners.iter().enumerate() {
            let _ = write!(d, "{}{} {}", if k == 0 { 'M' } else { 'L' }, num(*x), num(*y));
        }
        d.push('z');
        let line = [("fill", "none"), ("stroke", "#000"), ("stroke-width", width.as_str()), ("d", d.as_str())];
        let mut path = el("path", &line);
        path.assign("id", "texture-box");
        g.append(path);
    }
    g
}

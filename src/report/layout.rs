//! `layout.svg`: the blocks on the part, in mm, y up.
//!
//! Consumes a [`Layout`], promises the properties of [`super`]. Layers, bottom to top, each a group
//! with an id and a name that Inkscape shows: texture box, texture off the part (where the job places some), blocks, sections or (where stops do not stand
//! on the grid of sections) windows, stage path, field of the first stop, axes and scale, numbers,
//! legend.
//!
//! Size: at most [`LIMIT`] bytes wherever that can be had. A drawing that would be larger is made
//! again with a coarser tolerance and, where that does not help, with short tooltips (see
//! [`DETAILS`]). The coarsest takes about 220 bytes a block, so beyond some 20,000 blocks the file is
//! larger than the limit.

use std::fmt::Write;

use svg::Node;
use svg::node::element::Element;

use super::colour::OFF_PART;
use super::outline::{self, Outlines, PaddedMap};
use super::sheet::{Detail, FONTS, Sheet, el, grid_box, layer, num, rectangle, sheet_box, text, titled};
use super::{Layout, blocks, clean, label, legend, stage};
use crate::geom::Nm;

/// Bytes that a drawing should not exceed.
pub(super) const LIMIT: usize = 5_000_000;

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
    let grid = PaddedMap::of(job.map, job.blocks().len());
    let sheet = Sheet::of(job);
    let outlines = outline::trace(&grid);
    let spots = label::place(&grid, 2.6 * sheet.unit / job.map.cell().mm());
    let mut text = String::new();
    for detail in DETAILS {
        text = draw(job, &sheet, &outlines, &spots, detail);
        if text.len() <= limit {
            break;
        }
    }
    text
}

fn draw(job: &Layout<'_>, sheet: &Sheet, outlines: &Outlines, spots: &[label::Spot], detail: Detail) -> String {
    let u = sheet.unit;
    let mut layers = vec![
        texture_box(sheet),
        blocks::regions(job, sheet, outlines, detail),
        if sheet.gridded { sections(job, sheet) } else { blocks::windows(job, sheet, detail) },
        stage::path(job, sheet, detail),
        stage::first_field(job, sheet),
        legend::measures(job, sheet),
        blocks::numbers(job, sheet, spots),
    ];
    if !job.off_part.is_empty() {
        layers.insert(1, off_part(job, sheet));
    }
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
        "text{{font-family:{FONTS};text-rendering:geometricPrecision}}\
         .w{{fill:#fff}}.halo{{paint-order:stroke;stroke:#fff;stroke-linejoin:round}}\
         #layer-blocks :hover{{stroke-width:{}}}#layer-windows g:hover{{visibility:visible}}",
        num(u * 0.3)
    )
}

/// Dashed section lines with the numbers of columns below and of rows at the left.
fn sections(job: &Layout<'_>, sheet: &Sheet) -> Element {
    let (u, s) = (sheet.unit, job.sections);
    let (width, dash) = (num(u * 0.14), format!("{} {}", num(u * 0.9), num(u * 0.5)));
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
    let lines = [("fill", "none"), ("stroke", "#000"), ("stroke-opacity", ".75"), ("stroke-width", width.as_str())];
    let mut path = el("path", &lines);
    path.assign("stroke-dasharray", dash);
    path.assign("d", d);
    g.append(path);
    let mut captions = el("g", &[("id", "section-captions"), ("fill", "#444")]);
    let size = |pitch: Nm| (pitch.mm() * 0.35).clamp(u * 0.5, u * 1.5);
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

/// Texture that the job places off the part, in red: nothing of it is marked.
fn off_part(job: &Layout<'_>, sheet: &Sheet) -> Element {
    let mut d = String::new();
    for row in job.off_part {
        let [x0, y0, x1, y1] = [row.lo.x, row.hi.y, row.hi.x, row.lo.y].map(|v| sheet.step(v as f64));
        blocks::push_command(&mut d, 'M', &[x0, -y0], sheet.decimals);
        blocks::push_command(&mut d, 'H', &[x1], sheet.decimals);
        blocks::push_command(&mut d, 'V', &[-y1], sheet.decimals);
        blocks::push_command(&mut d, 'H', &[x0], sheet.decimals);
        d.push('z');
    }
    let mut g = layer("layer-off-part", "Texture off the part", &[("fill", OFF_PART), ("stroke", "none")]);
    g.append(titled(el("path", &[("d", &d)]), "texture off the part or over a hole: not marked".into()));
    g
}

/// Under the blocks, so that its line never hides the narrow ones at the rim.
fn texture_box(sheet: &Sheet) -> Element {
    let width = num(sheet.unit * 0.3);
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

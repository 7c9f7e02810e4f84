//! The sheet that `layout.svg` is drawn on: where everything lies, and the elements it is drawn with.
//! Lengths in mm of the drawing: x as on the part, y negated.

use svg::Node;
use svg::node::element::Element;

use super::{Layout, clean, plain};
use crate::geom::{Box2, NM_PER_MM, Nm, P2, Turn, cos_sin};
use crate::program::Block;

/// Faces of all text, the most usual first.
pub(super) const FONTS: &str = "Arial,\"Liberation Sans\",\"DejaVu Sans\",sans-serif";

/// How much is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detail {
    /// How far a drawn border of a block may lie from the cells' border, in cells.
    pub tolerance: f64,
    /// Whether tooltips tell everything.
    pub full: bool,
}

impl Detail {
    /// Whether a ring of this area (twice, in cells) is drawn: a coarse drawing leaves out the specks
    /// and holes below its tolerance, though never the largest ring of a block.
    pub fn shows(self, area2: i64) -> bool {
        self.tolerance <= 0.5 || area2 as f64 >= 2.0 * self.tolerance * self.tolerance
    }
}

/// Where everything lies, in mm of the drawing: x as on the part, y negated.
pub(super) struct Sheet {
    /// The part of the drawing that shows the part: left, top, right, bottom.
    pub view: [f64; 4],
    /// The measure of captions and lines: a hundredth of the part's size.
    pub unit: f64,
    /// Digits of a coordinate after the point.
    pub decimals: usize,
    /// Whether the stops stand on the grid of sections; else their windows lie freely.
    pub gridded: bool,
    /// The frame around the texture, if there is any.
    pub frame: Option<Frame>,
}

/// A rectangle around the texture. It lies along the part's own axes: on a part that is turned by
/// no multiple of 90 degrees, the box of the texture would say little of where its sides are.
pub(super) struct Frame {
    /// Corners in order.
    pub corners: [[f64; 2]; 4],
    /// Width and height.
    pub size: [f64; 2],
    /// Whether it is turned. Then it holds the marks: where the texture's own sides were is not known here.
    pub turned: bool,
}

impl Frame {
    fn of(job: &Layout<'_>) -> Option<Self> {
        let [cos, sin] = cos_sin(job.turn_rad);
        let turned = cos != 0.0 && sin != 0.0;
        let turn = |[x, y]: [f64; 2], sin: f64| [x * cos - y * sin, x * sin + y * cos];
        let [mut lo, mut hi] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        let mut add = |p: [f64; 2]| (lo, hi) = ([0, 1].map(|k| lo[k].min(p[k])), [0, 1].map(|k| hi[k].max(p[k])));
        let program = job.checked.program();
        if turned {
            for block in job.blocks() {
                let c = block.stop.centre;
                for p in program.strokes_of(block).iter().flat_map(|s| program.points_of(s)) {
                    add(turn(<P2>::new(c.x + i64::from(p.x), c.y + i64::from(p.y)).mm(), -sin));
                }
            }
        } else if !job.texture.is_empty() {
            add(job.texture.lo.mm());
            add(job.texture.hi.mm());
        }
        let back = |p: [f64; 2]| if turned { turn(p, sin) } else { p };
        let corners = [lo, [hi[0], lo[1]], hi, [lo[0], hi[1]]].map(back).map(|[x, y]| [x, -y]);
        (lo[0] <= hi[0]).then_some(Self { corners, size: [hi[0] - lo[0], hi[1] - lo[1]], turned })
    }
}

impl Sheet {
    pub fn of(job: &Layout<'_>) -> Self {
        let gridded = job.is_gridded();
        let mut all = job.texture.union(job.map.bounds());
        if gridded {
            all = all.union(grid_box(job));
        }
        if let Some(first) = job.blocks().first() {
            all = all.union(field_box(job, first));
        }
        job.blocks().iter().for_each(|b| all.add(Turn::drawn(b.stop.centre)));
        let [w, h] = all.size().map(Nm::mm);
        let unit = ((w * h).sqrt() / 100.0).max(w / 260.0).max(h / 400.0);
        // A coordinate keeps a twentieth of a cell: 0.01 mm at the usual cells of 0.25 mm.
        let decimals = match job.map.cell().0 {
            200_000.. => 2,
            20_000.. => 3,
            _ => 4,
        };
        let ([x0, y0], [x1, y1]) = (all.lo.mm(), all.hi.mm());
        Self { view: [x0, -y1, x1, -y0], unit, decimals, gridded, frame: Frame::of(job) }
    }

    /// nm to steps of the last place.
    pub fn step(&self, nm: f64) -> i64 {
        (nm / NM_PER_MM * 10f64.powi(self.decimals as i32)).round() as i64
    }
}

/// The grid of sections as a box.
pub(super) fn grid_box(job: &Layout<'_>) -> Box2 {
    let s = job.sections;
    let end = |o: i64, k: usize| o + s.pitch[k].0 * i64::from(s.count[k]);
    Box2 { lo: s.origin, hi: P2::new(end(s.origin.x, 0), end(s.origin.y, 1)) }
}

/// The usable field at a block's stop.
pub(super) fn field_box(job: &Layout<'_>, block: &Block) -> Box2 {
    Box2::around(Turn::drawn(block.stop.centre), job.machine.usable_field().map(|w| w / 2))
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

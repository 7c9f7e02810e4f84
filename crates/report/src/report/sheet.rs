//! The sheet that `layout.svg` is drawn on: where everything lies, and the elements it is drawn with.
//! Lengths in mm of the drawing: x as on the part, y negated.

use svg::Node;
use svg::node::element::Element;

use super::{Layout, Picture, clean, plain};
use terrace_core::geom::{Box2, BoxMm, NM_PER_MM, P2, cos_sin};
use terrace_core::machine::Machine;
use terrace_plan::fixtures::Fixture;

/// Faces of all text, the most usual first.
pub(super) const FONTS: &str = "Arial,\"Liberation Sans\",\"DejaVu Sans\",sans-serif";

/// How much is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detail {
    /// How far a drawn border of a block may lie from the cells' border, in cells.
    pub tolerance: f64,
    /// Whether tooltips say everything.
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
    /// The measure of captions and lines: a hundredth of the sheet's width.
    pub unit: f64,
    /// Whether the legend is below the part, in columns; else it begins right of it.
    pub below: bool,
    /// Digits of a coordinate after the point.
    pub decimals: usize,
    /// Whether the stops stand on the grid of sections; else their windows lie freely, if there are any.
    pub gridded: bool,
    /// The frame around the texture, if there is any.
    pub frame: Option<Frame>,
}

/// Distances on a sheet, in its units. The sheet is 100 units wide, so text of [`FONT`] is 7.7 px high where the sheet
/// is 480 px wide.
pub(super) const FONT: f64 = 1.6;
/// The smallest text that is shown on every sheet: 7 px at 480.
pub(super) const LEAST_FONT: f64 = 1.47;
/// Between the rim of the sheet and what is on it.
pub(super) const RIM: f64 = 2.0;
/// Left of the part, for the numbers of rows.
pub(super) const LEFT: f64 = 4.0;
/// Above the part, for the names of set-ups.
pub(super) const TOP: f64 = 3.4;
/// Below the part, for the numbers of columns, axes and scale.
pub(super) const FOOT: f64 = 9.5;
/// Width of the legend right of the part, and its distance from it.
pub(super) const BESIDE: f64 = 33.0;
pub(super) const GAP: f64 = 3.0;
/// A part more than so many times as wide as high has its whole legend below it.
const WIDE: f64 = 2.0;

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
    fn of(job: &Picture<'_>) -> Option<Self> {
        let [cos, sin] = cos_sin(job.turn_rad);
        let turned = cos != 0.0 && sin != 0.0;
        let turn = |[x, y]: [f64; 2], sin: f64| [x * cos - y * sin, x * sin + y * cos];
        let mut all = BoxMm::EMPTY;
        if turned {
            for group in job.groups() {
                for p in &group.points {
                    let [x, y, _] = group.frame.part_from_group(p.at);
                    all.add(turn([x, y], -sin));
                }
            }
        } else if !job.texture.is_empty() {
            all.add(job.texture.lo.mm());
            all.add(job.texture.hi.mm());
        }
        let back = |p: [f64; 2]| if turned { turn(p, sin) } else { p };
        let corners = all.corners().map(back).map(|[x, y]| [x, -y]);
        (all.lo[0] <= all.hi[0]).then_some(Self { corners, size: all.size(), turned })
    }
}

impl Sheet {
    pub fn of(job: &Picture<'_>) -> Self {
        let mut all = job.texture.union(job.relief.grid.bounds());
        let gridded = job.stepped().is_some_and(Layout::is_gridded);
        if let Some(stepped) = job.stepped() {
            all = all.union(stepped.map.bounds());
            if gridded {
                all = all.union(grid_box(stepped));
            }
        }
        job.places().iter().for_each(|&p| all.add(p));
        if let Some(&first) = job.places().first() {
            all = all.union(field_box(job.machine, first));
        }
        all = with_fixtures(all, job.stepped().map_or(&[][..], |layout| layout.fixtures));
        let [w, h] = all.size().map(|v| v.mm().max(1e-3));
        let below = w > WIDE * h;
        let beside = if below { 0.0 } else { GAP + BESIDE };
        let unit = w / (100.0 - 2.0 * RIM - LEFT - beside);
        // A coordinate is off by no more than a twentieth of a pixel where the sheet is 4,000 px wide.
        let decimals = [2, 3].into_iter().find(|&d| 10f64.powi(-d) <= unit / 400.0).unwrap_or(4) as usize;
        let ([x0, y0], [x1, y1]) = (all.lo.mm(), all.hi.mm());
        Self { view: [x0, -y1, x1, -y0], unit, below, decimals, gridded, frame: Frame::of(job) }
    }

    /// nm to steps of the last place.
    pub fn step(&self, nm: f64) -> i64 {
        (nm / NM_PER_MM * 10f64.powi(self.decimals as i32)).round() as i64
    }

    /// mm to steps of the last place.
    pub fn step_mm(&self, mm: f64) -> i64 {
        self.step(mm * NM_PER_MM)
    }
}

/// A box that shows what of the fixtures lies beside it, as far as an eighth of its larger side.
fn with_fixtures(all: Box2, fixtures: &[Fixture]) -> Box2 {
    let [w, h] = all.size();
    let most = w.max(h).0 / 8;
    let at = |p: [f64; 3]| -> P2 { P2::new(p[0] as i64, p[1] as i64) };
    let within = fixtures.iter().map(|fixture| {
        let [lo, hi] = fixture.ends().map(at);
        Box2 { lo, hi }
    });
    within.fold(all, |shown, fixture| {
        let lo = [(fixture.lo.x, all.lo.x), (fixture.lo.y, all.lo.y)].map(|(own, end)| own.clamp(end - most, end));
        let hi = [(fixture.hi.x, all.hi.x), (fixture.hi.y, all.hi.y)].map(|(own, end)| own.clamp(end, end + most));
        shown.union(Box2 { lo: P2::new(lo[0], lo[1]), hi: P2::new(hi[0], hi[1]) })
    })
}

/// The grid of sections as a box.
pub(super) fn grid_box(job: &Layout<'_>) -> Box2 {
    let s = job.sections;
    let end = |o: i64, k: usize| o + s.pitch[k].0 * i64::from(s.count[k]);
    Box2 { lo: s.origin, hi: P2::new(end(s.origin.x, 0), end(s.origin.y, 1)) }
}

/// The usable field around a place.
pub(super) fn field_box(machine: &Machine, at: P2) -> Box2 {
    Box2::around(at, machine.usable_field().map(|w| w / 2))
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

/// A path command with as few characters as possible.
pub(super) fn push_command(d: &mut String, command: char, values: &[i64], decimals: usize) {
    d.push(command);
    let scale = 10u64.pow(decimals as u32);
    let mut digits = itoa::Buffer::new();
    for (k, &v) in values.iter().enumerate() {
        if v < 0 {
            d.push('-');
        } else if k > 0 {
            d.push(' ');
        }
        let whole = v.unsigned_abs() / scale;
        let mut part = v.unsigned_abs() % scale;
        if whole > 0 || part == 0 {
            d.push_str(digits.format(whole));
        }
        if part > 0 {
            d.push('.');
            let mut place = scale;
            while part > 0 {
                place /= 10;
                d.push(char::from(b'0' + (part / place) as u8));
                part %= place;
            }
        }
    }
}

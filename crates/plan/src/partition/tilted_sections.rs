//! Places that are each marked at a tilt of their own: per section the plane that the marks deviate least
//! from (Chebyshev), levels along its normal.
//!
//! The deviation that is left is the curvature of the surface in the section, about its mean curvature times
//! the square of the section's size over 8: so sections a little below the field may need far fewer levels than
//! sections of the whole field, and a section that needs several may do with fewer when halved. Sections of
//! some equal sizes are tried, each halved where that saves stops, and the cheapest are taken.
//!
//! # Limits
//! Planes are fitted to sample points of the marks ([`crate::projection::Marks`]); what the levels must hold is
//! found from all marks afterwards. A section is a rectangle of the plane of the drawing.

use super::{Lattice, SectionLevel, StopTilt, Stops, zrange};
use crate::projection::{MarksByField, TiltedCell, TiltedField, TiltedFields};
use terrace_core::geom::{Box2, Nm, P2, P3, Turn};
use terrace_core::machine::{Machine, Origin, TiltAngles};
use terrace_core::program::{SectionId, Sections, Stop};

/// What tilted stops are made for.
pub(crate) struct TiltSite<'a> {
    /// A machine with tilt axes.
    pub machine: &'a Machine,
    /// Position of the part in the table frame.
    pub origin: Origin,
    /// The texture's box.
    pub area: Box2,
    /// Window of a stop.
    pub window: [Nm; 2],
    /// By how much it is smaller on each side than that of a stage that stands where it is to.
    pub room: Nm,
    /// Lattice of the focal planes.
    pub lattice: Lattice,
}

/// Sections are divided into this many cells along x and along y.
const PARTS: i64 = 4;

/// Sections along an axis that are tried beyond the fewest.
const EXTRA_SECTIONS: i64 = 3;

/// How far the focal plane of a tilted head may lie from the middle of its level.
const FOCUS_TOLERANCE: Nm = Nm(2);

/// Allowance for marks between the sample points, nm.
const SAMPLING_ALLOWANCE_NM: f64 = 20_000.0;

impl TiltSite<'_> {
    /// The grid in whose cells sample points are taken: some forty along a window.
    pub fn samples(&self) -> Sections {
        let pitch = self.window.map(|w| ((w + self.room * 2) / 40).max(Nm(2)));
        let size = self.area.size();
        let count = [0, 1].map(|k| (size[k] / pitch[k] + 1) as u32);
        Sections { origin: self.area.lo, pitch, count }
    }

    /// Chooses the sections and their tilts by the sample points.
    pub fn plan(&self, samples: &[P3]) -> TiltedFields {
        let mut best: Option<(u64, TiltedFields)> = None;
        // A few sections more may need fewer levels: what is left of a surface off its best plane grows with the square
        // of the section.
        for more in 0..=EXTRA_SECTIONS {
            let Some(grid) = self.grid(more) else { continue };
            let made = self.over(grid, samples);
            if best.as_ref().is_none_or(|b| made.0 < b.0) {
                best = Some(made);
            }
        }
        best.map_or_else(|| self.over(self.tight(), samples).1, |b| b.1)
    }

    /// The grid for windows of few increments, which hold no sections of parts of whole ones: parts of any
    /// size, of sections so much smaller than a window that their centres may be rounded to where the stage
    /// can stand.
    fn tight(&self) -> Sections {
        let size = self.area.size();
        let step = self.lattice.step;
        let pitch = self.window.map(|w| ((w - step) / PARTS).max(Nm(1)));
        let count = [0, 1].map(|k| ((size[k] / (pitch[k] * PARTS) + 1) * PARTS) as u32);
        Sections { origin: self.area.lo, pitch, count }
    }

    /// The grid of parts of sections, with `more` sections along each axis than needed.
    fn grid(&self, more: i64) -> Option<Sections> {
        let size = self.area.size();
        let step = self.lattice.step;
        let count =
            [0, 1].map(|k| (size[k].0 as u64).div_ceil(self.window[k].0 as u64) as i64 + more).map(|c| c.max(1));
        let pitch = [0, 1].map(|k| {
            let part = Nm((size[k].0 as u64).div_ceil((count[k] * PARTS) as u64) as i64);
            step * (part / step + 1)
        });
        (0..2).all(|k| pitch[k] * PARTS <= self.window[k]).then(|| Sections {
            origin: self.area.lo,
            pitch,
            count: count.map(|c| (c * PARTS) as u32),
        })
    }

    /// Tilted fields over a grid of parts, and how many stops they need.
    fn over(&self, grid: Sections, samples: &[P3]) -> (u64, TiltedFields) {
        let columns = i64::from(grid.count[0]) / PARTS;
        let section = |p: &P3| {
            let [x, y] = [0, 1].map(|k| grid.along(k, p[k].round() as i64, 0) / PARTS);
            y * columns + x
        };
        let mut points: Vec<(i64, P3)> = samples.iter().map(|p| (section(p), *p)).collect();
        points.sort_by_key(|p| p.0);
        let cells = vec![TiltedCell::default(); grid.len()];
        let mut fields = TiltedFields { grid, cells, list: Vec::new(), half: self.window.map(|w| w / 2) };
        let mut stops = 0;
        let mut rest = &mut points[..];
        for i in 0..columns * i64::from(grid.count[1]) / PARTS {
            let (here, more) = rest.split_at_mut(rest.partition_point(|p| p.0 <= i));
            rest = more;
            let part = CellPart { at: [i % columns * PARTS, i / columns * PARTS], size: [PARTS; 2] };
            let mut here: Vec<P3> = here.iter().map(|p| p.1).collect();
            let (levels, found) = self.divide(&grid, part, &mut here);
            stops += levels;
            for (part, field) in found {
                for row in part.at[1]..part.at[1] + part.size[1] {
                    let first = row as usize * grid.count[0] as usize + part.at[0] as usize;
                    let row = &mut fields.cells[first..first + part.size[0] as usize];
                    row.iter_mut().for_each(|cell| cell.field = fields.list.len() as u32);
                }
                fields.list.push(field);
            }
        }
        (stops, fields)
    }

    /// The way with the fewest stops that was found to mark a rectangle of cells: as a whole, or in two halves along x or y,
    /// each divided further.
    fn divide(&self, grid: &Sections, part: CellPart, points: &mut [P3]) -> (u64, Vec<(CellPart, TiltedField)>) {
        let (levels, field) = self.fit(part.area(grid), points);
        let mut best = (levels, vec![(part, field)]);
        // Two halves that both hold points need a level each, so two levels are not beaten.
        for axis in (0..2).filter(|&k| levels > 2 && part.size[k] > 1) {
            let [low, high] = part.halves(axis);
            let border = grid.line(axis, high.at[axis]) as f64;
            // Partitioned in place, in the order the points had: each half gets its own slice.
            points.sort_by(|a, b| (a[axis] >= border).cmp(&(b[axis] >= border)));
            let (left, right) = points.split_at_mut(points.partition_point(|p| p[axis] < border));
            let (a, mut found) = self.divide(grid, low, left);
            let (b, more) = self.divide(grid, high, right);
            if a + b < best.0 {
                found.extend(more);
                best = (a + b, found);
            }
        }
        best
    }

    /// The best field of a rectangle, and how many levels it needs.
    fn fit(&self, area: Box2, points: &[P3]) -> (u64, TiltedField) {
        let upright = self.upright(area);
        // One level cannot be beaten, and costs no tilt.
        let (flat_levels, _) = self.levels_of(points.iter().map(|p| p[2]));
        let Some(table) = self.machine.tilt.as_ref().filter(|_| flat_levels > 1) else {
            return (flat_levels, upright);
        };
        let [a, b] = plane(points);
        let tilt = table.commands([-a, -b, 1.0]);
        let turn = table.turn(tilt, self.origin);
        let (tilted_levels, heights) = self.levels_of(points.iter().map(|&p| turn.apply(p)[2]));
        if tilted_levels >= flat_levels {
            return (flat_levels, upright);
        }
        let [lo, hi] = seen_window(area, points[0], heights, &turn);
        let step = self.lattice.step;
        if (0..2).any(|k| hi[k] - lo[k] > (self.window[k] - step * 2).f64()) {
            return (flat_levels, upright);
        }
        let [x, y] = [0, 1].map(|k| self.stand(k, (lo[k] + hi[k]) / 2.0));
        let field = TiltedField { tilt, turn, centre: P2::new(x, y), area, top: f64::INFINITY, is_wide: true };
        (tilted_levels, field)
    }

    /// How many levels hold all of these heights, and the lowest and the highest of them.
    fn levels_of(&self, heights: impl Iterator<Item = f64>) -> (u64, [f64; 2]) {
        let apart = (self.lattice.depth - self.lattice.hysteresis * 2).f64();
        let (lo, hi) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), z| (lo.min(z), hi.max(z)));
        // k levels that overlap by twice the hysteresis hold depth + (k - 1) apart.
        let beyond = (hi - lo - self.lattice.depth.f64()) / apart;
        (if hi < lo { 0 } else { 1 + beyond.ceil().max(0.0) as u64 }, [lo, hi])
    }

    /// The field of a rectangle without a tilt.
    fn upright(&self, area: Box2) -> TiltedField {
        let centre = [(area.lo.x, area.hi.x), (area.lo.y, area.hi.y)];
        let [x, y] = [0, 1].map(|k| self.stand(k, (centre[k].0 + centre[k].1) as f64 / 2.0));
        let turn = self.machine.turn(TiltAngles::UPRIGHT, self.origin);
        TiltedField { tilt: TiltAngles::UPRIGHT, turn, centre: P2::new(x, y), area, top: f64::INFINITY, is_wide: true }
    }

    /// The nearest place along x or y where the stage can stand.
    fn stand(&self, axis: usize, v: f64) -> i64 {
        let at = v.round() as i64 + self.lattice.step.0 / 2;
        at - (at + self.origin[axis]).rem_euclid(self.lattice.step.0)
    }

    /// Makes a field upright: what its tilt cannot do is done without.
    pub(crate) fn set_upright(&self, field: &mut TiltedField) {
        *field = self.upright(field.area);
    }

    /// The stops: for every field the fewest levels that hold what lies in it.
    pub fn stops(&self, fields: &TiltedFields, held: &MarksByField, sections: &Sections) -> Stops {
        // A tilted head meets any height to a nanometre, and two are rounded.
        let depth = (self.lattice.depth - FOCUS_TOLERANCE * 2).max(Nm(2));
        let any = Lattice { step: Nm(1), depth, ..self.lattice };
        let mut stops = Vec::new();
        for (field, held) in fields.list.iter().zip(&held.0) {
            let is_free = self.machine.tilts_head() && !field.tilt.is_upright();
            let lattice = if is_free { &any } else { &self.lattice };
            let (whole, deep): (Vec<_>, Vec<_>) = held.figures.iter().partition(|&&figure| lattice.holds(figure));
            let heights = super::with_figures(held.heights(), &deep);
            let middle = P3::new([field.centre.x as f64, field.centre.y as f64, lattice.depth.f64()]);
            let [x, y, _] = field.turn.back(middle).at;
            let section = [x, y].map(|v| v.round() as i64);
            let section = SectionId([0, 1].map(|k| sections.along(k, section[k], 0) as u32));
            for SectionLevel { number: level, z_lo } in zrange::levels(&heights, &whole, lattice) {
                let lpfl = z_lo + lattice.depth / 2;
                let z_hi = z_lo + lattice.depth;
                let stop = Stop { section, level, tilt: field.tilt, centre: field.centre, lpfl, z_lo, z_hi };
                stops.push((stop, StopTilt { turn: field.turn, area: (!field.is_wide).then_some(field.area) }));
            }
        }
        Stops::tilted(stops, self.window, self.lattice.depth)
    }
}

/// A rectangle of cells of the grid of parts.
#[derive(Clone, Copy)]
struct CellPart {
    at: [i64; 2],
    size: [i64; 2],
}

impl CellPart {
    fn area(self, grid: &Sections) -> Box2 {
        let corner = |at: [i64; 2]| P2::new(grid.line(0, at[0]), grid.line(1, at[1]));
        Box2 { lo: corner(self.at), hi: corner([self.at[0] + self.size[0], self.at[1] + self.size[1]]) }
    }

    fn halves(self, axis: usize) -> [Self; 2] {
        let (mut low, mut high) = (self, self);
        low.size[axis] /= 2;
        high.size[axis] -= low.size[axis];
        high.at[axis] += low.size[axis];
        [low, high]
    }
}

/// Lower and upper corner of the window, along the beam of a turned part, in which all marks of a rectangle lie: those
/// between two heights of the turned part, the lowest and the highest of its sample points, of which `sample` is one.
/// They lie between two planes along the beam, the corners of which bound them.
fn seen_window(area: Box2, sample: P3, heights: [f64; 2], turn: &Turn) -> [[f64; 2]; 2] {
    let mut window = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let up = turn.up();
    let anchor = turn.apply(sample)[2];
    let [lo, hi] = heights;
    for [x, y] in [[area.lo.x, area.lo.y], [area.hi.x, area.lo.y], [area.lo.x, area.hi.y], [area.hi.x, area.hi.y]] {
        for h in [lo - SAMPLING_ALLOWANCE_NM, hi + SAMPLING_ALLOWANCE_NM] {
            let [dx, dy] = [x as f64 - sample[0], y as f64 - sample[1]];
            // Where the vertical through the corner meets the plane of height h of the turned part.
            let z = sample[2] + (h - anchor - up[0] * dx - up[1] * dy) / up[2];
            let p = turn.apply(P3::new([x as f64, y as f64, z]));
            for k in 0..2 {
                window[0][k] = window[0][k].min(p[k]);
                window[1][k] = window[1][k].max(p[k]);
            }
        }
    }
    window
}

/// The slopes along x and y of the plane from which the points deviate least at most (Chebyshev).
///
/// The range of z - a x - b y is convex in a and b: from every place where it was measured a plane below it is
/// known, and the next place is where the highest of these planes is lowest (Kelley's method), until it is
/// measured there to be as low.
fn plane(points: &[P3]) -> [f64; 2] {
    /// Steepest slope that is looked at (63 deg), beyond the travel of usual tilt axes.
    const STEEP: f64 = 2.0;
    /// How near to the least range the search ends, nm: far below any depth range.
    const EXACT: f64 = 20.0;
    /// Cuts at most, for points on which the bounds come together slowly.
    const MOST: usize = 60;
    let Some(&o) = points.first() else { return [0.0; 2] };
    let local: Vec<[f64; 3]> = points.iter().map(|p| [p[0] - o[0], p[1] - o[1], p[2] - o[2]]).collect();
    let slope_cost = |[a, b]: [f64; 2]| FLAT * (a * a + b * b);
    let mut slopes = [0.0; 2];
    let (mut range, first) = farthest_apart(&local, slopes);
    let mut best = (range + slope_cost(slopes), slopes);
    let mut cuts = vec![first];
    for _ in 0..MOST {
        // The cuts lie below the range everywhere, so their minimum is a lower bound of it; the best place so far
        // is an upper one.
        let (least, next) = lowest(&cuts, STEEP);
        slopes = next;
        let cut;
        (range, cut) = farthest_apart(&local, slopes);
        if range + slope_cost(slopes) < best.0 {
            best = (range + slope_cost(slopes), slopes);
        }
        if best.0 <= least + EXACT {
            break;
        }
        cuts.push(cut);
    }
    best.1
}

/// How far points lie apart along z over a plane of these slopes, and the gap between the two that are farthest apart,
/// as z, x and y: as a function of the slopes it is the plane below the range that touches it here.
fn farthest_apart(points: &[[f64; 3]], [a, b]: [f64; 2]) -> (f64, [f64; 3]) {
    let mut lo = (f64::INFINITY, 0);
    let mut hi = (f64::NEG_INFINITY, 0);
    for (i, p) in points.iter().enumerate() {
        let h = p[2] - a * p[0] - b * p[1];
        if h < lo.0 {
            lo = (h, i);
        }
        if h > hi.0 {
            hi = (h, i);
        }
    }
    let [p, q] = [points[hi.1], points[lo.1]];
    (hi.0 - lo.0, [p[2] - q[2], p[0] - q[0], p[1] - q[1]])
}

/// What a slope of 1 costs, nm: where many planes are equally good the flattest is taken.
const FLAT: f64 = 1e5;

/// Where the highest of the cuts and the cost of the slope are lowest within `-steep..steep`, and how low.
fn lowest(cuts: &[[f64; 3]], steep: f64) -> (f64, [f64; 2]) {
    let value = |a: f64, b: f64| {
        let highest = cuts.iter().map(|c| c[0] - a * c[1] - b * c[2]).fold(f64::NEG_INFINITY, f64::max);
        highest + FLAT * (a * a + b * b)
    };
    let along = |a: f64| golden(steep, |b| value(a, b));
    let (least, a) = golden(steep, |a| along(a).0);
    (least, [a, along(a).1])
}

/// The least value of a convex function on `-end..end` and where it is.
fn golden(end: f64, f: impl Fn(f64) -> f64) -> (f64, f64) {
    /// The golden section, (sqrt 5 - 1) / 2: of the two places of one interval, one is that of the next.
    const SHARE: f64 = 0.618_033_988_749_894_8;
    let (mut lo, mut hi) = (-end, end);
    let [mut x, mut y] = [hi - SHARE * (hi - lo), lo + SHARE * (hi - lo)];
    let [mut fx, mut fy] = [f(x), f(y)];
    // 0.618^40 = 4e-9 of the first interval: finer than a tilt axis can be commanded.
    for _ in 0..40 {
        if fx <= fy {
            (hi, y, fy) = (y, x, fx);
            x = hi - SHARE * (hi - lo);
            fx = f(x);
        } else {
            (lo, x, fx) = (x, y, fy);
            y = lo + SHARE * (hi - lo);
            fy = f(y);
        }
    }
    if fx <= fy { (fx, x) } else { (fy, y) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_points_farthest_apart_over_a_plane_are_those_off_it() {
        // Four corners of a plane of slopes 0.5 and -0.25, one of them 3 too high.
        let points = [[0.0, 0.0, 0.0], [4.0, 0.0, 2.0], [0.0, 4.0, -1.0], [4.0, 4.0, 4.0]];
        let (range, [z, x, y]) = farthest_apart(&points, [0.5, -0.25]);
        assert_eq!((range, z - 0.5 * x + 0.25 * y), (3.0, 3.0));
    }
}

//! How few stops a job needs at least: what is taken of its marks, and the certificate.
//!
//! The bound holds for all upright stops that the machine can take, whatever the method: for closed boxes
//! of the usable field by the depth range. Of a circular field the box is the square around it, which holds all that a
//! stop can mark. Points of marks are rounded to the nanometre, as are cuts, so
//! boxes are taken a few nm larger than they are. With a zoom optic a stop holds all that lies within the optic's reach. Where `keep_whole` asks for whole figures and the method
//! keeps them, figures that a stop holds count as one piece. What was too short to be marked does not count.

use std::collections::HashSet;

use super::grid::PassGrid;
use super::methods::row;
use crate::partition::bound::{self, Certificate};
use crate::partition::box_index::Item;
use crate::projection::{HeightRange, Samples, Sampling};
use crate::split::Sliver;
use terrace_core::geom::{Nm, P2};
use terrace_core::machine::Machine;
use terrace_input::job::{Focus, Level, Method};
use terrace_input::texture::Texture;

/// What rounding may do to a box.
const ROUNDING: Nm = Nm(4);

/// Cells along a window that places without marks are noted in, at most.
const FINE_CELLS: i64 = 1_000;

/// Cells along a window; no window holds both ends of this many.
const CELLS: i64 = 64;

/// What a stop holds at most, nm; None where it is out of reach of 32 bits.
pub(super) fn size(machine: &Machine, focus: &Focus) -> Option<[i32; 3]> {
    let [width, height] = machine.field_box();
    let depth = match (machine.most_focus_shift(), focus.level) {
        (Nm(0), _) => focus.depth,
        (shift, Level::Mid) => shift * 2 + focus.depth + machine.increment_nm() * 2,
        (shift, Level::Mean) => (shift + focus.depth) * 2,
    };
    let size = [width, height, depth].map(|v| i32::try_from((v + ROUNDING).0));
    let [Ok(x), Ok(y), Ok(z)] = size else { return None };
    [x, y, z].iter().all(|&v| v < 1 << 30).then_some([x, y, z])
}

/// What is taken of the marks for stops of this size.
pub(super) fn sampling(size: [i32; 3], texture: &Texture) -> Sampling {
    let area = texture.bounds();
    let cell = Nm(i64::from(size[0].min(size[1])) / CELLS + 1);
    let origin = P2::new((area.lo.x + area.hi.x) / 2, (area.lo.y + area.hi.y) / 2);
    Sampling { rows: bound::rows(size[2]), cell, origin, every: every(texture, cell) }
}

/// Strokes may be so dense that every few of them leave marks in every cell: how few.
fn every(texture: &Texture, cell: Nm) -> usize {
    let spacing = texture.spacing_estimate().lines;
    // Every hundredth stroke at most: density may differ from place to place.
    if spacing > 0.0 { ((cell.f64() / spacing) as usize).clamp(1, 100) } else { 1 }
}

/// The bound for what `method` made of `marks` with stops of this size.
pub(super) fn certificate(
    grid: &PassGrid,
    marks: Option<Samples>,
    size: Option<[i32; 3]>,
    method: Method,
    slivers: &[Sliver],
) -> Option<Certificate> {
    // Tilted stops hold more than upright boxes.
    if !row(method).has_bound {
        return None;
    }
    let (mut marks, size) = (marks?, size?);
    let slivers = SliverCells::new(slivers, marks.origin(), i64::from(size[0].min(size[1])) / FINE_CELLS);
    let mut points = marks.points();
    points.retain(|&p| !slivers.touches(p, p));
    let by_points = bound::lower_bound(&points, size);
    // `contour` cuts figures at its levels.
    if grid.keep.0 == Nm(0) || !row(method).keeps_figures {
        return Some(by_points);
    }
    let heights = |f: &[[i32; 3]; 2]| HeightRange { lo: f64::from(f[0][2]), hi: f64::from(f[1][2]) };
    let is_whole = |f: &[[i32; 3]; 2]| grid.lattice.holds(heights(f)) && !slivers.touches(f[0], f[1]);
    let figures = marks.figures();
    let most = figures.len().div_ceil(MOST_FIGURES).max(1);
    let whole = figures.into_iter().step_by(most).filter(is_whole);
    let figures: Vec<Item> = whole.map(|[lo, hi]| Item { lo, hi }).collect();
    let by_figures = bound::lower_bound_whole(&figures, size);
    Some(if by_figures.stops() > by_points.stops() { by_figures } else { by_points })
}

/// Places about what was too short to be marked, of which the bound does not speak: cells of the plane.
struct SliverCells {
    cells: HashSet<[i64; 2]>,
    width: i64,
}

impl SliverCells {
    /// The cells of the slivers; `origin` is what points are counted from. Cells are as wide as the longest sliver, and
    /// `least`, so that a box covers few of them.
    fn new(slivers: &[Sliver], origin: P2, least: i64) -> Self {
        let longest = slivers.iter().flat_map(|s| [0, 1].map(|k| s.hi[k] - s.lo[k])).max();
        let width = (longest.unwrap_or_default() + ROUNDING.0).max(least);
        let mut sliver_cells = Self { cells: HashSet::new(), width };
        for s in slivers {
            let local = |at: [i64; 3], by: i64| [at[0] - origin.x + by, at[1] - origin.y + by];
            let cells: Vec<_> = sliver_cells.over(local(s.lo, -ROUNDING.0), local(s.hi, ROUNDING.0)).collect();
            sliver_cells.cells.extend(cells);
        }
        sliver_cells
    }

    /// Whether a box from `lo` to `hi` touches one of the cells.
    fn touches(&self, lo: [i32; 3], hi: [i32; 3]) -> bool {
        let local = |at: [i32; 3]| [at[0], at[1]].map(i64::from);
        !self.cells.is_empty() && self.over(local(lo), local(hi)).any(|cell| self.cells.contains(&cell))
    }

    /// The cells that a box from `lo` to `hi` touches.
    fn over(&self, lo: [i64; 2], hi: [i64; 2]) -> impl Iterator<Item = [i64; 2]> + use<> {
        let [lo, hi] = [lo, hi].map(|at| at.map(|v| v.div_euclid(self.width)));
        (lo[1]..=hi[1]).flat_map(move |y| (lo[0]..=hi[0]).map(move |x| [x, y]))
    }
}

/// Figures that are looked at, at most: the search takes seconds for more.
const MOST_FIGURES: usize = 200_000;

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::machine::FieldShape;
    use terrace_core::math;
    use terrace_core::random::Random;
    use terrace_core::units::Length;

    /// Whether one circle of this radius and a depth hold all of some points: the circle is one through two of them, or
    /// about one.
    fn one_stop_holds(points: &[[i32; 3]], radius: f64, depth: i32) -> bool {
        let heights = || points.iter().map(|p| p[2]);
        if heights().max().zip(heights().min()).is_some_and(|(hi, lo)| hi - lo > depth) {
            return false;
        }
        let at: Vec<[f64; 2]> = points.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
        let mut centres = at.clone();
        for (i, a) in at.iter().enumerate() {
            for b in &at[i + 1..] {
                let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
                let half = math::hypot(dx, dy) / 2.0;
                if half > 0.0 && half <= radius {
                    let off = (radius * radius - half * half).sqrt() / (2.0 * half);
                    let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
                    centres.extend([1.0, -1.0].map(|s| [middle[0] - s * off * dy, middle[1] + s * off * dx]));
                }
            }
        }
        centres.iter().any(|c| at.iter().all(|p| math::hypot(p[0] - c[0], p[1] - c[1]) <= radius + 1.0))
    }

    /// The least number of stops, by trying every way to part the points.
    fn least(points: &[[i32; 3]], radius: f64, depth: i32) -> usize {
        let all = (1usize << points.len()) - 1;
        let chosen =
            |set: usize| (0..points.len()).filter(|i| set >> i & 1 == 1).map(|i| points[i]).collect::<Vec<_>>();
        let is_held: Vec<bool> = (0..=all).map(|set| one_stop_holds(&chosen(set), radius, depth)).collect();
        let mut least = vec![usize::MAX; all + 1];
        least[0] = 0;
        for set in 1..=all {
            let mut part = set;
            while part > 0 {
                if is_held[part] {
                    least[set] = least[set].min(1 + least[set & !part]);
                }
                part = (part - 1) & set;
            }
        }
        least[all]
    }

    #[test]
    fn no_bound_of_a_circular_field_is_above_the_least_cover_by_circles() {
        let text = "surface.file = \"a.stl\"\nsurface.unit = \"mm\"\nfocus.pdof = \"0.07 mm\"\n\
                    machine.profile = \"xyz-galvo-40\"\n[[texture]]\npattern = \"hatch\"\npitch = \"1 mm\"\n\
                    [[pen]]\nname = \"a\"\nspeed = \"1 m/s\"\npower = \"50 %\"\nfrequency = \"60 kHz\"\n";
        let job =
            terrace_input::job::Job::parse(std::path::Path::new("a.toml"), text, &Default::default()).expect("a job");
        let mut machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        (machine.lens.shape, machine.lens.field) = (FieldShape::Circle, [Length::mm(20.0); 2]);
        let size = size(&machine, &job.focus).expect("a size");
        // A line of 19 mm.
        assert_eq!(bound::lower_bound(&[[0, 0, 0], [9_500_000, 0, 0], [19_000_000, 0, 0]], size).stops(), 1);
        let mut random = Random::new(41);
        let mut sharp = 0;
        for case in 0..30 {
            let extent = random.between(10_000_000, 60_000_000);
            let heights = if case % 2 == 0 { 0 } else { 150_000 };
            let mut point = || [extent, extent, heights].map(|v| random.between(0, v) as i32);
            let points: Vec<[i32; 3]> = (0..9).map(|_| point()).collect();
            let (found, least) = (bound::lower_bound(&points, size).stops(), least(&points, 10_000_000.0, size[2]));
            assert!((1..=least).contains(&found), "{found} of {least}: {points:?}");
            sharp += usize::from(found == least);
        }
        assert!(sharp >= 10, "{sharp} of 30 are as large as they can be");
    }
}

//! The texture as small boxes: what windows that are placed freely must hold.

use super::{GridTracer, Keep, Piece, segments};
use terrace_core::geom::{Nm, P2};

/// Slabs of height whose borders lie on the stage's lattice: any eight of them that follow each other
/// are exactly as high as the depth range D less twice the hysteresis.
#[derive(Clone, Copy, Debug)]
pub struct Slabs {
    /// Lower border of slab 0; on the lattice.
    pub z0: Nm,
    /// Depth range; a whole number of steps.
    pub depth: Nm,
    /// By how much a stop that holds a slab reaches beyond it up and down; a whole number of steps,
    /// less than half the depth range.
    pub hysteresis: Nm,
    /// Stage increment.
    pub step: Nm,
}

impl Slabs {
    /// Slabs in a depth range.
    pub const COUNT: i64 = 8;

    /// Height of eight slabs.
    fn height(&self) -> Nm {
        self.depth - self.hysteresis * 2
    }

    /// Whether a stop on the lattice admits heights from `lo` to `hi`.
    fn holds(&self, lo: Nm, hi: Nm) -> bool {
        lo - (lo - self.z0).rem_euclid(self.step) + self.depth >= hi
    }

    /// Lower border of slab `k`.
    pub fn border(&self, k: i64) -> Nm {
        let steps = k * (self.height() / self.step);
        self.z0 + self.step * (steps + Self::COUNT / 2).div_euclid(Self::COUNT)
    }

    /// The slab that holds `z`, its lower border included.
    fn of(&self, z: f64) -> i64 {
        let mut k = ((z - self.z0.f64()) * Self::COUNT as f64 / self.height().f64()).floor() as i64;
        while self.border(k).f64() > z {
            k -= 1;
        }
        while self.border(k + 1).f64() <= z {
            k += 1;
        }
        k
    }
}

/// The box of a stroke that is to stay whole, nm.
pub type Figure = [[i64; 3]; 2];

/// The texture as boxes: cells of a fine grid, each cut into slabs, and whole figures. Sets, kept sorted.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    /// Row, column, slab; packed so that they sort in that order.
    keys: Vec<u64>,
    sorted: usize,
    figures: Vec<Figure>,
}

/// Adds the keys of the slabs of a cell that a piece lies in.
#[inline]
fn add_boxes(keys: &mut Vec<u64>, slabs: &Slabs, p: &Piece, [column, row]: [i64; 2]) {
    let (lo, hi) = (p.z0.min(p.z1), p.z0.max(p.z1));
    let first = slabs.of(lo);
    let mut last = slabs.of(hi);
    // Boxes are closed: what ends on a border needs no box above it.
    last -= i64::from(last > first && slabs.border(last).f64() >= hi);
    // Rounding may put the lowest mark of all a hair below slab 0.
    for k in first.max(0)..=last.max(0) {
        let key = ((row as u64) << Cells::COLUMN | column as u64) << Cells::SLAB | k as u64;
        // Pieces that follow each other often lie in one box.
        if keys.last() != Some(&key) {
            keys.push(key);
        }
    }
}

impl Cells {
    /// Bits of a slab's number and of a column's in a key of 64, of which the row has the rest.
    const SLAB: u32 = 24;
    const COLUMN: u32 = 20;

    /// Most columns, rows and slabs of a grid.
    pub const MOST: i64 = 1 << Self::COLUMN;

    /// Adds one stroke, traced over the fine grid. Heights lie at or above the lowest slab.
    pub fn add(&mut self, points: &[P2], tracer: &mut GridTracer<'_>, slabs: &Slabs, keep: Keep) {
        let keys = &mut self.keys;
        if let Some(bounds) = keep.bounds(points) {
            let (z, is_whole) = tracer.small_stroke(points, |_, _, _| ());
            let (lo, hi) = (Nm::floor(z[0]), Nm::ceil(z[1]));
            if is_whole && slabs.holds(lo, hi) {
                let P2 { x, y, .. } = bounds.hi;
                self.figures.push([[bounds.lo.x, bounds.lo.y, lo.0], [x, y, hi.0]]);
            } else {
                tracer.replay(|p, cell| add_boxes(keys, slabs, &p, cell));
            }
        } else {
            for (a, b) in segments(points) {
                tracer.segment(a, b, |p, cell| add_boxes(keys, slabs, &p, cell));
            }
        }
        // Sorted again only when it has doubled: strokes next to each other add the same cells.
        if self.keys.len() > 2 * self.sorted + (1 << 16) {
            self.tidy();
        }
    }

    /// Sorts the keys, each once.
    fn tidy(&mut self) {
        self.keys.sort_unstable();
        self.keys.dedup();
        self.sorted = self.keys.len();
    }

    /// Joins what another part of the texture found.
    pub fn merge(&mut self, mut other: Self) {
        self.keys.append(&mut other.keys);
        self.figures.append(&mut other.figures);
        self.tidy();
    }

    /// The whole figures, sorted.
    pub(crate) fn take_figures(&mut self) -> Vec<Figure> {
        self.figures.sort_unstable();
        std::mem::take(&mut self.figures)
    }

    /// Column, row and slab of every box, by row, column and slab.
    pub fn list(mut self) -> impl ExactSizeIterator<Item = [i64; 3]> + Clone {
        self.tidy();
        self.keys.into_iter().map(|key| {
            let bits = |shift: u32, count: u32| (key >> shift & ((1 << count) - 1)) as i64;
            [bits(Self::SLAB, Self::COLUMN), bits(Self::SLAB + Self::COLUMN, Self::COLUMN), bits(0, Self::SLAB)]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Tracer;
    use super::super::tests::{LINES, MM, ends, slope};
    use super::*;
    use terrace_core::program::Sections;

    #[test]
    fn eight_slabs_are_one_depth_range_wherever_they_begin() {
        for (depth, hysteresis, step) in [(70_000, 0, 100), (70_000, 5100, 100), (200, 0, 100), (68_600, 600, 200)] {
            let [depth, hysteresis, step] = [depth, hysteresis, step].map(Nm);
            let slabs = Slabs { z0: Nm(-300), depth, hysteresis, step };
            for k in -20..20 {
                assert_eq!(slabs.border(k + Slabs::COUNT) - slabs.border(k), depth - hysteresis * 2);
                assert_eq!((slabs.border(k) + Nm(300)) % step, Nm(0));
                for z in [slabs.border(k).f64(), slabs.border(k + 1).f64() - 1e-3] {
                    let of = slabs.of(z);
                    assert!(slabs.border(of).f64() <= z && z < slabs.border(of + 1).f64(), "{depth:?} {k} {z}");
                }
            }
        }
    }

    #[test]
    fn cells_hold_every_mark() {
        let surface = slope();
        let grid = Sections { origin: P2::new(0, 0), pitch: [Nm(MM / 2); 2], count: [18, 18] };
        let slabs = Slabs { z0: Nm(0), depth: Nm(70_000), hysteresis: Nm(0), step: Nm(100) };
        let mut tracer = GridTracer::new(Tracer::new(&surface, 1.0), &grid);
        let mut cells = Cells::default();
        for (a, b) in LINES.map(ends) {
            cells.add(&[a, b], &mut tracer, &slabs, Keep::default());
        }
        let list: Vec<[i64; 3]> = cells.list().collect();
        assert!(list.windows(2).all(|w| [w[0][1], w[0][0], w[0][2]] < [w[1][1], w[1][0], w[1][2]]));
        for (a, b) in LINES.map(ends) {
            for i in 0..=1000 {
                let p = a.lerp(b, f64::from(i) / 1000.0);
                let z = 0.1 * p.x as f64;
                let held = list.iter().any(|&[column, row, slab]| {
                    let (x, y) = (column * MM / 2, row * MM / 2);
                    (x..=x + MM / 2).contains(&p.x)
                        && (y..=y + MM / 2).contains(&p.y)
                        && slabs.border(slab).f64() - 1.0 <= z
                        && z <= slabs.border(slab + 1).f64() + 1.0
                });
                assert!(held || p.x < 0 || p.x > 9 * MM, "{p:?}");
            }
        }
        // A line needs a box for every slab and every cell border that it crosses.
        assert!(list.len() < 107 + 133 + 13 + 94 + 121, "and little else: {}", list.len());
    }
}

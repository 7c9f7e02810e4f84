//! A texture stroke traced over the surface: what lies under it, piece by piece.
//!
//! Consumes strokes of the texture and the surface; promises pieces that tile every segment of the
//! stroke: the height of each is linear, or it says why it is not marked. Partition and split both
//! look at the part through this one window, so what the first saw is what the second cuts. What
//! partition sees is the [`Footprint`], the heights of the marks in every section, and the [`Cells`],
//! the texture as small boxes. Units: nm; slopes as squared tangents.

use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use crate::geom::P2;
use crate::program::Sections;
use crate::surface::{Cursor, Span, Surface};

/// Why a piece is not marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skip {
    /// No part under it.
    OffPart,
    /// The surface is steeper than the limit.
    Steep,
}

/// A stretch of one segment.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// Parameters on the segment, 0 to 1, t0 < t1.
    pub t0: f64,
    /// See `t0`.
    pub t1: f64,
    /// Heights at the two ends, nm; without meaning on skipped pieces.
    pub z0: f64,
    /// See `z0`.
    pub z1: f64,
    /// Why the piece is not marked, if it is not.
    pub skip: Option<Skip>,
}

impl Piece {
    /// Height at parameter `t` of the segment, never beyond those of the ends.
    #[inline]
    pub fn z(&self, t: f64) -> f64 {
        if t >= self.t1 {
            self.z1
        } else if t <= self.t0 {
            self.z0
        } else {
            self.z0 + (self.z1 - self.z0) * ((t - self.t0) / (self.t1 - self.t0))
        }
    }
}

/// Traces strokes; holds what can be reused from one to the next.
pub struct Tracer<'a> {
    surface: &'a Surface,
    max_slope2: f64,
    cursor: Cursor,
    spans: Vec<Span>,
    /// Largest squared slope of what was marked so far.
    pub worst_slope2: f64,
}

impl<'a> Tracer<'a> {
    /// `max_slope` is the tangent of the steepest slope that is marked.
    pub fn new(surface: &'a Surface, max_slope: f64) -> Self {
        Self {
            surface,
            max_slope2: max_slope * max_slope,
            cursor: Cursor::default(),
            spans: Vec::new(),
            worst_slope2: 0.0,
        }
    }

    /// Hands the pieces of the segment from `a` to `b` (a ≠ b) to `sink` in order.
    pub fn segment(&mut self, a: P2, b: P2, mut sink: impl FnMut(Piece)) {
        self.surface.walk(a, b, &mut self.cursor, &mut self.spans);
        for span in &self.spans {
            let skip = match span.facet() {
                None => Some(Skip::OffPart),
                Some(f) => {
                    let slope2 = self.surface.slope2(f);
                    if slope2 > self.max_slope2 {
                        Some(Skip::Steep)
                    } else {
                        self.worst_slope2 = self.worst_slope2.max(slope2);
                        None
                    }
                }
            };
            sink(Piece { t0: span.t0, t1: span.t1, z0: span.z0, z1: span.z1, skip });
        }
    }
}

/// Traces strokes over a grid: what is marked, cut at the lines of the grid.
pub struct GridTracer<'a> {
    tracer: Tracer<'a>,
    grid: &'a Sections,
    cuts: Vec<(f64, [i64; 2])>,
}

impl<'a> GridTracer<'a> {
    /// Pieces are cut where they leave a cell of `grid`.
    pub fn new(tracer: Tracer<'a>, grid: &'a Sections) -> Self {
        Self { tracer, grid, cuts: Vec::new() }
    }

    /// Hands the marked pieces of the segment from `a` to `b` (a ≠ b) to `sink` in order, each with its
    /// cell: column and row.
    pub fn segment(&mut self, a: P2, b: P2, mut sink: impl FnMut(Piece, [i64; 2])) {
        self.cut(a, b);
        let Self { tracer, cuts, .. } = self;
        let mut cut = 0;
        tracer.segment(a, b, |p| {
            if p.skip.is_some() {
                return;
            }
            // `cuts[cut]` is the cell at the piece's begin; later cuts inside the piece divide it.
            let mut t = p.t0;
            loop {
                while cut + 1 < cuts.len() && cuts[cut + 1].0 <= t {
                    cut += 1;
                }
                let end = match cuts.get(cut + 1) {
                    Some(&(at, _)) if at < p.t1 => at,
                    _ => p.t1,
                };
                sink(Piece { t0: t, t1: end, z0: p.z(t), z1: p.z(end), skip: None }, cuts[cut].1);
                if end >= p.t1 {
                    break;
                }
                t = end;
            }
        });
    }

    /// The cells along the segment: parameter at which each begins, column and row.
    fn cut(&mut self, a: P2, b: P2) {
        let d = [b.x - a.x, b.y - a.y];
        let from = [a.x, a.y];
        let mut at = [self.grid.along(0, a.x, d[0]), self.grid.along(1, a.y, d[1])];
        let to = [self.grid.along(0, b.x, -d[0]), self.grid.along(1, b.y, -d[1])];
        // A segment that stays on a border stays on the side it began on.
        let to = [if d[0] == 0 { at[0] } else { to[0] }, if d[1] == 0 { at[1] } else { to[1] }];
        self.cuts.clear();
        self.cuts.push((0.0, at));
        while at != to {
            let next = [0, 1].map(|axis| {
                if at[axis] == to[axis] {
                    return f64::INFINITY;
                }
                let line = self.grid.line(axis, at[axis] + i64::from(d[axis] > 0));
                (line - from[axis]) as f64 / d[axis] as f64
            });
            let t = next[0].min(next[1]);
            for axis in 0..2 {
                if next[axis] == t {
                    at[axis] += d[axis].signum();
                }
            }
            self.cuts.push((t, at));
        }
    }
}

/// Disjoint, sorted intervals of height, nm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heights {
    list: Vec<(f64, f64)>,
    /// Not joined yet: joined in one go, so that many separate intervals cost no more than sorting.
    new: Vec<(f64, f64)>,
}

impl Heights {
    /// Adds the interval between `a` and `b`.
    pub fn add(&mut self, a: f64, b: f64) {
        let (lo, hi) = (a.min(b), a.max(b));
        let i = self.list.partition_point(|&(_, h)| h < lo);
        let alone = self.new.is_empty() && self.list.len() == 1;
        match self.list.get_mut(i) {
            Some((l, h)) if *l <= lo && hi <= *h => return,
            Some((l, h)) if alone && *l <= hi => {
                return (*l, *h) = (l.min(lo), h.max(hi));
            }
            _ => self.new.push((lo, hi)),
        }
        if self.new.len() > self.list.len() + 16 {
            self.join();
        }
    }

    /// Joins what was added, where it touches.
    pub fn join(&mut self) {
        if self.new.is_empty() {
            return;
        }
        self.list.append(&mut self.new);
        self.list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        self.list.dedup_by(|next, last| {
            let touches = next.0 <= last.1;
            if touches {
                last.1 = last.1.max(next.1);
            }
            touches
        });
    }

    /// The intervals, upwards; joined.
    pub fn intervals(&self) -> &[(f64, f64)] {
        debug_assert!(self.new.is_empty());
        &self.list
    }
}

/// Where the texture touches the surface: the heights of its marks in every section.
#[derive(Clone, Debug, Default)]
pub struct Footprint {
    /// By section; most sections of a large grid may hold nothing.
    heights: FxHashMap<u32, Heights>,
}

impl Footprint {
    /// Adds one stroke, traced over the grid of sections.
    pub fn add(&mut self, points: &[P2], tracer: &mut GridTracer<'_>) {
        // Pieces of one section that follow each other make one interval each time the section or
        // the sheet changes.
        let mut run: Option<([i64; 2], f64, f64)> = None;
        let columns = i64::from(tracer.grid.count[0]);
        let heights = &mut self.heights;
        let mut close = |run: &mut Option<([i64; 2], f64, f64)>| {
            if let Some(([column, row], lo, hi)) = run.take() {
                heights.entry((row * columns + column) as u32).or_default().add(lo, hi);
            }
        };
        for w in points.windows(2) {
            tracer.segment(w[0], w[1], |p, cell| match &mut run {
                Some((at, lo, hi)) if *at == cell && p.z0 <= *hi && p.z0 >= *lo => {
                    *lo = lo.min(p.z1);
                    *hi = hi.max(p.z1);
                }
                run => {
                    close(run);
                    *run = Some((cell, p.z0.min(p.z1), p.z0.max(p.z1)));
                }
            });
        }
        close(&mut run);
    }

    /// Joins what another part of the texture found.
    pub fn merge(&mut self, other: Self) {
        for (section, mut theirs) in other.heights {
            match self.heights.entry(section) {
                Entry::Vacant(mine) => _ = mine.insert(theirs),
                Entry::Occupied(mine) => mine.into_mut().new.append(&mut {
                    theirs.join();
                    theirs.list
                }),
            }
        }
    }

    /// The same with all intervals joined, as the next functions need it.
    #[must_use]
    pub fn joined(mut self) -> Self {
        self.heights.values_mut().for_each(Heights::join);
        self
    }

    /// The intervals of a section, upwards.
    pub fn of_section(&self, section: usize) -> &[(f64, f64)] {
        self.heights.get(&(section as u32)).map_or(&[], Heights::intervals)
    }

    /// Lowest and highest mark, nm; None where nothing is marked.
    pub fn range(&self) -> Option<(f64, f64)> {
        let all = self.heights.values().flat_map(Heights::intervals);
        all.fold(None, |r: Option<(f64, f64)>, &(lo, hi)| Some(r.map_or((lo, hi), |(a, b)| (a.min(lo), b.max(hi)))))
    }
}

/// Slabs of height, eight to a depth range D, whose borders lie on the stage's lattice: any eight of
/// them that follow each other are D high, exactly.
#[derive(Clone, Copy, Debug)]
pub struct Slabs {
    /// Lower border of slab 0, nm; on the lattice.
    pub z0: i64,
    /// Depth range, nm; a whole number of steps.
    pub depth: i64,
    /// Stage increment, nm.
    pub step: i64,
}

impl Slabs {
    /// Slabs in a depth range.
    pub const COUNT: i64 = 8;

    /// Lower border of slab `k`, nm.
    pub fn border(&self, k: i64) -> i64 {
        let steps = k * (self.depth / self.step);
        self.z0 + (steps + Self::COUNT / 2).div_euclid(Self::COUNT) * self.step
    }

    /// The slab that holds `z`, its lower border included.
    fn of(&self, z: f64) -> i64 {
        let mut k = ((z - self.z0 as f64) * Self::COUNT as f64 / self.depth as f64).floor() as i64;
        while self.border(k) as f64 > z {
            k -= 1;
        }
        while self.border(k + 1) as f64 <= z {
            k += 1;
        }
        k
    }
}

/// The texture as small boxes that hold it: cells of a fine grid, each cut into slabs. A set, kept
/// sorted.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    /// Row, column, slab; packed so that they sort in that order.
    keys: Vec<u64>,
    sorted: usize,
}

impl Cells {
    /// Bits of a slab's number and of a column's.
    const SLAB: u32 = 24;
    const COLUMN: u32 = 20;

    /// Most columns, rows and slabs of a grid.
    pub const MOST: i64 = 1 << Self::COLUMN;

    /// Adds one stroke, traced over the fine grid. Heights lie at or above the lowest slab.
    pub fn add(&mut self, points: &[P2], tracer: &mut GridTracer<'_>, slabs: &Slabs) {
        for w in points.windows(2) {
            tracer.segment(w[0], w[1], |p, [column, row]| {
                let (lo, hi) = (p.z0.min(p.z1), p.z0.max(p.z1));
                let first = slabs.of(lo);
                let mut last = slabs.of(hi);
                // Boxes are closed: what ends on a border needs no box above it.
                last -= i64::from(last > first && slabs.border(last) as f64 >= hi);
                for k in first.max(0)..=last.max(0) {
                    let key = ((row as u64) << Self::COLUMN | column as u64) << Self::SLAB | k as u64;
                    if self.keys.last() != Some(&key) {
                        self.keys.push(key);
                    }
                }
            });
        }
        if self.keys.len() > 2 * self.sorted + (1 << 16) {
            self.tidy();
        }
    }

    fn tidy(&mut self) {
        self.keys.sort_unstable();
        self.keys.dedup();
        self.sorted = self.keys.len();
    }

    /// Joins what another part of the texture found.
    pub fn merge(&mut self, mut other: Self) {
        self.keys.append(&mut other.keys);
        self.tidy();
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
    use super::*;

    #[test]
    fn heights_join_what_touches_and_nothing_else() {
        let mut h = Heights::default();
        for (a, b) in [(5.0, 6.0), (1.0, 2.0), (9.0, 8.0), (2.0, 3.0)] {
            h.add(a, b);
        }
        h.join();
        assert_eq!(h.intervals(), [(1.0, 3.0), (5.0, 6.0), (8.0, 9.0)]);
        h.add(2.5, 8.5);
        h.join();
        assert_eq!(h.intervals(), [(1.0, 9.0)]);
    }

    /// Two facets that rise along x, a tenth of it, over 9 x 9 mm.
    fn slope() -> Surface {
        let facets =
            [[[0.0, 0.0, 0.0], [9.0, 0.0, 0.9], [9.0, 9.0, 0.9]], [[0.0, 0.0, 0.0], [9.0, 9.0, 0.9], [0.0, 9.0, 0.0]]];
        Surface::from_facets(facets, &mut Vec::new()).expect("two facets")
    }

    const MM: i64 = 1_000_000;
    const LINES: [((i64, i64), (i64, i64)); 5] =
        [((0, 0), (8, 8)), ((9, 1), (0, 7)), ((2, 8), (2, 0)), ((8, 4), (1, 4)), ((-1, 3), (10, 3))];

    fn ends((a, b): ((i64, i64), (i64, i64))) -> (P2, P2) {
        (P2::new(a.0 * MM, a.1 * MM), P2::new(b.0 * MM, b.1 * MM))
    }

    #[test]
    fn pieces_tile_the_segment() {
        let surface = slope();
        let mut tracer = Tracer::new(&surface, 1.0);
        for (a, b) in LINES.map(ends) {
            let mut t = 0.0;
            tracer.segment(a, b, |p| {
                assert_eq!(p.t0, t);
                assert!(p.t1 > p.t0);
                t = p.t1;
                let mid = a.lerp(b, (p.t0 + p.t1) / 2.0);
                match p.skip {
                    None => assert!((p.z0 - 0.1 * a.lerp(b, p.t0).x as f64).abs() < 2.0),
                    Some(skip) => assert!(skip == Skip::OffPart && (mid.x < 0 || mid.x > 9 * MM)),
                }
            });
            assert_eq!(t, 1.0);
        }
    }

    #[test]
    fn gridded_pieces_tile_what_is_marked_and_lie_in_their_cells() {
        let surface = slope();
        let grid = Sections { origin: P2::new(0, 0), pitch: [2 * MM, 2 * MM], count: [5, 5] };
        let mut tracer = GridTracer::new(Tracer::new(&surface, 1.0), &grid);
        for (a, b) in LINES.map(ends) {
            let mut length = 0.0;
            tracer.segment(a, b, |p, cell| {
                length += p.t1 - p.t0;
                let mid = a.lerp(b, (p.t0 + p.t1) / 2.0);
                assert_eq!(cell, [grid.along(0, mid.x, 0), grid.along(1, mid.y, 0)], "{a:?} {b:?} {p:?}");
                assert!((p.z0 - 0.1 * a.lerp(b, p.t0).x as f64).abs() < 2.0);
            });
            let want = if a.x < 0 { 9.0 / 11.0 } else { 1.0 };
            assert!((length - want).abs() < 1e-9, "{a:?} {b:?}: {length}");
        }
    }

    #[test]
    fn eight_slabs_are_one_depth_range_wherever_they_begin() {
        for (depth, step) in [(70_000, 100), (1000, 100), (200, 100), (68_600, 200)] {
            let slabs = Slabs { z0: -300, depth, step };
            for k in -20..20 {
                assert_eq!(slabs.border(k + Slabs::COUNT) - slabs.border(k), depth);
                assert_eq!((slabs.border(k) + 300) % step, 0);
                for z in [slabs.border(k) as f64, slabs.border(k + 1) as f64 - 1e-3] {
                    let of = slabs.of(z);
                    assert!(slabs.border(of) as f64 <= z && z < slabs.border(of + 1) as f64, "{depth} {k} {z}");
                }
            }
        }
    }

    #[test]
    fn cells_hold_every_mark() {
        let surface = slope();
        let grid = Sections { origin: P2::new(0, 0), pitch: [MM / 2, MM / 2], count: [18, 18] };
        let slabs = Slabs { z0: 0, depth: 70_000, step: 100 };
        let mut tracer = GridTracer::new(Tracer::new(&surface, 1.0), &grid);
        let mut cells = Cells::default();
        for (a, b) in LINES.map(ends) {
            cells.add(&[a, b], &mut tracer, &slabs);
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
                        && slabs.border(slab) as f64 - 1.0 <= z
                        && z <= slabs.border(slab + 1) as f64 + 1.0
                });
                assert!(held || p.x < 0 || p.x > 9 * MM, "{p:?}");
            }
        }
        // A line needs a box for every slab and every cell border that it crosses.
        assert!(list.len() < 107 + 133 + 13 + 94 + 121, "and little else: {}", list.len());
    }
}

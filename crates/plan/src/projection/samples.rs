//! Points of marks, thinned: what a lower bound of the stops is found from.
//!
//! Consumes the pieces of strokes in the order of each stroke; promises points that lie on marks, x and y
//! rounded to the nanometre, and figures that are to stay whole: at most one for every small cell of the
//! plane and height, and at most some million in all. What is kept follows from the set of strokes alone,
//! in whatever order they come and are joined. Units: nm, from the centre of the texture and height 0.

use super::Piece;
use terrace_core::geom::{Box2, Nm, P2};

/// Heights at which points are taken: multiples of a pitch, of every few the first ones.
#[derive(Clone, Copy, Debug)]
pub struct Rows {
    /// Distance of rows, nm.
    pub pitch: i32,
    /// Rows are counted in groups of this many.
    pub group: i32,
    /// Of each group this many are used, from its first.
    pub used: i32,
}

impl Rows {
    /// The heights from `lo` to `hi`.
    pub fn heights(self, lo: i32, hi: i32) -> impl Iterator<Item = i32> {
        let Self { pitch, group, used } = self;
        let first = -(-lo).div_euclid(pitch);
        (first..=hi.div_euclid(pitch)).filter(move |k| k.rem_euclid(group) < used).map(move |k| k * pitch)
    }
}

/// What is taken of the marks.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Heights of points; besides, one point is taken from each cell where strokes cross no rows.
    pub rows: Rows,
    /// Width of a cell.
    pub cell: Nm,
    /// What points are counted from.
    pub origin: P2,
    /// Points are taken from strokes whose numbers are multiples of this.
    pub every: usize,
}

/// Heights and places this far from the origin and further are left out: boxes are held in 32 bits.
const REACH: f64 = (1 << 30) as f64;

/// Heights of rows that one piece is looked at for, at most: a cliff crosses any number of them.
const CROSSINGS: usize = 256;

/// The row of points that lie at any height; that of a stroke before its first piece.
const NO_ROW: i32 = i32::MIN;

/// The whole figures and points of marks collected so far.
#[derive(Clone, Debug)]
pub struct Samples {
    sampling: Sampling,
    points: Thinned<[i32; 3]>,
    figures: Thinned<[[i32; 3]; 2]>,
    /// Whether points are taken from the stroke at hand.
    taken: bool,
    /// Row below the end of the last piece, and the way along the stroke to the next point of any height.
    row: i32,
    way: f64,
}

impl Samples {
    /// None yet.
    pub fn new(sampling: Sampling) -> Self {
        let points = Thinned::default();
        let figures = Thinned::default();
        Self { sampling, points, figures, taken: false, row: 0, way: 0.0 }
    }

    /// The pieces that follow are of stroke `number`.
    pub fn begin(&mut self, number: usize) {
        self.taken = number.is_multiple_of(self.sampling.every);
        (self.row, self.way) = (NO_ROW, 0.0);
    }

    /// Takes what is to be taken of a marked piece of the segment from `a` to `b`.
    #[inline]
    pub fn add(&mut self, p: &Piece, a: P2, b: P2) {
        if !self.taken {
            return;
        }
        let row = (p.z1 / f64::from(self.sampling.rows.pitch)).floor() as i32;
        self.way -= (p.t1 - p.t0) * a.distance(b);
        // The common case, no row crossed and no point due, costs a floor and a subtraction.
        if row != self.row || self.way < 0.0 {
            self.take(p, a, b);
            if row != self.row && self.row != NO_ROW {
                self.way = self.sampling.cell.f64();
            }
            self.row = row;
        }
    }

    /// Takes the points of a piece of the segment from `a` to `b`: where it crosses rows, and those of any height that
    /// are due. Of a dot that is its place.
    #[cold]
    fn take(&mut self, p: &Piece, a: P2, b: P2) {
        let Sampling { rows, cell, origin, .. } = self.sampling;
        let at = |t: f64, z: f64| {
            let q = a.lerp(b, t);
            let is_in_reach = q.x.abs_diff(origin.x).max(q.y.abs_diff(origin.y)) < 1 << 30 && z.abs() < REACH;
            is_in_reach.then(|| [(q.x - origin.x) as i32, (q.y - origin.y) as i32, z.round() as i32])
        };
        if a == b {
            if let Some(q) = at(0.0, p.z0) {
                self.points.add(key(q, cell, NO_ROW), q);
            }
            return;
        }
        let (lo, hi) = (p.z0.min(p.z1).max(-REACH).ceil(), p.z0.max(p.z1).min(REACH).floor());
        for h in rows.heights(lo as i32, hi as i32).take(CROSSINGS) {
            let share = if p.z0 == p.z1 { 0.0 } else { (f64::from(h) - p.z0) / (p.z1 - p.z0) };
            if let Some(q) = at(p.t0 + (p.t1 - p.t0) * share, f64::from(h)) {
                self.points.add(key(q, cell, h / rows.pitch), q);
            }
        }
        // Points of any height, one for every width of a cell along a stroke that crosses no row.
        let length = a.distance(b);
        // `way` is below 0 by how far the next point lies before the end of the piece.
        while self.way < 0.0 {
            let t = (p.t1 + self.way / length).clamp(p.t0, p.t1);
            if let Some(q) = at(t, p.z(t)) {
                self.points.add(key(q, cell, NO_ROW), q);
            }
            self.way += cell.f64();
        }
    }

    /// Takes a figure that is to stay whole, its marks between heights `z`.
    pub fn figure(&mut self, bounds: &Box2, z: [f64; 2]) {
        let Sampling { rows, cell, origin, .. } = self.sampling;
        let local = |p: P2, z: f64| [p.x - origin.x, p.y - origin.y, z as i64];
        let ends = [local(bounds.lo, z[0].floor()), local(bounds.hi, z[1].ceil())];
        if ends.iter().flatten().all(|v| v.abs() < 1 << 30) {
            let ends = ends.map(|p| p.map(|v| v as i32));
            self.figures.add(key(ends[0], cell, ends[0][2].div_euclid(rows.pitch)), ends);
        }
    }

    /// What points and figures are counted from.
    pub fn origin(&self) -> P2 {
        self.sampling.origin
    }

    /// Joins what was taken of other strokes.
    pub fn merge(&mut self, other: Self) {
        self.points.merge(other.points);
        self.figures.merge(other.figures);
    }

    /// The points, sorted.
    pub fn points(&mut self) -> Vec<[i32; 3]> {
        self.points.list()
    }

    /// Lower and upper corners of the figures, sorted.
    pub fn figures(&mut self) -> Vec<[[i32; 3]; 2]> {
        self.figures.list()
    }
}

/// The cell of a point in a row.
fn key(p: [i32; 3], cell: Nm, row: i32) -> [i32; 3] {
    let along = |v: i32| i64::from(v).div_euclid(cell.0) as i32;
    [row, along(p[0]), along(p[1])]
}

/// The least value of every key, for at most [`Thinned::MOST`] keys: of more, those with the fewest zeros
/// in the hash are dropped. Which these are does not depend on the order in which they came.
#[derive(Clone, Debug)]
struct Thinned<T> {
    list: Vec<([i32; 3], T)>,
    tidy: usize,
    zeros: u32,
}

impl<T> Default for Thinned<T> {
    fn default() -> Self {
        Self { list: Vec::new(), tidy: 0, zeros: 0 }
    }
}

impl<T: Copy + Ord> Thinned<T> {
    /// Keys that are kept, so that memory stays bounded whatever the texture.
    const MOST: usize = 1 << 20;

    #[inline]
    fn add(&mut self, key: [i32; 3], value: T) {
        if self.zeros > 0 && zeros(key) < self.zeros {
            return;
        }
        self.list.push((key, value));
        if self.list.len() > 2 * self.tidy + (1 << 16) {
            self.tidy();
        }
    }

    fn merge(&mut self, mut other: Self) {
        self.zeros = self.zeros.max(other.zeros);
        self.list.append(&mut other.list);
        self.tidy();
    }

    fn tidy(&mut self) {
        // A key that was dropped once stays dropped, in whatever part of the texture it comes again: `zeros` only
        // grows.
        self.list.retain(|e| zeros(e.0) >= self.zeros);
        // Sorted parts that follow each other are merged by this sort.
        self.list.sort();
        self.list.dedup_by_key(|e| e.0);
        while self.list.len() > Self::MOST {
            self.zeros += 1;
            self.list.retain(|e| zeros(e.0) >= self.zeros);
        }
        self.tidy = self.list.len();
    }

    fn list(&mut self) -> Vec<T> {
        self.tidy();
        let mut out: Vec<T> = self.list.iter().map(|e| e.1).collect();
        out.sort_unstable();
        out
    }
}

/// How many zeros end the hash of a key.
fn zeros(key: [i32; 3]) -> u32 {
    let mix = |h: u64, v: i32| (h ^ u64::from(v as u32)).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
    let h = key.iter().fold(0, |h, &v| mix(h, v));
    (h ^ h >> 32).wrapping_mul(0xBF58_476D_1CE4_E5B9).leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::super::Tracer;
    use super::super::tests::{LINES, MM, ends, slope};
    use super::*;
    use terrace_core::math;

    const SAMPLING: Sampling = Sampling {
        rows: Rows { pitch: 8750, group: 8, used: 2 },
        cell: Nm(MM / 4),
        origin: P2::new(4 * MM, MM),
        every: 1,
    };

    fn taken(lines: impl Iterator<Item = (usize, (P2, P2))>) -> Samples {
        let surface = slope();
        let mut tracer = Tracer::new(&surface, 1.0);
        let mut marks = Samples::new(SAMPLING);
        for (n, (a, b)) in lines {
            marks.begin(n);
            tracer.segment(a, b, |p| {
                if p.skip.is_none() {
                    marks.add(&p, a, b);
                }
            });
        }
        marks
    }

    #[test]
    fn points_lie_on_marks_at_the_heights_of_rows_and_everywhere_else() {
        let mut marks = taken(LINES.map(ends).into_iter().enumerate());
        let points = marks.points();
        for p in &points {
            let [x, y] = [f64::from(p[0]) + 4.0 * MM as f64, f64::from(p[1]) + MM as f64];
            assert!((f64::from(p[2]) - 0.1 * x).abs() < 2.0, "{p:?} on the slope");
            let off = LINES.map(ends).map(|(a, b)| {
                let d = [(b.x - a.x) as f64, (b.y - a.y) as f64];
                let v = [x - a.x as f64, y - a.y as f64];
                (d[0] * v[1] - d[1] * v[0]).abs() / math::hypot(d[0], d[1])
            });
            assert!(off.iter().any(|&o| o < 1.5), "{p:?} on a line");
        }
        // The line along x from 0 to 9 mm rises through all rows, and has a point in every cell.
        let on = |p: &&[i32; 3]| i64::from(p[1]) == 2 * MM;
        for h in SAMPLING.rows.heights(10, 899_990) {
            assert!(points.iter().filter(on).any(|p| (p[2] - h).abs() <= 1), "{h}");
        }
        let cells: std::collections::BTreeSet<i64> =
            points.iter().filter(on).map(|p| i64::from(p[0]).div_euclid(MM / 4)).collect();
        assert!(cells.len() >= 36, "{cells:?}");
    }

    #[test]
    fn samples_do_not_depend_on_the_order_of_strokes() {
        let lines: Vec<(usize, (P2, P2))> = LINES.map(ends).into_iter().enumerate().collect();
        let mut all = taken(lines.iter().copied());
        let mut parts = taken(lines[3..].iter().copied());
        parts.merge(taken(lines[..3].iter().rev().copied()));
        assert_eq!(all.points(), parts.points());
        assert!(all.points().len() > 100);
    }

    #[test]
    fn number_of_samples_is_bounded_for_any_order_of_strokes() {
        let n = 3 * Thinned::<u32>::MOST as i32;
        let (mut up, mut down, mut half) = (Thinned::default(), Thinned::default(), Thinned::default());
        (0..n).for_each(|i| up.add([i, 0, i / 7], i));
        (0..n).rev().for_each(|i| down.add([i, 0, i / 7], i));
        (n / 2..n).for_each(|i| half.add([i, 0, i / 7], i));
        let mut other = Thinned::default();
        (0..n / 2).for_each(|i| other.add([i, 0, i / 7], i));
        half.merge(other);
        let list = up.list();
        assert!((Thinned::<u32>::MOST / 3..=Thinned::<u32>::MOST).contains(&list.len()), "{}", list.len());
        assert_eq!(list, down.list());
        assert_eq!(list, half.list());
    }
}

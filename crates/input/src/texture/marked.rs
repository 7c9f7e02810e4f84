//! What of a texture jobs before have marked: left out of its strokes.
//!
//! Consumes the marks of those jobs where they lie on the part as designed. A stretch of a stroke is marked where a mark
//! of the same pen runs along it within 0.6 um; marks that cross a stroke leave it whole. Both are looked at in
//! pieces of at most 2 mm, so that few are near to each other.

use std::ops::{AddAssign, Range};
use std::path::Path;
use std::sync::Arc;

use super::cut_figure::{Cutter, Pieces};
use super::cut_texture::CutParts;
use super::{Figure, Texture};
use crate::surface::{Joining, Options, Surface, Trail};
use terrace_core::diag::Error;
use terrace_core::geom::{Buckets, P2, P3, Turn};
use terrace_core::math;
use terrace_core::program::PenId;
use terrace_core::progress::Task;

/// How far a mark may lie from the stroke that it is of, nm: what a measured part takes along is simplified by 200 nm, and
/// the height of a steep place is known to its weld.
const TOLERANCE_NM: f64 = 600.0;

/// Gaps between marked stretches that are shorter, nm, are marked too.
const GAP_NM: f64 = 2_000.0;

/// Marked stretches that are shorter, nm, are where marks cross; unless they are the whole stroke.
const CROSSING_NM: f64 = 10_000.0;

/// Longest piece of a mark or a stroke, nm.
const PIECE_NM: f64 = 2e6;

/// Side of the cells that marks are found by, nm.
const CELL_NM: i64 = 2_000_000;

/// Most cells along an axis.
const MAX_CELLS: i64 = 4096;

/// A mark on the part as designed.
#[derive(Clone, Debug)]
pub struct MarkedStroke {
    /// Its pen in the job that leaves it out.
    pub pen: PenId,
    /// Its points, nm, turned part frame; one of a dot.
    pub points: Vec<[f64; 2]>,
}

/// A straight piece of a mark, nm; of a dot both ends are the same.
#[derive(Clone, Copy, Debug, Default)]
struct MarkedPiece {
    pen: PenId,
    ends: [[f64; 2]; 2],
    is_dot: bool,
}

/// Marks of jobs before, found by where they lie.
#[derive(Debug)]
pub struct Marked {
    origin: P2,
    cell: i64,
    count: [usize; 2],
    pieces: Vec<MarkedPiece>,
    cells: Buckets<u32>,
    /// What is left between marked stretches, or beside one, and is shorter than this, nm, is a sliver.
    shortest: f64,
}

/// What is left out of strokes, nm and dots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Length of lines.
    pub nm: i64,
    /// Dots.
    pub dots: u64,
}

impl AddAssign for LeftOut {
    fn add_assign(&mut self, o: Self) {
        self.nm += o.nm;
        self.dots += o.dots;
    }
}

/// A part as it lay under a job before.
#[derive(Debug)]
pub struct Lay {
    /// Without its correction, which raises all that lies over a place alike.
    surface: Surface,
    /// From the part as designed.
    motion: Turn,
    max_slope: f64,
}

impl Lay {
    /// The part as designed, taken by a motion; `max_slope` is the tangent of the steepest slope that is marked.
    ///
    /// # Errors
    /// Those of [`Surface::moved`].
    pub fn new(designed: &Surface, motion: Turn, joining: Joining, max_slope: f64) -> Result<Self, Error> {
        Ok(Self { surface: designed.moved(&motion, None, joining)?, motion, max_slope })
    }

    /// The same of the part of a surface file.
    ///
    /// # Errors
    /// Those of [`Surface::load`].
    pub fn load(
        path: &Path,
        options: &Options,
        joining: Joining,
        turn_rad: f64,
        motion: Turn,
        max_slope: f64,
    ) -> Result<Self, Error> {
        let mut notes = Vec::new();
        let designed = Surface::load(path, options, joining, turn_rad, &mut notes, &mut |_| {}, Task::silent())?;
        Self::new(&designed, motion, joining, max_slope)
    }

    /// Where a mark on the part as it lay is on the part as designed. What of it lies off the part is left out.
    pub fn as_designed(&self, points: &[P2]) -> Vec<[f64; 2]> {
        let mut trail = Trail::new(self.max_slope);
        let mut out: Vec<[f64; 2]> = Vec::new();
        let mut follow = |a: P2, b: P2| {
            trail.follow(&self.surface, a, b);
            for (span, _) in trail.spans().filter(|(span, _)| span.facet().is_some()) {
                for (t, z) in [(span.t0, span.z0), (span.t1, span.z1)] {
                    let at = |a: i64, b: i64| a as f64 + (b - a) as f64 * t;
                    let [x, y, _] = self.motion.back(P3::new([at(a.x, b.x), at(a.y, b.y), z])).at;
                    out.push([x, y]);
                }
            }
        };
        if let &[dot] = points {
            follow(dot, dot);
        }
        points.windows(2).for_each(|w| follow(w[0], w[1]));
        if points.len() == 1 {
            out.truncate(1);
        }
        out.dedup();
        out
    }
}

impl Marked {
    /// Sorts marks by where they lie. What is left beside them is not marked where it is shorter than `shortest_nm`, which
    /// the jobs before have left out too: half a spot.
    pub fn new(strokes: &[MarkedStroke], shortest_nm: f64) -> Self {
        let mut pieces = Vec::new();
        for MarkedStroke { pen, points } in strokes {
            if let &[dot] = points.as_slice() {
                pieces.push(MarkedPiece { pen: *pen, ends: [dot; 2], is_dot: true });
            }
            for ends in points.windows(2) {
                let (a, b) = (ends[0], ends[1]);
                let count = (length(a, b) / PIECE_NM).ceil().max(1.0);
                let at = |i: u32| [0, 1].map(|k| a[k] + (b[k] - a[k]) * f64::from(i) / count);
                let of = |i: u32| MarkedPiece { pen: *pen, ends: [at(i), at(i + 1)], is_dot: false };
                pieces.extend((0..count as u32).map(of));
            }
        }
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in pieces.iter().flat_map(|piece| piece.ends) {
            (0..2).for_each(|k| (lo[k], hi[k]) = (lo[k].min(p[k]), hi[k].max(p[k])));
        }
        if pieces.is_empty() {
            (lo, hi) = ([0.0; 2], [0.0; 2]);
        }
        let extent = (hi[0] - lo[0]).max(hi[1] - lo[1]) as i64;
        let cell = CELL_NM.max(extent / MAX_CELLS + 1);
        let origin = P2::new(lo[0].floor() as i64, lo[1].floor() as i64);
        let count = [0, 1].map(|k| ((hi[k] - lo[k]) as i64 / cell + 2) as usize);
        let mut it = Self { origin, cell, count, pieces, cells: Buckets::default(), shortest: shortest_nm.max(GAP_NM) };
        let placed = it.pieces.iter().enumerate();
        let placed = placed.flat_map(|(i, piece)| it.cells_of(piece.ends, 0.0).map(move |cell| (cell, i as u32)));
        it.cells = Buckets::new(it.count[0] * it.count[1], placed);
        it
    }

    /// The cells that the box of a piece, grown by `around`, touches.
    fn cells_of(&self, [a, b]: [[f64; 2]; 2], around: f64) -> impl Iterator<Item = usize> + Clone + use<> {
        let (origin, cell, count) = ([self.origin.x, self.origin.y], self.cell, self.count);
        let range = move |k: usize| {
            let index = |v: f64| ((v.floor() as i64 - origin[k]).div_euclid(cell)).clamp(-1, count[k] as i64);
            let (from, to) = (index(a[k].min(b[k]) - around), index(a[k].max(b[k]) + around));
            from.max(0) as usize..((to + 1).max(0) as usize).min(count[k])
        };
        let columns = range(0);
        range(1).flat_map(move |row| columns.clone().map(move |column| row * count[0] + column))
    }

    /// The pieces of marks near a straight piece of a stroke.
    fn near(&self, ends: [[f64; 2]; 2]) -> impl Iterator<Item = &MarkedPiece> {
        let all = self.cells_of(ends, TOLERANCE_NM).flat_map(|cell| self.cells.of(cell));
        all.map(|&i| &self.pieces[i as usize])
    }

    /// The stretches of a stroke that marks of its pen run along, nm along it, in order.
    fn stretches(&self, pen: PenId, points: &[P2], out: &mut Vec<[f64; 2]>) -> f64 {
        out.clear();
        let mut start = 0.0;
        for ends in points.windows(2) {
            let [a, b] = [ends[0], ends[1]].map(|p| [p.x as f64, p.y as f64]);
            let whole = length(a, b);
            let count = (whole / PIECE_NM).ceil().max(1.0);
            for i in 0..count as u32 {
                let ends = [i, i + 1].map(|i| [0, 1].map(|k| a[k] + (b[k] - a[k]) * f64::from(i) / count));
                let from = start + whole * f64::from(i) / count;
                let marks = self.near(ends).filter(|piece| piece.pen == pen && !piece.is_dot);
                out.extend(marks.filter_map(|piece| along(ends, piece.ends)).map(|[s, t]| [from + s, from + t]));
            }
            start += whole;
        }
        out.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut kept = 0;
        for i in 0..out.len() {
            if kept > 0 && out[i][0] <= out[kept - 1][1] + GAP_NM {
                out[kept - 1][1] = out[kept - 1][1].max(out[i][1]);
            } else {
                out[kept] = out[i];
                kept += 1;
            }
        }
        out.truncate(kept);
        out.retain(|[s, t]| t - s >= CROSSING_NM.min(start - GAP_NM));
        start
    }
}

/// The stretch of a piece of a stroke, nm from its start, along which a piece of a mark lies within the tolerance.
fn along([a, b]: [[f64; 2]; 2], mark: [[f64; 2]; 2]) -> Option<[f64; 2]> {
    let whole = length(a, b);
    let dir = [0, 1].map(|k| (b[k] - a[k]) / whole);
    // How far along and beside the piece each end of the mark lies.
    let placed = mark.map(|p| {
        let d = [p[0] - a[0], p[1] - a[1]];
        [d[0] * dir[0] + d[1] * dir[1], d[1] * dir[0] - d[0] * dir[1]]
    });
    let [[s0, off0], [s1, off1]] = if placed[0][0] <= placed[1][0] { placed } else { [placed[1], placed[0]] };
    let mut stretch = [s0.max(0.0), s1.min(whole)];
    let slant = (off1 - off0) / (s1 - s0);
    if slant.is_finite() && slant != 0.0 {
        let ends = [-TOLERANCE_NM, TOLERANCE_NM].map(|off| s0 + (off - off0) / slant);
        stretch = [stretch[0].max(ends[0].min(ends[1])), stretch[1].min(ends[0].max(ends[1]))];
    } else if off0.abs() > TOLERANCE_NM {
        return None;
    }
    (stretch[0] < stretch[1]).then_some(stretch)
}

fn length(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::hypot(b[0] - a[0], b[1] - a[1])
}

/// The marks, with the pens of the strokes that they are left out of.
#[derive(Debug)]
pub(super) struct LeavesOut {
    marked: Arc<Marked>,
    base: Arc<dyn Figure>,
    own: PenId,
}

impl Cutter for LeavesOut {
    type Scratch = Vec<[f64; 2]>;
    type Tally = LeftOut;

    fn scratch(&self) -> Self::Scratch {
        Vec::new()
    }

    fn cut(&self, i: u64, points: &[P2], stretches: &mut Self::Scratch, pieces: &mut Pieces) -> LeftOut {
        let pen = self.base.pen(i).unwrap_or(self.own);
        if let &[dot] = points {
            let at = [dot.x as f64, dot.y as f64];
            let is_it =
                |piece: &&MarkedPiece| piece.is_dot && piece.pen == pen && length(at, piece.ends[0]) <= TOLERANCE_NM;
            if self.marked.near([at; 2]).any(|piece| is_it(&piece)) {
                return LeftOut { nm: 0, dots: 1 };
            }
            pieces.push([dot], true);
            return LeftOut::default();
        }
        let whole = self.marked.stretches(pen, points, stretches);
        if stretches.is_empty() {
            pieces.push(points.iter().copied(), false);
            return LeftOut::default();
        }
        let mut left_out = 0.0;
        let mut from = 0.0;
        for &[s, t] in &*stretches {
            left_out += t - s;
            if s - from > self.marked.shortest {
                pieces.push(between(points, from, s), false);
            }
            from = t;
        }
        if whole - from > self.marked.shortest {
            pieces.push(between(points, from, whole), false);
        }
        LeftOut { nm: left_out as i64, dots: 0 }
    }

    fn is_cheap(&self) -> bool {
        false
    }
}

/// The points of a stroke from one length along it to another.
fn between(points: &[P2], from: f64, to: f64) -> Vec<P2> {
    let mut out = Vec::new();
    let mut start = 0.0;
    for ends in points.windows(2) {
        let (a, b) = (ends[0], ends[1]);
        let end = start + a.distance(b);
        if end > from && start < to {
            let at = |s: f64| {
                if s <= start {
                    a
                } else if s >= end {
                    b
                } else {
                    a.lerp(b, (s - start) / (end - start))
                }
            };
            if out.is_empty() {
                out.push(at(from));
            }
            out.push(at(to));
        }
        start = end;
    }
    out
}

/// A texture without what was marked before.
#[derive(Debug)]
pub struct Unmarked {
    /// Its strokes.
    pub texture: Texture,
    /// What is left out.
    pub left_out: LeftOut,
    parts: CutParts<LeavesOut>,
}

impl Unmarked {
    /// The strokes that are left of stroke `i` of the texture.
    pub fn pieces(&self, i: usize) -> Range<usize> {
        self.parts.pieces(i)
    }
}

impl Texture {
    /// The texture without what jobs before have marked of it.
    ///
    /// # Errors
    /// `texture-large`.
    pub fn without(&self, marked: &Arc<Marked>) -> Result<Unmarked, Error> {
        let cutter = |base: &Arc<dyn Figure>, own| {
            Arc::new(LeavesOut { marked: Arc::clone(marked), base: Arc::clone(base), own })
        };
        let (texture, left_out, parts) = self.cut_by(cutter, true)?;
        Ok(Unmarked { texture, left_out, parts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(points: &[[f64; 2]]) -> MarkedStroke {
        MarkedStroke { pen: PenId(0), points: points.iter().map(|p| p.map(|mm| mm * 1e6)).collect() }
    }

    /// The stretches of a stroke, mm, that marks run along.
    fn stretches(points: &[[f64; 2]], marks: &[MarkedStroke]) -> Vec<[f64; 2]> {
        let points: Vec<P2> = points.iter().map(|p| P2::from_mm(p[0], p[1]).expect("small")).collect();
        let mut out = Vec::new();
        Marked::new(marks, 10_000.0).stretches(PenId(0), &points, &mut out);
        out.iter().map(|s| s.map(|nm| (nm / 1e3).round() / 1e3)).collect()
    }

    const LINE: [[f64; 2]; 2] = [[0.0, 0.0], [30.0, 0.0]];

    #[test]
    fn marks_along_a_stroke_are_found_whichever_way_round_and_in_pieces() {
        let marks = [mark(&[[12.0, 0.0], [5.0, 2e-4], [5.0, 3.0]]), mark(&[[20.0, 0.0], [12.001, 0.0]])];
        assert_eq!(stretches(&LINE, &marks), [[5.0, 20.0]]);
        let bent = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]];
        assert_eq!(stretches(&bent, &[mark(&[[8.0, 0.0], [10.0, 0.0], [10.0, 4.0]])]), [[8.0, 14.0]]);
    }

    #[test]
    fn marks_across_or_beside_a_stroke_leave_it_whole_and_one_that_touches_it_is_a_stretch() {
        assert_eq!(stretches(&LINE, &[mark(&[[15.0, -5.0], [15.0, 5.0]])]), [[0.0; 2]; 0]);
        assert_eq!(stretches(&LINE, &[mark(&[[0.0, 0.001], [30.0, 0.001]])]), [[0.0; 2]; 0]);
        // The corner of a polygon on the line: within 0.6 um for 19 um on either side.
        let corner = mark(&[[14.0, -0.0316], [15.0, 0.0], [16.0, -0.0316]]);
        assert_eq!(stretches(&LINE, &[corner]), [[14.981, 15.019]]);
    }

    #[test]
    fn pieces_keep_the_corners_between_their_ends() {
        let points = [[0, 0], [10, 0], [10, 10], [0, 10]].map(|[x, y]| P2::new(x * 1_000_000, y * 1_000_000));
        assert_eq!(
            between(&points, 4e6, 24e6),
            [[4, 0], [10, 0], [10, 10], [6, 10]].map(|[x, y]| P2::new(x * 1_000_000, y * 1_000_000))
        );
        assert_eq!(between(&points, 0.0, 1e6).len(), 2);
    }
}

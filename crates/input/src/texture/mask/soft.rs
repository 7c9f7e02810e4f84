//! A soft border: marks fade over a width `w` next to it.
//!
//! A piece that the border leaves is divided into equal lengths of at most 4 w. Length j of piece k of stroke i has a
//! random number u in [0, 1), a hash of the seed and i, k and j, and is marked where it lies farther than u w from the
//! border. At a distance d from the border a share min(d / w, 1) of the strokes is marked in the mean, however they
//! run; strokes that end at the border end at a random distance from it, and strokes along it are marked or not as
//! wholes. What lies farther than w from the border is marked always and stays uncut.
//!
//! The points of a segment nearer than c to an edge of the border lie within a rectangle and two discs; their union is
//! convex, so they are one stretch of the segment, found in closed form.

use crate::texture::artwork::Cells;
use crate::texture::clip::distance;
use crate::texture::clip::{Polylines, extent, is_closed};
use crate::texture::place::LEAST;
use terrace_core::geom::PlanePoint;
use terrace_core::math;

/// Most columns and rows of cells.
const MAX_CELLS: f64 = 256.0;

/// The longest stretch with one random number, in widths.
const STRETCH: f64 = 4.0;

/// The piece of a stroke, by numbers from which its random numbers follow.
#[derive(Clone, Copy, Debug)]
pub(super) struct PieceId {
    /// Index of the stroke before the border cuts it.
    pub(super) stroke: u64,
    /// Number of the piece among those that the border leaves of it.
    pub(super) piece: u64,
}

/// A width over which marks fade.
#[derive(Debug)]
pub(super) struct Soft {
    width: f64,
    seed: u64,
    /// The edges within the width.
    near: Cells,
}

impl Soft {
    pub(super) fn new(edges: &[[PlanePoint; 2]], size: [f64; 2], width: f64, seed: u64) -> Self {
        let count = size.map(|s| (s / width).clamp(1.0, MAX_CELLS) as usize);
        Self { width, seed, near: Cells::new(edges, count, width) }
    }

    /// Appends what is marked of `line`, the piece of a stroke that `id` names.
    pub(super) fn fade(&self, edges: &[[PlanePoint; 2]], line: &[PlanePoint], id: PieceId, out: &mut Polylines) {
        if let [dot] = line {
            if self.keeps_dot(edges, *dot, id) {
                out.push(line);
            }
        } else if self.is_near(line) {
            self.fade_line(edges, line, id, out);
        } else {
            out.push(line);
        }
    }

    /// Whether a dot is marked: it lies at least the random share of the width from all edges.
    fn keeps_dot(&self, edges: &[[PlanePoint; 2]], dot: PlanePoint, id: PieceId) -> bool {
        let mut near = Vec::new();
        self.edges_near([dot; 2], &mut near);
        let away = near.iter().map(|&e| distance(dot, edges[e as usize])).fold(f64::INFINITY, f64::min);
        away >= self.width * self.random(id, 0)
    }

    /// Whether a line passes a cell with edges within the width of it.
    fn is_near(&self, line: &[PlanePoint]) -> bool {
        let mut is_near = false;
        sides(line).for_each(|s| self.near.along(s, |cell| is_near |= !self.near.edges_of(cell).is_empty()));
        is_near
    }

    /// Appends what is marked of a line of two points or more.
    fn fade_line(&self, edges: &[[PlanePoint; 2]], line: &[PlanePoint], id: PieceId, out: &mut Polylines) {
        let total: f64 = sides(line).map(length).sum();
        let count = (total / (STRETCH * self.width)).ceil().max(1.0);
        let stretch = total / count;
        let mut near = Vec::new();
        let mut lost = Vec::new();
        let mut kept = KeptPieces::new(line);
        // The length of the line up to the side.
        let mut before = 0.0;
        for side in sides(line) {
            let at = |t: f64| [0, 1].map(|k| side[0][k] + t * (side[1][k] - side[0][k]));
            lost.clear();
            let own = length(side);
            // The stretches that the side has a part in.
            let mut j = (before / stretch).floor().max(0.0);
            while j < count && j * stretch < before + own {
                let part =
                    [(j * stretch - before) / own, ((j + 1.0) * stretch - before) / own].map(|t| t.clamp(0.0, 1.0));
                // Rounding must not leave the end of the line without a stretch.
                let part = if j + 1.0 == count { [part[0], 1.0] } else { part };
                // Of a long side each stretch has edges of its own.
                self.edges_near(part.map(at), &mut near);
                let reach = self.width * self.random(id, j as u64);
                for &edge in &near {
                    if let Some([t0, t1]) = nearer(side, edges[edge as usize], reach) {
                        lost.push([t0.max(part[0]), t1.min(part[1])]);
                    }
                }
                j += 1.0;
            }
            lost.retain(|t| t[0] < t[1]);
            lost.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
            kept.add_side(side, &lost);
            before += own;
        }
        kept.finish(out);
    }

    /// Writes the edges that may lie within the width of a segment into `near`.
    fn edges_near(&self, side: [PlanePoint; 2], near: &mut Vec<u32>) {
        near.clear();
        self.near.along(side, |cell| near.extend_from_slice(self.near.edges_of(cell)));
        near.sort_unstable();
        near.dedup();
    }

    /// The random number of a stretch of a piece, from 0 to 1.
    fn random(&self, id: PieceId, stretch: u64) -> f64 {
        // The finaliser of SplitMix64, once for each number.
        let mut h = self.seed;
        for v in [id.stroke, id.piece, stretch] {
            h = h.wrapping_add(v).wrapping_add(0x9E37_79B9_7F4A_7C15);
            for (shift, factor) in [(30, 0xBF58_476D_1CE4_E5B9u64), (27, 0x94D0_49BB_1331_11EB)] {
                h = (h ^ (h >> shift)).wrapping_mul(factor);
            }
            h ^= h >> 31;
        }
        (h >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The segments of a polyline.
fn sides(line: &[PlanePoint]) -> impl Iterator<Item = [PlanePoint; 2]> {
    line.windows(2).map(|s| [s[0], s[1]])
}

fn length([a, b]: [PlanePoint; 2]) -> f64 {
    math::hypot(b[0] - a[0], b[1] - a[1])
}

/// The parameters between which a segment lies nearer than `reach` to an edge.
fn nearer([a, b]: [PlanePoint; 2], [p, q]: [PlanePoint; 2], reach: f64) -> Option<[f64; 2]> {
    let d = [b[0] - a[0], b[1] - a[1]];
    let e = [q[0] - p[0], q[1] - p[1]];
    let edge_length = math::hypot(e[0], e[1]);
    let mut out: Option<[f64; 2]> = None;
    for centre in [p, q] {
        out = joined(out, in_disc(a, d, centre, reach));
    }
    if edge_length > 0.0 {
        // Along the edge from 0 to its length, across it up to the reach to either side.
        let u = [e[0] / edge_length, e[1] / edge_length];
        let v = [a[0] - p[0], a[1] - p[1]];
        let along = within(u[0] * v[0] + u[1] * v[1], u[0] * d[0] + u[1] * d[1], 0.0, edge_length);
        let across = within(u[0] * v[1] - u[1] * v[0], u[0] * d[1] - u[1] * d[0], -reach, reach);
        out = joined(out, along.zip(across).map(|(s, t)| [s[0].max(t[0]), s[1].min(t[1])]));
    }
    out.map(|[t0, t1]| [t0.max(0.0), t1.min(1.0)]).filter(|t| t[0] < t[1])
}

/// The interval around two others; one that ends before it begins is none.
fn joined(a: Option<[f64; 2]>, b: Option<[f64; 2]>) -> Option<[f64; 2]> {
    match (a, b.filter(|b| b[0] <= b[1])) {
        (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
        (a, b) => a.or(b),
    }
}

/// The parameters for which a + t d lies in a disc.
fn in_disc(a: PlanePoint, d: PlanePoint, centre: PlanePoint, radius: f64) -> Option<[f64; 2]> {
    let v = [a[0] - centre[0], a[1] - centre[1]];
    // Of |a + t d - centre|^2 = radius^2: square t^2 + 2 half t + |v|^2 - radius^2 = 0.
    let square = d[0] * d[0] + d[1] * d[1];
    let half = v[0] * d[0] + v[1] * d[1];
    let root = half * half - square * (v[0] * v[0] + v[1] * v[1] - radius * radius);
    (square > 0.0 && root >= 0.0).then(|| [-1.0, 1.0].map(|sign| (sign * root.sqrt() - half) / square))
}

/// The parameters for which v + t d lies between two limits.
fn within(v: f64, d: f64, lo: f64, hi: f64) -> Option<[f64; 2]> {
    if d == 0.0 {
        return (lo <= v && v <= hi).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let [s, t] = [(lo - v) / d, (hi - v) / d];
    Some([s.min(t), s.max(t)])
}

/// The pieces that are kept of a polyline, which is taken side by side.
struct KeptPieces<'a> {
    line: &'a [PlanePoint],
    pieces: Vec<Vec<PlanePoint>>,
    /// Whether the last piece reaches up to the place that is looked at, so that what is kept from there on is part of
    /// it.
    is_open: bool,
}

impl<'a> KeptPieces<'a> {
    fn new(line: &'a [PlanePoint]) -> Self {
        Self { line, pieces: Vec::new(), is_open: false }
    }

    /// Takes the next side, without what is lost of it, in order.
    fn add_side(&mut self, [a, b]: [PlanePoint; 2], lost: &[[f64; 2]]) {
        let at = |t: f64| match t {
            0.0 => a,
            1.0 => b,
            t => [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])],
        };
        // What lies before `from` is kept or lost. The last of the intervals ends the side.
        let mut from = 0.0;
        for &[t0, t1] in lost.iter().chain([&[1.0, f64::INFINITY]]) {
            if t0 > from {
                self.keep(at(from), at(t0));
            }
            if t1.is_finite() {
                self.is_open = false;
            }
            from = t1.max(from);
        }
    }

    /// Continues the last piece, or begins one.
    fn keep(&mut self, from: PlanePoint, to: PlanePoint) {
        if !self.is_open {
            self.pieces.push(vec![from]);
        }
        self.pieces.last_mut().expect("one was begun").push(to);
        self.is_open = true;
    }

    /// Appends the pieces; of a closed polyline none is divided at its first point unless it is whole.
    fn finish(mut self, out: &mut Polylines) {
        if is_closed(self.line) && self.pieces.len() > 1 && self.is_open && self.pieces[0][0] == self.line[0] {
            let first = self.pieces.remove(0);
            self.pieces.last_mut().expect("more than one").extend_from_slice(&first[1..]);
        }
        for mut piece in self.pieces {
            piece.dedup();
            let [w, h] = extent(&piece);
            if w.max(h) >= LEAST {
                out.push(&piece);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::random::Random;

    #[test]
    fn intervals_are_joined_unless_one_is_empty() {
        assert_eq!(joined(None, Some([1.0, 2.0])), Some([1.0, 2.0]));
        assert_eq!(joined(Some([1.0, 2.0]), Some([4.0, 5.0])), Some([1.0, 5.0]));
        assert_eq!(joined(Some([1.0, 2.0]), Some([5.0, 4.0])), Some([1.0, 2.0]));
        assert_eq!(joined(None, Some([5.0, 4.0])), None);
    }

    #[test]
    fn pieces_end_where_something_is_lost() {
        let line = [[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]];
        let mut kept = KeptPieces::new(&line);
        kept.add_side([line[0], line[1]], &[[0.25, 0.5]]);
        kept.add_side([line[1], line[2]], &[]);
        let mut out = Polylines::default();
        kept.finish(&mut out);
        let pieces: Vec<&[PlanePoint]> = out.iter().collect();
        assert_eq!(pieces, [&[[0.0, 0.0], [1.0, 0.0]][..], &[[2.0, 0.0], [4.0, 0.0], [8.0, 0.0]]]);
    }

    #[test]
    fn stretches_near_an_edge_agree_with_distances() {
        let mut noise = Random::case(3);
        for _ in 0..2000 {
            let [a, b, p, q] = [0; 4].map(|_| [noise.range(0.0, 4.0), noise.range(0.0, 4.0)]);
            let reach = noise.range(0.0, 1.5);
            let found = nearer([a, b], [p, q], reach);
            for k in 0..=50 {
                let t = f64::from(k) / 50.0;
                let at = [0, 1].map(|i| a[i] + t * (b[i] - a[i]));
                let e = [q[0] - p[0], q[1] - p[1]];
                let s = (((at[0] - p[0]) * e[0] + (at[1] - p[1]) * e[1]) / (e[0] * e[0] + e[1] * e[1])).clamp(0.0, 1.0);
                let away = math::hypot(at[0] - p[0] - s * e[0], at[1] - p[1] - s * e[1]);
                let is_found = found.is_some_and(|[t0, t1]| t0 <= t && t <= t1);
                assert!(
                    is_found == (away < reach) || (away - reach).abs() < 1e-9,
                    "{a:?} {b:?} {p:?} {q:?} {reach} {t}"
                );
            }
        }
    }
}

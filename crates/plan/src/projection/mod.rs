//! A texture stroke traced over the surface: what lies under it, piece by piece.
//!
//! Consumes strokes of the texture and the surface; promises pieces that tile every segment of the
//! stroke: the height of each is linear, or it says why it is not marked. Partition and split both
//! read the part through this module alone, so what the first saw is what the second cuts. What
//! partition sees is the [`Footprint`], the heights of the marks in every section, and the [`Cells`],
//! the texture as small boxes; lower bounds see the [`Samples`], points of it. Units: nm; slopes as squared tangents.

mod cells;
mod footprint;
mod marks;
mod reserve;
mod samples;
mod turned;

pub use cells::{Cells, Figure, Slabs};
pub use footprint::{Footprint, HeightRange, join_ranges};
pub use marks::Marks;
pub use reserve::{HeightDoubt, HeightReserve, KeptFree, Short};
pub use samples::{Rows, Samples, Sampling};
pub use turned::{FieldMarks, MarksByField, TiltedCell, TiltedField, TiltedFields};

use terrace_core::geom::{Box2, Nm, P2};
use terrace_core::program::Sections;
use terrace_input::surface::{Cursor, Span, Surface, Trail};

/// The segments of a stroke; a dot has one without length.
pub fn segments(points: &[P2]) -> impl Iterator<Item = (P2, P2)> + '_ {
    let dot = if let [dot] = points { Some((*dot, *dot)) } else { None };
    points.windows(2).map(|w| (w[0], w[1])).chain(dot)
}

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
    /// Squared slope of the facet under it; without meaning off the part.
    pub slope2: f64,
    /// What is kept free above and below it for the height of a part that is not known exactly, nm.
    pub reserve: f64,
    /// Facet under it; without meaning off the part.
    facet: u32,
}

impl Piece {
    /// Its lowest place, and what is kept free below it.
    fn lowest(&self) -> f64 {
        self.z0.min(self.z1) - self.reserve
    }

    /// Its highest place, and what is kept free above it.
    fn highest(&self) -> f64 {
        self.z0.max(self.z1) + self.reserve
    }

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

/// Surface normals under the pieces of a tracer.
#[derive(Clone, Copy)]
pub struct Normals<'a>(&'a Surface);

impl Normals<'_> {
    /// The normal under a piece on the part: upwards, of length 1.
    pub fn under(&self, p: &Piece) -> [f64; 3] {
        self.0.normal(p.facet)
    }
}

/// Traces strokes; holds what can be reused from one to the next.
pub struct Tracer<'a> {
    surface: &'a Surface,
    reserve: Option<&'a HeightReserve>,
    trail: Trail,
    /// Where the last beam was followed, and what it met.
    beam: Cursor,
    beam_spans: Vec<Span>,
    /// Largest squared slope of what was marked so far.
    pub worst_slope2: f64,
}

impl<'a> Tracer<'a> {
    /// `max_slope` is the tangent of the steepest slope that is marked.
    pub fn new(surface: &'a Surface, max_slope: f64) -> Self {
        Self {
            surface,
            reserve: None,
            trail: Trail::new(max_slope),
            beam: Cursor::default(),
            beam_spans: Vec::new(),
            worst_slope2: 0.0,
        }
    }

    /// The same for a part whose height is known no better than this.
    #[must_use]
    pub fn with_reserve(self, reserve: Option<&'a HeightReserve>) -> Self {
        Self { reserve, ..self }
    }

    /// The surface normals under its pieces.
    pub fn normals(&self) -> Normals<'a> {
        Normals(self.surface)
    }

    /// Hands the pieces of the segment from `a` to `b` to `sink`, in order. A segment of length 0 is one piece with one
    /// height.
    pub fn segment(&mut self, a: P2, b: P2, mut sink: impl FnMut(Piece)) {
        self.trail.follow(self.surface, a, b);
        let max_slope2 = self.trail.max_slope2();
        for (span, slope2) in self.trail.spans() {
            let skip = match span.facet() {
                None => Some(Skip::OffPart),
                Some(_) if slope2 > max_slope2 => Some(Skip::Steep),
                Some(_) => None,
            };
            if skip.is_none() {
                self.worst_slope2 = self.worst_slope2.max(slope2);
            }
            // Off the part it has no meaning.
            let facet = span.facet().unwrap_or_default();
            let piece = Piece { t0: span.t0, t1: span.t1, z0: span.z0, z1: span.z1, skip, slope2, reserve: 0.0, facet };
            match self.reserve {
                Some(reserve) if skip.is_none() => reserved(reserve, a, b, &piece, &mut sink),
                _ => sink(piece),
            }
        }
    }
}

/// Hands on a piece of the segment from `a` to `b` with what is kept free for it: in parts no longer than the cells of
/// the reserve, since it is the same for all of a part.
fn reserved(reserve: &HeightReserve, a: P2, b: P2, piece: &Piece, sink: &mut impl FnMut(Piece)) {
    let [side, _] = reserve.cell();
    let count = ((piece.t1 - piece.t0) * a.distance(b) / side.f64()).ceil().max(1.0);
    let t = |k: f64| if k >= count { piece.t1 } else { piece.t0 + (piece.t1 - piece.t0) * (k / count) };
    let mut k = 0.0;
    while k < count {
        let (t0, t1) = (t(k), t(k + 1.0));
        let mut area = Box2::EMPTY;
        area.add(a.lerp(b, t0));
        area.add(a.lerp(b, t1));
        sink(Piece { t0, t1, z0: piece.z(t0), z1: piece.z(t1), reserve: reserve.kept(area), ..*piece });
        k += 1.0;
    }
}

/// Traces strokes over a grid: what is marked, cut at the lines of the grid.
pub struct GridTracer<'a> {
    tracer: Tracer<'a>,
    grid: &'a Sections,
    cuts: Vec<(f64, [i64; 2])>,
    /// Whether a piece was not marked since this was last made false.
    gap: bool,
    small: Vec<(Piece, [i64; 2])>,
}

/// Which strokes stay whole if they may: those no larger than a size along x and y; 0 for none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Keep(pub Nm);

impl Keep {
    /// The box of a stroke that is to stay whole.
    pub fn bounds(self, points: &[P2]) -> Option<Box2> {
        // A dot cannot be cut.
        if self.0 <= Nm(0) || points.len() <= 1 {
            return None;
        }
        let mut bounds = Box2::EMPTY;
        for &p in points {
            bounds.add(p);
            if bounds.size().iter().any(|&side| side > self.0) {
                return None;
            }
        }
        Some(bounds)
    }
}

impl<'a> GridTracer<'a> {
    /// Pieces are cut where they leave a cell of `grid`.
    pub fn new(tracer: Tracer<'a>, grid: &'a Sections) -> Self {
        Self { tracer, grid, cuts: Vec::new(), gap: false, small: Vec::new() }
    }

    /// Hands the marked pieces of the segment from `a` to `b` to `sink` in order, each with its
    /// cell: column and row.
    pub fn segment(&mut self, a: P2, b: P2, mut sink: impl FnMut(Piece, [i64; 2])) {
        self.cut(a, b);
        let Self { tracer, cuts, gap, .. } = self;
        let mut cut = 0;
        tracer.segment(a, b, |p| {
            if p.skip.is_some() {
                *gap = true;
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
                sink(Piece { t0: t, t1: end, z0: p.z(t), z1: p.z(end), ..p }, cuts[cut].1);
                if end >= p.t1 {
                    break;
                }
                t = end;
            }
        });
    }

    /// Traces a whole stroke; answers its lowest and highest mark with what is kept free around them, and whether nothing
    /// of it is skipped. [`GridTracer::replay`] gives its pieces; `also` sees them with their segments.
    fn small_stroke(&mut self, points: &[P2], mut also: impl FnMut(&Piece, P2, P2)) -> ([f64; 2], bool) {
        let mut list = std::mem::take(&mut self.small);
        list.clear();
        self.gap = false;
        let mut z = [f64::INFINITY, f64::NEG_INFINITY];
        for (a, b) in segments(points) {
            self.segment(a, b, |p, cell| {
                z = [z[0].min(p.lowest()), z[1].max(p.highest())];
                also(&p, a, b);
                list.push((p, cell));
            });
        }
        self.small = list;
        (z, !self.gap)
    }

    /// Hands the pieces of the stroke that was traced last by [`GridTracer::small_stroke`] to `sink`, with their cells.
    fn replay(&self, mut sink: impl FnMut(Piece, [i64; 2])) {
        self.small.iter().for_each(|&(p, cell)| sink(p, cell));
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
        // Cell by cell: of the next lines across x and y the nearer one is crossed, through a corner both at once.
        // Cells are decided on integers, parameters only order the crossings, so the walk ends in `to` whatever
        // rounding does.
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

#[cfg(test)]
pub(crate) mod tests;

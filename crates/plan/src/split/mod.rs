//! Strokes are traced and cut where they leave their block.
//!
//! Consumes texture strokes, a [`Tracer`] and the stops; promises fragments that, with what was
//! skipped, tile every stroke: a cut point is computed once, rounded once to the nanometre grid and
//! used by both sides, so mark + skipped = texture. A fragment stays in its stop as long as the stop
//! admits it; then, of the stops that admit what follows, the one whose box the stroke leaves last continues, which
//! gives the fewest cuts. Of several that are left at the same place the last of the list continues, so
//! that in a grid the upper level and the upper section have what lies on their borders. A fragment whose
//! points all round to one point is dropped. A dot is one fragment of one point, in the stop whose box holds it (of
//! several the last of the list).
//!
//! A sliver is a fragment shorter than a given length that a cut between two stops made. Slivers next to a mark of
//! their stroke may be left out: what is not marked then lies no farther from a mark than that length, and no stroke
//! vanishes.
//!
//! Where an overlap is wanted, the fragment that continues after a cut begins that much before it, as far as
//! its own stop admits the stroke there: no mark leaves what its stop admits. It reaches over at most half
//! of what the fragment before it has for itself, so that nothing is marked three times; and never over the
//! point where a closed figure was drawn from. What is shared is counted, cuts with less than was asked for
//! too: mark - overlap + skipped = texture.

mod cutter;
mod regroup;
#[cfg(test)]
mod tests;

pub use cutter::Seam;
pub use regroup::Regroup;

use cutter::Cutter;

use crate::partition::Stops;
use crate::projection::{Keep, Piece, Tracer, segments};
use terrace_core::geom::{FieldPoint, Nm, P2, P3};
use terrace_core::program::{PenId, StopId, StrokeId};

/// Pieces that are looked ahead over at most.
const RUN: usize = 1 << 14;

/// A piece of one stroke that is marked in one block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fragment {
    /// Index of its stop.
    pub stop: StopId,
    /// Stroke of the texture.
    pub source: StrokeId,
    /// Segment of that stroke on which it begins.
    pub segment: u32,
    /// First point in [`Fragments::points`].
    pub first: u32,
    /// How many points; 1 of a dot.
    pub len: u32,
    /// Pen.
    pub pen: PenId,
    /// Whether it is the whole of a closed stroke, which may be marked from any of its vertices.
    pub is_figure: bool,
    /// Whether it begins where the fragment before it in the list ends.
    pub goes_on: bool,
}

/// What the surface is like under a fragment. Heights are counted from the lower end of what the stop admits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measure {
    /// Lowest and highest height over the lower end of what its stop admits, nm.
    pub z: [i32; 2],
    /// The same with what is kept free above and below each place for the height of a measured part, nm.
    pub held: [i32; 2],
    /// Mean of that height over the length, nm.
    pub mean_z: f32,
    /// Length of the mark in the field before its ends were rounded, nm; 0 of a dot. On a tilted part that is another
    /// than the length in the plane of the drawing, and it is the one that takes time.
    pub length: f32,
    /// One less the mean cosine of the slope over the length: single precision would not hold a cosine near one.
    pub versine: f32,
    /// Largest squared slope.
    pub slope2: f32,
}

impl Measure {
    /// Lowest and highest height with what is kept free around them, where the stop admits from `z_lo` on, nm.
    pub fn held(&self, z_lo: f64) -> [f64; 2] {
        self.held.map(|z| z_lo + f64::from(z))
    }

    /// Mean cosine of the slope over the length.
    pub fn cos(&self) -> f64 {
        1.0 - f64::from(self.versine)
    }

    /// What lies under two fragments that become one, both over the same height.
    fn joined(self, other: Self) -> Self {
        let [mine, others] = [self.length, other.length].map(f64::from);
        let length = mine + others;
        let mean = |a: f32, b: f32| {
            if length > 0.0 { ((f64::from(a) * mine + f64::from(b) * others) / length) as f32 } else { a }
        };
        Self {
            z: [self.z[0].min(other.z[0]), self.z[1].max(other.z[1])],
            held: [self.held[0].min(other.held[0]), self.held[1].max(other.held[1])],
            mean_z: mean(self.mean_z, other.mean_z),
            length: length as f32,
            versine: mean(self.versine, other.versine),
            slope2: self.slope2.max(other.slope2),
        }
    }

    /// The same ground over another height, which is so much lower.
    fn over(self, lower: Nm) -> Self {
        let by = i32::try_from(lower.0).unwrap_or(0);
        let [z, held] = [self.z, self.held].map(|ends| ends.map(|z| z.saturating_add(by)));
        Self { z, held, mean_z: self.mean_z + by as f32, ..self }
    }
}

/// Lengths that were not marked, mm, every pass counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Skipped {
    /// Length off the part.
    pub off_part: f64,
    /// Length on slopes steeper than the limit.
    pub steep: f64,
    /// Fragments that are too short.
    pub small: f64,
}

/// Dots, each counted once whatever the passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dots {
    /// All of the texture.
    pub texture: u64,
    /// Not marked: off the part.
    pub off_part: u64,
    /// Not marked: steeper than the limit.
    pub steep: u64,
}

impl Dots {
    /// The dots that are marked.
    pub fn marked(self) -> u64 {
        self.texture - self.off_part - self.steep
    }
}

impl std::ops::AddAssign for Dots {
    fn add_assign(&mut self, other: Self) {
        self.texture += other.texture;
        self.off_part += other.off_part;
        self.steep += other.steep;
    }
}

/// Which fragments are left out, nm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Least {
    /// All that are shorter than this.
    pub mark: f64,
    /// Slivers next to a mark that are shorter than this.
    pub sliver: f64,
}

/// A fragment that was left out because it is short: its stop, and lower and upper corner of a box around it in the
/// part frame of that stop, nm.
#[derive(Clone, Copy, Debug)]
pub struct Sliver {
    /// The stop that would have marked it.
    pub stop: StopId,
    /// Lower corner: x, y, z.
    pub lo: [i64; 3],
    /// Upper corner.
    pub hi: [i64; 3],
    /// Stroke of the texture.
    pub source: StrokeId,
    /// The ends of the sliver in the part frame, nm, at the mean of its heights.
    pub ends: [[f64; 3]; 2],
    /// What it has for itself of the length that is skipped, mm, every pass counted.
    pub length_mm: f64,
    /// How many fragments of its run of strokes lie before it.
    pub after: u32,
}

/// What became of a run of strokes.
#[derive(Clone, Debug, Default)]
pub struct Fragments {
    /// In the order of the texture.
    pub list: Vec<Fragment>,
    /// What each of them lies on.
    pub measures: Vec<Measure>,
    /// Points of all fragments, field frame of their stops, nm.
    pub points: Vec<FieldPoint>,
    /// Length of the strokes, mm, every pass counted.
    pub texture_mm: f64,
    /// Length of what is marked of them, in the plane of the drawing, mm, every pass counted.
    pub mark_mm: f64,
    /// Length that is marked twice where two fragments overlap, mm, every pass counted.
    pub overlap_mm: f64,
    /// What was not marked.
    pub skipped: Skipped,
    /// The dots.
    pub dots: Dots,
    /// The fragments that are too short.
    pub slivers: Vec<Sliver>,
    /// Cuts between two blocks that were to overlap.
    pub cuts: usize,
    /// The cuts whose blocks overlap by less than they were to.
    pub short: usize,
    /// Strokes in more than one fragment.
    pub strokes_cut: usize,
    /// Closed strokes marked as one fragment.
    pub figures_whole: usize,
    /// Closed strokes that were cut or partly skipped.
    pub figures_cut: usize,
    /// Strokes that were to stay whole and were cut between blocks.
    pub not_kept: usize,
    /// A place that was too steep, if any was.
    pub steep_at: Option<P2>,
    /// Largest squared slope of the marks.
    pub worst_slope2: f64,
}

impl Fragments {
    /// Gives back the memory that lists keep to grow.
    pub(crate) fn shrink(&mut self) {
        self.list.shrink_to_fit();
        self.measures.shrink_to_fit();
        self.points.shrink_to_fit();
        self.slivers.shrink_to_fit();
    }
}

/// Cuts strokes between the stops of several candidates, over one walk.
pub struct Splitter<'a> {
    tracer: Tracer<'a>,
    cutters: Vec<Cutter<'a>>,
    run: Run,
}

/// Some segments of one stroke, traced: as far as cutters look ahead.
#[derive(Default)]
struct Run {
    pieces: Vec<Piece>,
    segments: Vec<Segment>,
}

/// One segment of a run.
#[derive(Clone, Copy)]
struct Segment {
    index: u32,
    a: P2,
    b: P2,
    /// The first piece and the end of the pieces.
    first: usize,
    end: usize,
}

impl Segment {
    /// The place at `t`, over which the surface is `z` high.
    #[inline]
    fn at(&self, t: f64, z: f64) -> P3 {
        let [a, b] = [self.a, self.b];
        P3::new([a.x as f64 + t * (b.x - a.x) as f64, a.y as f64 + t * (b.y - a.y) as f64, z])
    }
}

impl<'a> Splitter<'a> {
    /// Fragments shorter than `least` are skipped and counted. What `keep` wants whole stays whole
    /// where a stop holds it, as every stroke does; cuts of it are counted.
    pub fn new(tracer: Tracer<'a>, candidates: &[&'a Stops], least: Least, keep: Keep, seam: Seam) -> Self {
        let cutters = candidates.iter().map(|stops| Cutter::new(tracer.normals(), stops, least, keep, seam)).collect();
        Self { tracer, cutters, run: Run::default() }
    }

    /// What became of all strokes given so far, by candidate.
    pub fn finish(self) -> impl Iterator<Item = Fragments> {
        let worst = self.tracer.worst_slope2;
        self.cutters.into_iter().map(move |c| c.finish(worst))
    }

    /// Cuts one stroke of the texture, which its pen marks `passes` times.
    pub fn stroke(&mut self, source: StrokeId, pen: PenId, passes: u32, points: &[P2]) {
        let Self { tracer, cutters, run } = self;
        cutters.iter_mut().for_each(|c| c.begin(source, pen, passes));
        let last = points.len().saturating_sub(2);
        for (i, (a, b)) in segments(points).enumerate() {
            let first = run.pieces.len();
            tracer.segment(a, b, |piece| run.pieces.push(piece));
            run.segments.push(Segment { index: i as u32, a, b, first, end: run.pieces.len() });
            if i == last || run.pieces.len() >= RUN {
                cutters.iter_mut().for_each(|c| if a == b { c.dot(run) } else { c.cut_run(run) });
                run.pieces.clear();
                run.segments.clear();
            }
        }
        if points.len() > 1 {
            cutters.iter_mut().for_each(|c| c.end(points));
        }
    }
}

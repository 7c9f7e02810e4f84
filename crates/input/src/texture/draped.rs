//! A texture on a part that lies otherwise than it was designed.
//!
//! The texture is projected onto the part as designed, along z of the part, as always. Each stroke is then a polyline in
//! space, which goes where the part goes; its projection is the stroke on the part as it lies. So marks lie where they
//! were designed on the part, whatever it leans, and plan, check and emit see a surface and strokes as they lie.
//!
//! A stroke is parted where the part steps, since both sides of the step move apart. What a leaning part hides, what
//! comes to lie beside it, and what was off the part before, is left out and counted. Moved strokes are simplified by
//! [`TOLERANCE_NM`].

use std::ops::{AddAssign, Range};
use std::path::Path;
use std::sync::Arc;

use super::Texture;
use super::cut_figure::{Cutter, Pieces};
use super::cut_texture::CutParts;
use crate::surface::{Joining, Options, Surface, Trail};
use terrace_core::diag::Error;
use terrace_core::geom::{P2, P3, Turn};
use terrace_core::math;
use terrace_core::progress::Task;

/// How far a simplified stroke may lie from where the part takes it, nm.
const TOLERANCE_NM: f64 = 200.0;

/// Heights that differ by more, nm, are a step.
const STEP_NM: f64 = 10.0;

/// Pieces of a longer stroke that are shorter, nm, are left out.
const SHORTEST_NM: f64 = 1_000.0;

/// A place is hidden where the part as it lies is higher by more, nm; and where it is lower, beside its sheet. Beyond
/// that the slope counts, over the distance by which a stroke is off.
const OTHER_SHEET_NM: f64 = 5_000.0;

/// A part as designed, as it lies, and the rigid motion between the two. A correction of its heights changes neither
/// where strokes lie nor what hides them, since all that lies over a place is raised alike.
#[derive(Debug)]
pub struct Draping {
    designed: Arc<Surface>,
    lying: Arc<Surface>,
    motion: Turn,
    max_slope: f64,
}

/// What is left out, in lengths as seen from the lens, nm, and in dots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lost {
    /// Off the part as designed.
    pub off_part: LostMarks,
    /// Hidden by the part as it lies.
    pub hidden: LostMarks,
    /// Beside the part as it lies, or on another sheet of it.
    pub beside: LostMarks,
}

/// Marks that are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LostMarks {
    /// Length of lines, nm.
    pub nm: i64,
    /// Dots.
    pub dots: u64,
}

impl LostMarks {
    /// Whether there are none.
    pub fn is_none(self) -> bool {
        self == Self::default()
    }

    fn add(&mut self, length: f64, is_dot: bool) {
        self.nm += length.round() as i64;
        self.dots += u64::from(is_dot);
    }
}

impl AddAssign for LostMarks {
    fn add_assign(&mut self, o: Self) {
        self.nm += o.nm;
        self.dots += o.dots;
    }
}

impl AddAssign for Lost {
    fn add_assign(&mut self, o: Self) {
        self.off_part += o.off_part;
        self.hidden += o.hidden;
        self.beside += o.beside;
    }
}

/// A texture on a part as it lies.
#[derive(Debug)]
pub struct Draped {
    /// Its strokes.
    pub texture: Texture,
    /// What is left out.
    pub lost: Lost,
    parts: CutParts<Draping>,
}

impl Draped {
    /// The strokes that are left of stroke `i` of the texture as designed.
    pub fn pieces(&self, i: usize) -> Range<usize> {
        self.parts.pieces(i)
    }
}

impl Draping {
    /// A part and where a motion takes it; `max_slope` is the tangent of the steepest slope that is marked.
    pub fn new(designed: Arc<Surface>, lying: Arc<Surface>, motion: Turn, max_slope: f64) -> Self {
        Self { designed, lying, motion, max_slope }
    }

    /// Reads a surface file as [`Surface::load`] does, for a part that a motion takes from where the job turns it to
    /// where it lies.
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
        let lying = designed.moved(&motion, None, joining)?;
        Ok(Self::new(Arc::new(designed), Arc::new(lying), motion, max_slope))
    }

    /// The part as designed.
    pub fn designed(&self) -> &Arc<Surface> {
        &self.designed
    }
}

impl Texture {
    /// The texture as the part takes it along.
    ///
    /// # Errors
    /// `texture-large`; `texture-empty` where nothing of a request is left.
    pub fn draped(&self, draping: &Arc<Draping>) -> Result<Draped, Error> {
        let (texture, lost, parts) = self.cut_by(|_, _| Arc::clone(draping), false)?;
        Ok(Draped { texture, lost, parts })
    }
}

/// A place of a moved stroke: x and y, nm, and its height.
#[derive(Clone, Copy, Debug)]
struct Moved {
    x: f64,
    y: f64,
    z: f64,
}

impl Moved {
    fn rounded(self) -> P2 {
        P2::new(terrace_core::geom::nearest(self.x), terrace_core::geom::nearest(self.y))
    }
}

/// Buffers reused from stroke to stroke.
#[derive(Debug)]
pub(super) struct DrapeScratch {
    designed: Trail,
    lying: Trail,
    /// A stretch of a stroke on one sheet, as it has moved.
    chain: Vec<Moved>,
    /// Indices of the places of the chain that are kept.
    kept: Vec<usize>,
    stack: Vec<[usize; 2]>,
    /// What can be seen of the chain, up to where it is hidden.
    seen: Vec<P2>,
    /// Length of the stroke as designed, nm.
    length: f64,
}

impl Cutter for Draping {
    type Scratch = DrapeScratch;
    type Tally = Lost;

    fn scratch(&self) -> DrapeScratch {
        let trail = || Trail::new(self.max_slope);
        let (chain, kept, stack, seen) = Default::default();
        DrapeScratch { designed: trail(), lying: trail(), chain, kept, stack, seen, length: 0.0 }
    }

    fn cut(&self, _: u64, points: &[P2], scratch: &mut DrapeScratch, pieces: &mut Pieces) -> Lost {
        let mut lost = Lost::default();
        let mut trail = std::mem::replace(&mut scratch.designed, Trail::new(self.max_slope));
        scratch.chain.clear();
        scratch.length = points.windows(2).map(|w| w[0].distance(w[1])).sum();
        if let &[dot] = points {
            trail.follow(&self.designed, dot, dot);
            match trail.spans().next().map(|(span, _)| *span) {
                Some(span) if span.facet().is_some() => {
                    scratch.chain.push(self.moved(dot, dot, 0.0, span.z0));
                    self.dot(scratch, pieces, &mut lost);
                }
                _ => lost.off_part.add(0.0, true),
            }
        }
        for ends in points.windows(2) {
            let (a, b) = (ends[0], ends[1]);
            trail.follow(&self.designed, a, b);
            let mut last_z = None;
            for (span, _) in trail.spans() {
                if span.facet().is_none() {
                    self.end(scratch, pieces, &mut lost);
                    lost.off_part.add(a.distance(b) * (span.t1 - span.t0), false);
                    last_z = None;
                    continue;
                }
                let from = self.moved(a, b, span.t0, span.z0);
                let continues = match last_z {
                    Some(z) => f64::abs(z - span.z0) <= STEP_NM,
                    // The corner between two segments: where the last one ended.
                    None => scratch.chain.last().is_some_and(|end| is_near(end, &from)),
                };
                if !continues {
                    self.end(scratch, pieces, &mut lost);
                    scratch.chain.push(from);
                }
                scratch.chain.push(self.moved(a, b, span.t1, span.z1));
                last_z = Some(span.z1);
            }
        }
        self.end(scratch, pieces, &mut lost);
        scratch.designed = trail;
        lost
    }

    fn is_cheap(&self) -> bool {
        true
    }
}

/// Whether two places are one but for rounding.
fn is_near(a: &Moved, b: &Moved) -> bool {
    [a.x - b.x, a.y - b.y, a.z - b.z].iter().all(|d| d.abs() <= STEP_NM)
}

impl Draping {
    /// Where the place at `t` of a segment comes to lie, of height `z`.
    fn moved(&self, a: P2, b: P2, t: f64, z: f64) -> Moved {
        let between = |a: i64, b: i64| a as f64 + (b - a) as f64 * t;
        let [x, y, z] = self.motion.apply(P3::new([between(a.x, b.x), between(a.y, b.y), z])).at;
        Moved { x, y, z }
    }

    /// Ends a dot, which is the chain.
    fn dot(&self, scratch: &mut DrapeScratch, pieces: &mut Pieces, lost: &mut Lost) {
        let at = scratch.chain[0];
        let p = at.rounded();
        scratch.chain.clear();
        scratch.lying.follow(&self.lying, p, p);
        let Some((span, slope2)) = scratch.lying.spans().next() else { return };
        match sight(span.facet().map(|_| span.z0), at.z, slope2) {
            Sight::Seen => pieces.push([p], true),
            Sight::Hidden => lost.hidden.add(0.0, true),
            Sight::Beside => lost.beside.add(0.0, true),
        }
    }

    /// Ends a stretch on one sheet: simplifies it, and takes what can be seen of it.
    fn end(&self, scratch: &mut DrapeScratch, pieces: &mut Pieces, lost: &mut Lost) {
        if scratch.chain.len() > 1 {
            simplify(scratch);
            let kept = std::mem::take(&mut scratch.kept);
            scratch.seen.clear();
            for ends in kept.windows(2) {
                self.segment(ends[0], ends[1], scratch, pieces, lost);
            }
            scratch.kept = kept;
            flush(scratch, pieces, lost);
        }
        scratch.chain.clear();
    }

    /// Takes what can be seen of the simplified segment between two places of the chain.
    fn segment(&self, from: usize, to: usize, scratch: &mut DrapeScratch, pieces: &mut Pieces, lost: &mut Lost) {
        let (a, b) = (scratch.chain[from].rounded(), scratch.chain[to].rounded());
        if scratch.seen.is_empty() {
            scratch.seen.push(a);
        }
        if a == b {
            return;
        }
        let lo = P2::new(a.x.min(b.x), a.y.min(b.y));
        let hi = P2::new(a.x.max(b.x), a.y.max(b.y));
        if self.lying.is_plain(lo, hi) {
            scratch.seen.push(b);
            return;
        }
        let length = a.distance(b);
        let mut lying = std::mem::replace(&mut scratch.lying, Trail::new(self.max_slope));
        lying.follow(&self.lying, a, b);
        let profile = Profile { chain: &scratch.chain[from..=to], a, b };
        let mut cuts: Vec<(f64, f64, Sight)> = Vec::new();
        for (span, slope2) in lying.spans() {
            let slack = slack(slope2);
            // Both sheets are straight between corners of the chain.
            let mut t0 = span.t0;
            let inner = profile.corners().filter(|t| *t > span.t0 && *t < span.t1);
            for t1 in inner.chain([span.t1]) {
                let z = |t: f64| span.z0 + (span.z1 - span.z0) * ((t - span.t0) / (span.t1 - span.t0).max(1e-300));
                // How far the sheet lies above the stroke: linear, so that it is cut where it passes the slack.
                let above = |t: f64| z(t) - profile.z(t);
                let [from, to] = [above(t0), above(t1)];
                let mut ends: Vec<f64> = [-slack, slack]
                    .into_iter()
                    .map(|limit| (limit - from) / (to - from))
                    .filter(|share| *share > 0.0 && *share < 1.0)
                    .map(|share| t0 + share * (t1 - t0))
                    .collect();
                ends.sort_by(f64::total_cmp);
                for end in ends.into_iter().chain([t1]) {
                    let middle = f64::midpoint(t0, end);
                    cuts.push((t0, end, sight(span.facet().map(|_| z(middle)), profile.z(middle), slope2)));
                    t0 = end;
                }
            }
        }
        scratch.lying = lying;
        for (t0, t1, sight) in cuts {
            match sight {
                Sight::Seen => {
                    if scratch.seen.is_empty() {
                        scratch.seen.push(a.lerp(b, t0));
                    }
                    scratch.seen.push(if t1 >= 1.0 { b } else { a.lerp(b, t1) });
                }
                Sight::Hidden | Sight::Beside => {
                    flush(scratch, pieces, lost);
                    let lost = if sight == Sight::Hidden { &mut lost.hidden } else { &mut lost.beside };
                    lost.add(length * (t1 - t0), false);
                }
            }
        }
    }
}

/// Makes a piece of what was seen, unless it is no more than rounding of a stroke at a step or beside what hides it.
fn flush(scratch: &mut DrapeScratch, pieces: &mut Pieces, lost: &mut Lost) {
    straighten(&mut scratch.seen);
    let length: f64 = scratch.seen.windows(2).map(|w| w[0].distance(w[1])).sum();
    if length < SHORTEST_NM && scratch.length > SHORTEST_NM {
        lost.beside.add(length, false);
        scratch.seen.clear();
    }
    pieces.push(scratch.seen.drain(..), false);
}

/// Leaves out points that lie on the line between their neighbours, as parameters of seen stretches leave them.
fn straighten(points: &mut Vec<P2>) {
    points.dedup();
    let mut kept = 0;
    for i in 0..points.len() {
        while kept > 1 {
            let (a, b, c) = (points[kept - 2], points[kept - 1], points[i]);
            let is_between = terrace_core::geom::orient(a, b, c) == 0.0
                && (b.x - a.x) as f64 * (c.x - b.x) as f64 + (b.y - a.y) as f64 * (c.y - b.y) as f64 > 0.0;
            if !is_between {
                break;
            }
            kept -= 1;
        }
        points[kept] = points[i];
        kept += 1;
    }
    points.truncate(kept);
}

/// Whether a place of a moved stroke can be marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sight {
    Seen,
    Hidden,
    Beside,
}

/// How far a sheet of this slope, squared, may lie from a stroke on it, nm.
fn slack(slope2: f64) -> f64 {
    OTHER_SHEET_NM + 2.0 * TOLERANCE_NM * slope2.sqrt()
}

/// Whether a place of height `wanted` is what the lens sees, which is of height `top`; None where there is no part.
fn sight(top: Option<f64>, wanted: f64, slope2: f64) -> Sight {
    let slack = slack(slope2);
    match top {
        Some(z) if z > wanted + slack => Sight::Hidden,
        Some(z) if z >= wanted - slack => Sight::Seen,
        _ => Sight::Beside,
    }
}

/// Heights of a chain along its simplified segment.
struct Profile<'a> {
    chain: &'a [Moved],
    a: P2,
    b: P2,
}

impl Profile<'_> {
    fn parameter(&self, p: &Moved) -> f64 {
        let [dx, dy] = [(self.b.x - self.a.x) as f64, (self.b.y - self.a.y) as f64];
        ((p.x - self.a.x as f64) * dx + (p.y - self.a.y as f64) * dy) / (dx * dx + dy * dy)
    }

    /// Parameters of its corners, rising.
    fn corners(&self) -> impl Iterator<Item = f64> {
        let mut last = 0.0;
        self.chain.iter().map(move |p| {
            last = f64::max(last, self.parameter(p).clamp(0.0, 1.0));
            last
        })
    }

    /// Height at a parameter.
    fn z(&self, t: f64) -> f64 {
        let after = self.chain.partition_point(|p| self.parameter(p) <= t).clamp(1, self.chain.len() - 1);
        let (from, to) = (&self.chain[after - 1], &self.chain[after]);
        let (t0, t1) = (self.parameter(from), self.parameter(to));
        if t1 <= t0 { from.z } else { from.z + (to.z - from.z) * ((t - t0) / (t1 - t0)).clamp(0.0, 1.0) }
    }
}

/// Leaves the indices of the places of the chain that the others lie within the tolerance of (Douglas and Peucker 1973).
fn simplify(scratch: &mut DrapeScratch) {
    let DrapeScratch { chain, kept, stack, .. } = scratch;
    kept.clear();
    stack.clear();
    let last = chain.len() - 1;
    kept.push(0);
    stack.push([0, last]);
    while let Some([from, to]) = stack.pop() {
        match farthest(chain, from, to) {
            Some(k) => {
                stack.push([k, to]);
                stack.push([from, k]);
            }
            None => kept.push(to),
        }
    }
}

/// The place between two that lies farthest from the segment between them; None where all lie within the tolerance, each
/// after the one before.
fn farthest(chain: &[Moved], from: usize, to: usize) -> Option<usize> {
    let (a, b) = (chain[from], chain[to]);
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let length2 = dx * dx + dy * dy;
    let mut worst = (TOLERANCE_NM, None);
    let mut reached = 0.0;
    for (k, p) in chain.iter().enumerate().take(to).skip(from + 1) {
        let t = if length2 > 0.0 { ((p.x - a.x) * dx + (p.y - a.y) * dy) / length2 } else { 0.0 };
        let on = t.clamp(0.0, 1.0);
        let off = math::hypot(p.x - a.x - on * dx, p.y - a.y - on * dy);
        // A stroke that goes back on itself is no segment.
        let back = (reached - t) * length2.sqrt();
        reached = f64::max(reached, t);
        let off = off.max(back);
        if off > worst.0 {
            worst = (off, Some(k));
        }
    }
    worst.1
}

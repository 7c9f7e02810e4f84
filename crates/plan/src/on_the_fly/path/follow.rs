//! Which stretches of strokes are marked on the fly, and the part under them.
//!
//! Consumes a stroke and the part; promises pieces between which the laser is off, cut where the part steps by more
//! than a straight line between two nodes may pass it, and without the stretches that cannot be followed.
//! Places are lengths along a stroke as the lens sees it, from its first point in the direction of marking. Units: mm.

use crate::on_the_fly::path::height_field::HeightField;
use crate::projection::Tracer;
use terrace_core::geom::{NM_PER_MM, P2, P3Mm, UnitVector};
use terrace_core::program::PieceId;

/// A cut is this far from the step that it is made for: marks that are rounded to a nanometre stay on their side.
const BESIDE_STEP: f64 = 5e-5;
/// Pieces that are shorter are left out.
const SHORTEST: f64 = 2e-3;
/// Nodes of a segment are farther apart, mm, but for its ends: over less, a line is as near to the part as its ends,
/// and nodes may be one on the grid.
const APART: f64 = 1e-5;

/// A stretch of a stroke of the program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Index of the stroke.
    pub stroke: PieceId,
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
}

/// What a path does where the part steps or cannot be followed.
pub struct Follow<'a> {
    /// Largest distance in height of the part from the line between two nodes; infinite: nodes lie evenly, and nothing
    /// is cut.
    pub near: f64,
    /// Whether a point of the part with its normal can be marked.
    pub holds: &'a dyn Fn(P3Mm, UnitVector) -> bool,
    /// Stretches that are left out besides.
    pub without: &'a [Stretch],
}

impl Follow<'_> {
    /// Marks everything, with even nodes.
    pub(crate) const EVENLY: Follow<'static> = Follow { near: f64::INFINITY, holds: &|_, _| true, without: &[] };
}

/// What lies under a stretch of a segment: one facet, or none where rounding has put the mark off the part.
#[derive(Clone, Copy)]
pub(super) struct Under {
    /// Parameters on the segment.
    pub(super) t: [f64; 2],
    /// Heights there.
    pub(super) z: [f64; 2],
    normal: Option<UnitVector>,
}

impl Under {
    pub(super) fn z(&self, t: f64) -> f64 {
        let [t0, t1] = self.t;
        if t >= t1 {
            self.z[1]
        } else if t <= t0 {
            self.z[0]
        } else {
            self.z[0] + (self.z[1] - self.z[0]) * ((t - t0) / (t1 - t0))
        }
    }
}

/// A segment of a stroke over the part.
pub(super) struct Segment {
    pub(super) a: P2,
    pub(super) b: P2,
    /// Length of the stroke up to it, and its own.
    pub(super) before: f64,
    pub(super) length: f64,
    pub(super) under: Vec<Under>,
}

impl Segment {
    /// A point of it in plan.
    pub(super) fn at(&self, t: f64) -> [f64; 2] {
        let ([ax, ay], [bx, by]) = (self.a.mm(), self.b.mm());
        [ax + t * (bx - ax), ay + t * (by - ay)]
    }

    /// A point of it on the grid.
    pub(super) fn point(&self, t: f64) -> P2 {
        self.a.lerp(self.b, t)
    }

    /// What lies under the segment just before a parameter.
    pub(super) fn under_before(&self, t: f64) -> &Under {
        let last = self.under.len() - 1;
        &self.under[self.under.partition_point(|u| u.t[1] < t).min(last)]
    }

    /// What lies under the segment just after a parameter.
    pub(super) fn under_after(&self, t: f64) -> &Under {
        let last = self.under.len() - 1;
        &self.under[self.under.partition_point(|u| u.t[1] <= t).min(last)]
    }

    fn along(&self, t: f64) -> f64 {
        self.before + t * self.length
    }

    /// Parameters of what a stretch has of it, if anything.
    pub(super) fn share(&self, stretch: &Stretch) -> Option<[f64; 2]> {
        // Far less than a nanometre: the sums of lengths are rounded.
        const ROUNDED: f64 = 1e-8;
        let (from, to) = (stretch.from - self.before, stretch.to - self.before);
        let from = if from <= ROUNDED { 0.0 } else { from / self.length };
        let to = if to >= self.length - ROUNDED { 1.0 } else { to / self.length };
        // A piece begins on the next segment where it would have but its last nanometres of this one, which are none
        // on the grid, and ends on the one before.
        let apart = APART / self.length;
        let begins = from < if from > 0.0 { 1.0 - apart } else { 1.0 };
        let ends = to > if to < 1.0 { apart } else { 0.0 };
        (begins && ends && from < to).then_some([from, to])
    }
}

/// The segments of a stroke with the part under them; off the part the height continues from the nearest that is known,
/// as the height field does.
pub(super) fn segments(points: &[P2], tracer: &mut Tracer<'_>, height_field: &HeightField) -> Vec<Segment> {
    let mut out: Vec<Segment> = Vec::with_capacity(points.len() - 1);
    let mut before = 0.0;
    // The last place whose height is known, and the height.
    let mut last_known: Option<([f64; 2], f64)> = None;
    for w in points.windows(2) {
        let (a, b) = (w[0], w[1]);
        let mut segment = Segment { a, b, before, length: a.distance(b) / NM_PER_MM, under: Vec::new() };
        let normals = tracer.normals();
        tracer.segment(a, b, |p| {
            let (t, ends) = ([p.t0, p.t1], [segment.at(p.t0), segment.at(p.t1)]);
            let under = if p.skip.is_none() {
                Under { t, z: [p.z0, p.z1].map(|z| z / NM_PER_MM), normal: Some(UnitVector(normals.under(&p))) }
            } else {
                let offset = |(at, z): ([f64; 2], f64)| z - height_field.at(at).z;
                let z = ends.map(|xy| last_known.map_or(0.0, offset) + height_field.at(xy).z);
                Under { t, z, normal: None }
            };
            if p.skip.is_none() {
                last_known = Some((ends[1], under.z[1]));
            }
            segment.under.push(under);
        });
        before += segment.length;
        out.push(segment);
    }
    out
}

/// The pieces of a stroke that are marked, and the stretches that are left out, both in order. No piece nor stretch is
/// shorter than what a cut takes.
pub(super) fn pieces(
    stroke: PieceId,
    segments: &[Segment],
    follow: &Follow<'_>,
    spacing: f64,
) -> (Vec<Stretch>, Vec<Stretch>) {
    let length = segments.last().map_or(0.0, |s| s.along(1.0));
    let mut cuts: Vec<[f64; 2]> =
        follow.without.iter().filter(|w| w.stroke == stroke).map(|w| [w.from, w.to]).collect();
    if follow.near.is_finite() {
        steps(segments, follow.near, &mut cuts);
        unfollowed(segments, follow, spacing, &mut cuts);
    }
    cuts.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut marked, mut left_out) = (Vec::new(), Vec::new());
    let mut at = 0.0f64;
    let mut gap = [0.0f64, 0.0];
    // Invariant: the pieces and stretches so far tile the stroke up to the begin of `gap`, which is left out up to
    // `at`.
    for [from, to] in cuts.into_iter().chain([[length, length]]) {
        // What is too short to be marked joins the gap; a stroke that is short as a whole is marked.
        if from - at > SHORTEST || (from >= length && at == 0.0) {
            let last: Option<&Stretch> = marked.last();
            if last.is_some_and(|last| point_at(segments, last.to) == point_at(segments, at)) {
                // Where a stroke turns back, the gap about its turn may begin and end at one place: without a jump
                // between them two pieces would be one mark, which cuts the turn off.
                at += 2.0 * BESIDE_STEP;
                gap[1] = at;
            }
            if gap[1] > gap[0] {
                left_out.push(Stretch { stroke, from: gap[0], to: gap[1] });
            }
            marked.push(Stretch { stroke, from: at, to: from.min(length) });
            gap = [from, from];
        }
        at = at.max(to.min(length));
        gap[1] = at;
    }
    if gap[1] > gap[0] {
        left_out.push(Stretch { stroke, from: gap[0], to: gap[1] });
    }
    (marked, left_out)
}

/// The point of a stroke at a length along it.
fn point_at(segments: &[Segment], along: f64) -> Option<P2> {
    let segment = segments.iter().find(|s| along <= s.along(1.0)).or(segments.last())?;
    Some(segment.point(((along - segment.before) / segment.length).clamp(0.0, 1.0)))
}

/// Adds a cut wherever the part steps by more than a line between two nodes may pass it on both sides.
fn steps(segments: &[Segment], near: f64, out: &mut Vec<[f64; 2]>) {
    let mut before: Option<f64> = None;
    for segment in segments {
        for under in &segment.under {
            let at = segment.along(under.t[0]);
            if before.is_some_and(|z| (under.z[0] - z).abs() > 2.0 * near) {
                out.push([at - BESIDE_STEP, at + BESIDE_STEP]);
            }
            before = Some(under.z[1]);
        }
    }
}

/// Adds where the part cannot be marked: from the last place that can to the next one.
fn unfollowed(segments: &[Segment], follow: &Follow<'_>, spacing: f64, out: &mut Vec<[f64; 2]>) {
    let (mut last, mut left_out) = (0.0, None);
    for segment in segments {
        for under in &segment.under {
            let Some(normal) = under.normal else { continue };
            let count = ((under.t[1] - under.t[0]) * segment.length / spacing).ceil().max(1.0) as usize;
            for k in 0..=count {
                let t = under.t[0] + (under.t[1] - under.t[0]) * k as f64 / count as f64;
                let ([x, y], along) = (segment.at(t), segment.along(t));
                if !(follow.holds)(P3Mm::new([x, y, under.z(t)]), normal) {
                    left_out.get_or_insert(last);
                } else {
                    out.extend(left_out.take().map(|from| [from, along]));
                    last = along;
                }
            }
        }
    }
    let length = segments.last().map_or(0.0, |s| s.along(1.0));
    out.extend(left_out.map(|from| [from, length]));
}

/// Parameters of the nodes of a segment from `from` to `to`: even ones, and those between that keep the part within
/// `near` of the line from node to node. The begin is not among them, the end is.
pub(super) fn nodes(segment: &Segment, from: f64, to: f64, spacing: f64, near: f64) -> Vec<f64> {
    let count = ((segment.length / spacing).ceil() as usize).max(1);
    let apart = APART / segment.length;
    let even = (1..=count).map(|i| i as f64 / count as f64).filter(|&t| t > from + apart && t < to - apart);
    let mut even: Vec<f64> = even.collect();
    even.push(to);
    if !near.is_finite() {
        return even;
    }
    let mut out = Vec::with_capacity(even.len());
    let mut last = ProfilePoint { t: from, z: segment.under_after(from).z(from) };
    for end in even {
        while let Some(node) = end_of_near_line(segment, last, end, near) {
            out.push(node.t);
            last = node;
        }
        out.push(end);
        last = ProfilePoint { t: end, z: segment.under_before(end).z(end) };
    }
    out
}

/// A place of a segment and the height of the part there.
#[derive(Clone, Copy)]
struct ProfilePoint {
    t: f64,
    z: f64,
}

/// The last border of facets up to which one line from `begin` is within `near` of the part; None where one is up to
/// `end`.
fn end_of_near_line(segment: &Segment, begin: ProfilePoint, end: f64, near: f64) -> Option<ProfilePoint> {
    let apart = APART / segment.length;
    let first = segment.under.partition_point(|u| u.t[1] <= begin.t);
    let borders = segment.under[first..].iter().map(|u| u.t[1]).take_while(|&t| t < end - apart);
    let borders = borders.filter(|&t| t > begin.t + apart);
    // Invariant: lines of slopes from `low` to `high` pass all borders so far near enough. One to the next border must
    // have such a slope.
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut passed = begin;
    for t in borders.chain([end]) {
        let z = segment.under_before(t).z(t);
        let (run, rise) = (t - begin.t, z - begin.z);
        // The first border is always reached, so that a node is farther on than the last.
        if passed.t > begin.t && !(low..=high).contains(&(rise / run)) {
            return Some(passed);
        }
        low = low.max((rise - near) / run);
        high = high.min((rise + near) / run);
        passed = ProfilePoint { t, z };
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_beside_a_turn_that_is_left_out_are_two_marks() {
        // 10 mm there and back over a plane, without what lies within a millimetre of the turn.
        let [a, b] = [P2::new(0, 0), P2::new(10_000_000, 0)];
        let under = || vec![Under { t: [0.0, 1.0], z: [0.0; 2], normal: Some(UnitVector::UP) }];
        let segments = [
            Segment { a, b, before: 0.0, length: 10.0, under: under() },
            Segment { a: b, b: a, before: 10.0, length: 10.0, under: under() },
        ];
        let without = [Stretch { stroke: PieceId(3), from: 9.0, to: 11.0 }];
        let follow = Follow { near: 1e-3, holds: &|_, _| true, without: &without };
        let (marked, left_out) = pieces(PieceId(3), &segments, &follow, 0.1);
        assert_eq!(marked.len(), 2, "{marked:?}");
        assert_ne!(point_at(&segments, marked[0].to), point_at(&segments, marked[1].from));
        // Both together are the stroke.
        assert_eq!((marked[0].from, marked[0].to, marked[1].to), (0.0, 9.0, 20.0));
        assert_eq!(left_out, [Stretch { stroke: PieceId(3), from: 9.0, to: marked[1].from }]);
    }

    #[test]
    fn no_two_nodes_fall_together() {
        // A border a fraction of a nanometre before the end, beyond which the part falls away.
        let t = [0.5, 1.0 - 1e-13];
        let under = vec![
            Under { t: [0.0, t[0]], z: [0.0; 2], normal: None },
            Under { t, z: [0.0, 1.0], normal: None },
            Under { t: [t[1], 1.0], z: [1.0, 0.9], normal: None },
        ];
        let segment = Segment { a: P2::new(0, 0), b: P2::new(10_000_000, 0), before: 5.0, length: 10.0, under };
        assert_eq!(nodes(&segment, 0.0, 1.0, 20.0, 1e-3), [0.5, 1.0]);
        // Pieces that begin or end there.
        let share = |from, to| segment.share(&Stretch { stroke: PieceId(0), from, to });
        assert_eq!(share(15.0 - 4e-7, 20.0), None);
        assert_eq!(share(0.0, 5.0 + 4e-7), None);
        assert_eq!(share(0.0, 20.0), Some([0.0, 1.0]));
        assert_eq!(share(6.0, 7.0), Some([0.1, 0.2]));
    }
}

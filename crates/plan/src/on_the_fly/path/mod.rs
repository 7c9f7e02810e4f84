//! The path of the beam over the part: strokes in their order, and the jumps between them.
//!
//! Consumes the strokes and the part; promises nodes so close that straight lines between them stand for the path, with
//! every vertex of a stroke among them. Units: mm; the frame is the part's. Under marks the height is the part's own,
//! along jumps the height field's. Where rounding has put a mark off the part its height continues from the nearest
//! that is known, as the height field does.
//!
//! `Path::with_skywriting` puts run-ins and run-outs before and after the marks, which continue as the marks do, and
//! one straight jump between two runs; [`Path::evened`] leaves vertices of gentle turns out.

pub mod c_rewind;
pub mod follow;
pub mod height_field;
pub mod schedule;

use crate::on_the_fly::path::follow::{Follow, Segment, Stretch};
use crate::on_the_fly::path::height_field::HeightField;
use crate::ordered_strokes::OrderedStrokes;
use crate::projection::Tracer;
use terrace_core::geom::{NM_PER_MM, P2, P3Mm, mm_from_nm};
use terrace_core::math;
use terrace_core::motion::{CORNER, angle, is_corner};
use terrace_core::program::{Pen, PenId, PieceId};
use terrace_input::surface::Surface;

/// What the path does at a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum NodeKind {
    /// Goes straight on.
    Between,
    /// Turns a little, as a curve does that is drawn with straight lines.
    Vertex,
    /// Turns sharply.
    Corner,
    /// A stroke begins or ends.
    End,
}

/// A node of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Where it lies.
    pub at: P3Mm,
    /// Pen of the stretch that ends here; None for a jump.
    pub pen: Option<PenId>,
    /// What the path does here.
    pub kind: NodeKind,
    /// Which of the strokes it belongs to, the one just marked or jumped to.
    pub stroke: PieceId,
    /// Pen whose speed the laser-off stretch that ends here keeps: it runs out of a mark or into one.
    pub run: Option<PenId>,
}

/// A path of marks and jumps; index 0 is where it begins.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// The nodes, in order.
    pub nodes: Vec<Node>,
}

/// A path with what of the strokes it marks and leaves out, in its order.
#[derive(Clone, Debug, Default)]
pub struct Followed {
    /// The path.
    pub path: Path,
    /// The pieces between which the laser is off.
    pub marked: Vec<Stretch>,
    /// What is not marked.
    pub left_out: Vec<Stretch>,
}

impl Path {
    /// The path of some of the strokes, with nodes no farther apart than `spacing` mm.
    pub fn of(
        ordered: &OrderedStrokes,
        range: std::ops::Range<usize>,
        surface: &Surface,
        height_field: &HeightField,
        spacing: f64,
    ) -> Self {
        Self::following(ordered, range, surface, height_field, spacing, &Follow::EVENLY).path
    }

    /// The path of some of the strokes, cut and with nodes as `follow` has it.
    pub fn following(
        ordered: &OrderedStrokes,
        range: std::ops::Range<usize>,
        surface: &Surface,
        height_field: &HeightField,
        spacing: f64,
        follow: &Follow<'_>,
    ) -> Followed {
        let mut out = Followed::default();
        let mut follower =
            PathFollower { path: Self::default(), reached: None, height_field, spacing, near: follow.near };
        let mut tracer = Tracer::new(surface, f64::INFINITY);
        for (number, stroke) in range.clone().zip(&ordered.strokes[range]) {
            let segments = follow::segments(ordered.points_of(stroke), &mut tracer, height_field);
            let (marked, left_out) = follow::pieces(PieceId(number as u32), &segments, follow, spacing);
            for piece in &marked {
                follower.add_piece(&segments, piece, stroke.pen);
            }
            out.marked.extend(marked);
            out.left_out.extend(left_out);
        }
        out.path = follower.path;
        out
    }

    /// The path with no more nodes than a smooth path needs: between two corners or ends one for every
    /// `step` mm of way and every turn of a corner's angle, evenly spread over both; no more than there were.
    pub fn evened(&self, step: f64) -> Self {
        let mut out = Self::default();
        out.nodes.extend(self.nodes.first());
        let way = self.distances();
        let mut from = 0;
        for to in 1..self.len() {
            if !self.runs_on_past(to) {
                out.add_evened(self, &way, from, to, step);
                from = to;
            }
        }
        out
    }

    /// Whether the path neither turns sharply at a node nor ends there, and keeps its pen and its stroke.
    fn runs_on_past(&self, i: usize) -> bool {
        let pen_and_stroke = |i: usize| self.nodes.get(i).map(|node| (node.pen, node.stroke));
        pen_and_stroke(i) == pen_and_stroke(i + 1) && !matches!(self.nodes[i].kind, NodeKind::Corner | NodeKind::End)
    }

    /// Adds what a path has after its node `from` up to `to`, with as many nodes as `step` mm of `way` and its turns
    /// ask for.
    fn add_evened(&mut self, path: &Self, way: &[f64], from: usize, to: usize, step: f64) {
        let weights: Vec<f64> = (from..to).map(|i| path.weight_for_nodes(way, from, to, i, step)).collect();
        let total: f64 = weights.iter().sum();
        let count = total.ceil() as usize;
        if count >= to - from {
            self.nodes.extend_from_slice(&path.nodes[from + 1..=to]);
            return;
        }
        let (mut i, mut before) = (from, 0.0);
        for n in 1..count {
            let at = total * n as f64 / count as f64;
            // Invariant: `before` is the weight of the stretches from `from` up to node i, and less than `at`.
            while i + 1 < to && before + weights[i - from] < at {
                before += weights[i - from];
                i += 1;
            }
            let share = ((at - before) / weights[i - from]).clamp(0.0, 1.0);
            let [a, b] = [i, i + 1].map(|i| path.nodes[i].at);
            self.node(a.lerp(b, share), path.nodes[to].pen, path.nodes[to].stroke);
        }
        self.nodes.push(path.nodes[to]);
    }

    /// How many nodes the stretch after node `i` asks for, of those from `from` to `to`: nodes go where there is way,
    /// and where there are turns, half of one at either end.
    fn weight_for_nodes(&self, way: &[f64], from: usize, to: usize, i: usize, step: f64) -> f64 {
        let heading = |i: usize| [0, 1].map(|k| self.nodes[i + 1].at[k] - self.nodes[i].at[k]);
        let turn = |i: usize| if i > from && i < to { angle(heading(i - 1), heading(i)) } else { 0.0 };
        (way[i + 1] - way[i]) / step + (turn(i) + turn(i + 1)) / (2.0 * CORNER)
    }

    /// A share of its nodes, from the middle, that begins where a mark begins and ends where one ends, where marks are
    /// not too long for that.
    pub fn middle(&self, share: f64) -> Self {
        let count = ((self.len() as f64 * share.clamp(0.0, 1.0)).ceil() as usize).max(2).min(self.len());
        if self.is_empty() {
            return Self::default();
        }
        let first = (self.len() - count) / 2;
        let from = (first..first + count).find(|&i| self.begins_mark(i)).unwrap_or(first);
        let enough = (from + count).min(self.len());
        let to = (enough..(from + 2 * count).min(self.len() + 1)).find(|to| self.ends_mark(to - 1)).unwrap_or(enough);
        self.piece(from..to)
    }

    /// Whether a mark, or its run-in, begins at a node.
    fn begins_mark(&self, i: usize) -> bool {
        // A run-in and its mark have no end between them, but two marks on one line may have.
        self.is_mark_or_run(i + 1) && (self.nodes[i].kind == NodeKind::End || !self.is_mark_or_run(i))
    }

    /// Whether a mark, or its run-out, ends at a node.
    fn ends_mark(&self, i: usize) -> bool {
        self.is_mark_or_run(i) && (self.nodes[i].kind == NodeKind::End || !self.is_mark_or_run(i + 1))
    }

    /// Some of its nodes, as a path of their own.
    pub fn piece(&self, range: std::ops::Range<usize>) -> Self {
        let mut out = Self { nodes: self.nodes[range].to_vec() };
        if let Some(first) = out.nodes.first_mut() {
            (first.pen, first.kind, first.run) = (None, NodeKind::End, None);
        }
        out
    }

    /// How many nodes there are.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether nothing is marked.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Pen of the stretch that ends at a node; None for a jump and beyond the path.
    pub fn pen_at(&self, i: usize) -> Option<PenId> {
        self.nodes.get(i)?.pen
    }

    /// Pen whose speed the stretch that ends at a node keeps with the laser off, if it runs out of a mark or into one.
    pub(crate) fn run_at(&self, i: usize) -> Option<PenId> {
        self.nodes.get(i)?.run
    }

    /// Whether the stretch that ends at a node is a mark, or a run-in or run-out of one; the others are jumps.
    pub(crate) fn is_mark_or_run(&self, i: usize) -> bool {
        self.pen_at(i).or(self.run_at(i)).is_some()
    }

    /// Length of the path seen from the lens up to each node.
    pub fn distances(&self) -> Vec<f64> {
        let mut sum = 0.0;
        let steps = self.nodes.windows(2).map(|w| {
            sum += stretch(w);
            sum
        });
        std::iter::once(0.0).chain(steps).take(self.len()).collect()
    }

    /// Half of the marked length on either side of each node: how much its figures count.
    pub fn weights(&self) -> Vec<f64> {
        self.weighted(|_| 1.0)
    }

    /// Half of the marked length on either side of each node, every pass of the pens counted.
    pub fn weights_of_passes(&self, pens: &[Pen]) -> Vec<f64> {
        self.weighted(|pen| f64::from(pens[pen.index()].passes))
    }

    /// Half of the marked length on either side of each node, each stretch counted as often as its pen says.
    fn weighted(&self, times: impl Fn(PenId) -> f64) -> Vec<f64> {
        let mut out = vec![0.0; self.len()];
        for (i, w) in self.nodes.windows(2).enumerate() {
            if let Some(pen) = w[1].pen {
                let half = times(pen) * stretch(w) / 2.0;
                out[i] += half;
                out[i + 1] += half;
            }
        }
        out
    }

    /// The marks with run-ins and run-outs of `time_s` at the pen's speed, straight on at every end and straight
    /// towards every begin, and jumps between them: the stage turns while nothing is marked. Between two marks on one
    /// line that leave no room for that the path runs on. Of no time, the path as it is.
    pub(crate) fn with_skywriting(&self, time_s: f64, pens: &[Pen]) -> Self {
        self.with_runs(&pens.iter().map(|pen| time_s * pen.speed.as_mm_s()).collect::<Vec<_>>())
    }

    /// The marks with run-ins and run-outs of so many mm for each pen, 0 for none, at whose far ends the spot rests.
    /// The jumps between them get nodes.
    pub fn with_run_ups(&self, run_mm: &[f64]) -> Self {
        /// Between nodes of a jump, mm.
        const STEP: f64 = 1.0;
        if run_mm.iter().all(|mm| *mm <= 0.0) {
            return self.clone();
        }
        let runs = self.with_runs(run_mm);
        let is_jump = |i: usize| !runs.is_mark_or_run(i);
        let mut out = Self::default();
        for (i, node) in runs.nodes.iter().enumerate() {
            let rests = i == 0 || i + 1 == runs.len() || is_jump(i) != is_jump(i + 1);
            let kind = if rests { NodeKind::End } else { node.kind };
            if let Some(last) = out.nodes.last().map(|last| last.at).filter(|_| is_jump(i)) {
                let count = (math::hypot(node.at[0] - last[0], node.at[1] - last[1]) / STEP).ceil();
                for k in 1..count as usize {
                    out.node(last.lerp(node.at, k as f64 / count), None, node.stroke);
                }
            }
            out.nodes.push(Node { kind, ..*node });
        }
        out
    }

    /// The marks with run-ins and run-outs of so many mm for each pen, and straight jumps between them.
    fn with_runs(&self, run_mm: &[f64]) -> Self {
        if run_mm.iter().all(|mm| *mm <= 0.0) {
            return self.clone();
        }
        let mut out = Self::default();
        // The end of the last mark. Its run-out is added once the next mark is known, which may run on from it.
        let mut ended: Option<MarkEnd> = None;
        for (i, node) in self.nodes.iter().enumerate() {
            if let Some(pen) = node.pen {
                out.node(node.at, Some(pen), node.stroke);
                if node.kind == NodeKind::End {
                    ended = Some(self.mark_end(i, pen, run_mm));
                    if run_mm[pen.index()] <= 0.0 {
                        out.turn(NodeKind::End);
                    }
                } else if let Some(last) = out.nodes.last_mut() {
                    last.kind = node.kind;
                }
            }
            if let Some(pen) = self.pen_at(i + 1).filter(|_| node.kind == NodeKind::End) {
                let begin = self.mark_begin(i, pen, run_mm);
                let stroke = self.nodes[i + 1].stroke;
                if !ended.is_some_and(|ended| on_one_line(&ended, &begin)) {
                    let stroke_before = out.nodes.last().map(|node| node.stroke).unwrap_or_default();
                    out.add_run_out(ended, stroke_before);
                    out.add_jump_to_run_in(&begin, stroke);
                    if run_mm[pen.index()] <= 0.0 {
                        out.turn(NodeKind::End);
                    }
                }
                // The path is at the mark already after a run-in of no length, or where the last mark ended there.
                if out.nodes.last().is_none_or(|last| last.at != begin.at) {
                    out.laser_off(begin.at, Some(pen), stroke);
                }
            }
        }
        if let Some(last) = self.nodes.last() {
            out.add_run_out(ended, last.stroke);
        }
        out
    }

    /// The end of a mark of a pen at a node.
    fn mark_end(&self, i: usize, pen: PenId, run_mm: &[f64]) -> MarkEnd {
        let before = self.farther_along_mark(i, |j| self.pen_at(j).map(|_| j - 1));
        MarkEnd { at: self.nodes[i].at, run: self.run(before, i, run_mm[pen.index()]), pen }
    }

    /// The begin of a mark of a pen at a node.
    fn mark_begin(&self, i: usize, pen: PenId, run_mm: &[f64]) -> MarkEnd {
        let after = self.farther_along_mark(i, |j| self.pen_at(j + 1).map(|_| j + 1));
        MarkEnd { at: self.nodes[i].at, run: self.run(i, after, run_mm[pen.index()]), pen }
    }

    /// A run of so many mm, seen from the lens, in the direction from one node to another.
    fn run(&self, from: usize, to: usize, mm: f64) -> [f64; 3] {
        let (a, b) = (self.nodes[from].at, self.nodes[to].at);
        let length = math::hypot(b[0] - a[0], b[1] - a[1]);
        let share = if length > 0.0 { mm / length } else { 0.0 };
        b.way_from(a).map(|v| share * v)
    }

    /// The nearest node of the same mark that shows the direction at its end `i`; `next` gives the node after one,
    /// away from that end.
    fn farther_along_mark(&self, i: usize, next: impl Fn(usize) -> Option<usize>) -> usize {
        /// So far from the node, mm, rounding to nanometres no longer turns the direction.
        const ENOUGH: f64 = 0.1;
        let mut node = i;
        while let Some(j) = next(node) {
            let (a, b) = (self.nodes[i].at, self.nodes[j].at);
            node = j;
            // Past a vertex the mark has another direction.
            if math::hypot(b[0] - a[0], b[1] - a[1]) >= ENOUGH || self.nodes[j].kind != NodeKind::Between {
                break;
            }
        }
        node
    }

    /// Adds the run-out of a mark, where there is one of any length.
    fn add_run_out(&mut self, ended: Option<MarkEnd>, stroke: PieceId) {
        if let Some(MarkEnd { at, run, pen }) = ended.filter(|ended| ended.run != [0.0; 3]) {
            self.laser_off(at.moved(run), Some(pen), stroke);
        }
    }

    /// Adds the jump to where the run-in of a mark begins.
    fn add_jump_to_run_in(&mut self, begin: &MarkEnd, stroke: PieceId) {
        let run_in_begins = begin.at.moved(begin.run.map(|v| -v));
        if self.nodes.last().is_none_or(|last| last.at != run_in_begins) {
            self.node(run_in_begins, None, stroke);
        }
    }

    /// Adds a node that a mark of a pen comes to, or a jump.
    fn node(&mut self, at: P3Mm, pen: Option<PenId>, stroke: PieceId) {
        self.nodes.push(Node { at, pen, kind: NodeKind::Between, stroke, run: None });
    }

    /// Adds a node that is run to with the laser off at a pen's speed.
    fn laser_off(&mut self, at: P3Mm, run: Option<PenId>, stroke: PieceId) {
        self.nodes.push(Node { at, pen: None, kind: NodeKind::Between, stroke, run });
    }

    /// What the path does at the node it has come to.
    fn turn(&mut self, kind: NodeKind) {
        if let Some(last) = self.nodes.last_mut() {
            last.kind = kind.max(last.kind);
        }
    }
}

/// A path while it follows the pieces of strokes one after the other.
struct PathFollower<'a> {
    path: Path,
    /// Where the path has come to, on the grid.
    reached: Option<P2>,
    height_field: &'a HeightField,
    /// Largest distance of two nodes, mm.
    spacing: f64,
    /// Largest distance in height of the part from the line between two nodes of a mark, mm.
    near: f64,
}

impl PathFollower<'_> {
    /// Adds a piece of a stroke, with the jump to it.
    fn add_piece(&mut self, segments: &[Segment], piece: &Stretch, pen: PenId) {
        let mut direction = None;
        for segment in segments {
            let Some([t0, t1]) = segment.share(piece) else { continue };
            if direction.is_none() {
                self.jump_to(segment.point(t0), piece.stroke);
                if let Some(last) = self.path.nodes.last_mut().filter(|last| last.pen.is_none()) {
                    // The stroke begins at the part's own height.
                    last.at[2] = segment.under_after(t0).z(t0);
                }
            }
            let heading = heading(segment.a, segment.b);
            self.path.turn(match direction {
                None => NodeKind::End,
                Some(d) if is_corner(d, heading) => NodeKind::Corner,
                Some(_) => NodeKind::Vertex,
            });
            for t in follow::nodes(segment, t0, t1, self.spacing, self.near) {
                let [x, y] = segment.at(t);
                self.path.node(P3Mm::new([x, y, segment.under_before(t).z(t)]), Some(pen), piece.stroke);
            }
            direction = Some(heading);
            self.reached = Some(segment.point(t1));
        }
        self.path.turn(NodeKind::End);
        // A cut lies on the grid of the jump that begins there.
        if let (Some(last), Some(p)) = (self.path.nodes.last_mut(), self.reached) {
            [last.at[0], last.at[1]] = p.mm();
        }
    }

    /// Adds the jump to a place, at which the path may be already; the first place begins the path.
    fn jump_to(&mut self, to: P2, stroke: PieceId) {
        let Some(from) = self.reached else {
            let [x, y] = to.mm();
            return self.path.node(P3Mm::new([x, y, 0.0]), None, stroke);
        };
        if from == to {
            return;
        }
        let count = pieces(from, to, self.spacing);
        let ([ax, ay], [bx, by]) = (from.mm(), to.mm());
        for i in 1..=count {
            let t = i as f64 / count as f64;
            let xy = [ax + t * (bx - ax), ay + t * (by - ay)];
            self.path.node(P3Mm::new([xy[0], xy[1], self.height_field.at(xy).z]), None, stroke);
        }
    }
}

/// One end of a mark, and the run with the laser off beyond it.
#[derive(Clone, Copy)]
struct MarkEnd {
    /// Where the mark ends or begins.
    at: P3Mm,
    /// The run-out from there or the run-in to there, in the direction of marking; of no length for pens without.
    run: [f64; 3],
    pen: PenId,
}

/// Whether a mark that ends and one that begins lie on one line, nearer than run-out and run-in both.
fn on_one_line(end: &MarkEnd, begin: &MarkEnd) -> bool {
    /// What two pieces of one line may differ by, in direction, rad, and in length of their runs, as a share.
    const STRAIGHT: f64 = 1e-3;
    /// Height between them, mm, up to which the part does not step there, beside the slope of the mark.
    const FLAT: f64 = 1e-3;
    /// Slope beside that of the mark up to which the part does not step there.
    const STEEPER: f64 = 0.2;
    let gap = [begin.at[0] - end.at[0], begin.at[1] - end.at[1]];
    let run_out = [end.run[0], end.run[1]];
    let run_in = [begin.run[0], begin.run[1]];
    let gap_mm = math::hypot(gap[0], gap[1]);
    let run_out_mm = math::hypot(run_out[0], run_out[1]);
    let run_in_mm = math::hypot(run_in[0], run_in[1]);
    // Where the part steps between them a way that runs on would have to rise like a wall.
    let step = (begin.at[2] - end.at[2] - end.run[2] / run_out_mm * gap_mm).abs();
    if step > FLAT + STEEPER * gap_mm {
        return false;
    }
    // Another pen's speed is another length.
    (run_out_mm - run_in_mm).abs() <= STRAIGHT * run_out_mm
        && angle(run_out, run_in) < STRAIGHT
        && gap_mm < run_out_mm + run_in_mm
        && (gap_mm == 0.0 || angle(run_out, gap) < STRAIGHT)
}

/// Length between two neighbouring nodes, seen from the lens.
fn stretch(w: &[Node]) -> f64 {
    math::hypot(w[1].at[0] - w[0].at[0], w[1].at[1] - w[0].at[1])
}

/// How many pieces of `spacing` mm or less a line between two points is divided into.
fn pieces(a: P2, b: P2, spacing: f64) -> usize {
    ((a.distance(b) / NM_PER_MM / spacing).ceil() as usize).max(1)
}

fn heading(a: P2, b: P2) -> [f64; 2] {
    [mm_from_nm(b.x - a.x), mm_from_nm(b.y - a.y)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::units::{Frequency, Power, Speed};

    fn pens() -> Vec<Pen> {
        vec![Pen {
            name: "a".into(),
            speed: Speed::mm_s(100.0),
            power: Power::Percent(50.0),
            frequency: Frequency::khz(60.0),
            passes: 1,
            dwell: None,
        }]
    }

    /// Marks through points, joined by jumps.
    fn path(marks: &[&[[f64; 3]]]) -> Path {
        let mut out = Path::default();
        for (stroke, mark) in marks.iter().enumerate() {
            let stroke = PieceId(stroke as u32);
            if out.nodes.last().is_none_or(|last| last.at.mm != mark[0]) {
                out.node(P3Mm::new(mark[0]), None, stroke);
            }
            out.turn(NodeKind::End);
            for &p in &mark[1..] {
                out.node(P3Mm::new(p), Some(PenId(0)), stroke);
            }
            out.turn(NodeKind::End);
        }
        out
    }

    fn places(path: &Path) -> Vec<[f64; 3]> {
        path.nodes.iter().map(|node| node.at.mm).collect()
    }

    fn lit(path: &Path) -> Vec<[[f64; 3]; 2]> {
        (1..path.len())
            .filter(|&i| path.nodes[i].pen.is_some())
            .map(|i| [path.nodes[i - 1].at.mm, path.nodes[i].at.mm])
            .collect()
    }

    #[test]
    fn skywriting_runs_are_collinear_with_their_mark() {
        // Two lines there and back on a slope of 0.1, and a third that continues where the second ends.
        let path = path(&[
            &[[0.0, 0.0, 0.0], [10.0, 0.0, 1.0], [20.0, 0.0, 2.0]],
            &[[20.0, 1.0, 2.0], [0.0, 1.0, 0.0]],
            &[[0.0, 1.0, 0.0], [-5.0, 1.0, -0.5]],
        ]);
        let out = path.with_skywriting(0.02, &pens());
        // The marks are the same.
        assert_eq!(lit(&out), lit(&path));
        let off: Vec<[f64; 3]> =
            (0..out.len()).filter(|&i| out.nodes[i].pen.is_none()).map(|i| out.nodes[i].at.mm).collect();
        let near = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-12);
        let want = [
            [-2.0, 0.0, -0.2],
            [0.0, 0.0, 0.0],
            [22.0, 0.0, 2.2],
            [22.0, 1.0, 2.2],
            [20.0, 1.0, 2.0],
            [-7.0, 1.0, -0.7],
        ];
        assert!(off.len() == want.len() && off.iter().zip(&want).all(|(a, b)| near(a, b)), "{off:?}");
        // All but the jump and the first node run at the pen's speed.
        let jumps = (0..out.len()).filter(|&i| out.nodes[i].pen.is_none() && out.nodes[i].run.is_none()).count();
        assert_eq!(jumps, 2);
        assert_eq!(path.with_skywriting(0.0, &pens()).nodes, path.nodes);
        // A second, slower pen on the same line ends the run.
        let mut two = self::path(&[&[[0.0; 3], [5.0, 0.0, 0.0]], &[[5.0, 0.0, 0.0], [9.0, 0.0, 0.0]]]);
        assert_eq!(two.with_skywriting(0.02, &pens()).len(), 5);
        two.nodes[2].pen = Some(PenId(1));
        let slow = Pen { speed: Speed::mm_s(20.0), ..pens()[0].clone() };
        assert_eq!(two.with_skywriting(0.02, &[pens()[0].clone(), slow]).len(), 8);
        assert!(Path::default().with_skywriting(0.02, &pens()).is_empty());
        // Run-ups of one pen alone: the spot rests at their far ends, and at the ends of the other pen's mark.
        let out = two.with_run_ups(&[1.5, 0.0]);
        assert_eq!(lit(&out), lit(&two));
        let rests = out.nodes.iter().filter(|node| node.kind == NodeKind::End).map(|node| node.at[0]);
        assert_eq!(rests.collect::<Vec<_>>(), [-1.5, 6.5, 5.0, 9.0]);
    }

    #[test]
    fn marks_run_on_where_they_lie_on_one_line_within_reach_of_their_runs() {
        let mark_end = |at: [f64; 3], run: [f64; 3]| MarkEnd { at: P3Mm::new(at), run, pen: PenId(0) };
        let end = mark_end([0.0; 3], [2.0, 0.0, 0.2]);
        let runs_on = |at: [f64; 3], run: [f64; 3]| on_one_line(&end, &mark_end(at, run));
        assert!(runs_on([3.0, 0.0, 0.3], [2.0, 0.0, 0.2]));
        assert!(runs_on([0.0; 3], [2.0, 0.0, 0.2]), "without a gap");
        assert!(!runs_on([5.0, 0.0, 0.5], [2.0, 0.0, 0.2]), "farther than both runs");
        assert!(!runs_on([3.0, 0.1, 0.3], [2.0, 0.0, 0.2]), "beside the line");
        assert!(!runs_on([3.0, 0.0, 0.3], [-2.0, 0.0, -0.2]), "back");
        assert!(!runs_on([3.0, 0.0, 0.3], [1.0, 0.0, 0.1]), "another speed");
        assert!(!runs_on([3.0, 0.0, 1.3], [2.0, 0.0, 0.2]), "over a step");
    }

    #[test]
    fn the_middle_begins_and_ends_with_whole_marks() {
        let lines: Vec<[[f64; 3]; 3]> =
            (0..20).map(f64::from).map(|y| [[0.0, y, 0.0], [5.0, y, 0.0], [10.0, y, 0.0]]).collect();
        let all = path(&lines.iter().map(|l| &l[..]).collect::<Vec<_>>());
        let is_whole = |p: &Path| {
            let (first, last) = (p.nodes[0].at, p.nodes[p.len() - 1].at);
            let lit = lit(p);
            assert_eq!(p.nodes[0].pen, None);
            assert!(
                lit.len().is_multiple_of(2) && lit.iter().flatten().all(|p| (5.0..15.0).contains(&p[1])),
                "{lit:?}"
            );
            (first, last)
        };
        let (first, last) = is_whole(&all.middle(0.2));
        assert!(first[0] == 0.0 && last[0] == 10.0, "{first:?} {last:?}");
        // With the runs of its marks.
        let (first, last) = is_whole(&all.with_skywriting(0.02, &pens()).middle(0.2));
        assert!(first[0] == -2.0 && last[0] == 12.0, "{first:?} {last:?}");
        assert_eq!(all.middle(1.0).nodes, all.nodes);
        // One mark alone is cut anywhere.
        let one: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        assert_eq!(path(&[&one]).middle(0.1).len(), 10);
        assert!(Path::default().middle(0.5).is_empty());
    }

    #[test]
    fn even_nodes_keep_corners_ends_and_round_shapes() {
        let circle: Vec<[f64; 3]> = (0..=720)
            .map(|i| f64::from(i).to_radians() / 2.0)
            .map(|t| [10.0 * math::cos(t), 10.0 * math::sin(t), 0.0])
            .collect();
        let mut path = path(&[&circle, &[circle[720], [10.0, -3.0, 0.0], [13.0, -3.0, 0.0]]]);
        path.nodes[721].kind = NodeKind::Corner;
        for i in 1..720 {
            path.nodes[i].kind = NodeKind::Vertex;
        }
        let out = path.evened(1.0);
        let at = places(&out);
        assert!(at.contains(&[10.0, -3.0, 0.0]) && at.last() == Some(&[13.0, -3.0, 0.0]), "{at:?}");
        let on: Vec<f64> = at.iter().take(63).map(|p| math::hypot(p[0], p[1])).collect();
        assert!(on.iter().all(|r| (r - 10.0).abs() < 1e-3), "{on:?}");
        let lengths = |p: &Path| p.distances().last().copied().unwrap_or_default();
        assert!((lengths(&out) / lengths(&path) - 1.0).abs() < 1e-3 && out.len() < 95, "{}", out.len());
        // A small circle keeps its turns gentle, few nodes stay as they are.
        let small: Vec<[f64; 3]> = circle.iter().map(|p| p.map(|v| v / 100.0)).collect();
        let small = self::path(&[&small]).evened(1.0);
        assert!(small.len() >= 24, "{}", small.len());
        // A hairpin between long legs too.
        let bend = (1..16)
            .map(|i| (f64::from(i) * 11.25).to_radians())
            .map(|t| [0.2 * math::sin(t), -0.2 * math::cos(t), 0.0]);
        let leg = |y: f64, back: bool| (0..50).map(move |i| [-f64::from(if back { i } else { 50 - i }), y, 0.0]);
        let hairpin: Vec<[f64; 3]> =
            leg(-0.2, false).chain([[0.0, -0.2, 0.0]]).chain(bend).chain(leg(0.2, true)).collect();
        let mut hairpin = self::path(&[&hairpin]);
        (1..hairpin.len() - 1).for_each(|i| hairpin.nodes[i].kind = NodeKind::Vertex);
        let out = hairpin.evened(1.5);
        let round = places(&out).iter().filter(|p| p[0] > 0.0).count();
        assert!(out.len() < hairpin.len() && round >= 11, "{round} of {}", out.len());
        let line = self::path(&[&[[0.0; 3], [0.3, 0.0, 0.0], [9.0, 0.0, 0.0]]]);
        assert_eq!(places(&line.evened(1.0)), places(&line));
        assert!(Path::default().evened(1.0).is_empty());
    }
}

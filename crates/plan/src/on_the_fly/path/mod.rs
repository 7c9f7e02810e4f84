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
use terrace_core::geom::{NM_PER_MM, P2, mm_from_nm};
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
    pub at: [f64; 3],
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

    /// The same, cut and with nodes as `follow` has it.
    pub fn following(
        ordered: &OrderedStrokes,
        range: std::ops::Range<usize>,
        surface: &Surface,
        height_field: &HeightField,
        spacing: f64,
        follow: &Follow<'_>,
    ) -> Followed {
        let mut out = Followed::default();
        let path = &mut out.path;
        let mut tracer = Tracer::new(surface, f64::INFINITY);
        let mut from: Option<P2> = None;
        for (number, stroke) in range.clone().zip(&ordered.strokes[range]) {
            let segments = follow::segments(ordered.points_of(stroke), &mut tracer, height_field);
            let (marked, left_out) = follow::pieces(PieceId(number as u32), &segments, follow, spacing);
            for piece in &marked {
                path.piece_of(&segments, piece, &mut from, stroke.pen, (height_field, spacing, follow.near));
            }
            out.marked.extend(marked);
            out.left_out.extend(left_out);
        }
        out
    }

    /// The same with no more nodes than a smooth path needs: between two corners or ends one for every
    /// `step` mm of way and every turn of a corner's angle, evenly spread over both; no more than there were.
    pub fn evened(&self, step: f64) -> Self {
        let mut out = Self::default();
        out.nodes.extend(self.nodes.first());
        let (way, mut from) = (self.distances(), 0);
        for to in 1..self.len() {
            let of = |i: usize| self.nodes.get(i).map(|node| (node.pen, node.stroke));
            let goes_on = of(to) == of(to + 1);
            if goes_on && !matches!(self.nodes[to].kind, NodeKind::Corner | NodeKind::End) {
                continue;
            }
            // Nodes go where there is way, and where there are turns.
            let heading = |i: usize| [0, 1].map(|k| self.nodes[i + 1].at[k] - self.nodes[i].at[k]);
            let turn = |i: usize| if i > from && i < to { angle(heading(i - 1), heading(i)) } else { 0.0 };
            let weight = |i: usize| (way[i + 1] - way[i]) / step + (turn(i) + turn(i + 1)) / (2.0 * CORNER);
            let all: f64 = (from..to).map(weight).sum();
            let count = all.ceil() as usize;
            let (mut i, mut before) = (from, 0.0);
            for n in 1..count.min(to - from) {
                if count >= to - from {
                    out.nodes.push(self.nodes[from + n]);
                    continue;
                }
                let at = all * n as f64 / count as f64;
                while i + 1 < to && before + weight(i) < at {
                    before += weight(i);
                    i += 1;
                }
                let share = ((at - before) / weight(i)).clamp(0.0, 1.0);
                let [a, b] = [i, i + 1].map(|i| self.nodes[i].at);
                let spot = [0, 1, 2].map(|k| a[k] + share * (b[k] - a[k]));
                out.node(spot, self.nodes[to].pen, self.nodes[to].stroke);
            }
            out.nodes.push(self.nodes[to]);
            from = to;
        }
        out
    }

    /// A share of its nodes, from the middle, that begins where a mark begins and ends where one ends, where marks are
    /// not too long for that.
    pub fn middle(&self, share: f64) -> Self {
        let count = ((self.len() as f64 * share.clamp(0.0, 1.0)).ceil() as usize).max(2).min(self.len());
        if self.is_empty() {
            return Self::default();
        }
        let first = (self.len() - count) / 2;
        let marks = |i: usize| self.pen_at(i).is_some();
        let runs = |i: usize| self.run_at(i).is_some();
        // A mark goes with its runs, where it has any: these have no ends of their own.
        let goes = |i: usize| marks(i) || runs(i);
        let is_end = |i: usize| self.nodes[i].kind == NodeKind::End;
        let begins = |i: &usize| goes(i + 1) && (is_end(*i) || !goes(*i));
        let ends = |i: &usize| goes(*i) && (is_end(*i) || !goes(i + 1));
        let from = (first..first + count).find(begins).unwrap_or(first);
        let enough = (from + count).min(self.len());
        let to = (enough..(from + 2 * count).min(self.len() + 1)).find(|to| ends(&(to - 1))).unwrap_or(enough);
        self.piece(from..to)
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

    /// Pen whose speed that stretch keeps with the laser off, if it runs out of a mark or into one.
    pub(crate) fn run_at(&self, i: usize) -> Option<PenId> {
        self.nodes.get(i)?.run
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

    /// The same with every pass of the pens counted.
    pub fn weights_of_passes(&self, pens: &[Pen]) -> Vec<f64> {
        self.weighted(|pen| f64::from(pens[pen.index()].passes))
    }

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

    /// The same marks with run-ins and run-outs of `time_s` at the pen's speed, straight on at every end and straight
    /// towards every begin, and jumps between them: the stage turns while nothing is marked. Between two marks on one
    /// line that leave no room for that the path runs on. Of no time, the path as it is.
    pub(crate) fn with_skywriting(&self, time_s: f64, pens: &[Pen]) -> Self {
        self.with_runs(&pens.iter().map(|pen| time_s * pen.speed.as_mm_s()).collect::<Vec<_>>())
    }

    /// The same with run-ins and run-outs of so many mm for each pen, 0 for none, at whose far ends the spot rests. The
    /// jumps between them get nodes.
    pub fn with_run_ups(&self, run_mm: &[f64]) -> Self {
        /// Between nodes of a jump, mm.
        const STEP: f64 = 1.0;
        if run_mm.iter().all(|mm| *mm <= 0.0) {
            return self.clone();
        }
        let runs = self.with_runs(run_mm);
        let jumps = |i: usize| runs.pen_at(i).or(runs.run_at(i)).is_none();
        let mut out = Self::default();
        for (i, node) in runs.nodes.iter().enumerate() {
            let rests = i == 0 || i + 1 == runs.len() || jumps(i) != jumps(i + 1);
            let kind = if rests { NodeKind::End } else { node.kind };
            if let Some(last) = out.nodes.last().map(|last| last.at).filter(|_| jumps(i)) {
                let count = ((node.at[0] - last[0]).hypot(node.at[1] - last[1]) / STEP).ceil();
                for k in 1..count as usize {
                    let at = [0, 1, 2].map(|c| last[c] + k as f64 / count * (node.at[c] - last[c]));
                    out.node(at, None, node.stroke);
                }
            }
            out.nodes.push(Node { kind, ..*node });
        }
        out
    }

    /// The same with run-ins and run-outs of so many mm for each pen.
    fn with_runs(&self, run_mm: &[f64]) -> Self {
        if run_mm.iter().all(|mm| *mm <= 0.0) {
            return self.clone();
        }
        let mut out = Self::default();
        // The length of the run-in or run-out of a pen's mark, in the direction of the stretch between two nodes of it.
        let run = |from: usize, to: usize, pen: PenId| {
            let (a, b) = (self.nodes[from].at, self.nodes[to].at);
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            let share = if length > 0.0 { run_mm[pen.index()] / length } else { 0.0 };
            [0, 1, 2].map(|k| share * (b[k] - a[k]))
        };
        let mut ended: Option<([f64; 3], [f64; 3], PenId)> = None;
        for i in 0..self.len() {
            let begins = self.pen_at(i + 1).filter(|_| self.nodes[i].kind == NodeKind::End);
            if let Some(pen) = self.nodes[i].pen {
                out.node(self.nodes[i].at, Some(pen), self.nodes[i].stroke);
                if self.nodes[i].kind == NodeKind::End {
                    ended = Some((self.nodes[i].at, run(self.along(i, false), i, pen), pen));
                    if run_mm[pen.index()] <= 0.0 {
                        out.turn(NodeKind::End);
                    }
                } else if let Some(last) = out.nodes.last_mut() {
                    last.kind = self.nodes[i].kind;
                }
            }
            if let Some(pen) = begins {
                let (at, stroke, before) = (
                    self.nodes[i].at,
                    self.nodes[i + 1].stroke,
                    out.nodes.last().map(|node| node.stroke).unwrap_or_default(),
                );
                let into = run(i, self.along(i, true), pen);
                if !ended.is_some_and(|(from, way, _)| on_one_line(from, way, at, into)) {
                    if let Some((from, way, pen)) = ended.filter(|(_, way, _)| *way != [0.0; 3]) {
                        out.laser_off([0, 1, 2].map(|k| from[k] + way[k]), Some(pen), before);
                    }
                    let begin = [0, 1, 2].map(|k| at[k] - into[k]);
                    if out.nodes.last().is_none_or(|last| last.at != begin) {
                        out.node(begin, None, stroke);
                    }
                    if run_mm[pen.index()] <= 0.0 {
                        out.turn(NodeKind::End);
                    }
                }
                if out.nodes.last().is_none_or(|last| last.at != at) {
                    out.laser_off(at, Some(pen), stroke);
                }
            }
        }
        if let Some((from, way, pen)) = ended.filter(|(_, way, _)| *way != [0.0; 3]) {
            out.laser_off([0, 1, 2].map(|k| from[k] + way[k]), Some(pen), self.nodes[self.len() - 1].stroke);
        }
        out
    }

    /// The nearest node of the same mark after one, or before it, that shows the direction there.
    fn along(&self, i: usize, after: bool) -> usize {
        /// So far from the node, mm, rounding to nanometres no longer turns the direction.
        const ENOUGH: f64 = 0.1;
        let next = |j: usize| {
            let (next, pen) = if after { (j + 1, self.pen_at(j + 1)) } else { (j.wrapping_sub(1), self.pen_at(j)) };
            pen.map(|_| next)
        };
        let mut found = i;
        while let Some(j) = next(found) {
            let (a, b) = (self.nodes[i].at, self.nodes[j].at);
            found = j;
            if (b[0] - a[0]).hypot(b[1] - a[1]) >= ENOUGH || self.nodes[j].kind != NodeKind::Between {
                break;
            }
        }
        found
    }

    fn node(&mut self, at: [f64; 3], pen: Option<PenId>, stroke: PieceId) {
        self.nodes.push(Node { at, pen, kind: NodeKind::Between, stroke, run: None });
    }

    /// A node that is run to at a pen's speed.
    fn laser_off(&mut self, at: [f64; 3], run: Option<PenId>, stroke: PieceId) {
        self.nodes.push(Node { at, pen: None, kind: NodeKind::Between, stroke, run });
    }

    /// What the path does at the node it has come to.
    fn turn(&mut self, kind: NodeKind) {
        if let Some(last) = self.nodes.last_mut() {
            last.kind = kind.max(last.kind);
        }
    }

    fn jump(&mut self, a: P2, b: P2, height_field: &HeightField, spacing: f64, stroke: PieceId) {
        let count = pieces(a, b, spacing);
        let ([ax, ay], [bx, by]) = (a.mm(), b.mm());
        for i in 1..=count {
            let t = i as f64 / count as f64;
            let xy = [ax + t * (bx - ax), ay + t * (by - ay)];
            self.node([xy[0], xy[1], height_field.at(xy).z], None, stroke);
        }
    }

    /// A piece of a stroke, with the jump to it; `from` is where the path has come to.
    fn piece_of(
        &mut self,
        segments: &[Segment],
        piece: &Stretch,
        from: &mut Option<P2>,
        pen: PenId,
        (height_field, spacing, near): (&HeightField, f64, f64),
    ) {
        let mut direction = None;
        for segment in segments {
            let Some([t0, t1]) = segment.share(piece) else { continue };
            if direction.is_none() {
                let first = segment.point(t0);
                match *from {
                    Some(from) if from != first => self.jump(from, first, height_field, spacing, piece.stroke),
                    Some(_) => {}
                    None => self.node([first.mm()[0], first.mm()[1], 0.0], None, piece.stroke),
                }
                if let Some(last) = self.nodes.last_mut().filter(|last| last.pen.is_none()) {
                    // The stroke begins at the part's own height.
                    last.at[2] = segment.under(t0, true).z(t0);
                }
            }
            let heading = heading(segment.a, segment.b);
            self.turn(match direction {
                None => NodeKind::End,
                Some(d) if is_corner(d, heading) => NodeKind::Corner,
                Some(_) => NodeKind::Vertex,
            });
            for t in follow::nodes(segment, t0, t1, spacing, near) {
                let [x, y] = segment.at(t);
                self.node([x, y, segment.under(t, false).z(t)], Some(pen), piece.stroke);
            }
            direction = Some(heading);
            *from = Some(segment.point(t1));
        }
        self.turn(NodeKind::End);
        // A cut lies on the grid of the jump that begins there.
        if let (Some(last), Some(p)) = (self.nodes.last_mut(), from) {
            [last.at[0], last.at[1]] = p.mm();
        }
    }
}

/// Whether a mark that ends at `from` and one that begins at `to` lie on one line, nearer than the run-in and run-out
/// both, `out` and `into`.
fn on_one_line(from: [f64; 3], out: [f64; 3], to: [f64; 3], into: [f64; 3]) -> bool {
    /// What two pieces of one line may differ by, in direction, rad, and in length of their runs, as a share.
    const STRAIGHT: f64 = 1e-3;
    /// Height between them, mm, and slope beside that of the mark, up to which the part does not step there.
    const FLAT: f64 = 1e-3;
    const STEEPER: f64 = 0.2;
    let gap = [to[0] - from[0], to[1] - from[1]];
    let ([a, b], [c, d]) = ([out[0], out[1]], [into[0], into[1]]);
    let far = gap[0].hypot(gap[1]);
    let (l, m) = (a.hypot(b), c.hypot(d));
    // Where the part steps between them a way that runs on would have to rise like a wall.
    let step = (to[2] - from[2] - out[2] / l * far).abs();
    if step > FLAT + STEEPER * far {
        return false;
    }
    // Another pen's speed is another length.
    (l - m).abs() <= STRAIGHT * l
        && angle([a, b], [c, d]) < STRAIGHT
        && far < l + m
        && (far == 0.0 || angle([a, b], gap) < STRAIGHT)
}

/// Length between two neighbouring nodes, seen from the lens.
fn stretch(w: &[Node]) -> f64 {
    (w[1].at[0] - w[0].at[0]).hypot(w[1].at[1] - w[0].at[1])
}

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
            if out.nodes.last().is_none_or(|last| last.at != mark[0]) {
                out.node(mark[0], None, stroke);
            }
            out.turn(NodeKind::End);
            for &p in &mark[1..] {
                out.node(p, Some(PenId(0)), stroke);
            }
            out.turn(NodeKind::End);
        }
        out
    }

    fn places(path: &Path) -> Vec<[f64; 3]> {
        path.nodes.iter().map(|node| node.at).collect()
    }

    fn lit(path: &Path) -> Vec<[[f64; 3]; 2]> {
        (1..path.len())
            .filter(|&i| path.nodes[i].pen.is_some())
            .map(|i| [path.nodes[i - 1].at, path.nodes[i].at])
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
            (0..out.len()).filter(|&i| out.nodes[i].pen.is_none()).map(|i| out.nodes[i].at).collect();
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
        let circle: Vec<[f64; 3]> =
            (0..=720).map(|i| f64::from(i).to_radians() / 2.0).map(|t| [10.0 * t.cos(), 10.0 * t.sin(), 0.0]).collect();
        let mut path = path(&[&circle, &[circle[720], [10.0, -3.0, 0.0], [13.0, -3.0, 0.0]]]);
        path.nodes[721].kind = NodeKind::Corner;
        for i in 1..720 {
            path.nodes[i].kind = NodeKind::Vertex;
        }
        let out = path.evened(1.0);
        let at = places(&out);
        assert!(at.contains(&[10.0, -3.0, 0.0]) && at.last() == Some(&[13.0, -3.0, 0.0]), "{at:?}");
        let on: Vec<f64> = at.iter().take(63).map(|p| p[0].hypot(p[1])).collect();
        assert!(on.iter().all(|r| (r - 10.0).abs() < 1e-3), "{on:?}");
        let lengths = |p: &Path| p.distances().last().copied().unwrap_or_default();
        assert!((lengths(&out) / lengths(&path) - 1.0).abs() < 1e-3 && out.len() < 95, "{}", out.len());
        // A small circle keeps its turns gentle, few nodes stay as they are.
        let small: Vec<[f64; 3]> = circle.iter().map(|p| p.map(|v| v / 100.0)).collect();
        let small = self::path(&[&small]).evened(1.0);
        assert!(small.len() >= 24, "{}", small.len());
        // A hairpin between long legs too.
        let bend = (1..16).map(|i| (f64::from(i) * 11.25).to_radians()).map(|t| [0.2 * t.sin(), -0.2 * t.cos(), 0.0]);
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

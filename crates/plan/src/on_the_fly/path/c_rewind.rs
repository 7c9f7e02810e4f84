//! Rewind of C: the turntable is turned back by whole turns during a jump, with the laser off.
//!
//! Consumes a path and its axes, C unwrapped (unbounded), and the travel of C; promises the same with C within its
//! travel in every mark that needs no more than all of it: in the jump before a mark that would leave it C is rewound
//! by whole turns, as far as it can, so that the next rewind comes as late as possible. The jump gets as many nodes as
//! that takes, over which X, Y and Z go round with the part. Units: mm, rad.

use std::f64::consts::TAU;
use std::ops::Range;

use crate::on_the_fly::axes::kinematics::{Axes, turned};
use crate::on_the_fly::path::{Node, NodeKind, Path};
use terrace_core::geom::P3Mm;

/// The most that C turns from node to node of a jump, rad.
const STEP: f64 = 0.08;
/// Jumps shorter than this are no place to turn, mm.
const SHORTEST: f64 = 1e-3;

/// A path with the nodes that rewinds of C need.
pub(crate) struct PathWithRewinds {
    /// The path.
    pub path: Path,
    /// The axes at each node.
    pub axes: Vec<Axes>,
    /// Nodes between which C is rewound.
    pub rewinds: Vec<[usize; 2]>,
}

/// The path and its axes with C rewound in jumps wherever the next mark would leave its travel, rad.
pub(crate) fn with_rewinds(path: &Path, axes: &[Axes], travel: [f64; 2]) -> PathWithRewinds {
    let mut divider = JumpDivider::new(path, axes, travel);
    let mut turns = WholeTurns { count: 0.0, fits: true };
    let mut done = 0;
    // Invariant: all nodes before `done` are in the result. The last of them ends a mark, with `turns` added to its C.
    while done < axes.len() {
        let next_mark = next_mark(path, done);
        let mut next_turns = match &next_mark {
            Some(mark) => turns.for_mark(&axes[mark.clone()], travel),
            None => turns,
        };
        // After the last mark the path may end with a jump.
        let Range { start: first, end } = next_mark.unwrap_or(axes.len() - 1..axes.len());
        let from = done.saturating_sub(1);
        if done == 0 {
            // The path begins with the turns of its first mark.
            turns = next_turns;
            divider.keep(0, turns);
        } else if divider.way[first] - divider.way[from] < SHORTEST {
            // A rewind takes way: a mark that begins where the last one ended keeps its turns, whether they fit or not.
            let fits = next_turns.fits && next_turns.count == turns.count;
            next_turns = WholeTurns { count: turns.count, fits };
        }
        divider.add_jump(from, first, turns, next_turns);
        (first + 1..end).for_each(|k| divider.keep(k, next_turns));
        turns = next_turns;
        done = end;
    }
    divider.result
}

/// The nodes of the first marks from a node on that follow each other without a jump; their run-ups are nodes of them.
fn next_mark(path: &Path, from: usize) -> Option<Range<usize>> {
    let begin = (from..path.len()).find(|&i| path.is_mark_or_run(i + 1))?;
    let end = (begin + 1..path.len()).find(|&i| !path.is_mark_or_run(i)).unwrap_or(path.len());
    Some(begin..end)
}

/// A path and its axes while nodes are added to its jumps.
struct JumpDivider<'a> {
    path: &'a Path,
    axes: &'a [Axes],
    travel: [f64; 2],
    /// Distance of each node along the path, mm.
    way: Vec<f64>,
    result: PathWithRewinds,
}

impl<'a> JumpDivider<'a> {
    fn new(path: &'a Path, axes: &'a [Axes], travel: [f64; 2]) -> Self {
        let result =
            PathWithRewinds { path: Path::default(), axes: Vec::with_capacity(axes.len()), rewinds: Vec::new() };
        Self { path, axes, travel, way: path.distances(), result }
    }

    /// Adds node `k` as it is, with so many turns added to C.
    fn keep(&mut self, k: usize, turns: WholeTurns) {
        let axes = self.axes[k];
        self.result.path.nodes.push(self.path.nodes[k]);
        self.result.axes.push(Axes { c: axes.c + TAU * turns.count, ..axes });
    }

    /// Adds the nodes after `from` up to `to`, between which the path jumps. C goes evenly along the jump from the
    /// turns before it to those after it, and the tool stays over its place, so the jump gets as many nodes as C's turn
    /// takes.
    fn add_jump(&mut self, from: usize, to: usize, before: WholeTurns, after: WholeTurns) {
        let change = after.count - before.count;
        let length = self.way[to] - self.way[from];
        let begin = self.result.axes.len() - 1;
        for k in from + 1..=to {
            let edge = self.way[k] - self.way[k - 1];
            let pieces = ((change * TAU / STEP).abs() * edge / length.max(SHORTEST)).ceil().max(1.0) as usize;
            for j in 1..=pieces {
                let t = j as f64 / pieces as f64;
                let share_of_jump =
                    if length > 0.0 { (self.way[k - 1] + t * edge - self.way[from]) / length } else { 1.0 };
                let turns = before.count + share_of_jump * change;
                let mut c = interpolated(self.axes[k - 1].c, self.axes[k].c, t) + TAU * turns;
                // Between two marks within its travel C stays there too; at `to` it is the second mark's own.
                if before.fits && after.fits && k < to {
                    c = c.clamp(self.travel[0], self.travel[1]);
                }
                self.add_node_between(k, t, c);
            }
        }
        if change != 0.0 {
            self.result.rewinds.push([begin, self.result.axes.len() - 1]);
        }
    }

    /// Adds a node at the share `t` of the way from node `k - 1` to node `k`, with C at `c`.
    fn add_node_between(&mut self, k: usize, t: f64, c: f64) {
        let (nodes, axes) = (&self.path.nodes, self.axes);
        let at = P3Mm::new([0, 1, 2].map(|i| interpolated(nodes[k - 1].at[i], nodes[k].at[i], t)));
        // The tool goes straight over the part; where X, Y and Z must go for that follows from A and C.
        let [p, q] = [k - 1, k].map(|i| axes[i].tool().p);
        let tool = P3Mm::new([0, 1, 2].map(|i| interpolated(p[i], q[i], t)));
        let a = interpolated(axes[k - 1].a, axes[k].a, t);
        let kind = if t < 1.0 { NodeKind::Between } else { nodes[k].kind };
        self.result.path.nodes.push(Node { at, kind, ..nodes[k] });
        self.result.axes.push(Axes { xyz: turned(a, c, tool), a, c });
    }
}

/// The value at a share of the way from `a` to `b`: at its end exactly `b`, so that marks begin where they did.
fn interpolated(a: f64, b: f64, t: f64) -> f64 {
    if t >= 1.0 { b } else { a + t * (b - a) }
}

/// Whole turns that are added to C in a mark, and whether the mark is within its travel with them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct WholeTurns {
    count: f64,
    fits: bool,
}

impl WholeTurns {
    /// The turns of the next mark, which has these axes. A mark that no count of turns brings into the travel keeps the
    /// turns of the one before.
    fn for_mark(self, axes: &[Axes], [lo, hi]: [f64; 2]) -> Self {
        let empty = [f64::INFINITY, f64::NEG_INFINITY];
        let [least_c, most_c] = axes.iter().fold(empty, |[least, most], a| [least.min(a.c), most.max(a.c)]);
        let fewest = ((lo - least_c) / TAU).ceil();
        let most = ((hi - most_c) / TAU).floor();
        if fewest > most {
            return Self { fits: false, ..self };
        }
        // As few changes as possible: where one is needed, as far as the travel goes.
        let count = if self.count > most {
            fewest
        } else if self.count < fewest {
            most
        } else {
            self.count
        };
        Self { count, fits: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_the_fly::axes::kinematics::FieldPosition;
    use terrace_core::math;
    use terrace_core::program::{PenId, PieceId};

    /// Rings about the pole with short jumps between them, all the same way round; C as it would continue.
    fn rings(count: u32, jump: f64) -> (Path, Vec<Axes>) {
        let (mut path, mut axes) = (Path::default(), Vec::new());
        for ring in 0..count {
            for i in 0..=90 {
                let (angle, r) = (f64::from(4 * i).to_radians(), 10.0 + jump * f64::from(ring));
                let c = TAU * f64::from(ring) + angle;
                let at = [r * math::cos(angle), r * math::sin(angle), 0.0];
                path.nodes.push(Node {
                    at: P3Mm::new(at),
                    pen: (i > 0).then_some(PenId(0)),
                    kind: if i % 90 == 0 { NodeKind::End } else { NodeKind::Vertex },
                    stroke: PieceId(ring),
                    run: None,
                });
                // The pivot is the origin of the part.
                axes.push(Axes { xyz: turned(0.1, c, P3Mm::new(at)), a: 0.1, c });
            }
        }
        (path, axes)
    }

    #[test]
    fn turns_change_only_where_a_mark_leaves_the_travel_and_then_as_far_as_it_goes() {
        let mark =
            |from: f64, to: f64| [from, to].map(|turns| Axes { xyz: P3Mm::new([0.0; 3]), a: 0.0, c: TAU * turns });
        let travel = [-3.0 * TAU, 3.0 * TAU];
        let none = WholeTurns { count: 0.0, fits: true };
        assert_eq!(none.for_mark(&mark(-2.9, 2.9), travel), none);
        assert_eq!(none.for_mark(&mark(3.1, 4.2), travel), WholeTurns { count: -6.0, fits: true });
        assert_eq!(none.for_mark(&mark(-4.2, -3.1), travel), WholeTurns { count: 6.0, fits: true });
        // A mark of more than all of the travel keeps the turns.
        assert_eq!(none.for_mark(&mark(0.0, 6.1), travel), WholeTurns { count: 0.0, fits: false });
    }

    #[test]
    fn rewinding_c_during_jumps_keeps_the_pose_at_marks() {
        for (travel, jump) in [([-TAU, TAU], 1.0), ([-0.2, TAU + 0.2], 0.05), ([-4.5 * TAU, -1.5 * TAU], 0.3)] {
            let (path, axes) = rings(7, jump);
            let PathWithRewinds { path: out, axes: turned, rewinds } = with_rewinds(&path, &axes, travel);
            let turns_back = |r: &[usize; 2]| (turned[r[1]].c - turned[r[0]].c).abs() > 0.9 * TAU;
            assert!(!rewinds.is_empty() && rewinds.iter().all(turns_back));
            assert!(turned.iter().all(|a| (travel[0] - 1e-9..=travel[1] + 1e-9).contains(&a.c)), "{travel:?}");
            assert!(turned.windows(2).all(|w| (w[1].c - w[0].c).abs() < STEP + 0.01));
            assert_eq!(out.len(), turned.len());
            // Marks are the same, and so is where the tool stands over each node.
            let lit = |p: &Path| p.nodes.iter().filter(|n| n.pen.is_some()).map(|n| n.at).collect();
            let [before, after]: [Vec<P3Mm>; 2] = [lit(&path), lit(&out)];
            assert_eq!(before, after);
            for (node, axes) in out.nodes.iter().zip(&turned) {
                let FieldPosition { uv: [u, v], height } = axes.seen(P3Mm::new(node.at.mm));
                assert!([u, v, height].iter().all(|v| v.abs() < 1e-9), "{u} {v} {height}");
            }
        }
    }

    #[test]
    fn rewind_leaves_paths_that_fit_or_cannot_fit_unchanged() {
        let (path, axes) = rings(2, 1.0);
        for travel in [[-9.0 * TAU, 9.0 * TAU], [-1.0, 1.0]] {
            let PathWithRewinds { path: out, axes: same, rewinds } = with_rewinds(&path, &axes, travel);
            assert!(rewinds.is_empty());
            assert_eq!(out.nodes, path.nodes);
            assert!(same.iter().zip(&axes).all(|(a, b)| (a.c - b.c).abs() < 1e-12));
        }
        // A jump of a nanometre is not a place to turn.
        let (path, axes) = rings(3, 1e-6);
        assert_eq!(with_rewinds(&path, &axes, [-0.1, TAU + 0.1]).path.len(), path.len());
        assert!(with_rewinds(&Path::default(), &[], [0.0, 1.0]).axes.is_empty());
    }
}

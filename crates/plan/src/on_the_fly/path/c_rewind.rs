//! Rewind of C: the turntable is turned back by whole turns during a jump, with the laser off.
//!
//! Consumes a path and its axes, C unwrapped (unbounded), and the travel of C; promises the same with C within its
//! travel in every mark that needs no more than all of it: in the jump before a mark that would leave it C is rewound
//! by whole turns, as far as it can, so that the next rewind comes as late as possible. The jump gets as many nodes as
//! that takes, over which X, Y and Z go round with the part. Units: mm, rad.

use std::f64::consts::TAU;

use crate::on_the_fly::axes::kinematics::{Axes, machine_from_part};
use crate::on_the_fly::path::{Node, NodeKind, Path};

/// The most that C turns from node to node of a jump, rad.
const STEP: f64 = 0.08;
/// Jumps shorter than this are no place to turn, mm.
const SHORTEST: f64 = 1e-3;

/// A path with the nodes that turning back needs.
pub(crate) struct Rewound {
    /// The path.
    pub path: Path,
    /// The axes at each node.
    pub axes: Vec<Axes>,
    /// Nodes between which C is rewound.
    pub rewinds: Vec<[usize; 2]>,
}

/// The path with the nodes that turning back needs, and its axes.
pub(crate) fn rewound(path: &Path, axes: &[Axes], travel: [f64; 2]) -> Rewound {
    // A mark goes with its run-ups.
    let marks = |i: usize| path.pen_at(i).or(path.run_at(i)).is_some();
    let mut rewinding = Rewinding::new(path, axes, travel);
    let mut turns = Revolutions { by: 0.0, fit: true };
    let mut at = 0;
    // Invariant: all nodes before `at` are made, with `turns.by` whole turns added to C at the last of them, which
    // ends a mark (or begins the path).
    while at < axes.len() {
        // From the end of a mark, or the path's start, to the start of the next.
        let begin = (at..axes.len()).find(|&i| marks(i + 1));
        let first = begin.unwrap_or(axes.len() - 1);
        let end = (first + 1..axes.len()).find(|&i| !marks(i)).unwrap_or(axes.len());
        let mut next = if begin.is_some() { turns.next(&axes[first..end], travel) } else { turns };
        let from = at.saturating_sub(1);
        if at == 0 {
            // The path begins with the turns of its first mark.
            turns = next;
            rewinding.keep(0, turns);
        } else if rewinding.way[first] - rewinding.way[from] < SHORTEST {
            // A rewind takes way: a mark that begins where the last one ended keeps its turns, whether they fit or not.
            next = Revolutions { by: turns.by, fit: next.fit && next.by == turns.by };
        }
        rewinding.jump([from, first], [turns, next]);
        (first + 1..end).for_each(|k| rewinding.keep(k, next));
        (turns, at) = (next, end);
    }
    rewinding.made
}

/// A path while nodes are added to its jumps.
struct Rewinding<'a> {
    path: &'a Path,
    axes: &'a [Axes],
    travel: [f64; 2],
    /// Distance of each node along the path, mm.
    way: Vec<f64>,
    made: Rewound,
}

impl<'a> Rewinding<'a> {
    fn new(path: &'a Path, axes: &'a [Axes], travel: [f64; 2]) -> Self {
        let made = Rewound { path: Path::default(), axes: Vec::with_capacity(axes.len()), rewinds: Vec::new() };
        Self { path, axes, travel, way: path.distances(), made }
    }

    /// Node `k` with so many turns added to C.
    fn keep(&mut self, k: usize, turns: Revolutions) {
        let axes = self.axes[k];
        self.made.path.nodes.push(self.path.nodes[k]);
        self.made.axes.push(Axes { c: axes.c + TAU * turns.by, ..axes });
    }

    /// The nodes after the first of a jump. C goes from one count of turns to the other evenly along it, and the tool
    /// stays over its place, so the jump gets as many nodes as C's turn takes.
    fn jump(&mut self, [from, to]: [usize; 2], [turns, next]: [Revolutions; 2]) {
        let change = next.by - turns.by;
        let length = self.way[to] - self.way[from];
        let begin = self.made.axes.len() - 1;
        for k in from + 1..=to {
            let edge = self.way[k] - self.way[k - 1];
            let pieces = ((change * TAU / STEP).abs() * edge / length.max(SHORTEST)).ceil().max(1.0) as usize;
            for j in 1..=pieces {
                let t = j as f64 / pieces as f64;
                let share = if length > 0.0 { (self.way[k - 1] + t * edge - self.way[from]) / length } else { 1.0 };
                let mut c = between(self.axes[k - 1].c, self.axes[k].c, t) + TAU * (turns.by + share * change);
                // Between two marks within its travel C stays there too.
                if turns.fit && next.fit && k < to {
                    c = c.clamp(self.travel[0], self.travel[1]);
                }
                self.divide(k, t, c);
            }
        }
        if change != 0.0 {
            self.made.rewinds.push([begin, self.made.axes.len() - 1]);
        }
    }

    /// A node at the share `t` of the way from node `k - 1` to node `k`, C at `c`.
    fn divide(&mut self, k: usize, t: f64, c: f64) {
        let (nodes, axes) = (&self.path.nodes, self.axes);
        let at = [0, 1, 2].map(|i| between(nodes[k - 1].at[i], nodes[k].at[i], t));
        let [p, q] = [k - 1, k].map(|i| axes[i].tool().p);
        let tool = [0, 1, 2].map(|i| between(p[i], q[i], t));
        let a = between(axes[k - 1].a, axes[k].a, t);
        let kind = if t < 1.0 { NodeKind::Between } else { nodes[k].kind };
        self.made.path.nodes.push(Node { at, kind, ..nodes[k] });
        self.made.axes.push(Axes { xyz: machine_from_part(a, c, tool), a, c });
    }
}

fn between(a: f64, b: f64, t: f64) -> f64 {
    if t >= 1.0 { b } else { a + t * (b - a) }
}

/// Whole turns that are added to C, and whether its travel holds the mark with them.
#[derive(Clone, Copy)]
struct Revolutions {
    by: f64,
    fit: bool,
}

impl Revolutions {
    /// The revolutions of the next mark.
    fn next(self, axes: &[Axes], [lo, hi]: [f64; 2]) -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let needs = axes.iter().fold(none, |e, a| [e[0].min(a.c), e[1].max(a.c)]);
        let [fewest, most] = [((lo - needs[0]) / TAU).ceil(), ((hi - needs[1]) / TAU).floor()];
        if fewest > most {
            return Self { fit: false, ..self };
        }
        // As few changes as possible: where one is needed, as far as the travel goes.
        let by = if self.by > most {
            fewest
        } else if self.by < fewest {
            most
        } else {
            self.by
        };
        Self { by, fit: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::program::{PenId, PieceId};

    /// Rings about the pole with short jumps between them, all the same way round; C as it would continue.
    fn rings(count: u32, jump: f64) -> (Path, Vec<Axes>) {
        let (mut path, mut axes) = (Path::default(), Vec::new());
        for ring in 0..count {
            for i in 0..=90 {
                let (angle, r) = (f64::from(4 * i).to_radians(), 10.0 + jump * f64::from(ring));
                let c = TAU * f64::from(ring) + angle;
                path.nodes.push(Node {
                    at: [r * angle.cos(), r * angle.sin(), 0.0],
                    pen: (i > 0).then_some(PenId(0)),
                    kind: if i % 90 == 0 { NodeKind::End } else { NodeKind::Vertex },
                    stroke: PieceId(ring),
                    run: None,
                });
                axes.push(Axes { xyz: machine_from_part(0.1, c, path.nodes[path.len() - 1].at), a: 0.1, c });
            }
        }
        (path, axes)
    }

    #[test]
    fn rewinding_c_during_jumps_keeps_the_pose_at_marks() {
        for (travel, jump) in [([-TAU, TAU], 1.0), ([-0.2, TAU + 0.2], 0.05), ([-4.5 * TAU, -1.5 * TAU], 0.3)] {
            let (path, axes) = rings(7, jump);
            let Rewound { path: out, axes: turned, rewinds } = rewound(&path, &axes, travel);
            let turns_back = |r: &[usize; 2]| (turned[r[1]].c - turned[r[0]].c).abs() > 0.9 * TAU;
            assert!(!rewinds.is_empty() && rewinds.iter().all(turns_back));
            assert!(turned.iter().all(|a| (travel[0] - 1e-9..=travel[1] + 1e-9).contains(&a.c)), "{travel:?}");
            assert!(turned.windows(2).all(|w| (w[1].c - w[0].c).abs() < STEP + 0.01));
            assert_eq!(out.len(), turned.len());
            // Marks are the same, and so is where the tool stands over each node.
            let lit = |p: &Path| p.nodes.iter().filter(|n| n.pen.is_some()).map(|n| n.at).collect();
            let [before, after]: [Vec<[f64; 3]>; 2] = [lit(&path), lit(&out)];
            assert_eq!(before, after);
            for (node, axes) in out.nodes.iter().zip(&turned) {
                let off = axes.field_from_part(node.at);
                assert!(off.iter().all(|v| v.abs() < 1e-9), "{off:?}");
            }
        }
    }

    #[test]
    fn rewind_leaves_paths_that_fit_or_cannot_fit_unchanged() {
        let (path, axes) = rings(2, 1.0);
        for travel in [[-9.0 * TAU, 9.0 * TAU], [-1.0, 1.0]] {
            let Rewound { path: out, axes: same, rewinds } = rewound(&path, &axes, travel);
            assert!(rewinds.is_empty());
            assert_eq!(out.nodes, path.nodes);
            assert!(same.iter().zip(&axes).all(|(a, b)| (a.c - b.c).abs() < 1e-12));
        }
        // A jump of a nanometre is not a place to turn.
        let (path, axes) = rings(3, 1e-6);
        assert_eq!(rewound(&path, &axes, [-0.1, TAU + 0.1]).path.len(), path.len());
        assert!(rewound(&Path::default(), &[], [0.0, 1.0]).axes.is_empty());
    }
}

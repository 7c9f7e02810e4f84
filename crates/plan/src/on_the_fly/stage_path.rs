//! The stage as a path in the spot's own time: smooth where the spot starts and stops.
//!
//! Consumes the tools over the nodes of a path and the spot's own motion along it; promises X, Y, Z, A and C over the
//! spot's own time as a natural cubic spline. The stage passes the tools' path in its order, but at an even pace: how
//! far it has come is what the spot has, averaged over a window of time, so that it neither stops nor hurries where the
//! spot does. It then stands over a tool a little before or behind that of the spot's own node. Units: mm, s, rad.
//!
//! The articles let both keep step at every point; the window is ours.

use crate::on_the_fly::axes::kinematics::{Axes, Deviation, Pose};
use crate::on_the_fly::axes::motion::STAGE;
use crate::on_the_fly::decompose::{Method, stage};
use crate::on_the_fly::kinematic_model::KinematicModel;
use crate::on_the_fly::path::Path;
use crate::on_the_fly::spline;
use crate::on_the_fly::spot::SpotMotion;
use terrace_core::parallel;

/// Nodes of the path per window, and the fewest of a leg.
const NODES: f64 = 12.0;
const FEWEST: usize = 8;
/// Most nodes of a path: those of longer ones lie farther apart.
const MOST: f64 = 400_000.0;

/// Stage axes over a rising parameter, a natural cubic spline between stops.
#[derive(Clone, Debug, Default)]
pub(crate) struct StagePath {
    /// The parameter at the nodes.
    pub at: Vec<f64>,
    /// Positions, [`STAGE`] a node.
    pub positions: Vec<f64>,
    /// Second derivatives.
    bends: Vec<f64>,
    /// Nodes at which the stage rests, the ends among them.
    pub stops: Vec<usize>,
}

impl StagePath {
    /// Through positions, from stop to stop.
    fn new(at: Vec<f64>, positions: Vec<f64>, stops: Vec<usize>) -> Self {
        let mut bends = vec![0.0; positions.len()];
        for w in stops.windows(2) {
            let (nodes, run) = (w[0]..w[1] + 1, w[0] * STAGE..(w[1] + 1) * STAGE);
            spline::bends(&positions[run.clone()], &at[nodes], STAGE, &mut bends[run]);
        }
        Self { at, positions, bends, stops }
    }

    /// Over the spot's own time through all tools, at rest at `stops`.
    pub(crate) fn through_stops(spot: &SpotMotion, axes: &[Axes], stops: Vec<usize>) -> Self {
        Self::new(spot.times().iter().map(|t| t[0]).collect(), axes.iter().flat_map(listed).collect(), stops)
    }

    /// Over the spot's own time through the tool of every node of the path, but for nodes that are all but at one time.
    pub(crate) fn through_nodes(spot: &SpotMotion, axes: &[Axes], rewinds: &[[usize; 2]]) -> Self {
        let mut out = Legs::default();
        for Leg { first, last, .. } in legs(axes.len(), rewinds) {
            out.by_nodes(spot, axes, first, last);
        }
        out.spline()
    }

    /// Over the spot's own time at a pace averaged over a `window` of it.
    pub fn evened(spot: &SpotMotion, axes: &[Axes], rewinds: &[[usize; 2]], window: f64) -> Self {
        let mut stops: Vec<usize> = rewinds.iter().flatten().copied().chain([0, axes.len() - 1]).collect();
        stops.sort_unstable();
        stops.dedup();
        let tools = Self::new(spot.way().to_vec(), axes.iter().flat_map(listed).collect(), stops);
        let mut out = Legs::default();
        for Leg { first, last, rewinds } in legs(axes.len(), rewinds) {
            if rewinds {
                out.by_nodes(spot, axes, first, last);
            } else {
                out.evened(spot, &tools, first, last, window);
            }
        }
        out.spline()
    }

    /// Positions at a parameter; `hint` is the segment of the last call.
    pub fn position(&self, at: f64, hint: &mut usize) -> [f64; STAGE] {
        let (i, at) = spline::cell(&self.at, at, hint);
        let (h, x) = (self.at[i + 1] - self.at[i], at - self.at[i]);
        // The bend at a stop is zero from both sides.
        std::array::from_fn(|k| {
            let (m, n) = (i * STAGE + k, (i + 1) * STAGE + k);
            let ends = [self.positions[m], self.positions[n]];
            spline::segment(ends, [self.bends[m], self.bends[n]], h, x)[0]
        })
    }

    /// The stage as it stands at a parameter.
    pub fn axes(&self, at: f64, hint: &mut usize) -> Axes {
        let [x, y, z, a, c] = self.position(at, hint);
        Axes { xyz: [x, y, z], a, c }
    }

    /// The stage as the spot comes to each node of its path.
    pub(crate) fn at_nodes(&self, spot: &SpotMotion) -> Vec<Axes> {
        let mut hint = 0;
        spot.times().iter().map(|t| self.axes(t[0], &mut hint)).collect()
    }

    /// How many times smaller the limits of U and V are in each run of the spot for what they take to hold the spot on
    /// the part while the stage moves. What the stage cannot do it will not.
    pub fn shares(&self, path: &Path, spot: &SpotMotion, model: &KinematicModel<'_>, rests: &[usize]) -> Vec<f64> {
        /// Between samples of which accelerations and jerks are taken, s.
        const APART: [f64; 2] = [5e-3, 1e-2];
        /// No more than half is taken: what is left of such a run is slowed down.
        const MOST: f64 = 2.0;
        let Some(limit) = model.spot else { return vec![1.0; rests.len() - 1] };
        let of = |run: usize| {
            let (first, last) = (rests[run], rests[run + 1]);
            let [begin, end] = [spot.times()[first][0], spot.times()[last][0]];
            let count = (((end - begin) / APART[1]).ceil() as usize).clamp(2, 1000);
            let (mut acceleration, mut jerk) = (0.0f64, 0.0f64);
            let (mut hint, mut node) = (self.at.partition_point(|&x| x <= begin).max(1) - 1, first);
            for k in 0..=count {
                let now = begin + (end - begin) * k as f64 / count as f64;
                let p = model.from_pivot(path.nodes[spot.node_at(now, &mut node)].at);
                let mut held = |at: f64| {
                    let [u, v, _] = self.axes(now + at, &mut hint).field_from_part(p);
                    [u, v]
                };
                let [h, j] = APART;
                let three = [-h, 0.0, h].map(&mut held);
                let four = [-1.5 * j, -0.5 * j, 0.5 * j, 1.5 * j].map(&mut held);
                for k in 0..2 {
                    let [a, b, c] = three.map(|p| p[k]);
                    acceleration = acceleration.max((a - 2.0 * b + c).abs() / (h * h));
                    let [a, b, c, d] = four.map(|p| p[k]);
                    jerk = jerk.max((d - a - 3.0 * (c - b)).abs() / (j * j * j));
                }
            }
            let share = |limit: f64, taken: f64| (limit / (limit - taken).max(0.0)).min(MOST);
            // X and Y take no more than they can.
            let [x, y] = [&model.limits[0], &model.limits[1]];
            let acceleration = acceleration.min(2.0 * x.acceleration.hypot(y.acceleration));
            let jerk = match (x.jerk, y.jerk) {
                (Some(x), Some(y)) => jerk.min(2.0 * x.hypot(y)),
                _ => jerk,
            };
            share(limit.acceleration, acceleration).max(limit.jerk.map_or(1.0, |most| share(most, jerk)))
        };
        let runs = rests.len() - 1;
        let chunks = runs.div_ceil(256);
        parallel::map(chunks, |c| (256 * c..(256 * (c + 1)).min(runs)).map(of).collect::<Vec<_>>()).concat()
    }
}

/// X, Y, Z, A, C.
pub fn listed(axes: &Axes) -> [f64; STAGE] {
    let [x, y, z] = axes.xyz;
    [x, y, z, axes.a, axes.c]
}

/// Deviations of marks from the stage as it stands over them.
pub fn deviations(marks: &[Pose], axes: &[Axes]) -> Vec<Deviation> {
    marks.iter().zip(axes).map(|(m, a)| Deviation::of(m, &a.tool())).collect()
}

/// Nodes of a path from one rest of the stage to the next.
struct Leg {
    first: usize,
    last: usize,
    /// Whether C is rewound there.
    rewinds: bool,
}

fn legs(nodes: usize, rewinds: &[[usize; 2]]) -> Vec<Leg> {
    let mut out = Vec::new();
    let mut from = 0;
    for &[first, last] in rewinds {
        if first > from {
            out.push(Leg { first: from, last: first, rewinds: false });
        }
        out.push(Leg { first, last, rewinds: true });
        from = last;
    }
    if nodes - 1 > from {
        out.push(Leg { first: from, last: nodes - 1, rewinds: false });
    }
    out
}

/// A path while it grows, leg by leg.
#[derive(Default)]
struct Legs {
    at: Vec<f64>,
    positions: Vec<f64>,
    stops: Vec<usize>,
}

impl Legs {
    fn push(&mut self, at: f64, position: [f64; STAGE]) {
        self.at.push(at);
        self.positions.extend(position);
    }

    fn by_nodes(&mut self, spot: &SpotMotion, axes: &[Axes], first: usize, last: usize) {
        let times = spot.times();
        let end = if last + 1 == times.len() { spot.total() } else { times[last][0] };
        let apart = 1e-9 * (end - times[first][0]).max(1e-3);
        let arrives = times[last][0];
        for (i, axes) in axes.iter().enumerate().take(last + 1).skip(first) {
            let (at, is_first) = (times[i][0], i == first);
            if is_first && !self.at.is_empty() || !is_first && i < last && arrives - at <= apart {
                continue;
            }
            if self.at.last().is_some_and(|before| at - before <= apart) {
                continue;
            }
            self.push(at, listed(axes));
        }
        self.end();
        // The stage rests while the spot waits at the end of the path.
        if end - arrives > apart {
            self.push(end, listed(&axes[last]));
            self.end();
        }
    }

    fn evened(&mut self, spot: &SpotMotion, tools: &StagePath, first: usize, last: usize, window: f64) {
        let (times, way) = (spot.times(), spot.way());
        let end = if last + 1 == times.len() { spot.total() } else { times[last][0] };
        let [begin, s0, s1] = [times[first][0], way[first], way[last]];
        let window = window.min(end - begin);
        let least = (window / NODES).max(spot.total() / MOST);
        let count = (((end - begin) / least).ceil() as usize).max(FEWEST);
        let step = (end - begin) / count as f64;
        let samples = 2 * (window / 3.0 / step / 2.0) as usize + 1;
        let reach = 3 * (samples / 2);
        let (mut node, mut cell) = (first, 0);
        // Before the leg's begin and after its end the spot continues as it came: the averages keep both ends in place.
        let mut reached = |at: f64| {
            if at < begin {
                2.0 * s0 - spot.way_at((2.0 * begin - at).min(end), &mut node, &mut cell)
            } else if at > end {
                2.0 * s1 - spot.way_at((2.0 * end - at).max(begin), &mut node, &mut cell)
            } else {
                spot.way_at(at, &mut node, &mut cell)
            }
        };
        // The mean over a step, so that what is faster than the steps is not seen at all.
        const PARTS: usize = 4;
        let mut pace: Vec<[f64; 1]> = (0..count + 1 + 2 * reach)
            .map(|k| {
                let at = begin + (k as f64 - reach as f64) * step;
                let part = |m: usize| ((m as f64 + 0.5) / PARTS as f64 - 0.5) * step;
                [(0..PARTS).map(|m| reached(at + part(m))).sum::<f64>() / PARTS as f64]
            })
            .collect();
        for _ in 0..3 {
            pace = stage(&pace, Method::MovingAverage { samples });
        }
        let mut hint = 0;
        for (k, pace) in pace[reach..=reach + count].iter().enumerate() {
            if k > 0 || self.at.is_empty() {
                let s = if k == 0 {
                    s0
                } else if k == count {
                    s1
                } else {
                    pace[0].clamp(s0, s1)
                };
                let at = if k == count { end } else { begin + k as f64 * step };
                self.push(at, tools.position(s, &mut hint));
            }
        }
        self.end();
    }

    fn end(&mut self) {
        if self.stops.is_empty() {
            self.stops.push(0);
        }
        self.stops.push(self.at.len() - 1);
    }

    fn spline(self) -> StagePath {
        StagePath::new(self.at, self.positions, self.stops)
    }
}

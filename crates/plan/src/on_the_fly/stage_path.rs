//! The stage as a path in the spot's own time: smooth where the spot starts and stops.
//!
//! Consumes the tools over the nodes of a path and the spot's own motion along it; promises X, Y, Z, A and C over the
//! spot's own time as a natural cubic spline. The stage passes the tools' path in its order, but at an even pace: how
//! far it has come is what the spot has, averaged over a window of time, so that it neither stops nor hurries where the
//! spot does. It then stands over a tool a little before or behind that of the spot's own node. Units: mm, s, rad.
//!
//! The articles let both keep step at every point; the window is ours.

use crate::on_the_fly::axes::kinematics::{Axes, Deviation, Pivot, Pose};
use crate::on_the_fly::axes::motion::STAGE;
use crate::on_the_fly::decompose::{Method, stage};
use crate::on_the_fly::kinematic_model::KinematicModel;
use crate::on_the_fly::path::Path;
use crate::on_the_fly::spline;
use crate::on_the_fly::spot::SpotMotion;
use crate::on_the_fly::topp::Limit;
use terrace_core::geom::P3Mm;
use terrace_core::math;
use terrace_core::parallel;

/// Nodes of the stage's path per window of time.
const NODES: f64 = 12.0;
/// Fewest nodes of a leg.
const FEWEST: usize = 8;
/// Most nodes of a path: those of longer ones lie farther apart.
const MOST: f64 = 400_000.0;
/// Nodes that the spot reaches within this share of a leg's time of each other count as one.
const SAME_TIME: f64 = 1e-9;

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
    /// The spline through positions, from stop to stop.
    fn new(at: Vec<f64>, positions: Vec<f64>, stops: Vec<usize>) -> Self {
        let mut bends = vec![0.0; positions.len()];
        for w in stops.windows(2) {
            let (nodes, run) = (w[0]..w[1] + 1, w[0] * STAGE..(w[1] + 1) * STAGE);
            spline::bends(&positions[run.clone()], &at[nodes], STAGE, &mut bends[run]);
        }
        Self { at, positions, bends, stops }
    }

    /// The path through all tools over the spot's own time, at rest at `stops`.
    pub(crate) fn through_stops(spot: &SpotMotion, axes: &[Axes], stops: Vec<usize>) -> Self {
        Self::new(spot.times().iter().map(|t| t[0]).collect(), axes.iter().flat_map(listed).collect(), stops)
    }

    /// The path through the tool of every node over the spot's own time; of nodes at all but the same time through one.
    pub(crate) fn through_nodes(spot: &SpotMotion, axes: &[Axes], rewinds: &[[usize; 2]]) -> Self {
        let mut out = Legs::default();
        for Leg { first, last, .. } in legs(axes.len(), rewinds) {
            out.add_nodes(spot, axes, first, last);
        }
        out.spline()
    }

    /// The path over the spot's own time at a pace averaged over a `window` of it. C is rewound at the spot's own pace.
    pub fn evened(spot: &SpotMotion, axes: &[Axes], rewinds: &[[usize; 2]], window: f64) -> Self {
        let mut stops: Vec<usize> = rewinds.iter().flatten().copied().chain([0, axes.len() - 1]).collect();
        stops.sort_unstable();
        stops.dedup();
        let tools = Self::new(spot.way().to_vec(), axes.iter().flat_map(listed).collect(), stops);
        let mut out = Legs::default();
        for Leg { first, last, rewinds } in legs(axes.len(), rewinds) {
            if rewinds {
                out.add_nodes(spot, axes, first, last);
            } else {
                out.add_evened(spot, &tools, first, last, window);
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
        Axes { xyz: P3Mm::new([x, y, z]), a, c }
    }

    /// The stage as the spot comes to each node of its path.
    pub(crate) fn at_nodes(&self, spot: &SpotMotion) -> Vec<Axes> {
        let mut hint = 0;
        spot.times().iter().map(|t| self.axes(t[0], &mut hint)).collect()
    }

    /// How many times smaller the limits of U and V are in each run of the spot for what they take to hold the spot on
    /// the part while the stage moves. What the stage cannot do it will not.
    pub fn shares(&self, path: &Path, spot: &SpotMotion, model: &KinematicModel<'_>, rests: &[usize]) -> Vec<f64> {
        /// Runs that a thread takes at a time.
        const CHUNK: usize = 256;
        let runs = rests.len() - 1;
        let Some(limit) = model.spot else { return vec![1.0; runs] };
        let share = |run: usize| {
            let taken = self.holding_peaks(path, spot, model, rests[run], rests[run + 1]);
            taken.within_reach_of_stage(model).share(&limit)
        };
        let chunks = runs.div_ceil(CHUNK);
        parallel::map(chunks, |c| (CHUNK * c..(CHUNK * (c + 1)).min(runs)).map(share).collect::<Vec<_>>()).concat()
    }

    /// What U and V do to hold the spot on the node that it comes from, while the stage moves as it does between two
    /// nodes of the path.
    fn holding_peaks(
        &self,
        path: &Path,
        spot: &SpotMotion,
        model: &KinematicModel<'_>,
        first: usize,
        last: usize,
    ) -> HoldingPeaks {
        /// Between the samples of which an acceleration is taken, s.
        const H: f64 = 5e-3;
        /// Between the samples of which a jerk is taken, and between the times that are looked at, s.
        const J: f64 = 1e-2;
        /// Most times that are looked at.
        const MOST_TIMES: usize = 1000;
        let [begin, end] = [spot.times()[first][0], spot.times()[last][0]];
        let count = (((end - begin) / J).ceil() as usize).clamp(2, MOST_TIMES);
        let mut peaks = HoldingPeaks { acceleration: 0.0, jerk: 0.0 };
        let mut hint = self.at.partition_point(|&x| x <= begin).max(1) - 1;
        let mut node = first;
        for k in 0..=count {
            let now = begin + (end - begin) * k as f64 / count as f64;
            let p = model.from_pivot(path.nodes[spot.node_at(now, &mut node)].at);
            let three = [-H, 0.0, H].map(|after| self.field_point(p, now + after, &mut hint));
            let four = [-1.5 * J, -0.5 * J, 0.5 * J, 1.5 * J].map(|after| self.field_point(p, now + after, &mut hint));
            for k in 0..2 {
                // Second and third central differences.
                let [a, b, c] = three.map(|uv| uv[k]);
                peaks.acceleration = peaks.acceleration.max((a - 2.0 * b + c).abs() / (H * H));
                let [a, b, c, d] = four.map(|uv| uv[k]);
                peaks.jerk = peaks.jerk.max((d - a - 3.0 * (c - b)).abs() / (J * J * J));
            }
        }
        peaks
    }

    /// U and V over a point of the part, seen from the pivot, with the stage where it is at a time.
    fn field_point(&self, p: P3Mm<Pivot>, time: f64, hint: &mut usize) -> [f64; 2] {
        self.axes(time, hint).seen(p).uv
    }
}

/// The largest acceleration and jerk of U or V that hold the spot in its place while the stage moves.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HoldingPeaks {
    acceleration: f64,
    jerk: f64,
}

impl HoldingPeaks {
    /// No more than X and Y can cause.
    fn within_reach_of_stage(self, model: &KinematicModel<'_>) -> Self {
        let [x, y] = [&model.limits[0], &model.limits[1]];
        let jerk = match (x.jerk, y.jerk) {
            (Some(x), Some(y)) => self.jerk.min(2.0 * math::hypot(x, y)),
            _ => self.jerk,
        };
        Self { acceleration: self.acceleration.min(2.0 * math::hypot(x.acceleration, y.acceleration)), jerk }
    }

    /// How many times smaller what is left of a limit is than the limit.
    fn share(self, limit: &Limit) -> f64 {
        let of_acceleration = share_left(limit.acceleration, self.acceleration);
        of_acceleration.max(limit.jerk.map_or(1.0, |most| share_left(most, self.jerk)))
    }
}

/// How many times smaller what is left of a limit is than the limit, where so much of it is taken.
fn share_left(limit: f64, taken: f64) -> f64 {
    /// No more than half of a limit is taken: a run that would need more is slowed down.
    const MOST: f64 = 2.0;
    (limit / (limit - taken).max(0.0)).min(MOST)
}

/// X, Y, Z, A, C.
pub fn listed(axes: &Axes) -> [f64; STAGE] {
    let [x, y, z] = axes.xyz.mm;
    [x, y, z, axes.a, axes.c]
}

/// Deviations of marks from the stage as it stands over them.
pub fn deviations(marks: &[Pose<Pivot>], axes: &[Axes]) -> Vec<Deviation> {
    marks.iter().zip(axes).map(|(m, a)| Deviation::of(m, &a.tool())).collect()
}

/// Nodes of a path from one rest of the stage to the next.
struct Leg {
    first: usize,
    last: usize,
    /// Whether C is rewound there.
    rewinds: bool,
}

/// The legs of a path with so many nodes: its rewinds, and what lies between them.
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

/// The nodes of a stage path while it grows, leg by leg. A leg begins with the node that ends the leg before.
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

    /// Adds a leg through the tools of its nodes, as the spot reaches them.
    fn add_nodes(&mut self, spot: &SpotMotion, axes: &[Axes], first: usize, last: usize) {
        let times = spot.times();
        let end = end_of_leg(spot, last);
        let apart = SAME_TIME * (end - times[first][0]).max(1e-3);
        let arrives = times[last][0];
        for (i, axes) in axes.iter().enumerate().take(last + 1).skip(first) {
            let (at, is_first) = (times[i][0], i == first);
            let is_end_of_leg_before = is_first && !self.at.is_empty();
            // The last node is a stop and is kept rather than one at the same time.
            let is_at_time_of_last = !is_first && i < last && arrives - at <= apart;
            if is_end_of_leg_before || is_at_time_of_last {
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

    /// Adds a leg along the path of the tools, as far along it as the spot is, averaged over a `window` of its time.
    fn add_evened(&mut self, spot: &SpotMotion, tools: &StagePath, first: usize, last: usize, window: f64) {
        let [s0, s1] = [spot.way()[first], spot.way()[last]];
        let [begin, end] = [spot.times()[first][0], end_of_leg(spot, last)];
        let window = window.min(end - begin);
        let least = (window / NODES).max(spot.total() / MOST);
        let count = (((end - begin) / least).ceil() as usize).max(FEWEST);
        let step = (end - begin) / count as f64;
        // Three averages of a third of the window each, of an odd number of samples.
        let samples = 2 * (window / 3.0 / step / 2.0) as usize + 1;
        let reach = 3 * (samples / 2);
        let mut way = ContinuedWay { spot, times: [begin, end], ways: [s0, s1], node: first, cell: 0 };
        let mut pace: Vec<[f64; 1]> = (0..count + 1 + 2 * reach)
            .map(|k| [way.mean_over_step(begin + (k as f64 - reach as f64) * step, step)])
            .collect();
        for _ in 0..3 {
            pace = stage(&pace, Method::MovingAverage { samples });
        }
        let mut hint = 0;
        for (k, pace) in pace[reach..=reach + count].iter().enumerate() {
            if k > 0 || self.at.is_empty() {
                // Both ends exactly: the next leg begins where this one ends.
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

    /// Ends a leg: the stage stops at the last node so far.
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

/// When a leg that ends at a node ends: as the spot comes to it; at the end of the path after the spot's wait there.
fn end_of_leg(spot: &SpotMotion, last: usize) -> f64 {
    let times = spot.times();
    if last + 1 == times.len() { spot.total() } else { times[last][0] }
}

/// How far the spot has come along its path at times of a leg, and before and after it. There the way continues as it
/// came, mirrored in the leg's ends, so that averages keep both ends in place.
struct ContinuedWay<'a> {
    spot: &'a SpotMotion,
    /// When the leg begins and ends.
    times: [f64; 2],
    /// Way along the path at its begin and its end.
    ways: [f64; 2],
    /// Hints of [`SpotMotion::way_at`].
    node: usize,
    cell: usize,
}

impl ContinuedWay<'_> {
    fn at(&mut self, time: f64) -> f64 {
        let [begin, end] = self.times;
        if time < begin {
            2.0 * self.ways[0] - self.spot.way_at((2.0 * begin - time).min(end), &mut self.node, &mut self.cell)
        } else if time > end {
            2.0 * self.ways[1] - self.spot.way_at((2.0 * end - time).max(begin), &mut self.node, &mut self.cell)
        } else {
            self.spot.way_at(time, &mut self.node, &mut self.cell)
        }
    }

    /// The mean over a step around a time, so that what is faster than the steps is not seen at all.
    fn mean_over_step(&mut self, time: f64, step: f64) -> f64 {
        const PARTS: usize = 4;
        let part = |m: usize| ((m as f64 + 0.5) / PARTS as f64 - 0.5) * step;
        (0..PARTS).map(|m| self.at(time + part(m))).sum::<f64>() / PARTS as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_tile_the_path_and_rewinds_are_legs_of_their_own() {
        let ends = |rewinds: &[[usize; 2]]| {
            legs(10, rewinds).iter().map(|leg| (leg.first, leg.last, leg.rewinds)).collect::<Vec<_>>()
        };
        assert_eq!(ends(&[]), [(0, 9, false)]);
        assert_eq!(ends(&[[2, 4], [4, 5]]), [(0, 2, false), (2, 4, true), (4, 5, true), (5, 9, false)]);
        assert_eq!(ends(&[[0, 9]]), [(0, 9, true)]);
    }

    #[test]
    fn way_continues_past_a_leg_mirrored_in_its_ends() {
        // A carried spot: its own time is the way.
        let spot = SpotMotion::carried(&[0.0, 1.0, 5.0]);
        let mut way = ContinuedWay { spot: &spot, times: [1.0, 5.0], ways: [1.0, 5.0], node: 1, cell: 0 };
        assert_eq!([0.5, 1.0, 2.5, 5.0, 6.5].map(|time| way.at(time)), [0.5, 1.0, 2.5, 5.0, 6.5]);
        assert_eq!(way.mean_over_step(2.0, 0.5), 2.0);
    }

    #[test]
    fn no_more_than_half_of_a_limit_is_taken() {
        assert_eq!(
            [0.0, 25.0, 50.0, 99.0, 200.0].map(|taken| share_left(100.0, taken)),
            [1.0, 4.0 / 3.0, 2.0, 2.0, 2.0]
        );
    }
}

//! The spot's own motion along its path: what the scanner does while the stage runs on.
//!
//! Consumes a path with the tools above it and the limits of U and V; promises when the spot would be where on the path
//! if the stage kept up: its *own time*. Where the machine states the scanner's acceleration the spot goes from rest to
//! rest between its stops, as fast as speed, acceleration and jerk of U and V and the pen allow; on a straight run that
//! is the motion of [`GalvoModel`], on a curve what the curve leaves of it. Else it is always at speed, and waits as
//! the machine's delays say. Units: mm, s.
//!
//! # Source
//! Ma et al. (2025) stop the galvo at every point of the curve; here it need not where the path runs straight on.

use crate::on_the_fly::axes::kinematics::{Axes, turned_vector};
use crate::on_the_fly::kinematic_model::KinematicModel;
use crate::on_the_fly::path::schedule::Schedule;
use crate::on_the_fly::path::{NodeKind, Path};
use crate::on_the_fly::topp::{self, TimedPath};
use terrace_core::diag::Error;
use terrace_core::geom::P3Mm;
use terrace_core::math;
use terrace_core::motion::GalvoModel;

/// Where the spot comes to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rests {
    /// At corners and ends of marks and jumps.
    Corners,
    /// At every vertex of a stroke besides, as in the article.
    EveryPoint,
}

impl Rests {
    /// The nodes of a path at which it rests, both ends among them.
    pub fn of(self, path: &Path) -> Vec<usize> {
        let last = path.len() - 1;
        let rests = |kind| match self {
            Self::Corners => matches!(kind, NodeKind::Corner | NodeKind::End),
            Self::EveryPoint => kind != NodeKind::Between,
        };
        (0..=last).filter(|&i| i == 0 || i == last || rests(path.nodes[i].kind)).collect()
    }
}

/// What bounds the speed of the spot between two rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpotPace {
    /// Scanner and pen: a stage that is slower makes the spot wait at its rests.
    Scanner,
    /// The stage too, from node to node: the spot waits for it on its way.
    ScannerAndStage,
}

/// When the spot is where on its path, in its own time.
#[derive(Clone, Debug)]
pub struct SpotMotion {
    law: MotionLaw,
    /// When it comes to each node, and when it leaves.
    times: Vec<[f64; 2]>,
    /// Way along the path to each node.
    way: Vec<f64>,
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one to a job")]
enum MotionLaw {
    /// From rest to rest.
    Profiled(TimedPath),
    /// Evenly from node to node.
    Even,
}

/// A run is straight where no node is farther from its chord, mm: vertices lie on a grid of nanometres.
const STRAIGHT: f64 = 5e-6;

/// Along a straight run speeds that differ by less than this factor are replaced by one, so that the run has a closed
/// form.
const UNEVEN: f64 = 1.2;

/// Gain of the spot's time, relative, for which its search makes no more steps.
const GAIN: f64 = 5e-3;

/// The largest speed of the spot, seen from the lens, with which the stage comes to a node in time, mm/s.
fn stage_cap(model: &KinematicModel<'_>, way: &[f64], axes: &[Axes], i: usize) -> f64 {
    let (a, b) = (&axes[i - 1], &axes[i]);
    let steps = [b.xyz[0] - a.xyz[0], b.xyz[1] - a.xyz[1], b.xyz[2] - a.xyz[2], b.a - a.a, b.c - a.c];
    let times = steps.iter().zip(&model.limits).map(|(step, limit)| step.abs() / limit.speed);
    (way[i] - way[i - 1]) / times.fold(0.0, f64::max)
}

impl SpotMotion {
    /// The motion of a spot that rests in the field while the stage carries it: its own time is the way, mm.
    pub fn carried(way: &[f64]) -> Self {
        Self { law: MotionLaw::Even, times: way.iter().map(|&s| [s; 2]).collect(), way: way.to_vec() }
    }

    /// The motion under the limits of U and V, or at speed, with the stage at `axes` over each node.
    ///
    /// In run number i between `rests` the limits are as many times smaller as `shares[i]`; without shares the scanner
    /// has all of them.
    ///
    /// # Errors
    /// Those of [`topp::time_optimal`], which are faults of the program.
    pub fn new(
        path: &Path,
        axes: &[Axes],
        model: &KinematicModel<'_>,
        rests: &[usize],
        shares: &[f64],
        pace: SpotPace,
    ) -> Result<Self, Error> {
        let way = path.distances();
        let Some(limit) = model.spot else { return Ok(Self::at_speed(path, model, way)) };
        let mut course = Course::new(path, axes, model, &way, pace);
        for (run, ends) in rests.windows(2).enumerate() {
            course.add_run(ends[0], ends[1], shares.get(run).copied().unwrap_or(1.0));
        }
        let course = topp::Path { positions: &course.positions, s: &way, caps: &course.caps, stops: rests };
        let timed =
            topp::time_optimal(&course, &[limit; 2], &topp::Options { gain: GAIN, ..topp::Options::default() })?;
        let settle_s = GalvoModel::of(model.machine).delays(model.machine).jump;
        let times = settled_times(path, &timed, settle_s);
        Ok(Self { law: MotionLaw::Profiled(timed), times, way })
    }

    /// The motion of a spot that is always at speed and waits as the machine's delays say.
    fn at_speed(path: &Path, model: &KinematicModel<'_>, way: Vec<f64>) -> Self {
        let visits = Schedule::of(path, model.machine, model.pens, 0.0).visits;
        Self { law: MotionLaw::Even, times: visits.iter().map(|v| [v.arrive, v.leave]).collect(), way }
    }

    /// The time of the whole path at the spot's own speed.
    pub fn total(&self) -> f64 {
        self.times.last().map_or(0.0, |t| t[1])
    }

    /// When it comes to a node, and when it leaves it.
    pub fn times(&self) -> &[[f64; 2]] {
        &self.times
    }

    /// Way to every node, mm.
    pub fn way(&self) -> &[f64] {
        &self.way
    }

    /// The last node that it has come to at a time, from 0 to the last but one; `hint` is that of the last call.
    pub(crate) fn node_at(&self, time: f64, hint: &mut usize) -> usize {
        let last = self.times.len() - 2;
        let is_reached = |i: usize| self.times[i][0] <= time;
        // Times mostly rise from call to call: the node is that of the last call or the next. Else it is searched.
        if !is_reached(*hint) || *hint < last && is_reached(*hint + 2) {
            *hint = self.times.partition_point(|t| t[0] <= time).clamp(1, last + 1) - 1;
        } else if *hint < last && is_reached(*hint + 1) {
            *hint += 1;
        }
        *hint = (*hint).min(last);
        *hint
    }

    /// Way along the path at a time of the spot; `node` and `cell` are hints, those of the last call.
    pub fn way_at(&self, time: f64, node: &mut usize, cell: &mut usize) -> f64 {
        let i = self.node_at(time, node);
        let [from, to] = [self.way[i], self.way[i + 1]];
        match &self.law {
            // The profile is of the motion alone: its time stands still while the spot waits at a node.
            MotionLaw::Profiled(timed) if time > self.times[i][1] => {
                timed.parameter_at(timed.node_time(i) + (time - self.times[i][1]), cell).clamp(from, to)
            }
            MotionLaw::Profiled(_) => from,
            MotionLaw::Even => {
                let (begin, end) = (self.times[i][1], self.times[i + 1][0]);
                from + ((time - begin) / (end - begin)).clamp(0.0, 1.0) * (to - from)
            }
        }
    }
}

/// When the spot comes to each node and leaves it, if it waits before every mark until the mirrors have settled, as
/// after any jump.
fn settled_times(path: &Path, timed: &TimedPath, settle_s: f64) -> Vec<[f64; 2]> {
    let mut waited_s = 0.0;
    let mut times = Vec::with_capacity(path.len());
    for (i, moved_s) in timed.node_times().enumerate() {
        let arrives = moved_s + waited_s;
        // A mark begins with its run-in, where it has one.
        let begins_mark = path.nodes[i].kind == NodeKind::End && path.pen_at(i + 1).or(path.run_at(i + 1)).is_some();
        waited_s += if begins_mark { settle_s } else { 0.0 };
        times.push([arrives, moved_s + waited_s]);
    }
    times
}

/// What U and V go along a path, and how fast the spot may be on it.
struct Course<'a> {
    path: &'a Path,
    axes: &'a [Axes],
    model: &'a KinematicModel<'a>,
    /// Way along the path to each node, mm.
    way: &'a [f64],
    pace: SpotPace,
    /// U and V at each node so far, mm, one pair after another; from 0.
    positions: Vec<f64>,
    /// Largest speed to each node but the first, mm/s.
    caps: Vec<f64>,
}

impl<'a> Course<'a> {
    fn new(path: &'a Path, axes: &'a [Axes], model: &'a KinematicModel<'a>, way: &'a [f64], pace: SpotPace) -> Self {
        Self { path, axes, model, way, pace, positions: vec![0.0; 2], caps: Vec::with_capacity(path.len()) }
    }

    /// Adds the nodes after `first`, which is the last one so far, up to `last`. Between them the spot does not rest,
    /// and the limits of U and V are divided by `share`.
    fn add_run(&mut self, first: usize, last: usize, share: f64) {
        let mut caps: Vec<f64> = (first + 1..=last).map(|i| self.cap(i)).collect();
        if is_straight(self.path, first, last) {
            self.add_line(first, last, share);
            if let Some(cap) = self.even_cap(first, last, &caps) {
                caps.fill(cap);
            }
        } else {
            self.add_curve(first, last, share);
        }
        self.caps.extend(caps);
    }

    /// Adds the positions of a run whose stage poses, and with them the steps of U and V, change from node to node.
    fn add_curve(&mut self, first: usize, last: usize, share: f64) {
        for i in first + 1..=last {
            let [u, v] = self.step(i - 1, i, share);
            let [from_u, from_v] = self.last_position();
            self.positions.extend([from_u + u, from_v + v]);
        }
    }

    /// Adds the positions of a straight run, evenly along its way.
    fn add_line(&mut self, first: usize, last: usize, share: f64) {
        let [from_u, from_v] = self.last_position();
        let [u, v] = self.step(first, last, share);
        let length = self.way[last] - self.way[first];
        for s in &self.way[first + 1..=last] {
            let t = (s - self.way[first]) / length;
            self.positions.extend([from_u + t * u, from_v + t * v]);
        }
    }

    /// One speed for all of a straight run, with which it takes as long as with `caps`, but no faster than pen and
    /// scanner allow anywhere; None where `caps` differ too much for that.
    fn even_cap(&self, first: usize, last: usize, caps: &[f64]) -> Option<f64> {
        let [least, most] = caps.iter().fold([f64::INFINITY, 0.0f64], |[l, m], &c| [l.min(c), m.max(c)]);
        if most < UNEVEN * least {
            let time: f64 =
                caps.iter().enumerate().map(|(k, c)| (self.way[first + k + 1] - self.way[first + k]) / c).sum();
            let length = self.way[last] - self.way[first];
            let own_caps = (first + 1..=last).map(|i| self.model.cap(self.path, self.way, i));
            return Some(own_caps.fold(length / time, f64::min));
        }
        None
    }

    /// U and V at the last node so far, mm.
    fn last_position(&self) -> [f64; 2] {
        let [.., u, v] = self.positions[..] else { unreachable!("it begins with a pair") };
        [u, v]
    }

    /// What U and V have to go from one node to another, mm, with the stage half-way between its poses at them; times
    /// `share`, which slows the motion as much as limits divided by `share` would.
    fn step(&self, i: usize, j: usize, share: f64) -> [f64; 2] {
        let (nodes, axes) = (&self.path.nodes, self.axes);
        let d = nodes[j].at.way_from(nodes[i].at);
        let a = 0.5 * (axes[i].a + axes[j].a);
        let c = 0.5 * (axes[i].c + axes[j].c);
        let [u, v, _] = turned_vector(a, c, d);
        [share * u, share * v]
    }

    /// The largest speed of the spot to a node, mm/s.
    fn cap(&self, i: usize) -> f64 {
        let own = self.model.cap(self.path, self.way, i);
        match self.pace {
            SpotPace::Scanner => own,
            SpotPace::ScannerAndStage => own.min(stage_cap(self.model, self.way, self.axes, i)),
        }
    }
}

/// Whether the nodes between two others lie on the line between them, seen from the lens.
fn is_straight(path: &Path, first: usize, last: usize) -> bool {
    let [a, b] = [first, last].map(|i| path.nodes[i].at);
    let chord = [b[0] - a[0], b[1] - a[1]];
    let length = math::hypot(chord[0], chord[1]);
    let distance = |p: P3Mm| ((p[0] - a[0]) * chord[1] - (p[1] - a[1]) * chord[0]).abs() / length;
    last == first + 1 || length > 0.0 && path.nodes[first + 1..last].iter().all(|node| distance(node.at) <= STRAIGHT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_the_fly::path::Node;
    use terrace_core::program::PieceId;

    #[test]
    fn run_is_straight_where_its_nodes_lie_within_rounding_of_the_chord() {
        let through = |points: &[[f64; 3]]| Path {
            nodes: points
                .iter()
                .map(|&at| Node {
                    at: P3Mm::new(at),
                    pen: None,
                    kind: NodeKind::Between,
                    stroke: PieceId(0),
                    run: None,
                })
                .collect(),
        };
        // Heights do not count: the scanner sees the plan.
        assert!(is_straight(&through(&[[0.0; 3], [1.0, 4e-6, 7.0], [2.0, 0.0, 0.0]]), 0, 2));
        assert!(!is_straight(&through(&[[0.0; 3], [1.0, 6e-6, 0.0], [2.0, 0.0, 0.0]]), 0, 2));
        assert!(is_straight(&through(&[[0.0; 3], [0.0; 3]]), 0, 1));
        assert!(!is_straight(&through(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3]]), 0, 2));
    }
}

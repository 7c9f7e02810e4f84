//! When the beam is where on its path, at the speeds of its pens: what scanner and stage divide between them.
//!
//! The spot moves by the machine's [`GalvoModel`], as in [`terrace_core::motion::marking`]: from rest to rest between
//! corners and ends, no faster than its pen in marks and than the scanner in jumps; or always at these speeds, with
//! waits at ends and corners as the machine's delays say. With skywriting a mark continues into its run-out without a
//! rest. A jump that is longer than half of the field is the stage's to carry: it runs no faster than the quickest pen,
//! or the stage. Units: mm, s.
//!
//! [`Schedule::lifted`] gives z the time that it needs between marks on different heights. Moving averages of a motion
//! keep the limits that it keeps, so that a step of the part does not slow the marks on either side of it.

use crate::on_the_fly::path::{NodeKind, Path};
use terrace_core::machine::{Axis, Machine};
use terrace_core::math;
use terrace_core::motion::{GalvoModel, RestToRest, Run};
use terrace_core::program::Pen;

/// When the beam is at a node of its path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Visit {
    /// When it comes, s.
    pub arrive: f64,
    /// When it leaves.
    pub leave: f64,
    /// Height that z should have when it arrives, and when it leaves.
    pub z: [f64; 2],
}

/// Times at the nodes of a path, and what they are made of.
#[derive(Clone, Debug, Default)]
pub struct Schedule {
    /// Every node.
    pub visits: Vec<Visit>,
    /// Time of marks, s.
    pub mark_s: f64,
    /// Time of jumps, s.
    pub jump_s: f64,
    /// Time of waiting, s.
    pub delay_s: f64,
    /// How the spot moves between the nodes; empty where it is always at speed.
    runs: Runs,
}

/// The runs of the spot from rest to rest.
#[derive(Clone, Debug, Default)]
struct Runs {
    runs: Vec<SpotRun>,
    /// What stretch of a run ends at each node; of the first node none.
    stretches: Vec<StretchOfRun>,
}

/// A run of the spot from rest to rest.
#[derive(Clone, Debug)]
struct SpotRun {
    /// The node that it begins at.
    first: usize,
    motion: RestToRest,
}

/// A stretch between two nodes as a part of its run.
#[derive(Clone, Debug)]
struct StretchOfRun {
    /// Index of the run.
    run: usize,
    /// Way of the run up to both ends of the stretch, mm.
    way: [f64; 2],
}

impl Runs {
    /// The runs of a path whose stretches have the speeds given, and the time of each stretch, s. Both are empty where
    /// the spot is always at speed.
    fn of(path: &Path, model: GalvoModel, speeds: &[f64]) -> (Self, Vec<f64>) {
        let step = |i: usize| [0, 1].map(|k| path.nodes[i].at[k] - path.nodes[i - 1].at[k]);
        // The first node ends no stretch.
        let mut out = Self { runs: Vec::new(), stretches: vec![StretchOfRun { run: 0, way: [0.0; 2] }] };
        let mut times = vec![0.0];
        let mut first = 0;
        for last in (1..path.len()).filter(|&i| spot_rests(path, i)) {
            let stretches = first + 1..=last;
            let run = stretches.clone().fold(Run::default(), |run, i| run.then(step(i)));
            let speed = speeds[stretches.clone()].iter().copied().fold(f64::INFINITY, f64::min);
            let Some(motion) = model.motion(run, speed) else { return Default::default() };
            let (mut way, mut time) = (0.0, 0.0);
            for i in stretches {
                let [x, y] = step(i);
                let (way_before, time_before) = (way, time);
                way += math::hypot(x, y);
                // The sum of the ways is rounded: the run ends when it ends.
                time = if i == last { motion.total_s() } else { motion.time_at(way) };
                out.stretches.push(StretchOfRun { run: out.runs.len(), way: [way_before, way] });
                times.push(time - time_before);
            }
            out.runs.push(SpotRun { first, motion });
            first = last;
        }
        (out, times)
    }

    /// The share of the way from the node before `next` to it that the spot has come at a time, s.
    fn share(&self, next: usize, now: f64, visits: &[Visit]) -> Option<f64> {
        let &StretchOfRun { run, way: [from, to] } = self.stretches.get(next)?;
        let SpotRun { first, motion } = &self.runs[run];
        let way = motion.way_at(now - visits[*first].leave);
        Some(if to > from { ((way - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 })
    }
}

/// Whether the spot comes to rest at a node: where the path turns sharply or ends, and between a mark and a jump.
fn spot_rests(path: &Path, i: usize) -> bool {
    matches!(path.nodes[i].kind, NodeKind::Corner | NodeKind::End)
        || i + 1 == path.len()
        || path.is_mark_or_run(i) != path.is_mark_or_run(i + 1)
}

/// The path at even steps of time.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Where the beam is.
    pub at: Vec<[f64; 3]>,
    /// Whether it marks.
    pub on: Vec<bool>,
    /// Time between samples, s.
    pub step_s: f64,
}

/// The jumps of a path: the nodes from which and to which they lead.
fn jumps(path: &Path) -> Vec<[usize; 2]> {
    let mut out = Vec::new();
    let mut i = 1;
    while i < path.len() {
        let end = (i..path.len()).find(|&j| path.is_mark_or_run(j)).unwrap_or(path.len());
        if end > i {
            out.push([i - 1, end - 1]);
        }
        i = end + 1;
    }
    out
}

/// Whether the stretch that ends at each node belongs to a jump that is longer than half of the field.
fn carried(path: &Path, machine: &Machine) -> Vec<bool> {
    let half = machine.half_usable_field_mm();
    let mut out = vec![false; path.len()];
    for [from, to] in jumps(path) {
        let (a, b) = (path.nodes[from].at, path.nodes[to].at);
        out[from + 1..=to].fill((0..2).any(|k| (b[k] - a[k]).abs() > half[k]));
    }
    out
}

/// The largest speed of the spot on the stretch that ends at each node, mm/s.
fn speeds(path: &Path, machine: &Machine, pens: &[Pen]) -> Vec<f64> {
    let jump_speed = machine.scanner.jump_speed.as_mm_s();
    let carried = carried(path, machine);
    // A jump that the stage carries runs no faster than the quickest pen, or the stage.
    let fastest = pens.iter().map(|p| p.speed.as_mm_s()).fold(0.0, f64::max);
    let stage = machine.stage.x.speed.as_mm_s().min(machine.stage.y.speed.as_mm_s());
    let carry_speed = fastest.max(stage).min(jump_speed);
    let speed = |i: usize| match path.nodes[i].pen.or(path.nodes[i].run) {
        Some(pen) => pens[pen.index()].speed.as_mm_s(),
        None if carried[i] => carry_speed,
        None => jump_speed,
    };
    (0..path.len()).map(speed).collect()
}

/// The least time in which z rises or falls by a height along [`ease`], within its limits, s.
fn lift_s(z: &Axis, height: f64) -> f64 {
    // Peaks of the first three derivatives of `ease`: 15/8, 10/sqrt 3 and 60.
    let by_speed = 1.875 * height / z.speed.as_mm_s();
    let by_acceleration = (10.0 / 3.0f64.sqrt() * height / z.acceleration.as_mm_s2()).sqrt();
    let by_jerk = z.jerk.map_or(0.0, |jerk| math::cbrt(60.0 * height / jerk.as_mm_s3()));
    by_speed.max(by_acceleration).max(by_jerk)
}

/// A rise from 0 to 1, at rest and without acceleration at both ends: the polynomial of least degree.
fn ease(t: f64) -> f64 {
    t * t * t * (10.0 + t * (6.0 * t - 15.0))
}

impl Schedule {
    /// The times of a path on which the beam waits at every end for `wait_s` at least.
    pub fn of(path: &Path, machine: &Machine, pens: &[Pen], wait_s: f64) -> Self {
        let mut out = Self::default();
        let model = GalvoModel::of(machine);
        let delays = model.delays(machine);
        let speeds = speeds(path, machine, pens);
        let times: Vec<f64>;
        (out.runs, times) = Runs::of(path, model, &speeds);
        let mut now = 0.0;
        for (i, speed) in speeds.iter().enumerate() {
            let ends_mark = path.nodes[i].pen.is_some();
            if i > 0 {
                let (a, b) = (path.nodes[i - 1].at, path.nodes[i].at);
                let at_speed = || math::hypot(b[0] - a[0], b[1] - a[1]) / speed;
                let time = times.get(i).copied().unwrap_or_else(at_speed);
                *(if ends_mark { &mut out.mark_s } else { &mut out.jump_s }) += time;
                now += time;
            }
            let arrive = now;
            let begins_mark = path.pen_at(i + 1).is_some();
            let wait = match path.nodes[i].kind {
                NodeKind::Between => 0.0,
                NodeKind::Vertex | NodeKind::Corner => delays.polygon,
                // The end of a mark, the begin of one, or both.
                NodeKind::End => {
                    let mark_delay = if ends_mark { delays.mark } else { 0.0 };
                    let jump_delay = if begins_mark { delays.jump } else { 0.0 };
                    (mark_delay + jump_delay).max(wait_s)
                }
            };
            out.delay_s += wait;
            now += wait;
            out.visits.push(Visit { arrive, leave: now, z: [path.nodes[i].at[2]; 2] });
        }
        out
    }

    /// The schedule with heights in jumps that z can follow. Where the marks before and after a jump cannot be in focus
    /// together the beam waits before it until z has gone on; otherwise z goes straight from one to the other. Where
    /// the part between them rises so far that the lens might come too near, jumps follow it.
    pub fn lifted(mut self, path: &Path, machine: &Machine, half_depth: f64) -> Self {
        // So far the part may rise above the focal plane before the lens comes too near.
        let headroom = machine.lens.working_distance.as_mm() - machine.stage.clearance.as_mm();
        let mut waits = vec![0.0; path.len()];
        for [from, to] in jumps(path) {
            let [z0, z1] = [path.nodes[from].at[2], path.nodes[to].at[2]];
            let highest = path.nodes[from..=to].iter().fold(f64::NEG_INFINITY, |z, node| z.max(node.at[2]));
            if highest - z0.min(z1) > headroom {
                continue;
            }
            // Half-way between their heights both marks are in focus if they are no farther apart than twice the
            // offset.
            let is_step = (z1 - z0).abs() > 2.0 * half_depth;
            if is_step {
                waits[from] = lift_s(&machine.stage.z, (z1 - z0).abs());
                self.visits[from].z[1] = z1;
            }
            let [begin, end] = [self.visits[from].leave, self.visits[to].arrive];
            for visit in &mut self.visits[from + 1..=to] {
                let share = if is_step || end <= begin { 1.0 } else { (visit.arrive - begin) / (end - begin) };
                visit.z = [z0 + share * (z1 - z0); 2];
            }
        }
        // Every wait puts off all that comes after it.
        let mut later = 0.0;
        for (visit, wait) in self.visits.iter_mut().zip(waits) {
            visit.arrive += later;
            later += wait;
            visit.leave += later;
        }
        self.delay_s += later;
        self
    }

    /// Steps of a quarter of a millisecond, or what keeps a long path at `most` samples.
    pub fn step_s(&self, most: usize) -> f64 {
        const FINEST: f64 = 2.5e-4;
        (self.total_s() / most as f64).max(FINEST)
    }

    /// Time of the whole path, s.
    pub fn total_s(&self) -> f64 {
        self.visits.last().map_or(0.0, |v| v.leave)
    }

    /// The path at even steps of `step_s` or a little less, both ends included.
    pub fn samples(&self, path: &Path, step_s: f64) -> Samples {
        let count = ((self.total_s() / step_s).ceil() as usize).max(1);
        let step_s = self.total_s() / count as f64;
        let mut out = Samples { step_s, ..Samples::default() };
        let mut i = 0;
        for k in 0..=count {
            let now = k as f64 * step_s;
            while i + 1 < path.len() && self.visits[i + 1].arrive <= now {
                i += 1;
            }
            let next = (i + 1).min(path.len() - 1);
            let (from, to) = (self.visits[i], self.visits[next]);
            let is_moving = i + 1 < path.len() && now > from.leave;
            let t = if is_moving { self.share_of_stretch(next, now) } else { 0.0 };
            let (a, b) = (path.nodes[i].at, path.nodes[next].at);
            let z = if is_moving { from.z[1] + t * (to.z[0] - from.z[1]) } else { from.z_at(now) };
            out.at.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), z]);
            // At an end the laser is off while the beam waits; at other nodes of a mark it stays on.
            let waits_with_laser_on = path.nodes[i].kind != NodeKind::End && path.nodes[i].pen.is_some();
            out.on.push(if is_moving { path.nodes[next].pen.is_some() } else { waits_with_laser_on });
        }
        out
    }

    /// The share of the way from the node before `next` to it that the spot has come at a time between them, s.
    fn share_of_stretch(&self, next: usize, now: f64) -> f64 {
        let (from, to) = (self.visits[next - 1], self.visits[next]);
        let at_even_speed = || (now - from.leave) / (to.arrive - from.leave);
        self.runs.share(next, now, &self.visits).unwrap_or_else(at_even_speed)
    }
}

impl Visit {
    /// The height of z at a time of the visit, s: eased from that of the arrival to that of the departure.
    fn z_at(&self, now: f64) -> f64 {
        let wait = self.leave - self.arrive;
        let share = if wait > 0.0 { ((now - self.arrive) / wait).clamp(0.0, 1.0) } else { 1.0 };
        self.z[0] + ease(share) * (self.z[1] - self.z[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_the_fly::path::Node;
    use terrace_core::geom::P3Mm;
    use terrace_core::program::{PenId, PieceId};
    use terrace_core::units::{Frequency, Power, Speed};

    /// Two marks of 10 mm on one line, with a jump of `gap` mm over heights `between` to a mark `rise` mm higher.
    fn marks(gap: f64, rise: f64, between: &[f64]) -> Path {
        let count = between.len() as f64 + 1.0;
        let jump = between.iter().enumerate().map(|(i, &z)| [10.0 + gap * (i as f64 + 1.0) / count, 0.0, z]);
        let ends = [[10.0 + gap, 0.0, rise], [20.0 + gap, 0.0, rise]];
        let mut path = Path::default();
        for (i, at) in [[0.0; 3], [10.0, 0.0, 0.0]].into_iter().chain(jump).chain(ends).enumerate() {
            let last = between.len() + 3;
            path.nodes.push(Node {
                at: P3Mm::new(at),
                pen: (i == 1 || i == last).then_some(PenId(0)),
                kind: if i < 2 || i + 2 > last { NodeKind::End } else { NodeKind::Between },
                stroke: PieceId(u32::from(i > 1)),
                run: None,
            });
        }
        path
    }

    fn pens() -> Vec<Pen> {
        let frequency = Frequency::khz(60.0);
        vec![Pen {
            name: "a".into(),
            speed: Speed::mm_s(200.0),
            power: Power::Percent(50.0),
            frequency,
            passes: 1,
            dwell: None,
        }]
    }

    #[test]
    fn z_keeps_its_limits_in_the_wait_before_a_step_and_marks_keep_their_times() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let z = &machine.stage.z;
        for rise in [0.31, 3.0, -60.0] {
            let path = marks(1e-4, rise, &[]);
            let plain = Schedule::of(&path, &machine, &pens(), 0.0);
            let lifted = plain.clone().lifted(&path, &machine, 0.15);
            assert!((lifted.mark_s - plain.mark_s).abs() < 1e-12 && lifted.mark_s > 0.0);
            assert!((lifted.total_s() - plain.total_s() - lift_s(z, f64::abs(rise))).abs() < 1e-9);
            let step_s = 1e-4;
            let samples = lifted.samples(&path, step_s);
            let heights: Vec<f64> = samples.at.iter().map(|p| p[2]).collect();
            let d = |list: &[f64]| -> Vec<f64> { list.windows(2).map(|w| (w[1] - w[0]) / samples.step_s).collect() };
            let most = |list: &[f64]| list.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let (speed, acceleration) = (d(&heights), d(&d(&heights)));
            assert!(most(&speed) <= z.speed.as_mm_s() * 1.001, "{rise}: {}", most(&speed));
            assert!(most(&acceleration) <= z.acceleration.as_mm_s2() * 1.001, "{rise}: {}", most(&acceleration));
            // One of the limits is reached, and marks lie on their own heights.
            let jerk = most(&d(&acceleration)) / z.jerk.expect("a jerk").as_mm_s3();
            let near = [most(&speed) / z.speed.as_mm_s(), most(&acceleration) / z.acceleration.as_mm_s2(), jerk];
            assert!(near.iter().any(|v| *v > 0.9), "{rise}: {near:?}");
            for (at, _) in samples.at.iter().zip(&samples.on).filter(|(_, on)| **on) {
                assert!((at[2] - if at[0] > 10.00005 { rise } else { 0.0 }).abs() < 1e-9, "{at:?}");
            }
        }
    }

    #[test]
    fn jumps_go_straight_over_low_ground_and_follow_what_the_lens_might_touch() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let gap = machine.lens.working_distance.as_mm() - machine.stage.clearance.as_mm();
        let heights = |top: f64| {
            let path = marks(8.0, 0.2, &[-5.0, top, -5.0]);
            let lifted = Schedule::of(&path, &machine, &pens(), 0.0).lifted(&path, &machine, 0.15);
            lifted.visits.iter().map(|v| v.z[0]).collect::<Vec<_>>()
        };
        let straight = [0.0, 0.0, 0.05, 0.1, 0.15, 0.2, 0.2];
        assert!(heights(gap - 0.1).iter().zip(straight).all(|(a, b)| (a - b).abs() < 1e-9), "{:?}", heights(1.0));
        assert_eq!(heights(gap + 0.1)[3], gap + 0.1);
    }

    /// A square of four sides of `side` mm, each of `pieces` stretches, and a jump to another 3 mm away.
    fn squares(side: f64, pieces: u32) -> Path {
        let mut path = Path::default();
        for square in 0..2u32 {
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
            let place = |k: usize, t: f64| {
                let [a, b] = [corners[k], corners[k + 1]];
                [f64::from(square) * 3.0 + side * (a[0] + t * (b[0] - a[0])), side * (a[1] + t * (b[1] - a[1])), 0.0]
            };
            let mut put = |at, pen, kind| {
                path.nodes.push(Node { at: P3Mm::new(at), pen, kind, stroke: PieceId(square), run: None });
            };
            put(place(0, 0.0), None, NodeKind::End);
            for k in 0..4 {
                for i in 1..=pieces {
                    let kind = match (k, i == pieces) {
                        (3, true) => NodeKind::End,
                        (_, true) => NodeKind::Corner,
                        _ => NodeKind::Between,
                    };
                    put(place(k, f64::from(i) / f64::from(pieces)), Some(PenId(0)), kind);
                }
            }
        }
        path
    }

    #[test]
    fn spot_rests_at_corners_however_many_nodes_lie_between() {
        let machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
        let model = GalvoModel::of(&machine);
        let [side, jump] = [0.5, 3.0].map(|length| Run::default().then([length, 0.0]));
        let [mark_s, jump_s] = [8.0 * model.run_s(side, 200.0), model.run_s(jump, 3000.0)];
        for pieces in [1, 7] {
            let path = squares(0.5, pieces);
            let schedule = Schedule::of(&path, &machine, &pens(), 0.0);
            assert!((schedule.mark_s - mark_s).abs() < 1e-12 && (schedule.jump_s - jump_s).abs() < 1e-12);
            let delay = machine.delays.jump.as_s();
            assert!((schedule.delay_s - 2.0 * delay).abs() < 1e-12, "before each mark, at no corner");
            // The samples are those of the motion, with limits kept along every side and rests at corners.
            let samples = schedule.samples(&path, 1e-5);
            let speed = |w: &[[f64; 3]]| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1]) / samples.step_s;
            let speeds: Vec<f64> = samples.at.windows(2).map(speed).collect();
            let lit = speeds.iter().zip(&samples.on).filter(|(_, on)| **on).map(|(v, _)| *v);
            let peak = model.motion(side, 200.0).expect("a motion").peak();
            let fastest = lit.clone().fold(0.0, f64::max);
            assert!(fastest <= peak * 1.0001 && fastest > 0.999 * peak, "{fastest} {peak}");
            let rests = speeds.windows(3).filter(|w| w[1] < 2.0 && w[1] <= w[0] && w[1] < w[2]).count();
            assert!(rests >= 7, "{rests}");
            let most = speeds.windows(2).map(|w| (w[1] - w[0]).abs() / samples.step_s).fold(0.0, f64::max);
            assert!(most < 20_000.0 * 1.01, "{most}");
        }
    }

    #[test]
    fn skywriting_takes_the_rest_out_of_the_mark() {
        let machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
        let path = marks(5.0, 0.0, &[]);
        let plain = Schedule::of(&path, &machine, &pens(), 0.0);
        let skywriting = Schedule::of(&path.with_skywriting(0.03, &pens()), &machine, &pens(), 0.0);
        assert!((skywriting.mark_s - 20.0 / 200.0).abs() < 1e-9, "marks run at the pen's speed: {}", skywriting.mark_s);
        assert!(plain.mark_s > 1.1 * skywriting.mark_s);
    }
}

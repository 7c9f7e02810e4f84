//! Turnarounds: what the beam does between marks so that the whole runs quickest.
//!
//! Consumes a path, the machine and what scanner and focus allow; promises the path with the turnarounds chosen for it,
//! its schedule and its decomposition ([`xyzuv`](super::xyzuv)). The beam may run on with the laser off before and
//! after every mark, or wait at its ends, so that the stage turns where nothing has to be in focus. One choice holds
//! for all marks; it is made on the middle of the path and confirmed on the whole. Units: mm, s.
//!
//! The articles have no turnarounds: skywriting and longer waits are ours.

use super::path::Path;
use super::path::schedule::Schedule;
use super::xyzuv::{Decomposition, ScannerLimits, decomposed, synchronise};
use terrace_core::geom::BoxMm;
use terrace_core::machine::Machine;
use terrace_core::program::Pen;
use terrace_core::progress::Task;

/// Shortest turnaround that is tried, s at the pens' speeds.
const SHORTEST: f64 = 5e-4;
/// Longest turnaround that is tried, s at the pens' speeds.
const LONGEST: f64 = 0.6;
/// Turnarounds are tried on a piece of the path of so many samples.
const TRIAL_SAMPLES: usize = 50_000;
/// So many of the best turnarounds are tried on the whole path.
const SERIOUS: usize = 3;

/// What the scanner does at the ends of marks, with the laser off, while the stage turns; s at the pens' speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turnaround {
    /// The spot runs on for so long, and as long towards the next mark, s.
    Skywriting(f64),
    /// The spot waits for so long at least, s.
    Dwell(f64),
}

impl Turnaround {
    /// How long it lasts at each end of a mark, s.
    fn s(self) -> f64 {
        let (Self::Skywriting(s) | Self::Dwell(s)) = self;
        s
    }

    /// How long the beam waits at ends at least.
    pub fn wait_s(self) -> f64 {
        if let Self::Dwell(s) = self { s } else { 0.0 }
    }

    /// The same kind of turnaround, `by` times as long.
    fn times(self, by: f64) -> Self {
        match self {
            Self::Skywriting(s) => Self::Skywriting(by * s),
            Self::Dwell(s) => Self::Dwell(by * s),
        }
    }
}

/// A path, when the beam is where on it, and its motion.
pub struct SynchronisedPath {
    /// What the beam does at the ends of the path's marks.
    pub turn: Turnaround,
    /// The path, with run-ins and run-outs if `turn` is skywriting.
    pub path: Path,
    /// Times at the pens' speeds.
    pub schedule: Schedule,
    /// The motion.
    pub sync: Decomposition,
}

/// Decomposes a path with the turnarounds at its marks (skywriting, dwell or none) that make the whole quickest, from
/// `most` samples on, and up to eight times as many where z needs them.
///
/// `travels` says whether the stage can go between some ends of X, Y and Z: runs that it cannot make are not taken.
pub fn quickest(
    path: &Path,
    machine: &Machine,
    pens: &[Pen],
    allowed: ScannerLimits,
    most: usize,
    travels: &dyn Fn(BoxMm<3>) -> bool,
    task: Task<'_>,
) -> SynchronisedPath {
    let [plain_task, trial_task, whole_task] = task.split([2, 4, 2]);
    let search = TurnaroundSearch { machine, pens, allowed, travels };
    let plain = search.without_turnaround(path, most);
    drop(plain_task);
    // Where the pens' speeds are kept no turnaround can save time.
    if plain.sync.fits && plain.sync.slower <= 1.0 {
        return plain;
    }
    // Turnarounds are tried on the middle of the path, in steps as fine as it needs without them.
    let step_s = plain.sync.step_s / plain.sync.slower;
    let middle = path.middle(TRIAL_SAMPLES as f64 * step_s / plain.schedule.total_s());
    let candidates = search.quickest_of(&middle, step_s, trial_task);
    // What is best on the middle may not be possible everywhere.
    search.first_to_save_time(path, step_s, &candidates, &plain, whole_task).unwrap_or(plain)
}

/// A turnaround and the time of the trial path with it, s; None where it is not possible or cannot be among the best.
struct Trial {
    time_s: Option<f64>,
    turn: Turnaround,
}

impl Trial {
    /// The time by which trials are ordered: those without one come last.
    fn order_s(&self) -> f64 {
        self.time_s.unwrap_or(f64::INFINITY)
    }
}

/// What is the same for every turnaround that is tried.
struct TurnaroundSearch<'a> {
    machine: &'a Machine,
    pens: &'a [Pen],
    allowed: ScannerLimits,
    /// Whether the stage can go between some ends of X, Y and Z.
    travels: &'a dyn Fn(BoxMm<3>) -> bool,
}

impl TurnaroundSearch<'_> {
    /// A path with a turnaround at the ends of all marks, and when the beam is where on it.
    fn with_turnaround(&self, path: &Path, turn: Turnaround) -> (Path, Schedule) {
        let path = match turn {
            Turnaround::Skywriting(run_s) => path.with_skywriting(run_s, self.pens),
            Turnaround::Dwell(_) => path.clone(),
        };
        let schedule = Schedule::of(&path, self.machine, self.pens, turn.wait_s());
        let schedule = schedule.lifted(&path, self.machine, self.allowed.half_depth);
        (path, schedule)
    }

    /// The time of a motion, s; None where it is out of focus, or the stage does not travel so far.
    fn total_s(&self, schedule: &Schedule, sync: &Decomposition) -> Option<f64> {
        let is_possible = sync.fits && (self.travels)(BoxMm::of(sync.stage.iter().copied()));
        let total_s = || schedule.total_s() * sync.slower + 2.0 * sync.lead_s;
        is_possible.then(total_s).filter(|s| s.is_finite())
    }

    /// The path as it is: the spot turns at the very ends of marks.
    fn without_turnaround(&self, path: &Path, most: usize) -> SynchronisedPath {
        let turn = Turnaround::Dwell(0.0);
        let (path, schedule) = self.with_turnaround(path, turn);
        let sync = synchronise(&path, &schedule, self.machine, self.allowed, schedule.step_s(most));
        SynchronisedPath { turn, path, schedule, sync }
    }

    /// The turnarounds that are possible on a piece of the path, the quickest first. Both kinds are tried in steps of
    /// four, then lengths about the best.
    fn quickest_of(&self, piece: &Path, step_s: f64, task: Task<'_>) -> Vec<Turnaround> {
        // The scanner's own delays must fit into a run.
        let delays = &self.machine.delays;
        let least = delays.jump.as_s().max(delays.mark.as_s()).max(SHORTEST);
        let lengths = lengths_in_steps_of_four(least);
        // Besides, two lengths in each of two steps about the best.
        let task = task.of_steps(2 * lengths.len() + 4);
        let mut trials = Vec::new();
        let skywriting = lengths.iter().copied().map(Turnaround::Skywriting);
        for turn in skywriting.chain(lengths.iter().copied().map(Turnaround::Dwell)) {
            trials.push(self.attempt(piece, step_s, turn, &trials));
            task.step();
        }
        // Half of a step of four, then about half of that, as factors.
        for factor in [2.0, 1.4] {
            let best = trials.iter().min_by(|a, b| a.order_s().total_cmp(&b.order_s()));
            let Some(&Trial { turn: best, .. }) = best else { break };
            for turn in [1.0 / factor, factor].map(|by| best.times(by)).into_iter().filter(|turn| turn.s() >= least) {
                trials.push(self.attempt(piece, step_s, turn, &trials));
                task.step();
            }
        }
        trials.sort_by(|a, b| a.order_s().total_cmp(&b.order_s()));
        trials.into_iter().filter(|trial| trial.time_s.is_some()).map(|trial| trial.turn).collect()
    }

    /// Tries one more turnaround. It is given up early where it cannot be among the best few of all `trials`, which are
    /// tried on the whole path.
    fn attempt(&self, piece: &Path, step_s: f64, turn: Turnaround, trials: &[Trial]) -> Trial {
        let (path, schedule) = self.with_turnaround(piece, turn);
        let mut times: Vec<f64> = trials.iter().filter_map(|trial| trial.time_s).collect();
        times.sort_by(f64::total_cmp);
        // Slowed down by this, it takes as long as the last of the best few.
        let cutoff = times.get(SERIOUS - 1).map_or(f64::INFINITY, |last| last / schedule.total_s());
        if cutoff <= 1.0 {
            return Trial { time_s: None, turn };
        }
        let sync = decomposed(&path, &schedule, self.machine, self.allowed, step_s, cutoff);
        Trial { time_s: self.total_s(&schedule, &sync), turn }
    }

    /// The whole path with the first of the turnarounds that makes it quicker than it is without one, of the best few.
    fn first_to_save_time(
        &self,
        path: &Path,
        step_s: f64,
        turns: &[Turnaround],
        plain: &SynchronisedPath,
        task: Task<'_>,
    ) -> Option<SynchronisedPath> {
        let task = task.of_steps(SERIOUS);
        let plain_s = self.total_s(&plain.schedule, &plain.sync);
        for &turn in turns.iter().take(SERIOUS) {
            let (path, schedule) = self.with_turnaround(path, turn);
            let sync = decomposed(&path, &schedule, self.machine, self.allowed, step_s, f64::INFINITY);
            let saves_time = |total_s| plain_s.is_none_or(|plain_s| total_s < plain_s);
            if self.total_s(&schedule, &sync).is_some_and(saves_time) {
                return Some(SynchronisedPath { turn, path, schedule, sync });
            }
            task.step();
        }
        None
    }
}

/// Lengths of turnarounds from `least` on, each four times the one before, up to the longest that is tried, s.
fn lengths_in_steps_of_four(least: f64) -> Vec<f64> {
    std::iter::successors(Some(least), |t| Some(4.0 * t)).take_while(|&t| t <= LONGEST).collect()
}

#[cfg(test)]
mod tests {
    use super::super::xyzuv::Peaks;
    use super::*;
    use crate::on_the_fly::path::{Node, NodeKind};
    use terrace_core::geom::P3Mm;
    use terrace_core::math;
    use terrace_core::program::{PenId, PieceId};
    use terrace_core::units::{Frequency, Power, Speed};

    /// `count` lines of `length` mm there and back, a millimetre apart, up and down a slope of 0.1.
    fn lines(count: u32, length: f64) -> Path {
        let mut path = Path::default();
        for line in 0..count {
            let ends = [0.0, length].map(|x| [x, f64::from(line), 0.1 * x]);
            let [a, b] = if line % 2 == 0 { ends } else { [ends[1], ends[0]] };
            for (at, pen) in [(a, None), (b, Some(PenId(0)))] {
                path.nodes.push(Node { at: P3Mm::new(at), pen, kind: NodeKind::End, stroke: PieceId(line), run: None });
            }
        }
        path
    }

    fn pens(speed: f64) -> Vec<Pen> {
        let frequency = Frequency::khz(60.0);
        vec![Pen {
            name: "a".into(),
            speed: Speed::mm_s(speed),
            power: Power::Percent(50.0),
            frequency,
            passes: 1,
            dwell: None,
        }]
    }

    const ROOM: ScannerLimits = ScannerLimits { half_field: [20.0, 20.0], half_depth: 0.035 };

    #[test]
    #[ignore = "slow: make test-all"]
    fn stage_keeps_its_limits_and_marks_stay_in_field_and_focus() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let (path, pens) = (lines(9, 200.0), pens(1000.0));
        let SynchronisedPath { turn, path, schedule, sync } =
            quickest(&path, &machine, &pens, ROOM, 100_000, &|_| true, Task::silent());
        assert!(turn.s() > 0.0 && sync.fits && sync.slower > 1.0, "{turn:?} {}", sync.slower);
        let limits = Peaks::limits(&machine);
        for (k, limit) in limits.iter().enumerate() {
            let peaks = Peaks::of(&sync.stage, k, sync.step_s);
            assert!(peaks.slowed(limit) < 1.0 + 1e-9, "{k}: {peaks:?}");
            let (n, first, last) = (sync.stage.len(), sync.stage[0][k], sync.stage[sync.stage.len() - 1][k]);
            assert!((sync.stage[1][k] - first).abs() < 1e-6 && (sync.stage[n - 2][k] - last).abs() < 1e-6);
        }
        for (i, at) in sync.nodes(&path, &schedule).iter().enumerate() {
            let p = path.nodes[i].at;
            assert!((0..2).all(|k| (p[k] - at[k]).abs() <= ROOM.half_field[k] * (1.0 + 1e-6)), "{i}");
            let lit = path.nodes[i].pen.is_some() || path.pen_at(i + 1).is_some();
            assert!(!lit || (p[2] - at[2]).abs() <= ROOM.half_depth * (1.0 + 1e-6), "{i}: {p:?} {at:?}");
        }
        // The motion is that of the stage, and every mark runs at its speed, slowed alike.
        let motion = sync.motion(&path, &schedule);
        for w in motion.waypoints.windows(2).filter(|w| w[1].pen.is_some()) {
            let [a, b] = [0, 1].map(|i| [0, 1].map(|k| w[i].axes[k] + w[i].axes[5 + k]));
            let speed = math::hypot(b[0] - a[0], b[1] - a[1]) / (w[1].time - w[0].time);
            assert!((speed * sync.slower / 1000.0 - 1.0).abs() < 1e-6, "{speed}");
        }
    }

    #[test]
    fn skywriting_is_used_on_slopes_only_and_saves_time() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let total = |t: &SynchronisedPath| t.schedule.total_s() * t.sync.slower;
        let (path, fast) = (lines(5, 200.0), pens(1000.0));
        let schedule = Schedule::of(&path, &machine, &fast, 0.0);
        let plain = synchronise(&path, &schedule, &machine, ROOM, schedule.step_s(100_000));
        let found = quickest(&path, &machine, &fast, ROOM, 100_000, &|_| true, Task::silent());
        assert!(total(&found) < 0.7 * schedule.total_s() * plain.slower, "{} {}", total(&found), plain.slower);
        // What lies within the field needs no stage: the pens' speed is kept.
        let small = quickest(&lines(5, 0.3), &machine, &pens(100.0), ROOM, 100_000, &|_| true, Task::silent());
        assert!(small.turn == Turnaround::Dwell(0.0) && small.sync.slower == 1.0, "{}", small.sync.slower);
    }

    #[test]
    fn lengths_grow_by_four_up_to_the_longest() {
        assert_eq!(lengths_in_steps_of_four(0.01), [0.01, 0.04, 0.16]);
        assert!(lengths_in_steps_of_four(2.0 * LONGEST).is_empty());
    }

    #[test]
    fn path_of_a_single_mark_is_accepted() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        for length in [1e-6, 0.01, 300.0] {
            let found = quickest(&lines(1, length), &machine, &pens(1000.0), ROOM, 1000, &|_| true, Task::silent());
            assert!(found.sync.slower.is_finite() && found.sync.stage.iter().flatten().all(|v| v.is_finite()));
        }
    }
}

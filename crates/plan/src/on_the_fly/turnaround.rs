//! Turnarounds: what the beam does between marks so that the whole runs quickest.
//!
//! Consumes a path, the machine and what scanner and focus allow; promises the path with the turnarounds chosen for it,
//! its schedule and its decomposition ([`xyzuv`](super::xyzuv)). The beam may run on with the laser off before and
//! after every mark, or wait at its ends, so that the stage turns where focus is free. One choice holds for all marks;
//! it is made on the middle of the path and confirmed on the whole. Units: mm, s.
//!
//! The articles have no turnarounds: skywriting and longer waits are ours.

use super::path::Path;
use super::path::schedule::Schedule;
use super::xyzuv::{Decomposition, ScannerLimits, decomposed, synchronise};
use terrace_core::geom::BoxMm;
use terrace_core::machine::Machine;
use terrace_core::program::Pen;
use terrace_core::progress::Task;

/// Shortest and longest turnarounds that are tried, s at the pens' speeds, and samples they are tried with.
const SHORTEST: f64 = 5e-4;
const LONGEST: f64 = 0.6;
const TRIED: usize = 50_000;
/// How many of the best turns are tried on the whole path.
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
    fn s(self) -> f64 {
        let (Self::Skywriting(s) | Self::Dwell(s)) = self;
        s
    }

    /// How long the beam waits at ends at least.
    pub fn wait_s(self) -> f64 {
        if let Self::Dwell(s) = self { s } else { 0.0 }
    }

    fn times(self, by: f64) -> Self {
        match self {
            Self::Skywriting(s) => Self::Skywriting(by * s),
            Self::Dwell(s) => Self::Dwell(by * s),
        }
    }
}

/// A path, when the beam is where on it, and its motion.
pub struct Timed {
    /// What was found best.
    pub turn: Turnaround,
    /// With the runs of that.
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
) -> Timed {
    let [plainly, trying, whole] = task.split([2, 4, 2]);
    let marking = Marking { machine, pens, allowed, travels };
    let plain = marking.without_turnaround(path, most);
    drop(plainly);
    // Where the pens' speeds are kept no turn can be a better one.
    if plain.sync.fits && plain.sync.slower <= 1.0 {
        return plain;
    }
    // Turns are tried on the middle of the path, in steps as fine as it needs without them.
    let step_s = plain.sync.step_s / plain.sync.slower;
    let middle = path.middle(TRIED as f64 * step_s / plain.schedule.total_s());
    let tried = marking.tried(&middle, step_s, trying);
    // What is best there may not be possible everywhere.
    let whole = whole.of_steps(SERIOUS);
    let before = marking.total_s(&plain.schedule, &plain.sync);
    for Trial { turn, .. } in tried.into_iter().filter(|trial| trial.time_s.is_finite()).take(SERIOUS) {
        let (path, schedule) = marking.turned(path, turn);
        let sync = decomposed(&path, &schedule, machine, allowed, step_s, f64::INFINITY);
        if marking.total_s(&schedule, &sync) < before {
            return Timed { turn, path, schedule, sync };
        }
        whole.step();
    }
    plain
}

/// A turnaround and the time of the path with it, s; infinite where it is not possible or cannot be among the best.
struct Trial {
    time_s: f64,
    turn: Turnaround,
}

/// By what paths are marked, whatever their turnarounds.
struct Marking<'a> {
    machine: &'a Machine,
    pens: &'a [Pen],
    allowed: ScannerLimits,
    travels: &'a dyn Fn(BoxMm<3>) -> bool,
}

impl Marking<'_> {
    /// A path with a turnaround at the ends of all marks, and when the beam is where on it.
    fn turned(&self, path: &Path, turn: Turnaround) -> (Path, Schedule) {
        let path = match turn {
            Turnaround::Skywriting(run_s) => path.with_skywriting(run_s, self.pens),
            Turnaround::Dwell(_) => path.clone(),
        };
        let schedule = Schedule::of(&path, self.machine, self.pens, turn.wait_s());
        let schedule = schedule.lifted(&path, self.machine, self.allowed.focus);
        (path, schedule)
    }

    /// The time of a motion, s; infinite where it is out of focus, or the stage does not travel so far.
    fn total_s(&self, schedule: &Schedule, sync: &Decomposition) -> f64 {
        let is_possible = sync.fits && (self.travels)(BoxMm::of(sync.stage.iter().copied()));
        if is_possible { schedule.total_s() * sync.slower + 2.0 * sync.lead_s } else { f64::INFINITY }
    }

    /// The path as it is: the spot turns at the very ends of marks.
    fn without_turnaround(&self, path: &Path, most: usize) -> Timed {
        let turn = Turnaround::Dwell(0.0);
        let (path, schedule) = self.turned(path, turn);
        let sync = synchronise(&path, &schedule, self.machine, self.allowed, schedule.step_s(most));
        Timed { turn, path, schedule, sync }
    }

    /// Turnarounds of many lengths tried on a piece of the path, the quickest first: both kinds in steps of four, then
    /// lengths about the best.
    fn tried(&self, piece: &Path, step_s: f64, task: Task<'_>) -> Vec<Trial> {
        // The scanner's own delays must fit into a run.
        let delays = &self.machine.delays;
        let least = delays.jump.as_s().max(delays.mark.as_s()).max(SHORTEST);
        let lengths = || std::iter::successors(Some(least), |t| Some(4.0 * t)).take_while(|&t| t <= LONGEST);
        let task = task.of_steps(2 * lengths().count() + 4);
        let mut tried = Vec::new();
        for turn in lengths().map(Turnaround::Skywriting).chain(lengths().map(Turnaround::Dwell)) {
            self.try_turn(piece, step_s, turn, &mut tried);
            task.step();
        }
        for share in [2.0, 1.4] {
            let Some(&Trial { turn: best, .. }) = tried.iter().min_by(|a, b| a.time_s.total_cmp(&b.time_s)) else {
                break;
            };
            for turn in [1.0 / share, share].map(|by| best.times(by)).into_iter().filter(|turn| turn.s() >= least) {
                self.try_turn(piece, step_s, turn, &mut tried);
                task.step();
            }
        }
        tried.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        tried
    }

    /// Tries one more turnaround. It is given up early where it cannot be among the best few, which are tried on the
    /// whole path.
    fn try_turn(&self, piece: &Path, step_s: f64, turn: Turnaround, tried: &mut Vec<Trial>) {
        let (path, schedule) = self.turned(piece, turn);
        let mut times: Vec<f64> = tried.iter().map(|trial| trial.time_s).collect();
        times.sort_by(f64::total_cmp);
        let cutoff = times.get(SERIOUS - 1).map_or(f64::INFINITY, |worst| worst / schedule.total_s());
        let time_s = if cutoff <= 1.0 {
            f64::INFINITY
        } else {
            let sync = decomposed(&path, &schedule, self.machine, self.allowed, step_s, cutoff);
            self.total_s(&schedule, &sync)
        };
        tried.push(Trial { time_s, turn });
    }
}

#[cfg(test)]
mod tests {
    use super::super::xyzuv::Peaks;
    use super::*;
    use crate::on_the_fly::path::{Node, NodeKind};
    use terrace_core::program::{PenId, PieceId};
    use terrace_core::units::{Frequency, Power, Speed};

    /// `count` lines of `length` mm there and back, a millimetre apart, up and down a slope of 0.1.
    fn lines(count: u32, length: f64) -> Path {
        let mut path = Path::default();
        for line in 0..count {
            let ends = [0.0, length].map(|x| [x, f64::from(line), 0.1 * x]);
            let [a, b] = if line % 2 == 0 { ends } else { [ends[1], ends[0]] };
            for (at, pen) in [(a, None), (b, Some(PenId(0)))] {
                path.nodes.push(Node { at, pen, kind: NodeKind::End, stroke: PieceId(line), run: None });
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

    const ROOM: ScannerLimits = ScannerLimits { half_field: [20.0, 20.0], focus: 0.035 };

    #[test]
    #[ignore = "slow: make test-all"]
    fn stage_keeps_its_limits_and_marks_stay_in_field_and_focus() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let (path, pens) = (lines(9, 200.0), pens(1000.0));
        let Timed { turn, path, schedule, sync } =
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
            assert!(!lit || (p[2] - at[2]).abs() <= ROOM.focus * (1.0 + 1e-6), "{i}: {p:?} {at:?}");
        }
        // The motion is that of the stage, and every mark runs at its speed, slowed alike.
        let motion = sync.motion(&path, &schedule);
        for w in motion.waypoints.windows(2).filter(|w| w[1].pen.is_some()) {
            let [a, b] = [0, 1].map(|i| [0, 1].map(|k| w[i].axes[k] + w[i].axes[5 + k]));
            let speed = (b[0] - a[0]).hypot(b[1] - a[1]) / (w[1].time - w[0].time);
            assert!((speed * sync.slower / 1000.0 - 1.0).abs() < 1e-6, "{speed}");
        }
    }

    #[test]
    fn skywriting_is_used_on_slopes_only_and_saves_time() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let total = |t: &Timed| t.schedule.total_s() * t.sync.slower;
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
    fn path_of_a_single_mark_is_accepted() {
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        for length in [1e-6, 0.01, 300.0] {
            let found = quickest(&lines(1, length), &machine, &pens(1000.0), ROOM, 1000, &|_| true, Task::silent());
            assert!(found.sync.slower.is_finite() && found.sync.stage.iter().flatten().all(|v| v.is_finite()));
        }
    }
}

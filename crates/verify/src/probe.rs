//! The proof of a probe program: its lines are read back, and what it moves is followed over the surface file's own
//! facets.
//!
//! Probe and head are upright cylinders that reach up without end, each wider and lower by how far the part may lie from
//! where the job says. On a rapid move none of them may meet the part; on a touch the tip alone may. So wherever within
//! that distance the part lies, nothing but a touch of the tip meets it; fixtures nothing meets at all, and the table
//! nothing but the tip. Shared with what wrote the program are the readers of job, machine and files; what the job does
//! not name is not known.

use super::fixtures::{self, Fixture};
use super::geometry::Geometry;
use super::job_facts;
use super::read::probe::{ProbeStep, read};
use super::rules::sweep::Sweep;
use terrace_core::diag::Error;
use terrace_core::geom::{NM_PER_MM, SpacePoint};
use terrace_core::machine::{Machine, Origin, Probe};
use terrace_core::program::SetupId;
use terrace_input::job::Job;

/// What was found of a probe program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProbeProof {
    /// Moves that were followed, touches among them.
    pub moves: usize,
    /// Touches.
    pub touches: usize,
    /// What is wrong, each with its line.
    pub broken: Vec<String>,
}

/// Rounding of commands to increments of 1 nm and of f64 moves a place of the part by at most this, nm.
const ROUNDING: f64 = 3.0;

/// Messages beyond these say nothing new.
const MOST_BROKEN: usize = 20;

/// Reads the program of a probe back and follows it over the part of a job, which may lie `search_mm` from where the job
/// says.
///
/// # Errors
/// Faults of the surface file.
pub fn probe(
    program: &[u8],
    job: &Job,
    machine: &Machine,
    (probe, origin): (&Probe, Origin),
    search_mm: f64,
) -> Result<ProbeProof, Error> {
    let (shape, _) = job_facts::shape(job)?;
    let geometry = Geometry::new(shape, job.limits.max_incidence.as_rad(), job.surface.weld.f64());
    let mut fixtures = fixtures::load(job, origin, None)?;
    fixtures.retain(|fixture| fixture.is_in(SetupId(0)));
    let mut follower = Follower {
        geometry: &geometry,
        fixtures: &fixtures,
        machine,
        probe,
        origin,
        search: search_mm * NM_PER_MM,
        proof: ProbeProof::default(),
        axes: [None; 3],
        touched_from: None,
    };
    match read(program) {
        Ok(steps) => follower.follow(&steps),
        Err(fault) => follower.broken(fault.line, &fault.message),
    }
    Ok(follower.proof)
}

/// An upright cylinder, from the centre of the tip, nm: its axis, its radius and its lower end.
type Cylinder = ([f64; 2], f64, f64);

struct Follower<'a> {
    geometry: &'a Geometry,
    fixtures: &'a [Fixture],
    machine: &'a Machine,
    probe: &'a Probe,
    origin: Origin,
    search: f64,
    proof: ProbeProof,
    /// What the axes were sent to last.
    axes: [Option<i64>; 3],
    /// z before the touch that the program has just made: it has to be gone back to.
    touched_from: Option<i64>,
}

impl Follower<'_> {
    fn broken(&mut self, line: usize, text: &str) {
        if self.proof.broken.len() < MOST_BROKEN {
            self.proof.broken.push(format!("line {line}: {text}"));
        }
    }

    fn follow(&mut self, steps: &[(usize, ProbeStep)]) {
        let mut is_test = false;
        let mut has_ended = false;
        for (line, step) in steps {
            let line = *line;
            if has_ended {
                self.broken(line, "goes on after its end");
                return;
            }
            match step {
                ProbeStep::Nothing => {}
                ProbeStep::Test => is_test = true,
                ProbeStep::TestEnd => is_test = false,
                ProbeStep::End => has_ended = !is_test,
                ProbeStep::Unknown(text) => self.broken(line, &format!("{text} is no word of a probe program")),
                ProbeStep::Rapid(_) | ProbeStep::Touch(..) if is_test => self.broken(line, "a test moves the stage"),
                ProbeStep::Rapid(to) => {
                    let is_level = to[3..].iter().all(|angle| angle.is_none_or(|angle| angle == 0));
                    if !is_level {
                        self.broken(line, "the probe is tilted");
                    }
                    if to[..3].iter().any(Option::is_some) {
                        self.rapid(line, [to[0], to[1], to[2]]);
                    }
                }
                ProbeStep::Touch(z, feed) => self.touch(line, *z, *feed),
            }
        }
        if !has_ended {
            self.broken(steps.last().map_or(1, |s| s.0), "does not end");
        }
        if self.axes[2] != Some(self.machine.retract_z().0) {
            self.broken(steps.last().map_or(1, |s| s.0), "does not lift at its end");
        }
        if self.proof.touches == 0 {
            self.broken(1, "touches nothing");
        }
    }

    fn rapid(&mut self, line: usize, to: [Option<i64>; 3]) {
        self.proof.moves += 1;
        let from = self.axes;
        let after = [0, 1, 2].map(|k| to[k].or(from[k]));
        if to[2].is_some() && (to[0].is_some() || to[1].is_some()) {
            self.broken(line, "x or y moves together with z");
        }
        if from == [None; 3] && to != [None, None, Some(self.machine.retract_z().0)] {
            self.broken(line, "the first move does not lift z to the end of its travel");
        }
        if let Some(z) = self.touched_from.take() {
            // Where it has touched is not known: anywhere below where it came from.
            if to != [None, None, Some(z)] {
                self.broken(line, "after a touch the probe does not go back up to where it came from");
            }
        }
        self.in_travel(line, after);
        self.axes = after;
        let ([Some(x), Some(y), Some(z)], [from_x, from_y, from_z]) = (after, from) else { return };
        let (tip, [body, head]) = (self.tip_cylinder(), self.others());
        let all = [("the tip", tip), ("the body of the probe", body), ("the head", head)];
        let ways = match (from_x, from_y) {
            (Some(from_x), Some(from_y)) => {
                vec![(0.0, [self.tip([from_x, from_y, from_z.unwrap_or(z)]), self.tip([x, y, z])])]
            }
            _ => self.ways_over_travel(z),
        };
        for (wider, ends) in ways {
            for (what, (axis, radius, lower)) in all {
                let cylinder = (axis, radius + wider, lower);
                self.clear(line, what, cylinder, ends);
                self.clear_of_fixtures(line, what, cylinder, ends);
            }
            if !self.proof.broken.is_empty() {
                return;
            }
        }
    }

    /// Ways along x of at most 4 mm that cover the travel, each with half its width: a move may begin anywhere there.
    fn ways_over_travel(&self, z: i64) -> Vec<(f64, [SpacePoint; 2])> {
        const WIDEST: f64 = 4.0 * NM_PER_MM;
        let [[left, right], [front, back]] =
            [&self.machine.stage.x, &self.machine.stage.y].map(|a| a.travel_nm().map(|end| end.0));
        let [from, to] = [self.tip([left, front, z]), self.tip([right, back, z])];
        let width = to[1] - from[1];
        let count = (width.abs() / WIDEST).ceil().max(1.0);
        let way = |i: usize| {
            let y = from[1] + width * (2 * i + 1) as f64 / (2.0 * count);
            (width.abs() / (2.0 * count), [from, to].map(|[x, _, z]| [x, y, z]))
        };
        (0..count as usize).map(way).collect()
    }

    fn touch(&mut self, line: usize, z: i64, feed: f64) {
        (self.proof.moves, self.proof.touches) = (self.proof.moves + 1, self.proof.touches + 1);
        let most = self.probe.feed.as_mm_s() * 60.0 * (1.0 + 1e-3);
        if feed > most {
            self.broken(line, "touches faster than probe.feed");
        }
        let [Some(x), Some(y), Some(from)] = self.axes else {
            return self.broken(line, "touches from a place that is not known");
        };
        let sign = self.machine.stage.z.sign();
        if sign * z >= sign * from {
            self.broken(line, "a touch goes up");
        }
        self.in_travel(line, [Some(x), Some(y), Some(z)]);
        let ends = [self.tip([x, y, from]), self.tip([x, y, z])];
        for (what, cylinder) in ["the body of the probe", "the head"].into_iter().zip(self.others()) {
            self.clear(line, what, cylinder, ends);
            self.clear_of_fixtures(line, what, cylinder, ends);
            self.clear_of_table(line, what, cylinder, ends[1]);
        }
        self.clear_of_fixtures(line, "the tip", self.tip_cylinder(), ends);
        self.touched_from = Some(from);
    }

    fn in_travel(&mut self, line: usize, at: [Option<i64>; 3]) {
        for (k, (name, axis)) in self.machine.axes().into_iter().enumerate() {
            let [lo, hi] = axis.travel_nm();
            if at[k].is_some_and(|at| !(lo.0..=hi.0).contains(&at)) {
                self.broken(line, &format!("{name} leaves its travel"));
            }
        }
    }

    /// The centre of the tip in the part frame, nm.
    fn tip(&self, at: [i64; 3]) -> SpacePoint {
        let axes = self.machine.axes();
        let offset = self.probe.offset.map(|length| length.as_mm() * NM_PER_MM);
        [0, 1, 2].map(|k| (axes[k].1.sign() * at[k] - self.origin[k]) as f64 + offset[k])
    }

    fn tip_cylinder(&self) -> Cylinder {
        let radius = self.probe.radius.as_mm() * NM_PER_MM;
        ([0.0; 2], radius + self.search, -radius - self.search)
    }

    /// The body of the probe, and the head.
    fn others(&self) -> [Cylinder; 2] {
        let nm = |length: terrace_core::units::Length| length.as_mm() * NM_PER_MM;
        let [x, y, z] = self.probe.offset.map(nm);
        let body = ([0.0; 2], nm(self.probe.body) / 2.0 + self.search, nm(self.probe.stylus) - self.search);
        let lens = nm(self.machine.lens.working_distance) - nm(self.machine.stage.clearance) - z - self.search;
        [body, ([-x, -y], nm(self.machine.lens.diameter) / 2.0 + self.search, lens)]
    }

    /// Holds that the part does not rise into a cylinder on a move.
    fn clear(&mut self, line: usize, what: &str, cylinder: Cylinder, ends: [SpacePoint; 2]) {
        let worst = risen(self.geometry, cylinder, ends);
        if worst > 0.0 {
            let by = worst / NM_PER_MM;
            self.broken(line, &format!("{what} may meet the part: it is {by:.4} mm too low"));
        }
    }

    /// Holds that no fixture rises into a cylinder on a move.
    fn clear_of_fixtures(&mut self, line: usize, what: &str, cylinder: Cylinder, ends: [SpacePoint; 2]) {
        for fixture in self.fixtures {
            let worst = risen(&fixture.geometry, cylinder, ends);
            if worst > 0.0 {
                let by = worst / NM_PER_MM;
                self.broken(line, &format!("{what} may meet fixture {:?}: it is {by:.4} mm too low", fixture.name));
            }
        }
    }

    /// Holds that a cylinder as low as a touch goes keeps off the table, which lies where it lies.
    fn clear_of_table(&mut self, line: usize, what: &str, (_, _, lower): Cylinder, end: SpacePoint) {
        let Some(table) = self.machine.stage.table else { return };
        let height = end[2] + lower + self.search + self.origin[2] as f64;
        if height + ROUNDING < table.as_mm() * NM_PER_MM {
            self.broken(line, &format!("{what} may meet the table"));
        }
    }
}

/// By how much a shape may rise into a cylinder on a move, nm.
fn risen(geometry: &Geometry, (axis, radius, lower): Cylinder, ends: [SpacePoint; 2]) -> f64 {
    let weld = geometry.weld();
    let lower = lower + ROUNDING + 2.0 * weld;
    let ends = ends.map(|[x, y, z]| [x + axis[0], y + axis[1], z + lower]);
    let [_, highest] = geometry.heights();
    if ends.iter().all(|end| end[2] >= highest) {
        return 0.0;
    }
    let sweep = Sweep::new(ends, radius - ROUNDING - weld);
    let mut worst = 0.0f64;
    geometry.facets_in(sweep.bounds, &mut |corners| worst = sweep.rise(&corners, worst).unwrap_or(worst));
    worst
}

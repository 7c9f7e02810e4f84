//! Validation before the writers of on-the-fly programs: a [`Checked`] one holds what a program must, and the
//! limits of its machine at every sample. There is no other way to make one.
//!
//! Held are: times that rise, pens that there are, marks that move; travel of X, Y, Z, A and C, the field of U and V,
//! the speed of every axis, acceleration and jerk of X, Y and Z (what is measured:
//! [`crate::on_the_fly::program::peaks`]), of A and C, and of U and V in addition, where the machine file states them;
//! the speed of marks on the part; the longest line. Moves are straight, so what holds at their ends holds between
//! them.
//!
//! Limits are held by the program's own whole nanometres and microseconds. What the rounding of its samples may have
//! put on a speed, an acceleration or a jerk is taken from it before; what is left may be [`OVER`] above its limit.

mod energy;

pub use energy::LineEnergy;
use energy::Marks;
use terrace_core::math;

use crate::check::{Reach, fits, pen_faults, refused};
use crate::on_the_fly::axes::motion::AXES;
use crate::on_the_fly::program::peaks::{self, Peak, Peaks};
use crate::on_the_fly::program::{AxisCommands, Kind, Move, Program};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{NM_PER_MM, Nm, mm_from_nm};
use terrace_core::machine::Machine;

/// Share of a limit that may be exceeded: the rounding of sums.
pub const OVER: f64 = 1e-6;

/// Times, lengths and peaks of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Time of all moves, s.
    pub time_s: f64,
    /// Time of moves with the laser on, s.
    pub mark_s: f64,
    /// Pieces of strokes that are marked one by one.
    pub marks: usize,
    /// Way of the spot in the focal plane with the laser on, mm.
    pub mark_mm: f64,
    /// Way of the spot in the focal plane with the laser off, mm.
    pub jump_mm: f64,
    /// Fastest mark across its beam, mm/s.
    pub mark_speed: f64,
    /// Largest distance of a mark from the centre of the field, mm.
    pub displacement_mm: f64,
    /// Largest step of the spot's velocity at a sample next to a mark, mm/s: what a controller that blends
    /// moves rounds.
    pub corner_mm_s: f64,
    /// The shortest move, us.
    pub shortest_us: i64,
    /// Largest speed, acceleration and jerk of every axis.
    pub peaks: [Peaks; AXES],
    /// What the laser gives to each length of the marks.
    pub energy: LineEnergy,
}

impl Figures {
    /// How far a mark may begin or end too early, mm, where the laser is switched up to a servo period of `servo_s`
    /// early.
    pub fn laser_error_mm(&self, servo_s: f64) -> f64 {
        self.mark_speed * servo_s
    }
}

/// A program that may be emitted.
#[derive(Clone, Debug)]
pub struct Checked {
    program: Program,
    figures: Figures,
    /// Whether the power of marks follows the speed of the spot.
    power_by_speed: bool,
}

impl Checked {
    /// Checks a program; whether its power follows the speed of the spot decides its energy.
    ///
    /// # Errors
    /// Every limit that is broken (`travel`, `fly-field`, `fly-speed`, `fly-acceleration`, `fly-jerk`,
    /// `fly-mark-speed`, `fly-line`, `job-empty`), of each axis the worst; `fly-invariant` where the fault is ours.
    pub fn new(program: Program, machine: &Machine, power_by_speed: bool) -> Result<Self, Error> {
        let mut faults = invariants(&program);
        faults.extend(pen_faults(&program.pens, machine).into_iter().map(|(_, fault)| fault));
        if faults.is_empty() {
            let figures = figures(&program, machine, power_by_speed)?;
            faults.extend(travel(&program, machine));
            faults.extend(field(&program, machine)?);
            faults.extend(dynamics(&figures.peaks, &program, machine));
            faults.extend(scanner(&program, machine));
            faults.extend(mark_speed(&program, machine)?);
            faults.extend(lines(&program, machine));
            if faults.is_empty() {
                return Ok(Self { program, figures, power_by_speed });
            }
        }
        Err(refused(faults))
    }

    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }
    /// Its times, lengths and peaks.
    pub fn figures(&self) -> &Figures {
        &self.figures
    }
    /// Whether the power of marks follows the speed of the spot.
    pub fn power_by_speed(&self) -> bool {
        self.power_by_speed
    }
    /// For mutants of the verifier: a program that nobody checked.
    #[cfg(any(test, feature = "test-support"))]
    pub fn unchecked(program: Program, machine: &Machine) -> Self {
        let figures = figures(&program, machine, false).expect("a machine with the axes");
        Self { program, figures, power_by_speed: false }
    }
}

/// "at 1.25 s".
fn at(us: i64) -> String {
    format!("at {:.6} s", us as f64 / 1e6)
}

/// What breaks here is our own fault, whatever the job says.
fn invariants(program: &Program) -> Vec<Diag> {
    let mut faults = Vec::new();
    if !program.moves.iter().any(|m| m.mark.is_some()) {
        let text = "nothing would be marked: no texture lies on the part where it may be marked";
        let hint = "check the texture's area and origin against the part's box (`terrace inspect`)";
        faults.push(Diag::limit("job-empty", text).hint(hint));
    }
    for (us, from, to) in program.steps() {
        let broken = |what: &str| Diag::bug("fly-invariant", format!("{what} {}", at(us)));
        if to.us <= us {
            faults.push(broken("a move takes no time"));
        }
        let Some(mark) = to.mark else { continue };
        if mark.pen.index() >= program.pens.len() {
            faults.push(broken("a mark has no pen"));
        }
        if *from == to.to {
            faults.push(broken("a mark does not move"));
        }
    }
    faults
}

/// The travel of one axis.
struct AxisTravelEnds {
    /// The place of the axis among the axes.
    axis: usize,
    name: char,
    /// nm, or millionths of a degree.
    ends: [i64; 2],
    unit: &'static str,
}

/// The travel of all axes of a program that have ends.
fn travel_ends(program: &Program, machine: &Machine) -> Vec<AxisTravelEnds> {
    let mut out = Vec::new();
    for (k, (_, axis)) in machine.axes().into_iter().enumerate() {
        let ends = axis.travel_nm().map(|Nm(end)| end);
        out.push(AxisTravelEnds { axis: k, name: ['X', 'Y', 'Z'][k], ends, unit: "mm" });
    }
    if let (Kind::Xyzacuv, Some(table)) = (program.kind, &machine.tilt) {
        for (k, axis) in table.axes.iter().enumerate() {
            let Some(travel) = axis.travel.ends() else { continue };
            let ends = travel.map(|t| (t.as_deg() * 1e6).round() as i64);
            out.push(AxisTravelEnds { axis: 3 + k, name: axis.letter.char(), ends, unit: "deg" });
        }
    }
    out
}

/// Refuses axes that leave their travel, each with what would let it fit.
fn travel(program: &Program, machine: &Machine) -> Vec<Diag> {
    let samples = || std::iter::once((0, &program.start)).chain(program.moves.iter().map(|m| (m.us, &m.to)));
    let mut faults = Vec::new();
    for AxisTravelEnds { axis: k, name, ends, unit } in travel_ends(program, machine) {
        let reach = Reach::of(samples().map(|(_, to)| to[k]), ends);
        if reach.holds() {
            continue;
        }
        // With five axes the motion moves with the part; a tilt table turns it about a point that stays.
        let origins = match (program.kind, machine.axes().get(k)) {
            (Kind::Xyzuv, Some((_, axis))) => reach.origins(program.origin[k], axis.sign(), machine.increment_nm().0),
            _ => None,
        };
        let hint = match (origins, program.kind) {
            (Some(origins), _) => fits(&name.to_lowercase().to_string(), origins),
            (None, Kind::Xyzuv) => "no origin fits: mark a smaller area, or use a machine with more travel".into(),
            (None, Kind::Xyzacuv) => "move the part (placement.origin), or see the machine's travel".into(),
        };
        let worst = at(samples().nth(reach.worst).map_or(0, |(us, _)| us));
        let text = format!("{}, the worst is {worst}", reach.text(&name.to_string(), unit, "positions"));
        faults.push(Diag::limit("travel", text).hint(hint));
    }
    faults
}

/// Refuses positions of the scanner outside the usable field, with the worst.
fn field(program: &Program, machine: &Machine) -> Result<Option<Diag>, Error> {
    let field = program.fields(machine)?;
    let samples = || std::iter::once((0, &program.start)).chain(program.moves.iter().map(|m| (m.us, &m.to)));
    // A field point is counted in i32: what does not fit into one lies far outside.
    let is_outside = |at: [i64; 2]| {
        at.map(i32::try_from).iter().any(Result::is_err) || !machine.field_holds(at.map(|v| v as i32).into())
    };
    let farther_coordinate = |to: &AxisCommands| field(to).map(|v| v.abs()).into_iter().max();
    let outside: Vec<(i64, &AxisCommands)> = samples().filter(|(_, to)| is_outside(field(to))).collect();
    // Of positions equally far out, the first.
    Ok(outside.iter().max_by_key(|(us, to)| (farther_coordinate(to), -us)).map(|&(us, to)| {
        let [u, v] = field(to).map(mm_from_nm);
        let [w, h] = machine.usable_field().map(Nm::mm);
        let text = format!(
            "{} of {} positions of the scanner lie outside the usable field of {w} x {h} mm, the worst at ({u}, {v}) \
                 mm {}",
            outside.len(),
            samples().count(),
            at(us)
        );
        Diag::limit("fly-field", text).hint("let the stage follow more closely, or mark more slowly")
    }))
}

/// What the machine allows one axis.
struct AxisLimits {
    /// The place of the axis among the axes.
    axis: usize,
    name: char,
    unit: &'static str,
    /// Largest speed, acceleration and jerk, where the machine states them.
    most: [Option<f64>; 3],
}

/// The limits of the stage, of rotary axes and of the scanner.
fn axis_limits(program: &Program, machine: &Machine) -> Vec<AxisLimits> {
    let stage = machine.axes().into_iter().enumerate().map(|(axis, (_, a))| AxisLimits {
        axis,
        name: ['X', 'Y', 'Z'][axis],
        unit: "mm",
        most: [Some(a.speed.as_mm_s()), Some(a.acceleration.as_mm_s2()), a.jerk.map(|j| j.as_mm_s3())],
    });
    let table = machine.tilt.iter().filter(|_| program.kind == Kind::Xyzacuv);
    let table = table.flat_map(|t| &t.axes).enumerate().map(|(k, a)| AxisLimits {
        axis: 3 + k,
        name: a.letter.char(),
        unit: "deg",
        most: [
            a.speed.map(|v| v.as_rad_s().to_degrees()),
            a.acceleration.map(|v| v.as_rad_s2().to_degrees()),
            a.jerk.map(|v| v.as_rad_s3().to_degrees()),
        ],
    });
    let scanner = &machine.scanner;
    // How fast it may be depends on whether it marks.
    let most = [None, scanner.acceleration.map(|a| a.as_mm_s2()), scanner.jerk.map(|j| j.as_mm_s3())];
    // With five axes its delays stand for what it loses at ends and corners, as in stepped jobs.
    let mirrors = [(5, 'U'), (6, 'V')].into_iter().filter(|_| program.kind == Kind::Xyzacuv);
    let mirrors = mirrors.map(|(axis, name)| AxisLimits { axis, name, unit: "mm", most });
    stage.chain(table).chain(mirrors).collect()
}

impl AxisLimits {
    /// How many times slower the axis must run to keep its limits; less than 1 where it does.
    fn slower(&self, peaks: &Peaks) -> f64 {
        let share = |k: usize, peak: Peak| self.most[k].map_or(0.0, |most| peak.size / (most * (1.0 + OVER)));
        // Run k times slower, speed falls by k, acceleration by k² and jerk by k³.
        share(0, peaks.speed).max(share(1, peaks.acceleration).sqrt()).max(math::cbrt(share(2, peaks.jerk)))
    }
}

/// How much slower all of a program must run for its axes to keep speed, acceleration and jerk, and for the scanner to
/// keep its speeds; 1 where they do.
pub fn slower(program: &Program, machine: &Machine) -> f64 {
    let peaks = peaks::peaks(program);
    let axes = axis_limits(program, machine).iter().map(|l| l.slower(&peaks[l.axis])).fold(1.0, f64::max);
    let scanner = ScannerSpeeds::of(machine);
    let scanner_slower = |(us, from, to): (i64, &AxisCommands, &Move)| {
        (scanner_way(from, to) - ROUNDING) / (scanner.limit(to) * (1.0 + OVER) * (to.us - us) as f64 * 1e-6)
    };
    program.steps().map(scanner_slower).fold(axes, f64::max)
}

/// Largest speeds of the scanner, mm/s.
struct ScannerSpeeds {
    jump: f64,
    mark: f64,
}

impl ScannerSpeeds {
    fn of(machine: &Machine) -> Self {
        Self { jump: machine.scanner.jump_speed.as_mm_s(), mark: machine.scanner.max_mark_speed.as_mm_s() }
    }

    /// The largest speed in a move.
    fn limit(&self, to: &Move) -> f64 {
        if to.mark.is_some() { self.mark } else { self.jump }
    }
}

/// How far a move takes the scanner, mm.
fn scanner_way(from: &AxisCommands, to: &Move) -> f64 {
    let [u, v] = [5, 6].map(|k| mm_from_nm(to.to[k] - from[k]));
    math::hypot(u, v)
}

/// Speed, acceleration and jerk of the stage, of rotary axes and of the scanner.
fn dynamics(peaks: &[Peaks; AXES], program: &Program, machine: &Machine) -> Vec<Diag> {
    let mut faults = Vec::new();
    for AxisLimits { axis, name, unit, most } in axis_limits(program, machine) {
        let p = &peaks[axis];
        for (k, peak) in [p.speed, p.acceleration, p.jerk].into_iter().enumerate() {
            let Some(limit) = most[k].filter(|limit| peak.size > limit * (1.0 + OVER)) else { continue };
            let (what, per) = [("a speed", "s"), ("an acceleration", "s2"), ("a jerk", "s3")][k];
            let (size, at) = (peak.size, peak.at_s);
            let text =
                format!("{name} would need {what} of {size:.4} {unit}/{per} at {at:.6} s, but its limit is {limit}");
            let diag = match k {
                0 => Diag::limit("fly-speed", text),
                1 => Diag::limit("fly-acceleration", text),
                _ => Diag::limit("fly-jerk", text),
            };
            faults.push(diag.hint("mark more slowly, or let the stage follow less closely"));
        }
    }
    faults
}

/// What rounding may put on the length of a move, mm: a nanometre at either end.
const ROUNDING: f64 = 2.0 / NM_PER_MM;

/// Whether a way, mm, in a time, us, is faster than `limit` mm/s.
fn is_fast(way: f64, us: i64, limit: f64) -> bool {
    way - ROUNDING > limit * (1.0 + OVER) * us as f64 * 1e-6
}

/// Speed of the scanner, in marks and jumps.
fn scanner(program: &Program, machine: &Machine) -> Option<Diag> {
    let scanner = ScannerSpeeds::of(machine);
    program.steps().find_map(|(us, from, to)| {
        let way = scanner_way(from, to);
        let limit = scanner.limit(to);
        is_fast(way, to.us - us, limit).then(|| {
            let speed = way / (to.us - us) as f64 * 1e6;
            let text =
                format!("the scanner would have to run at {speed:.4} mm/s {}, but its limit is {limit} mm/s", at(us));
            Diag::limit("fly-speed", text).hint("see scanner.jump_speed and scanner.max_mark_speed of the machine")
        })
    })
}

/// Speed of marks, across their beams, against that of their pens.
fn mark_speed(program: &Program, machine: &Machine) -> Result<Option<Diag>, Error> {
    let spot = program.spots(machine)?;
    Ok(program.steps().find_map(|(us, from, to)| {
        let pen = &program.pens[to.mark?.pen.index()];
        let way = spot(from).way(&spot(&to.to));
        is_fast(way, to.us - us, pen.speed.as_mm_s()).then(|| {
            let speed = way / (to.us - us) as f64 * 1e6;
            let wanted = pen.speed.as_mm_s();
            let text = format!("a mark would run at {speed:.4} mm/s {}, pen {:?} at {wanted} mm/s", at(us), pen.name);
            Diag::limit("fly-mark-speed", text).hint("time the motion by the speeds of its pens")
        })
    }))
}

/// The longest line that a writer may need: a word of all axes, and the time.
fn lines(program: &Program, machine: &Machine) -> Option<Diag> {
    let samples = std::iter::once(&program.start).chain(program.moves.iter().map(|m| &m.to));
    let digits = |v: i64| math::log10(mm_from_nm(v.abs()).max(1.0)) as usize + 1;
    let mut widest = [0; AXES];
    for to in samples {
        widest.iter_mut().zip(&to.0).for_each(|(w, &v)| *w = (*w).max(digits(v)));
    }
    // A space, the letter, the sign, and six decimals after the point; G1 and the longest time.
    let length = 24 + program.kind.axes().iter().map(|&k| 10 + widest[k]).sum::<usize>();
    let most = machine.controller.max_line;
    (length > most).then(|| {
        let text = format!("a move takes up to {length} characters in one line, the controller takes {most}");
        Diag::limit("fly-line", text).hint("see controller.max_line of the machine")
    })
}

/// By how much the spot's velocity steps at most between two speeds of the axes; `lever` is its distance, mm, from
/// where axes turn.
fn corner(before: [f64; AXES], after: [f64; AXES], lever: f64) -> f64 {
    let step: [f64; AXES] = std::array::from_fn(|k| (after[k] - before[k]).abs());
    // Axes may be swapped or mirrored: any may add to any.
    math::hypot(step[0], step[1]) + math::hypot(step[5], step[6]) + (step[3] + step[4]).to_radians() * lever
}

fn figures(program: &Program, machine: &Machine, power_by_speed: bool) -> Result<Figures, Error> {
    let spot = program.spots(machine)?;
    let field = program.fields(machine)?;
    let mut out = Figures { time_s: program.total_s(), peaks: peaks::peaks(program), ..Figures::default() };
    out.shortest_us = program.steps().map(|(us, _, to)| to.us - us).min().unwrap_or(0);
    let mut marks = Marks::new(machine, power_by_speed);
    // Of the move before.
    let mut piece_before = None;
    let mut speeds_before = [0.0; AXES];
    for (us, from, to) in program.steps() {
        let s = (to.us - us) as f64 * 1e-6;
        let (p, q) = (spot(from), spot(&to.to));
        let way = p.way(&q);
        let piece = to.mark.map(|m| m.piece);
        if let Some(mark) = to.mark.filter(|_| piece != piece_before) {
            out.marks += 1;
            marks.begin(&program.pens[mark.pen.index()], [p.part[0], p.part[1]]);
        }
        if to.mark.is_some() {
            out.mark_s += s;
            out.mark_mm += way;
            out.mark_speed = out.mark_speed.max(way / s);
            for at in [from, &to.to] {
                let [u, v] = field(at).map(mm_from_nm);
                out.displacement_mm = out.displacement_mm.max(math::hypot(u, v));
            }
            marks.go(way, s, [q.part[0], q.part[1]]);
        } else {
            out.jump_mm += way;
        }
        let speeds: [f64; AXES] = std::array::from_fn(|k| mm_from_nm(to.to[k] - from[k]) / s);
        // A corner next to a mark, on either side of it.
        if piece.is_some() || piece_before.is_some() {
            out.corner_mm_s = out.corner_mm_s.max(corner(speeds_before, speeds, q.lever));
        }
        piece_before = piece;
        speeds_before = speeds;
    }
    if piece_before.is_some() {
        // The last mark ends in a stop.
        let lever = program.moves.last().map_or(0.0, |m| spot(&m.to).lever);
        out.corner_mm_s = out.corner_mm_s.max(corner(speeds_before, [0.0; AXES], lever));
    }
    out.energy = marks.energy();
    Ok(out)
}

#[cfg(test)]
mod tests;

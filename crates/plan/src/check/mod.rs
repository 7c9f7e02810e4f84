//! Validation before emitting: a [`Checked`] program keeps the invariants P1 to P7 of [`terrace_core::program`] and the limits
//! of its machine. There is no other way to make one. P8 and P9 speak of the part's surface and of the texture, which a
//! program does not hold: `terrace verify` proves them.
//!
//! Controllers clip, drop or truncate silently; here everything that breaks a limit is an error with
//! block and place.

mod clearance;
mod limits;
mod shadow;
mod table;

pub(crate) use limits::{Reach, fits};

use crate::fixtures::Fixture;
use terrace_core::clearance::{Clearance, EachFacet};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::Nm;
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, BlockId, PassId, Pen, Program, SetupId};

/// A program that may be emitted.
#[derive(Clone, Debug)]
pub struct Checked {
    program: Program,
    origins: Vec<Origin>,
}

/// What the program is checked against.
pub struct Limits<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// Positions of the part frame's origin in the table frame, nm, by set-up.
    pub origins: &'a [Origin],
    /// The fewest columns and rows of set-ups whose stops lie within travel.
    pub setups_needed: [u32; 2],
    /// Largest depth range of a block.
    pub depth: Nm,
    /// Tangent of the steepest slope that is marked: a nanometre in the plane is this much in height.
    pub max_slope: f64,
    /// The part's high places.
    pub clearance: &'a Clearance,
    /// The part's facets.
    pub facets: EachFacet<'a>,
    /// What holds the part.
    pub fixtures: &'a [Fixture],
}

/// Faults of one kind that are reported one by one; the rest is counted.
const SHOWN: usize = 10;

impl Checked {
    /// Checks a program.
    ///
    /// # Errors
    /// Every limit that is broken (`travel`, `clearance`, `strokes`), each once; `program-invariant` where the fault
    /// is ours.
    pub fn new(program: Program, limits: &Limits<'_>) -> Result<Self, Error> {
        let mut faults = Vec::new();
        if program.blocks.is_empty() {
            faults.push(
                Diag::limit("job-empty", "nothing would be marked: no texture lies on the part where it may be marked")
                    .hint("check the texture's area and origin against the part's box (`terrace inspect`)"),
            );
        }
        faults.extend(pen_faults(&program.pens, limits.machine).into_iter().map(|(_, fault)| fault));
        if !is_laid_out(&program) {
            // What follows reads strokes and points by these ranges.
            faults.push(Diag::bug("program-invariant", "P1: strokes and points are not laid out block by block"));
            return Err(Error::many(faults));
        }
        if program.blocks.windows(2).any(|w| w[0].pass > w[1].pass) {
            faults.push(Diag::bug("program-invariant", "P7: a block of an earlier pass comes after a later one"));
        }
        // Blocks of one pass and set-up that follow each other are one entry: another one with the same of both is a
        // gap.
        let mut runs: Vec<(PassId, SetupId)> = program.blocks.iter().map(|b| (b.pass, b.setup)).collect();
        runs.dedup();
        runs.sort_unstable();
        let is_known = |&(_, setup): &(PassId, SetupId)| setup.index() < limits.origins.len();
        if !runs.iter().all(is_known) || runs.windows(2).any(|w| w[0] == w[1]) {
            faults.push(Diag::bug("program-invariant", "P7: the blocks of a set-up are not consecutive"));
            return Err(Error::many(faults));
        }
        faults.extend(broken_invariants(&program, limits));
        faults.extend(limits::broken(&program, limits));
        if faults.is_empty() {
            return Ok(Self { program, origins: limits.origins.to_vec() });
        }
        Err(refused(faults))
    }

    /// A program, or blocks of one, that was checked before it was written, as the bytes say that were written.
    pub fn as_written(program: Program, origins: Vec<Origin>) -> Self {
        Self { program, origins }
    }
    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }
    /// Position of the part frame's origin in the table frame, nm, in the first set-up.
    pub fn origin(&self) -> Origin {
        self.origins.first().copied().unwrap_or_default()
    }
    /// Position of the part frame's origin in the table frame, nm, by set-up.
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }
    /// For tests of the emitters and mutants of the verifier: a program that nobody checked.
    #[cfg(any(test, feature = "test-support"))]
    pub fn unchecked(program: Program, origin: Origin) -> Self {
        Self { program, origins: vec![origin] }
    }
    /// A program in several set-ups that nobody checked.
    #[cfg(any(test, feature = "test-support"))]
    pub fn unchecked_setups(program: Program, origins: Vec<Origin>) -> Self {
        Self { program, origins }
    }
}

/// P1 to P6 over all blocks: each that is broken once, at the first block that does, with how often it is.
fn broken_invariants(program: &Program, limits: &Limits<'_>) -> Vec<Diag> {
    // The first fault of every rule, and how many more there are.
    let mut by_rule: Vec<(Diag, usize)> = Vec::new();
    for (i, block) in program.blocks.iter().enumerate() {
        for fault in invariants(program, block, limits) {
            // A message begins with the number of its rule.
            match by_rule.iter_mut().find(|(first, _)| first.message[..2] == fault.message[..2]) {
                Some((_, more)) => *more += 1,
                None => by_rule.push((fault.at(Place::Block(BlockId::new(i).to_string())), 0)),
            }
        }
    }
    let counted = |(mut fault, more): (Diag, usize)| {
        if more > 0 {
            fault.message += &format!(" (and {more} more)");
        }
        fault
    };
    by_rule.into_iter().map(counted).collect()
}

/// The first of P1 to P6 that a program breaks, if it breaks any.
pub(crate) fn first_broken(program: &Program, limits: &Limits<'_>) -> Option<Diag> {
    let blocks = program.blocks.iter().enumerate();
    let broken = |(i, block)| {
        let fault = invariants(program, block, limits).into_iter().next()?;
        Some(fault.at(Place::Block(BlockId::new(i).to_string())))
    };
    blocks.into_iter().find_map(broken)
}

/// The first of the limits that a program breaks, and how many more there are.
pub(crate) fn refused(mut faults: Vec<Diag>) -> Error {
    let more = faults.len().saturating_sub(SHOWN);
    faults.truncate(SHOWN);
    if more > 0 {
        faults.push(Diag::limit("more", format!("{more} more of this kind")));
    }
    Error::many(faults)
}

/// A pen below this speed, mm/s, is a slip of units: a metre takes it 28 hours.
const SLOWEST_MM_S: f64 = 0.01;

/// Pens that scanner or laser cannot follow, or whose speed must be a slip of units, each with its key in a job file.
pub(crate) fn pen_faults(pens: &[Pen], machine: &Machine) -> Vec<(String, Diag)> {
    let mut faults = Vec::new();
    for (i, pen) in pens.iter().enumerate() {
        let mut report = |key: &str, fault: Diag| faults.push((format!("pen.{i}.{key}"), fault));
        let speed = pen.speed.as_mm_s();
        let max_speed = machine.scanner.max_mark_speed.as_mm_s();
        if speed > max_speed {
            let text = format!("pen {:?} marks at {speed} mm/s, the scanner at {max_speed} mm/s at most", pen.name);
            report("speed", Diag::limit("pen-speed", text).hint("see scanner.max_mark_speed of the machine"));
        }
        if speed < SLOWEST_MM_S {
            let text = format!("pen {:?} marks at {speed} mm/s, slower than {SLOWEST_MM_S} mm/s", pen.name);
            report("speed", Diag::limit("pen-speed", text).hint("check the unit of the pen's speed"));
        }
        let power = pen.power.as_w(machine.laser.max_power);
        let max_power = machine.laser.max_power.as_w();
        if power > max_power {
            let text = format!("pen {:?} asks for {power} W, the laser gives {max_power} W at most", pen.name);
            report("power", Diag::limit("pen-power", text).hint("see laser.max_power of the machine"));
        }
    }
    faults
}

/// Whether blocks have the strokes one after another, and strokes the points.
fn is_laid_out(program: &Program) -> bool {
    let mut stroke = 0;
    let mut point = 0;
    let blocks = program.blocks.iter().all(|b| {
        let follows = b.strokes.start == stroke && b.strokes.end >= stroke;
        stroke = b.strokes.end;
        follows
    });
    let strokes = program.strokes.iter().all(|s| {
        let follows = s.first as usize == point;
        point += s.len as usize;
        follows
    });
    blocks && strokes && stroke == program.strokes.len() && point == program.points.len()
}

/// P1 to P6. What breaks here is our own fault, whatever the job says.
fn invariants(program: &Program, block: &Block, limits: &Limits<'_>) -> Vec<Diag> {
    let mut broken = Vec::new();
    broken_strokes(program, block, limits.machine, &mut broken);
    broken_heights(block, limits, &mut broken);
    broken_place(block, limits, &mut broken);
    broken.into_iter().map(|text| Diag::bug("program-invariant", text)).collect()
}

/// P1, P2 and P5: the strokes of a block, their points and their pens.
fn broken_strokes(program: &Program, block: &Block, machine: &Machine, broken: &mut Vec<String>) {
    if block.strokes.is_empty() {
        broken.push("P1: the block has no stroke".into());
    }
    for stroke in program.strokes_of(block) {
        let points = program.points_of(stroke);
        if points.is_empty() || points.windows(2).any(|w| w[0] == w[1]) {
            broken.push(format!("P1: a stroke of texture stroke {} has a segment without length", stroke.source.0));
        }
        if let Some(p) = points.iter().find(|&&p| !machine.field_holds(p)) {
            broken.push(format!("P2: {:?} nm lies outside of the usable field", [p.x, p.y]));
        }
        match program.pens.get(stroke.pen.index()) {
            None => broken.push(format!("P5: there is no pen {}", stroke.pen.0)),
            Some(pen) if stroke.is_dot() && pen.dwell.is_none() => {
                broken.push(format!("P1: a dot is marked with pen {}, which has no dwell", stroke.pen.0));
            }
            Some(_) => {}
        }
    }
}

/// P3 and P6: the heights of a block's marks against what its stop admits and against its focal plane.
fn broken_heights(block: &Block, limits: &Limits<'_>, broken: &mut Vec<String>) {
    let Block { stop, z_lo, z_hi, .. } = block;
    let (z_lo, z_hi) = (*z_lo, *z_hi);
    // A cut point is rounded by up to a nanometre in the plane, which the slope turns into height.
    let slack = Nm(1) + Nm::ceil(limits.max_slope);
    // A place that rounding left between two stops goes to one that is 2 nm away at most.
    let near = slack + Nm(2);
    if z_lo > z_hi || z_lo < stop.z_lo - near || z_hi > stop.z_hi + near {
        broken.push(format!(
            "P3: marks between {} and {} nm lie outside of what their stop accepts, {} to {} nm",
            z_lo.0, z_hi.0, stop.z_lo.0, stop.z_hi.0
        ));
    }
    if z_hi - z_lo > limits.depth + slack {
        broken.push(format!("P3: marks between {} and {} nm span more than {} nm", z_lo.0, z_hi.0, limits.depth.0));
    }
    let step = limits.machine.increment_nm();
    let defocus = (z_hi - stop.lpfl).max(stop.lpfl - z_lo);
    if (stop.lpfl < z_lo - step || stop.lpfl > z_hi + step) && defocus > limits.depth / 2 {
        broken.push(format!(
            "P6: the focal plane {} nm lies outside of the marks, {} to {} nm, and farther from them than half of {} nm",
            stop.lpfl.0, z_lo.0, z_hi.0, limits.depth.0
        ));
    }
}

/// P4: whether optic, tilt axes and stage can take a block's commands, and whether these are those of its stop.
fn broken_place(block: &Block, limits: &Limits<'_>, broken: &mut Vec<String>) {
    let machine = limits.machine;
    let stop = &block.stop;
    let origin = limits.origins[block.setup.index()];
    if block.focus_shift.abs() > machine.most_focus_shift() {
        broken.push(format!("P4: the focus shift {} nm is beyond the range of the zoom optic", block.focus_shift.0));
    }
    let axes = machine.tilt.as_ref().map(|t| &t.axes);
    if !axes.map_or(stop.tilt.is_upright(), |axes| (0..2).all(|k| axes[k].takes(stop.tilt[k]))) {
        broken.push(format!("P4: no tilt axes go to {:?} millionths of a degree", stop.tilt.0));
    }
    let step = machine.increment_nm();
    let is_there = machine.reaches(block.stage, stop.tilt, stop.centre, block.stage_plane(), origin);
    if !is_there || block.stage.0.iter().any(|v| v % step.0 != 0) {
        let stand = machine.stand(stop.tilt, stop.centre, block.stage_plane(), origin);
        broken.push(format!(
            "P4: stage target {:?} nm is not where the block lies, {:?} nm, in steps of {} nm",
            block.stage.0, stand.stage.0, step.0
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::geom::{Box2, P2};
    use terrace_core::machine::TiltAngles;
    use terrace_core::program::{PenId, sample};

    /// The sample program checked after a change, on a part with these high places.
    pub(super) fn faults_with(
        part: &[(Box2, Nm)],
        needed: [u32; 2],
        change: impl FnOnce(&mut Program, &mut Machine),
    ) -> Result<Checked, Error> {
        let (mut program, origin) = sample::program();
        let mut machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        change(&mut program, &mut machine);
        let clearance = Clearance::new(part, &machine);
        let facets = |sink: &mut dyn FnMut([[f64; 3]; 3])| part.iter().flat_map(lids).for_each(sink);
        let limits = Limits {
            machine: &machine,
            origins: &[origin],
            setups_needed: needed,
            depth: Nm(70_000),
            max_slope: 2.0,
            clearance: &clearance,
            facets: &facets,
            fixtures: &[],
        };
        Checked::new(program, &limits)
    }

    /// What the check says of it.
    fn faults(part: &[(Box2, Nm)], change: impl FnOnce(&mut Program, &mut Machine)) -> Vec<String> {
        let text = |d: &Diag| format!("{} {}", d.code, d.message);
        faults_with(part, [1, 1], change).map_or_else(|e| e.diags().iter().map(text).collect(), |_| Vec::new())
    }

    /// The top of a high place as facets.
    pub(super) fn lids((b, z): &(Box2, Nm)) -> [[[f64; 3]; 3]; 2] {
        let corner = |x: i64, y: i64| [x as f64, y as f64, z.f64()];
        let [low, high] = [corner(b.lo.x, b.lo.y), corner(b.hi.x, b.hi.y)];
        [[low, corner(b.hi.x, b.lo.y), high], [low, high, corner(b.lo.x, b.hi.y)]]
    }

    /// A high place on the part under the sample program.
    pub(super) fn mast() -> (Box2, Nm) {
        (Box2 { lo: P2::new(0, 0), hi: P2::new(1, 1) }, Nm(141_000_000))
    }

    /// Holds that a change breaks one rule once, and this one.
    fn assert_breaks(rule: &str, change: impl FnOnce(&mut Program, &mut Machine)) {
        let found = faults(&[], change);
        let begins = |f: &String| f.strip_prefix("program-invariant ").unwrap_or(f).starts_with(rule);
        assert!(found.len() == 1 && found.iter().all(begins), "{rule}: {found:?}");
    }

    /// Leaves the first `n` blocks.
    fn keep(p: &mut Program, n: usize) {
        p.blocks.truncate(n);
        p.strokes.truncate(p.blocks[n - 1].strokes.end);
        let points = p.strokes.iter().map(|s| s.len as usize).sum();
        p.points.truncate(points);
    }

    #[test]
    fn the_sample_program_keeps_every_invariant_and_limit() {
        assert_eq!(faults(&[], |_, _| {}), Vec::<String>::new());
    }

    #[test]
    fn every_invariant_that_is_broken_is_reported_by_its_number() {
        assert_breaks("P1: a stroke", |p, _| p.points[1] = p.points[0]);
        assert_breaks("P1: strokes and points", |p, _| p.strokes[1].first += 1);
        assert_breaks("P1: strokes and points", |p, _| p.blocks[0].strokes.end = 1);
        assert_breaks("P1: the block", |p, _| {
            let mut empty = p.blocks[2].clone();
            empty.strokes = p.strokes.len()..p.strokes.len();
            p.blocks.push(empty);
        });
        assert_breaks("P2", |p, _| p.points[1].x = 20_000_001);
        assert_breaks("P3: marks between 0 and 70004 nm span", |p, _| {
            let (stop, z) = ([Nm(0), Nm(70_004)], [Nm(0), Nm(70_004)]);
            [p.blocks[0].stop.z_lo, p.blocks[0].stop.z_hi] = stop;
            [p.blocks[0].z_lo, p.blocks[0].z_hi] = z;
        });
        assert_breaks("P3: marks between -6", |p, _| {
            p.blocks[0].z_lo = p.blocks[0].stop.z_lo - Nm(6);
            p.blocks[0].z_hi -= Nm(10);
        });
        assert_breaks("P4: stage target", |p, _| p.blocks[1].stage[2] += 100);
        assert_breaks("P4: stage target", |p, m| {
            p.blocks.iter_mut().for_each(|b| b.stop.centre.x += 50);
            p.blocks.iter_mut().for_each(|b| b.stage[0] += 50 * m.stage.x.sign());
            keep(p, 1);
        });
        assert_breaks("P4: the focus shift", |p, m| {
            p.blocks[1].focus_shift = Nm(100);
            p.blocks[1].stage[2] -= 100 * m.stage.z.sign();
        });
        assert_breaks("P4: no tilt axes", |p, _| p.blocks[1].stop.tilt = TiltAngles([0, 100]));
        assert_breaks("P5", |p, _| p.strokes[0].pen = PenId(2));
        assert_breaks("P6", |p, m| {
            p.blocks[1].stop.lpfl += Nm(40_000);
            p.blocks[1].stage[2] += 40_000 * m.stage.z.sign();
        });
        assert_breaks("P7: a block of an earlier pass", |p, _| {
            p.blocks[0].pass = PassId(1);
            keep(p, 2);
        });
        assert_breaks("P7: the blocks of a set-up", |p, _| p.blocks[1].setup = SetupId(1));
    }

    #[test]
    fn an_invariant_that_many_strokes_break_is_reported_once_with_their_number() {
        let found = faults(&[], |p, _| (0..p.points.len()).for_each(|i| p.points[i] = p.points[0]));
        let strokes = sample::program().0.strokes.len();
        let text = format!("(and {} more)", strokes - 1);
        assert!(strokes > 1 && found.len() == 1 && found[0].ends_with(&text), "{found:?}");
    }

    #[test]
    fn every_limit_that_is_broken_is_reported_by_its_code() {
        assert_breaks("travel", |p, m| {
            keep(p, 2);
            m.stage.z.travel[1] = terrace_core::units::Length::mm(0.4);
        });
        assert_breaks("strokes", |p, m| {
            m.controller.max_strokes = 1;
            keep(p, 1);
        });
        assert_breaks("pen-speed", |_, m| m.scanner.max_mark_speed = terrace_core::units::Speed::mm_s(900.0));
        assert_breaks("pen-power", |_, m| m.laser.max_power = terrace_core::units::Watts::w(3.0));
        assert_breaks("job-empty", |p, _| *p = Program { pens: p.pens.clone(), ..Program::default() });
        let found = faults(&[mast()], |_, _| {});
        assert!(found.len() == 1 && found[0].starts_with("clearance "), "{found:?}");
    }
}

//! The limits of the machine over all stops of a program. Each that is broken is reported once: how many stops break
//! it, by how much the worst does, and a value that works where there is one.

use super::{Limits, clearance, shadow, table};
use terrace_core::diag::{Diag, Place};
use terrace_core::geom::{Box2, Nm, P2, Turned, mm_from_nm};
use terrace_core::program::{Block, BlockId, Program};

/// The limits that a program breaks.
pub(super) fn broken(program: &Program, limits: &Limits<'_>) -> Vec<Diag> {
    let travel = (0..3).filter_map(|k| travel(program, limits, k));
    let around = clearance::broken(program, limits).into_iter().chain(table::broken(program, limits));
    travel.chain(around).chain(shadow::broken(program, limits)).chain(strokes(program, limits)).collect()
}

/// How many blocks exceed a limit, and the worst of them with its excess.
struct Excess {
    blocks: usize,
    worst: usize,
    by: i64,
}

/// The blocks whose excess over a limit is above zero; None where there are none.
fn excess(program: &Program, excess: impl Fn(&Block) -> i64) -> Option<Excess> {
    worst(program.blocks.iter().map(excess))
}

/// How many of the excesses of all blocks are above zero, and the worst of them, the first of equal ones.
fn worst(excesses: impl Iterator<Item = i64>) -> Option<Excess> {
    let over = excesses.enumerate().filter(|(_, by)| *by > 0);
    over.fold(None, |sum, (i, by)| {
        let Some(Excess { blocks, worst, by: most }) = sum else { return Some(Excess { blocks: 1, worst: i, by }) };
        let (worst, by) = if by > most { (i, by) } else { (worst, most) };
        Some(Excess { blocks: blocks + 1, worst, by })
    })
}

/// "3 of 40 stops".
fn share(excess: &Excess, program: &Program) -> String {
    format!("{} of {} stops", excess.blocks, program.blocks.len())
}

/// The positions of an axis against its travel, nm or millionths of a degree.
pub(crate) struct Reach {
    /// The lowest and the highest position.
    pub(crate) ends: [i64; 2],
    /// The travel.
    pub(crate) travel: [i64; 2],
    /// How many positions there are.
    pub(crate) all: usize,
    /// How many lie below the travel and how many above it.
    pub(crate) beyond: [usize; 2],
    /// Which lies farthest beyond it.
    pub(crate) worst: usize,
}

impl Reach {
    /// The reach of the positions of one axis.
    pub(crate) fn of(positions: impl Iterator<Item = i64>, travel: [i64; 2]) -> Self {
        let mut reach = Self { ends: [i64::MAX, i64::MIN], travel, all: 0, beyond: [0; 2], worst: 0 };
        let mut most = 0;
        for (i, at) in positions.enumerate() {
            let over = [travel[0] - at, at - travel[1]];
            (0..2).for_each(|side| reach.beyond[side] += usize::from(over[side] > 0));
            reach.ends = [reach.ends[0].min(at), reach.ends[1].max(at)];
            reach.all += 1;
            let over = over[0].max(over[1]);
            if over > most {
                (most, reach.worst) = (over, i);
            }
        }
        reach
    }

    /// Whether all lie in the travel.
    pub(crate) fn holds(&self) -> bool {
        self.beyond == [0; 2]
    }

    /// "x beyond travel: by 40 mm below its lower end at 32 of 32 stops; needed are -250 to 90 mm, ...".
    pub(crate) fn text(&self, name: &str, unit: &str, what: &str) -> String {
        let by = [self.travel[0] - self.ends[0], self.ends[1] - self.travel[1]].map(mm_from_nm);
        let sides = ["below its lower end", "above its upper end"];
        let sides: Vec<String> = (0..2)
            .filter(|&side| self.beyond[side] > 0)
            .map(|side| {
                format!("by {} {unit} {} at {} of {} {what}", by[side], sides[side], self.beyond[side], self.all)
            })
            .collect();
        let [[from, to], [lo, hi]] = [self.ends, self.travel].map(|ends| ends.map(mm_from_nm));
        let sides = sides.join(" and ");
        format!("{name} beyond travel {sides}: needed are {from} to {to} {unit}, the travel is {lo} to {hi} {unit}")
    }

    /// The positions of the part's origin that bring all into the travel, by whole `step`s from where it is; None where
    /// none does. A command is `sign` * (place on the part + origin).
    pub(crate) fn origins(&self, origin: i64, sign: i64, step: i64) -> Option<[i64; 2]> {
        let up = (self.travel[0] - self.ends[0] + step - 1).div_euclid(step) * step;
        let down = (self.travel[1] - self.ends[1]).div_euclid(step) * step;
        let [a, b] = if sign > 0 { [up, down] } else { [-down, -up] };
        (a <= b).then_some([origin + a, origin + b])
    }
}

/// Which origins fit along an axis.
pub(crate) fn fits(name: &str, origins: [i64; 2]) -> String {
    let [a, b] = origins.map(mm_from_nm);
    format!("a placement.origin with {name} between {a} and {b} mm fits")
}

/// Stops beyond the travel of axis `k`.
fn travel(program: &Program, limits: &Limits<'_>, k: usize) -> Option<Diag> {
    let (name, axis) = limits.machine.axes()[k];
    let reach = Reach::of(program.blocks.iter().map(|b| b.stage[k]), axis.travel_nm().map(|Nm(end)| end));
    if reach.holds() {
        return None;
    }
    let upright = program.blocks.iter().all(|b| b.stop.tilt.is_upright());
    let long = reach.ends[1] - reach.ends[0] > reach.travel[1] - reach.travel[0];
    let origins = match limits.origins {
        [origin] if upright => reach.origins(origin[k], axis.sign(), limits.machine.increment_nm().0),
        _ => None,
    };
    let hint = match origins {
        Some(origins) => fits(name, origins),
        None if upright || long => too_long(limits, k),
        None => format!("move the part along {name}, or mark a smaller area"),
    };
    let place = Place::Block(BlockId::new(reach.worst).to_string());
    Some(Diag::limit("travel", reach.text(name, "mm", "stops")).at(place).hint(hint))
}

/// What helps where no origin brings all stops into the travel of axis `k`.
fn too_long(limits: &Limits<'_>, k: usize) -> String {
    let mut hint = "check the unit of the part; no origin brings all stops within travel: ".to_owned();
    match (k, limits.setups_needed) {
        (2, _) => hint += "mark a smaller area, or tilt the fixture (`terrace orient JOB`)",
        (_, [columns, rows]) if columns * rows > 1 => {
            hint += &format!("mark a smaller area, or use [setups] with columns = {columns} and rows = {rows}");
        }
        _ => hint += "mark a smaller area",
    }
    hint + ", or use a machine with more travel"
}

/// Blocks with more strokes than the controller takes.
fn strokes(program: &Program, limits: &Limits<'_>) -> Option<Diag> {
    let limit = limits.machine.controller.max_strokes;
    if limit == 0 {
        return None;
    }
    let excess = excess(program, |b| b.strokes.len() as i64 - limit as i64)?;
    let most = program.blocks[excess.worst].strokes.len();
    let text = format!("{} have up to {most} strokes, but the controller takes {limit}", share(&excess, program));
    let hint = smaller_section(program, &program.blocks[excess.worst], limit);
    Some(Diag::limit("strokes", text).at(Place::Block(BlockId::new(excess.worst).to_string())).hint(hint))
}

/// How large sections may be so that none has more than `limit` strokes. In a narrower one there are fewer in
/// proportion, or by the square.
fn smaller_section(program: &Program, block: &Block, limit: usize) -> String {
    let mut area = Box2::<Turned>::EMPTY;
    program.strokes_of(block).iter().flat_map(|s| program.points_of(s)).for_each(|p| {
        area.add(P2::new(i64::from(p.x), i64::from(p.y)));
    });
    let size = area.size();
    let widest = size[0].max(size[1]).mm() * limit as f64 / block.strokes.len() as f64;
    let section = (widest * 10.0).floor() / 10.0;
    if section < SMALLEST_MM {
        return "use smaller sections (partition.section), or a larger pitch".into();
    }
    format!("a partition.section of {section} mm is about small enough")
}

/// Sections smaller than this are not suggested.
const SMALLEST_MM: f64 = 0.5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::tests::faults_with;
    use terrace_core::diag::Error;
    use terrace_core::machine::Machine;
    use terrace_core::units::Length;

    /// The one limit that the sample program breaks after a change of its machine.
    fn one(needed: [u32; 2], change: impl FnOnce(&mut Machine)) -> Diag {
        let found = faults_with(&[], needed, |_, machine| change(machine));
        let diags = found.as_ref().map_or_else(Error::diags, |_| &[]);
        let [d] = diags else { panic!("{diags:?}") };
        d.clone()
    }

    #[test]
    fn travel_error_suggests_a_valid_origin() {
        let (program, origin) = terrace_core::program::sample::program();
        let at: Vec<i64> = program.blocks.iter().map(|b| b.stage[0]).collect();
        let (lo, hi) = (*at.iter().min().expect("blocks"), *at.iter().max().expect("blocks"));
        // Travel is as long as the stops need, and lies 5 mm off.
        let d = one([1, 1], |m| m.stage.x.travel = [lo + 5_000_000, hi + 5_000_000].map(|v| Length::mm(mm_from_nm(v))));
        let below = at.iter().filter(|&&v| v < lo + 5_000_000).count();
        let text = format!("x beyond travel by 5 mm below its lower end at {below} of {} stops: needed are ", at.len());
        assert!(d.message.starts_with(&text), "{d}");
        let sign = Machine::built_in("xyz-galvo-40").expect("a profile").stage.x.sign();
        let wanted = mm_from_nm(origin[0] + sign * 5_000_000);
        assert_eq!(d.hint, format!("a placement.origin with x between {wanted} and {wanted} mm fits"));
    }

    #[test]
    fn travel_error_tells_both_sides() {
        let reach = Reach::of([-5, 0, 7, 12, -3].map(|v| v * 1_000_000).into_iter(), [-2_000_000, 10_000_000]);
        assert_eq!((reach.beyond, reach.all, reach.worst), ([2, 1], 5, 0));
        assert_eq!(
            reach.text("y", "mm", "stops"),
            "y beyond travel by 3 mm below its lower end at 2 of 5 stops and by 2 mm above its upper end at 1 of 5 \
             stops: needed are -5 to 12 mm, the travel is -2 to 10 mm"
        );
        assert_eq!(reach.origins(0, 1, 1000), None, "they span more than the travel");
    }

    #[test]
    fn origins_move_by_whole_increments_and_end_where_the_travel_does() {
        // From -7 to 5, in a travel of -4 to 9: up by 3 or 4; with a step of 2 by 4 alone.
        let reach = Reach::of([-7, 5].into_iter(), [-4, 9]);
        assert_eq!(reach.origins(100, 1, 1), Some([103, 104]));
        assert_eq!(reach.origins(100, -1, 1), Some([96, 97]), "the part moves against the command");
        assert_eq!(reach.origins(100, 1, 2), Some([104, 104]));
        assert_eq!(reach.origins(100, 1, 5), None);
    }

    #[test]
    fn travel_error_mentions_unit_and_set_ups_if_no_origin_fits() {
        let narrow = |m: &mut Machine| m.stage.x.travel = [Length::mm(0.0), Length::mm(0.001)];
        let hint = one([4, 3], narrow).hint;
        assert!(hint.starts_with("check the unit of the part") && hint.contains("columns = 4 and rows = 3"), "{hint}");
        let hint = one([1, 1], narrow).hint;
        assert!(!hint.contains("setups") && hint.contains("a smaller area, or use a machine"), "{hint}");
        let flat = |m: &mut Machine| m.stage.z.travel = [Length::mm(0.0), Length::um(0.1)];
        assert!(one([4, 3], flat).hint.contains("terrace orient"), "set-ups do not help in height");
    }

    #[test]
    fn strokes_beyond_the_controller_are_one_error_for_all_blocks() {
        let (program, _) = terrace_core::program::sample::program();
        let most = program.blocks.iter().map(|b| b.strokes.len()).max().expect("blocks");
        let over = program.blocks.iter().filter(|b| b.strokes.len() > 1).count();
        let d = one([1, 1], |m| m.controller.max_strokes = 1);
        let wanted =
            format!("{over} of {} stops have up to {most} strokes, but the controller takes 1", program.blocks.len());
        assert_eq!(d.message, wanted);
    }
}

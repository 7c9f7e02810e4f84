//! The limits of the machine over all stops of a program. Each that is broken is reported once: how many stops break
//! it, by how much the worst does, and a value that works where there is one.

use super::Limits;
use crate::diag::{Diag, Place};
use crate::geom::{Nm, mm_from_nm};
use crate::program::{Block, BlockId, Program};

/// The limits that a program breaks.
pub(super) fn broken(program: &Program, limits: &Limits<'_>) -> Vec<Diag> {
    let travel = (0..3).filter_map(|k| travel(program, limits, k));
    travel.chain(clearance(program, limits)).chain(strokes(program, limits)).collect()
}

/// How many blocks exceed a limit, and the worst of them with its excess.
struct Excess {
    blocks: usize,
    worst: usize,
    by: i64,
}

/// Where `excess` of a block is above zero it breaks a limit; None where none does.
fn excess(program: &Program, excess: impl Fn(&Block) -> i64) -> Option<Excess> {
    let over = program.blocks.iter().enumerate().map(|(i, b)| (i, excess(b))).filter(|(_, by)| *by > 0);
    over.fold(None, |found, (i, by)| {
        let Some(Excess { blocks, worst, by: most }) = found else { return Some(Excess { blocks: 1, worst: i, by }) };
        let (worst, by) = if by > most { (i, by) } else { (worst, most) };
        Some(Excess { blocks: blocks + 1, worst, by })
    })
}

/// "3 of 40 stops".
fn share(found: &Excess, program: &Program) -> String {
    format!("{} of {} stops", found.blocks, program.blocks.len())
}

/// Stops beyond the travel of axis `k`.
fn travel(program: &Program, limits: &Limits<'_>, k: usize) -> Option<Diag> {
    let (name, axis) = limits.machine.axes()[k];
    let [lo, hi] = axis.travel_nm().map(|Nm(end)| end);
    let found = excess(program, |b| (lo - b.stage[k]).max(b.stage[k] - hi))?;
    let ends = program.blocks.iter().fold([i64::MAX, i64::MIN], |[a, b], block| {
        let at = block.stage[k];
        [a.min(at), b.max(at)]
    });
    let [from, to] = ends.map(mm_from_nm);
    let text = format!(
        "{name} would have to travel from {from} to {to} mm, but its travel is {} to {} mm: {} are out of range, by \
         up to {} mm",
        mm_from_nm(lo),
        mm_from_nm(hi),
        share(&found, program),
        mm_from_nm(found.by)
    );
    let upright = program.blocks.iter().all(|b| b.stop.tilt.is_upright());
    let hint = if ends[1] - ends[0] > hi - lo || limits.origins.len() > 1 {
        too_long(limits, k)
    } else if let ([origin], true) = (limits.origins, upright) {
        // A command is sign * (place on the part + origin), so the origin may move by what both ends leave.
        let room = [lo - ends[0], hi - ends[1]];
        let [a, b] = if axis.sign() > 0 { room } else { [-room[1], -room[0]] };
        let [a, b] = [a, b].map(|by| mm_from_nm(origin[k] + by));
        format!("any placement.origin with {name} between {a} and {b} mm works")
    } else {
        format!("move the part along {name}, or mark a smaller area")
    };
    Some(Diag::limit("travel", text).at(Place::Block(BlockId::new(found.worst).to_string())).hint(hint))
}

/// What helps where no origin brings all stops into the travel of axis `k`.
fn too_long(limits: &Limits<'_>, k: usize) -> String {
    let mut hint = "check surface.unit; no origin brings all stops within travel: ".to_owned();
    match (k, limits.setups_needed) {
        (2, _) => hint += "mark a smaller area, or tilt the fixture (`terrace orient JOB`)",
        (_, [columns, rows]) if columns * rows > 1 => {
            hint += &format!("mark a smaller area, or use [setups] with columns = {columns} and rows = {rows}");
        }
        _ => hint += "mark a smaller area",
    }
    hint + ", or use a machine with more travel"
}

/// Stops at which the head is too near to a higher place of the part.
fn clearance(program: &Program, limits: &Limits<'_>) -> Option<Diag> {
    let lowest = |block: &Block| {
        let stop = &block.stop;
        if stop.tilt.is_upright() {
            return limits.clearance.lowest_focus(stop.centre, stop.centre);
        }
        let turn = limits.machine.turn(stop.tilt, limits.origins[block.setup.index()]);
        limits.clearance.lowest_focus_turned(&turn, stop.centre)
    };
    let found = excess(program, |b| lowest(b).saturating_sub(b.plane()).0)?;
    let text = format!(
        "at {} the head would come too near to a higher place of the part, by up to {} mm",
        share(&found, program),
        mm_from_nm(found.by)
    );
    let [x_mm, y_mm] = program.blocks[found.worst].stop.centre.mm();
    let hint = "lens.working_distance, lens.diameter and stage.clearance of the machine decide this; \
                `terrace orient JOB` suggests a fixture angle";
    Some(Diag::limit("clearance", text).at(Place::Part { x_mm, y_mm }).hint(hint))
}

/// Blocks with more strokes than the controller takes.
fn strokes(program: &Program, limits: &Limits<'_>) -> Option<Diag> {
    let limit = limits.machine.controller.max_strokes;
    if limit == 0 {
        return None;
    }
    let found = excess(program, |b| b.strokes.len() as i64 - limit as i64)?;
    let most = program.blocks[found.worst].strokes.len();
    let text = format!("{} have up to {most} strokes, but the controller takes {limit}", share(&found, program));
    let hint = "use smaller sections (partition.section)";
    Some(Diag::limit("strokes", text).at(Place::Block(BlockId::new(found.worst).to_string())).hint(hint))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::tests::{faults_with, mast};
    use crate::diag::Error;
    use crate::machine::Machine;
    use crate::units::Length;

    /// The one limit that the sample program breaks after a change of its machine.
    fn one(needed: [u32; 2], change: impl FnOnce(&mut Machine)) -> Diag {
        let found = faults_with(&[], needed, |_, machine| change(machine));
        let diags = found.as_ref().map_or_else(Error::diags, |_| &[]);
        let [d] = diags else { panic!("{diags:?}") };
        d.clone()
    }

    #[test]
    fn travel_error_suggests_a_valid_origin() {
        let (program, origin) = crate::program::sample::program();
        let at: Vec<i64> = program.blocks.iter().map(|b| b.stage[0]).collect();
        let (lo, hi) = (*at.iter().min().expect("blocks"), *at.iter().max().expect("blocks"));
        // Travel is as long as the stops need, and lies 5 mm off.
        let d = one([1, 1], |m| m.stage.x.travel = [lo + 5_000_000, hi + 5_000_000].map(|v| Length::mm(mm_from_nm(v))));
        let below = at.iter().filter(|&&v| v < lo + 5_000_000).count();
        assert!(d.message.contains(&format!("{below} of {} stops are out of range, by up to 5 mm", at.len())), "{d}");
        let sign = Machine::built_in("xyz-galvo-40").expect("a profile").stage.x.sign();
        let wanted = mm_from_nm(origin[0] + sign * 5_000_000);
        assert_eq!(d.hint, format!("any placement.origin with x between {wanted} and {wanted} mm works"));
    }

    #[test]
    fn travel_error_mentions_unit_and_set_ups_if_no_origin_fits() {
        let narrow = |m: &mut Machine| m.stage.x.travel = [Length::mm(0.0), Length::mm(0.001)];
        let hint = one([4, 3], narrow).hint;
        assert!(hint.starts_with("check surface.unit") && hint.contains("columns = 4 and rows = 3"), "{hint}");
        let hint = one([1, 1], narrow).hint;
        assert!(!hint.contains("setups") && hint.contains("a smaller area, or use a machine"), "{hint}");
        let flat = |m: &mut Machine| m.stage.z.travel = [Length::mm(0.0), Length::um(0.1)];
        assert!(one([4, 3], flat).hint.contains("terrace orient"), "set-ups do not help in height");
    }

    #[test]
    fn strokes_beyond_the_controller_are_one_error_for_all_blocks() {
        let (program, _) = crate::program::sample::program();
        let most = program.blocks.iter().map(|b| b.strokes.len()).max().expect("blocks");
        let over = program.blocks.iter().filter(|b| b.strokes.len() > 1).count();
        let d = one([1, 1], |m| m.controller.max_strokes = 1);
        let wanted =
            format!("{over} of {} stops have up to {most} strokes, but the controller takes 1", program.blocks.len());
        assert_eq!(d.message, wanted);
    }

    #[test]
    fn clearance_is_reported_once_at_the_worst_stop() {
        let found = faults_with(&[mast()], [1, 1], |_, _| {});
        let e = found.expect_err("a mast under the head");
        let [d] = e.diags() else { panic!("{e}") };
        assert!(d.code == "clearance" && d.message.contains(" stops the head would come too near"), "{d}");
        assert!(matches!(d.place, Place::Part { .. }), "{d}");
    }
}

//! The table: the part lies on it, not in it, and the head keeps clear of it.

use super::Limits;
use terrace_core::diag::Diag;
use terrace_core::geom::Nm;
use terrace_core::program::{BlockId, Program};

/// What of a program the table does not allow; nothing where the machine does not state its height.
pub(super) fn broken(program: &Program, limits: &Limits<'_>) -> Vec<Diag> {
    let Some(table) = limits.machine.table() else { return Vec::new() };
    part_below(table, limits).into_iter().chain(head_too_low(table, program, limits)).collect()
}

/// A part that reaches below the table by more than the depth of focus: it cannot lie where the job says.
fn part_below(table: Nm, limits: &Limits<'_>) -> Option<Diag> {
    let mut lowest = f64::INFINITY;
    (limits.facets)(&mut |corners| lowest = corners.iter().map(|p| p[2]).fold(lowest, f64::min));
    let origin = limits.origins.iter().map(|origin| origin[2]).min()?;
    let by = (table - Nm(origin)).f64() - lowest;
    (lowest.is_finite() && by > limits.depth.f64()).then(|| {
        let text = format!(
            "the part would lie {} mm deep in the table: its lowest place is at z = {:.3} mm of the part, and its \
             origin at z = {} mm over a table at {} mm",
            Nm::ceil(by).mm(),
            Nm::floor(lowest).mm(),
            Nm(origin).mm(),
            table.mm()
        );
        let hint = format!(
            "a placement.origin of z = {} mm puts it on the table; correct stage.table if that is wrong",
            (table - Nm::floor(lowest)).mm()
        );
        Diag::limit("table-reached", text).hint(hint)
    })
}

/// Stops at which the head would come too near to the table.
fn head_too_low(table: Nm, program: &Program, limits: &Limits<'_>) -> Option<Diag> {
    let gap = limits.clearance.gap();
    let below = program.blocks.iter().enumerate().map(|(i, block)| {
        let end = block.stage_plane() + gap + Nm(limits.origins[block.setup.index()][2]);
        (i, table - end)
    });
    let below: Vec<(usize, Nm)> = below.filter(|(_, by)| *by > Nm(0)).collect();
    let (worst, by) = *below.iter().max_by_key(|(i, by)| (*by, std::cmp::Reverse(*i)))?;
    let text = format!(
        "at {} of {} stops the head would come too near to the table, by up to {} mm at {}",
        below.len(),
        program.blocks.len(),
        by.mm(),
        BlockId::new(worst)
    );
    let hint = "lay the part higher, or state a smaller stage.clearance";
    Some(Diag::limit("table-reached", text).hint(hint))
}

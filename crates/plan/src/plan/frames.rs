//! Whether the frames of a program may be shown on the part.

use std::collections::BTreeSet;

use crate::check::Checked;
use crate::emit;
use terrace_core::diag::{Diag, Error};
use terrace_core::machine::Machine;
use terrace_core::program::{Pen, PenId};
use terrace_input::job::Job;

/// Refuses frames that would mark the part, or that a format cannot carry.
///
/// # Errors
/// `frames-power`; what the formats cannot carry.
pub(super) fn may_be_shown(job: &Job, machine: &Machine, checked: &Checked) -> Result<(), Error> {
    let Some(pen) = job.frames else { return Ok(()) };
    let program = checked.program();
    let marking = program.strokes.iter().map(|stroke| stroke.pen.index());
    if let Some(fault) = too_strong(job, machine, &program.pens, pen, marking) {
        return Err(fault.into());
    }
    emit::faults(&job.formats, emit::frames::frames(checked, pen, machine).program(), machine)
}

/// `frames-power`: the pen of the frames has the power, or the energy on a length, of one of the pens that mark, or more.
pub(super) fn too_strong(
    job: &Job,
    machine: &Machine,
    pens: &[Pen],
    frames: PenId,
    marking: impl Iterator<Item = usize>,
) -> Option<Diag> {
    let power_w = |pen: usize| pens[pen].power.as_w(machine.laser.max_power);
    // Energy on a length of line, J/mm.
    let energy = |i: usize| power_w(i) * f64::from(pens[i].passes) / pens[i].speed.as_mm_s();
    let shown = frames.index();
    let is_as_strong = |&marks: &usize| power_w(shown) >= power_w(marks) || energy(shown) >= energy(marks);
    let weakest = BTreeSet::from_iter(marking).into_iter().find(is_as_strong)?;
    let says = |i: usize| {
        let pen = &pens[i];
        format!("{:?} ({}, {}, {} passes)", pen.name, pen.power, pen.speed, pen.passes)
    };
    let text = format!(
        "pen {} of the frames has at least the power of pen {}, which marks, or its energy per length",
        says(shown),
        says(weakest)
    );
    let hint = "frames are shown, not marked: choose the least power, one pass and no low speed";
    Some(Diag::limit("frames-power", text).at(job.place_of("emit.frames")).hint(hint))
}

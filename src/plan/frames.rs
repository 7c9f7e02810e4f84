//! Whether the frames of a program may be shown on the part.

use crate::check::Checked;
use crate::diag::{Diag, Error};
use crate::emit;
use crate::job::Job;
use crate::machine::Machine;

/// Refuses frames that would mark the part, or that a format cannot carry.
///
/// # Errors
/// `frames-power` where their pen has the power, or the energy on a length, of a pen that marks, or more; what the formats cannot carry.
pub(super) fn may_be_shown(job: &Job, machine: &Machine, checked: &Checked) -> Result<(), Error> {
    let Some(pen) = job.frames else { return Ok(()) };
    let program = checked.program();
    let power_w = |pen: usize| program.pens[pen].power.as_w(machine.laser.max_power);
    // Energy on a length of line, J/mm.
    let energy = |i: usize| {
        let pen = &program.pens[i];
        power_w(i) * f64::from(pen.passes) / pen.speed.as_mm_s()
    };
    let mut marking: Vec<usize> = program.strokes.iter().map(|stroke| stroke.pen.index()).collect();
    marking.sort_unstable();
    marking.dedup();
    let shown = pen.index();
    let is_as_strong = |&marks: &usize| power_w(shown) >= power_w(marks) || energy(shown) >= energy(marks);
    if let Some(weakest) = marking.into_iter().find(is_as_strong) {
        let says = |i: usize| {
            let pen = &program.pens[i];
            format!("{:?} ({}, {}, {} passes)", pen.name, pen.power, pen.speed, pen.passes)
        };
        let text = format!(
            "pen {} of the frames has at least the power of pen {}, which marks, or its energy per length",
            says(shown),
            says(weakest)
        );
        return Err(Diag::limit("frames-power", text)
            .hint("frames are shown, not marked: choose the least power, one pass and no low speed")
            .into());
    }
    emit::faults(&job.formats, emit::frames::frames(checked, pen, machine).program(), machine)
}

//! Whether the frames of a program may be shown on the part.

use crate::check::Checked;
use crate::diag::{Diag, Error};
use crate::emit;
use crate::job::Job;
use crate::machine::Machine;

/// Refuses frames that would mark the part, or that a format cannot carry.
///
/// # Errors
/// `frames-power` where their pen has the power of a pen that marks, or more; what the formats cannot carry.
pub(super) fn may_be_shown(job: &Job, machine: &Machine, checked: &Checked) -> Result<(), Error> {
    let Some(pen) = job.frames else { return Ok(()) };
    let program = checked.program();
    let power_w = |pen: usize| program.pens[pen].power.as_w(machine.laser.max_power);
    let mut marking: Vec<usize> = program.strokes.iter().map(|stroke| stroke.pen.index()).collect();
    marking.sort_unstable();
    marking.dedup();
    if let Some(weakest) = marking.into_iter().min_by(|&a, &b| power_w(a).total_cmp(&power_w(b)))
        && power_w(pen.index()) >= power_w(weakest)
    {
        let [frames, marks] = [pen.index(), weakest].map(|pen| &program.pens[pen]);
        let text = format!(
            "pen {:?} of the frames has a power of {}, pen {:?}, which marks, of {}",
            frames.name, frames.power, marks.name, marks.power
        );
        return Err(Diag::limit("frames-power", text)
            .hint("frames are shown, not marked: choose the least power")
            .into());
    }
    emit::faults(&job.formats, emit::frames::frames(checked, pen).program(), machine)
}

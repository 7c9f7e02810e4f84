//! The formats of an on-the-fly job against the axes of its machine.

use crate::emit::Target;
use crate::on_the_fly::kinematic_model::KinematicModel;
use crate::on_the_fly::program::Kind;
use terrace_core::diag::{Diag, Error};
use terrace_core::format::{Format, names};
use terrace_core::machine::Machine;
use terrace_input::job::Job;

/// What of the job's formats cannot be written for the axes of the machine.
///
/// # Errors
/// Where that is all of them.
pub(super) fn unwritten(job: &Job, machine: &Machine) -> Result<Option<Diag>, Error> {
    // Which axes there are does not depend on where the part lies.
    let has_seven_axes = KinematicModel::of(machine, &job.pens, [0.0; 3]).is_some();
    let kind = if has_seven_axes { Kind::Xyzacuv } else { Kind::Xyzuv };
    let writes = |format: &Format| Target::of(*format).on_the_fly.is_some_and(|file| file.kinds.contains(&kind));
    let left: Vec<Format> = job.formats.iter().copied().filter(|f| !writes(f)).collect();
    if left.is_empty() || !job.names_formats && left.len() < job.formats.len() {
        return Ok(None);
    }
    let text =
        format!("emit.formats {} cannot be written for the axes {}", names(left.iter().copied()), kind.letters());
    let hint = format!("leave it out; formats for these axes: {}", names(Format::all().filter(writes)));
    let place = job.place_of("emit.formats");
    if left.len() == job.formats.len() {
        return Err(Diag::input("emit-mode", text).at(place).hint(hint).into());
    }
    Ok(Some(Diag::warning("emit-mode", text).at(place).hint(hint)))
}

//! Whether the files of a job serve the way in which its machine file says that blocks are loaded.

use crate::emit::Files;
use crate::emit::Target;
use terrace_core::diag::{Diag, Error};
use terrace_core::machine::{LoadingWay, Machine};
use terrace_input::job::{Job, Mode};

/// Holds the formats of a stepped job to the way that its machine states.
///
/// # Errors
/// `operator-way` where the job writes nothing that the way uses.
pub(super) fn served(job: &Job, machine: &Machine) -> Result<(), Error> {
    let Some(way) = machine.operator.way.filter(|_| job.mode == Mode::Stepped) else { return Ok(()) };
    let targets = || job.formats.iter().map(|&format| Target::of(format));
    let used = || targets().filter(|target| target.ways.contains(&way));
    let (is_served, lacks, add) = match way {
        // Its drivers take files of blocks, or have a card or a person that needs none.
        LoadingWay::Run => return Ok(()),
        LoadingWay::Card => (used().any(|t| t.moves_stage), "no stage program starts the scan card", "\"linuxcnc\""),
        LoadingWay::Person => {
            let is_of_blocks = used().any(|t| matches!(t.stepped, Some(Files::Blocks(..))));
            (is_of_blocks, "there is no file of a single block to load", "a format of single blocks, such as \"dxf\"")
        }
        LoadingWay::Ovf => (used().next().is_some(), "there is no job.ovf for the controller to read", "\"ovf\""),
    };
    if is_served {
        return Ok(());
    }
    let text = format!("operator.way is {:?}, but with emit.formats of the job {lacks}", way.name());
    let hint = format!("add {add} to emit.formats of the job, or state in the machine file how its blocks are loaded");
    Err(Diag::input("operator-way", text).at(job.place_in_machine("operator.way")).hint(hint).into())
}

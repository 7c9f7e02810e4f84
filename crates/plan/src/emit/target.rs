//! What a target is: which files it writes, and what it can carry.
//!
//! A target is a writer next to this file, a row of [`TARGETS`], and a variant and a row of [`Format`]; its reader with
//! the verifier's own row is in `verify::read`.

use super::known::{JobPens, KnownFault};
use super::{TARGETS, frames};
use crate::check::Checked;
use crate::on_the_fly::check::Checked as FlyChecked;
use crate::on_the_fly::program::Kind;
use terrace_core::diag::{Diag, Error};
use terrace_core::format::Format;
use terrace_core::geom::Nm;
use terrace_core::machine::{LoadingWay, Machine};
use terrace_core::program::{BlockFigures, BlockId, Program};

/// What the writers of a stepped job are given.
#[derive(Clone, Copy)]
pub struct Stepped<'a> {
    /// The program.
    pub checked: &'a Checked,
    /// The machine of the job.
    pub machine: &'a Machine,
    /// The figures of every block; none where the strokes are frames.
    pub figures: &'a [BlockFigures],
    /// Name of the job file.
    pub job: &'a str,
    /// Name of the surface file.
    pub part: &'a str,
    /// Ending of the files of single blocks, which stage programs name; None where there are none.
    pub block_file: Option<&'static str>,
    /// Where the strokes are frames: commanded x and y of the registration points of every set-up.
    pub frames: Option<&'a [Vec<[Nm; 2]>]>,
}

impl Stepped<'_> {
    /// The file of a block that stage programs name.
    pub(super) fn file_of(&self, block: BlockId) -> Option<String> {
        let name = if self.frames.is_some() { frames::of_block } else { Program::block_file };
        self.block_file.map(|ending| name(block, ending))
    }
}

/// The files of a stepped job.
#[derive(Clone, Copy)]
pub enum Files {
    /// One for the whole job: its name and its writer.
    Whole(&'static str, fn(&Stepped<'_>) -> Vec<u8>),
    /// One for every block: their ending and their writer.
    Blocks(&'static str, fn(&Stepped<'_>, usize) -> Vec<u8>),
}

impl Files {
    /// The name of the files in messages: of files of single blocks by their ending.
    pub fn shown(self) -> String {
        match self {
            Self::Whole(name, _) => name.to_owned(),
            Self::Blocks(ending, _) => format!("blocks/*.{ending}"),
        }
    }
}

/// The file of an on-the-fly job.
#[derive(Clone, Copy)]
pub struct FlyFile {
    /// The name of the file.
    pub name: &'static str,
    /// The machines that it can be written for.
    pub kinds: &'static [Kind],
    /// What writes the file.
    pub write: fn(&FlyChecked, &Machine) -> Vec<u8>,
    /// Usual servo period of its controller, s.
    pub servo_s: f64,
}

/// One target.
pub struct Target {
    /// Which.
    pub format: Format,
    /// What it writes of a stepped job; None where it cannot.
    pub stepped: Option<Files>,
    /// What it writes of an on-the-fly job; None where it cannot.
    pub on_the_fly: Option<FlyFile>,
    /// What keeps a stepped job from being written in it, as far as that is known before the job is planned.
    pub known_faults: fn(&JobPens<'_>) -> Vec<KnownFault>,
    /// What else keeps a program of a stepped job from being written in it on a machine.
    pub faults: fn(&Program, &Machine) -> Vec<Diag>,
    /// Whether a file of a stepped job says which pen each stroke is marked with.
    pub carries_pens: bool,
    /// Whether it also says speed, power, frequency and passes of that pen.
    pub carries_settings: bool,
    /// Whether a file of a stepped job sets the zoom optic for each block.
    pub carries_focus_shift: bool,
    /// Ways of loading the blocks of a stepped job that use its files.
    pub ways: &'static [LoadingWay],
    /// Whether it is a program for the control of the stage.
    pub moves_stage: bool,
    /// Lines of the run sheet that say how its files are used.
    pub sheet: &'static [&'static str],
}

/// The ways that use files of single blocks.
pub(super) const OF_BLOCKS: &[LoadingWay] = &[LoadingWay::Run, LoadingWay::Card, LoadingWay::Person];

impl Target {
    /// The row of a format.
    pub fn of(format: Format) -> &'static Self {
        TARGETS.iter().find(|t| t.format == format).expect("every format has a row, as a test holds")
    }

    /// The target's name in job files and messages.
    pub fn name(&self) -> &'static str {
        self.format.name()
    }
}

/// Holds a program against what its formats can carry.
///
/// # Errors
/// What a controller would clip, drop or truncate, by format.
pub fn faults(formats: &[Format], program: &Program, machine: &Machine) -> Result<(), Error> {
    let pens = JobPens::of_program(program, machine);
    let mut faults = Vec::new();
    for target in formats.iter().map(|&format| Target::of(format)) {
        faults.extend((target.known_faults)(&pens).into_iter().map(|(_, fault)| fault));
        faults.extend((target.faults)(program, machine));
    }
    if faults.is_empty() { Ok(()) } else { Err(Error::many(faults)) }
}

/// What is refused of a job before it is planned, by format.
pub fn known_faults(formats: &[Format], pens: &JobPens<'_>) -> Vec<(Format, KnownFault)> {
    formats.iter().flat_map(|&f| (Target::of(f).known_faults)(pens).into_iter().map(move |fault| (f, fault))).collect()
}

/// Formats that take every job, as far as it is known before it is planned.
pub(super) fn no_known_faults(_: &JobPens<'_>) -> Vec<KnownFault> {
    Vec::new()
}

/// Formats that take every program that the check takes.
pub(super) fn no_faults(_: &Program, _: &Machine) -> Vec<Diag> {
    Vec::new()
}

/// The ending of the files of single blocks among what `formats` write, the first where there are several.
pub fn block_file(formats: &[Format]) -> Option<&'static str> {
    formats.iter().find_map(|&f| match Target::of(f).stepped {
        Some(Files::Blocks(ending, _)) => Some(ending),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_have_a_target_in_their_order_and_it_writes_the_jobs_that_they_can_hold() {
        let of_targets: Vec<Format> = TARGETS.iter().map(|t| t.format).collect();
        assert_eq!(of_targets, Format::all().collect::<Vec<_>>());
        for target in &TARGETS {
            let writes = (target.stepped.is_some(), target.on_the_fly.is_some());
            assert_eq!(writes, (target.format.is_stepped(), target.format.is_on_the_fly()), "{}", target.name());
        }
    }

    #[test]
    fn no_two_targets_write_the_same_file() {
        let whole = |t: &Target| match t.stepped {
            Some(Files::Whole(name, _) | Files::Blocks(name, _)) => Some(name),
            None => None,
        };
        let mut names: Vec<&str> =
            TARGETS.iter().flat_map(|t| [whole(t), t.on_the_fly.map(|f| f.name)]).flatten().collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}

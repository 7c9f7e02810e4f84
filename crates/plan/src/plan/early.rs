//! What of a job is refused from its own file and the machine file, before any other file is read.
//!
//! All faults are found together, each at its key. The steps of the plan look for the same again where they know more.

use super::candidates::methods;
use super::fly_formats;
use super::frames;
use super::grid;
use crate::check::pen_faults;
use crate::emit::{self, JobPens, Key};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::format::Format;
use terrace_core::machine::Machine;
use terrace_core::program::PenId;
use terrace_input::job::{Job, Mode};
use terrace_input::texture::Request;

/// Pens that the machine cannot give, which no use of a job goes without.
pub(super) fn pens(job: &Job, machine: &Machine) -> Vec<Diag> {
    pen_faults(&job.pens, machine).into_iter().map(|(key, fault)| fault.at(job.place_of(&key))).collect()
}

/// What keeps a job from being planned and written.
pub(super) fn faults(job: &Job, machine: &Machine) -> Vec<Diag> {
    let mut faults = pens(job, machine);
    let dots = job.textures.iter().position(|texture| texture.kind.is_of_dots());
    match job.mode {
        Mode::Stepped => {
            let without_dwell = |(i, texture): (usize, &Request)| {
                let pen = &job.pens[texture.pen.index()];
                (texture.kind.is_of_dots() && texture.kind.is_pattern() && pen.dwell.is_none())
                    .then(|| no_dwell(job, texture.pen, i + 1))
            };
            faults.extend(job.textures.iter().enumerate().find_map(without_dwell));
            faults.extend(formats(job, machine, dots.is_some()));
            faults.extend(frames(job, machine));
            faults.extend(diags(grid::check(job, machine)));
            faults.extend(diags(methods(job, machine).map(drop)));
        }
        Mode::OnTheFly => {
            faults.extend(dots.map(|i| no_dots().at(job.place_of(&format!("texture.{i}")))));
            faults.extend(diags(fly_formats::unwritten(job, machine).map(drop)));
        }
    }
    faults
}

/// What the formats of a stepped job cannot carry of it; `has_dots` where a texture is known to have dots.
pub(super) fn formats(job: &Job, machine: &Machine, has_dots: bool) -> Vec<Diag> {
    // Only a pattern is known to be marked with the pen of its texture.
    let patterns = job.textures.iter().filter(|texture| texture.kind.is_pattern());
    let last_pen = patterns.map(|texture| texture.pen.index() + 1).max().unwrap_or(0);
    let pens = JobPens { pens: &job.pens, machine, has_dots, last_pen };
    let faults = emit::known_faults(&job.formats, &pens).into_iter();
    let mut faults: Vec<Diag> =
        faults.map(|(format, (key, fault))| fault.at(place_of_key(job, format, &key))).collect();
    // Two cards may say the same of a pen.
    faults.dedup();
    faults
}

/// Where the key stands whose value a format cannot carry.
fn place_of_key(job: &Job, format: Format, key: &Key) -> Place {
    match *key {
        Key::Format => job.place_of(&format!("emit.formats.{}", format.name())),
        Key::Pen(i, key) => job.place_of(&format!("pen.{i}.{key}")),
        Key::Machine(key) => job.place_in_machine(key),
    }
}

/// Frames that would mark as the patterns do. With dose compensation, which pens mark is known later.
fn frames(job: &Job, machine: &Machine) -> Option<Diag> {
    let pen = job.frames.filter(|_| job.dose.is_none())?;
    let patterns = job.textures.iter().filter(|texture| texture.kind.is_pattern());
    frames::too_strong(job, machine, &job.pens, pen, patterns.map(|texture| texture.pen.index()))
}

/// What a step of the plan refuses.
fn diags(result: Result<(), Error>) -> Vec<Diag> {
    result.err().map_or_else(Vec::new, |e| e.diags().to_vec())
}

/// What is said of texture `number`, from 1, whose dots are marked with a pen without dwell.
pub(super) fn no_dwell(job: &Job, pen: PenId, number: usize) -> Diag {
    let text = format!("texture {number} has dots, and their pen {:?} has no dwell", job.pens[pen.index()].name);
    let hint = "add dwell = \"100 us\" or pulses = 10 to the pen; leave out points of a drawing with `except`";
    Diag::input("pen-dwell", text).at(job.place_of(&format!("pen.{}", pen.index()))).hint(hint)
}

/// What is said of dots.
pub(super) fn no_dots() -> Diag {
    let text = "on-the-fly programs cannot mark dots: the beam would have to stand still";
    Diag::limit("fly-job", text).hint("compile a stepped job")
}

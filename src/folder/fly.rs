//! The folder of an on-the-fly job: its programs and its manifest.

use std::fs;
use std::path::Path;

use super::{MANIFEST, exchange, failed, inputs, job_file_from, put};
use crate::diag::{Diag, Error, Place};
use crate::emit::fly as emit;
use crate::fly::check::{Checked, Turning};
use crate::fly::program::Kind;
use crate::machine::Machine;
use crate::record::{Deviations, FlyFacts, fly_manifest, fly_summary};
use crate::spec::{Direction, Job};

/// An on-the-fly job that was planned and checked, not yet written.
#[derive(Clone, Debug)]
pub struct FlyPlan {
    /// The job.
    pub job: Job,
    /// Its machine.
    pub machine: Machine,
    /// The program.
    pub checked: Checked,
    /// Limits of A and C that it was checked against.
    pub turning: [Option<Turning>; 2],
    /// How far marks lie from the best, as planned.
    pub deviations: Deviations,
    /// What the user should know.
    pub warnings: Vec<Diag>,
}

impl FlyPlan {
    fn facts(&self) -> FlyFacts<'_> {
        let figures = self.checked.figures();
        FlyFacts {
            job_file: String::new(),
            job_blake3: blake3::hash(self.job.source.as_bytes()).to_hex().to_string(),
            inputs: Vec::new(),
            seed: self.job.seed,
            job: &self.job,
            machine: &self.machine,
            checked: &self.checked,
            turning: self.turning,
            deviations: self.deviations,
            warnings: &self.warnings,
            blend_mm: emit::blend_us(figures) as f64 * 1e-6 * figures.corner_mm_s / 8.0,
            files: &[],
        }
    }

    /// The figures, as the manifest has them and `compile --json` prints them.
    pub fn summary(&self) -> serde_json::Value {
        fly_summary(&self.facts())
    }
}

/// Whether a job asks for nothing that on-the-fly programs cannot do; to be asked before it is planned.
///
/// # Errors
/// `fly-job` with what is asked for.
pub fn marks_on_the_fly(job: &Job) -> Result<(), Error> {
    let file = &job.file;
    let asked = [
        (file.passes.count() > 1, "several passes (passes.count)"),
        (file.setups.is_some(), "set-ups ([setups])"),
        (file.dose.is_some(), "pens that make up for the slope ([dose])"),
        (file.pen.iter().any(|p| p.passes > 1), "pens of several passes (pen.passes)"),
        (
            file.texture.iter().any(|t| matches!(t.direction, Some(Direction::Contour))),
            "areas filled along contours (direction = \"contour\")",
        ),
    ];
    let faults = asked.into_iter().filter(|a| a.0).map(|(_, what)| {
        Diag::limit("fly-job", format!("on-the-fly programs cannot do {what}"))
            .at(Place::file(job.path.display().to_string()))
            .hint("leave it out, or compile a stepped job")
    });
    let faults: Vec<Diag> = faults.collect();
    if faults.is_empty() { Ok(()) } else { Err(Error::many(faults)) }
}

/// Writes the folder of an on-the-fly plan and puts it in the place of `target`, whole or not at all.
///
/// # Errors
/// As [`super::write`]; `fly-job` where the job asks for what on-the-fly programs cannot do.
pub fn write_fly(plan: &FlyPlan, target: &Path, seed: u64) -> Result<(), Error> {
    marks_on_the_fly(&plan.job)?;
    exchange(&plan.job, target, &|new, path| fill(plan, new, path, seed))
}

fn fill(plan: &FlyPlan, folder: &Path, target: &Path, seed: u64) -> Result<(), Error> {
    fs::create_dir(folder).map_err(|e| failed("make the folder", folder, &e))?;
    let FlyPlan { job, machine, checked, .. } = plan;
    let mut files = Vec::new();
    if checked.program().kind == Kind::Xyzuv {
        files.push(put(folder, "fly.ngc", &emit::linuxcnc(checked, machine))?);
    }
    files.push(put(folder, "fly.pmc", &emit::pmac(checked, machine))?);
    let facts = FlyFacts {
        job_file: job_file_from(&job.path, target)?,
        inputs: inputs(job)?,
        seed,
        files: &files,
        ..plan.facts()
    };
    put(folder, MANIFEST, &fly_manifest(&facts))?;
    Ok(())
}

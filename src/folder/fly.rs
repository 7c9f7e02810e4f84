//! The folder of an on-the-fly job: its programs and its manifest.

use std::fs;
use std::path::Path;

use super::{MANIFEST, exchange, failed, inputs, job_file_from, put};
use crate::compile::FlyPlan;
use crate::diag::Error;
use crate::emit::fly as emit;
use crate::fly::program::Kind;
use crate::record::{FlyFacts, fly_manifest, fly_summary};

fn facts(plan: &FlyPlan) -> FlyFacts<'_> {
    let figures = plan.checked.figures();
    FlyFacts {
        job_file: String::new(),
        job_blake3: blake3::hash(plan.job.source.as_bytes()).to_hex().to_string(),
        inputs: Vec::new(),
        seed: plan.job.seed,
        job: &plan.job,
        machine: &plan.machine,
        checked: &plan.checked,
        deviations: plan.deviations,
        warnings: &plan.warnings,
        blend_mm: emit::blend_us(figures) as f64 * 1e-6 * figures.corner_mm_s / 8.0,
        files: &[],
    }
}

/// The figures of a plan, as the manifest has them and `compile --json` prints them.
pub fn summary_of_fly(plan: &FlyPlan) -> serde_json::Value {
    fly_summary(&facts(plan))
}

/// Writes the folder of an on-the-fly plan and puts it in the place of `target`, whole or not at all.
///
/// # Errors
/// As [`super::write`].
pub fn write_fly(plan: &FlyPlan, target: &Path, seed: u64) -> Result<(), Error> {
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
        ..facts(plan)
    };
    put(folder, MANIFEST, &fly_manifest(&facts))?;
    Ok(())
}

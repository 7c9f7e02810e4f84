//! The manifest and the figures of an on-the-fly job.

use serde::Serialize;
use serde_json::{Value, json};

use super::{FileFact, InputFact};
use crate::diag::Diag;
use crate::fly::check::{Checked, Figures, SERVO_S};
use crate::fly::measure::Peaks;
use crate::geom::mm_from_nm;
use crate::machine::Machine;
use crate::program::Pen;
use crate::spec::Job;

/// Version of the manifest's keys.
const SCHEMA: u32 = 1;

/// How far marks lie from what their beam would like best, as planned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Deviations {
    /// Largest distance of a mark from the focal plane along the beam, um.
    pub worst_fod_um: f64,
    /// Largest angle between the beam and the surface's normal, degrees.
    pub worst_bia_deg: f64,
}

/// Everything that the manifest tells.
#[derive(Clone)]
pub struct FlyFacts<'a> {
    /// Path from the job folder to the job file.
    pub job_file: String,
    /// BLAKE3 of the job file, hex.
    pub job_blake3: String,
    /// The other input files.
    pub inputs: Vec<InputFact>,
    /// Seed of everything random.
    pub seed: u64,
    /// The job.
    pub job: &'a Job,
    /// Its machine.
    pub machine: &'a Machine,
    /// Its program.
    pub checked: &'a Checked,
    /// As planned.
    pub deviations: Deviations,
    /// What the user should know.
    pub warnings: &'a [Diag],
    /// How far blending rounds a corner of a mark, mm: by the program for PMAC.
    pub blend_mm: f64,
    /// The files of the folder but the manifest.
    pub files: &'a [FileFact],
}

/// The manifest: JSON, a line feed at the end.
pub fn fly_manifest(facts: &FlyFacts<'_>) -> Vec<u8> {
    let program = facts.checked.program();
    let document = json!({
        "schema": SCHEMA,
        "terrace": env!("CARGO_PKG_VERSION"),
        "mode": "on-the-fly",
        "job": { "file": facts.job_file, "blake3": facts.job_blake3 },
        "inputs": facts.inputs,
        "seed": facts.seed,
        "machine": facts.machine,
        "placement": {
            "origin_mm": program.origin.map(mm_from_nm),
            "turn_deg": facts.job.file.placement.turn.as_deg(),
        },
        "axes": program.kind.letters(),
        "limits": {
            "fod_um": facts.job.depth_range().as_mm() * 500.0,
            "bia_deg": facts.job.file.limits.max_incidence.as_deg(),
        },
        "pens": program.pens.iter().map(|p| pen(p, facts.machine)).collect::<Vec<_>>(),
        "files": facts.files,
        "summary": fly_summary(facts),
    });
    let mut out = serde_json::to_vec_pretty(&document).expect("all keys are text");
    out.push(b'\n');
    out
}

/// The figures of an on-the-fly job; keys are a promise, units are in the suffix.
pub fn fly_summary(facts: &FlyFacts<'_>) -> Value {
    let Figures { time_s, mark_s, marks, mark_mm, jump_mm, mark_speed, displacement_mm, laser_error_mm, peaks, .. } =
        facts.checked.figures();
    let program = facts.checked.program();
    let axes: serde_json::Map<String, Value> = program
        .kind
        .axes()
        .iter()
        .zip(program.kind.letters().chars())
        .map(|(&k, letter)| (letter.to_string(), axis(&peaks[k])))
        .collect();
    json!({
        "moves": program.moves.len(),
        "marks": marks,
        "time_s": time_s,
        "mark_s": mark_s,
        "mark_mm": mark_mm,
        "jump_mm": jump_mm,
        "worst_fod_um": facts.deviations.worst_fod_um,
        "worst_bia_deg": facts.deviations.worst_bia_deg,
        "worst_displacement_mm": displacement_mm,
        "mark_speed_mm_s": mark_speed,
        "servo_period_s": SERVO_S,
        "laser_error_mm": laser_error_mm,
        "blend_mm": facts.blend_mm,
        "peaks": axes,
        "warnings": facts.warnings.iter().map(Diag::to_json).collect::<Vec<_>>(),
    })
}

fn axis(p: &Peaks) -> Value {
    json!({ "speed": p.speed.size, "acceleration": p.acceleration.size, "jerk": p.jerk.size })
}

fn pen(pen: &Pen, machine: &Machine) -> Value {
    let full = machine.laser.max_power;
    json!({
        "name": pen.name, "speed_mm_s": pen.speed.as_mm_s(), "power": pen.power.to_string(),
        "power_percent": pen.power.as_w(full) / full.as_w() * 100.0, "frequency_khz": pen.frequency.as_khz(),
    })
}

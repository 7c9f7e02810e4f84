//! Reader of the `manifest.json` of an on-the-fly job: only what verification needs.

use serde::Deserialize;

use crate::machine::Machine;
use crate::verify::read::manifest::{Curves, FileEntry, InputEntry, JobRef, Placement};

/// The manifest of an on-the-fly job.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Manifest {
    pub(in crate::verify) job: JobRef,
    pub(in crate::verify) inputs: Vec<InputEntry>,
    pub(in crate::verify) machine: Machine,
    pub(in crate::verify) placement: Placement,
    /// XYZUV or XYZACUV.
    pub(in crate::verify) axes: String,
    pub(in crate::verify) limits: Limits,
    pub(in crate::verify) pens: Vec<PenEntry>,
    pub(in crate::verify) left_out: Vec<LeftOut>,
    pub(in crate::verify) files: Vec<FileEntry>,
    pub(in crate::verify) summary: Summary,
}

/// A stretch of a stroke of the texture that the program says it leaves out: lengths along it as it is drawn.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(in crate::verify) struct LeftOut {
    pub(in crate::verify) stroke: u32,
    pub(in crate::verify) from_mm: f64,
    pub(in crate::verify) to_mm: f64,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct PenEntry {
    pub(in crate::verify) name: String,
    pub(in crate::verify) speed_mm_s: f64,
    /// As the job file has it, percent or watts.
    pub(in crate::verify) power: String,
    pub(in crate::verify) power_percent: f64,
    pub(in crate::verify) frequency_khz: f64,
}

/// What the job allows.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Limits {
    pub(in crate::verify) pdof_mm: f64,
    pub(in crate::verify) reserve_mm: f64,
    pub(in crate::verify) fod_um: f64,
    pub(in crate::verify) bia_deg: f64,
}

/// How early the laser of a program may be switched.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Laser {
    pub(in crate::verify) file: String,
    pub(in crate::verify) servo_period_s: f64,
    pub(in crate::verify) laser_error_mm: f64,
}

/// What the laser gives to each length of the marks.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct LineEnergy {
    pub(in crate::verify) mean_j_per_m: f64,
    pub(in crate::verify) length_at_speed_percent: f64,
    pub(in crate::verify) slow_s: f64,
    pub(in crate::verify) worst_share: f64,
}

/// The figures that verification finds again.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Summary {
    pub(in crate::verify) part_mm: [f64; 3],
    pub(in crate::verify) texture_mm: f64,
    pub(in crate::verify) skipped_mm: f64,
    pub(in crate::verify) skipped_focus_mm: f64,
    pub(in crate::verify) blend_mm: f64,
    pub(in crate::verify) moves: usize,
    pub(in crate::verify) marks: usize,
    pub(in crate::verify) time_s: f64,
    pub(in crate::verify) mark_s: f64,
    pub(in crate::verify) mark_mm: f64,
    pub(in crate::verify) worst_displacement_mm: f64,
    pub(in crate::verify) laser: Vec<Laser>,
    pub(in crate::verify) line_energy: LineEnergy,
    #[serde(default)]
    pub(in crate::verify) curves: Option<Curves>,
}

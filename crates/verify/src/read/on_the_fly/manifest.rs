//! Reader of the `manifest.json` of an on-the-fly job: only what verification needs.

use serde::Deserialize;

use crate::read::manifest::{Curves, FileEntry, InputEntry, JobRef, Placement};
use terrace_core::machine::Machine;

/// The manifest of an on-the-fly job.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Manifest {
    pub(crate) job: JobRef,
    pub(crate) inputs: Vec<InputEntry>,
    pub(crate) machine: Machine,
    pub(crate) placement: Placement,
    /// XYZUV or XYZACUV.
    pub(crate) axes: String,
    pub(crate) limits: Limits,
    pub(crate) pens: Vec<PenEntry>,
    pub(crate) left_out: Vec<LeftOut>,
    pub(crate) files: Vec<FileEntry>,
    pub(crate) summary: Summary,
}

/// A stretch of a stroke of the texture that the program says it leaves out: lengths along it as it is drawn.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct LeftOut {
    pub(crate) stroke: u32,
    pub(crate) from_mm: f64,
    pub(crate) to_mm: f64,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct PenEntry {
    pub(crate) name: String,
    pub(crate) speed_mm_s: f64,
    /// The power as the job file has it, percent or watts.
    pub(crate) power: String,
    pub(crate) power_percent: f64,
    pub(crate) frequency_khz: f64,
}

/// The limits of the job.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Limits {
    pub(crate) pdof_mm: f64,
    pub(crate) reserve_mm: f64,
    pub(crate) fod_um: f64,
    pub(crate) bia_deg: f64,
}

/// How early the laser of a program may be switched.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Laser {
    pub(crate) file: String,
    pub(crate) servo_period_s: f64,
    pub(crate) laser_error_mm: f64,
}

/// Line energy of the marks.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct LineEnergy {
    pub(crate) mean_j_per_m: f64,
    pub(crate) length_at_speed_percent: f64,
    pub(crate) slow_s: f64,
    pub(crate) worst_share: f64,
}

/// The figures that verification finds again.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Summary {
    pub(crate) part_mm: [f64; 3],
    pub(crate) texture_mm: f64,
    pub(crate) skipped_mm: f64,
    pub(crate) skipped_focus_mm: f64,
    pub(crate) blend_mm: f64,
    pub(crate) moves: usize,
    pub(crate) marks: usize,
    pub(crate) time_s: f64,
    pub(crate) mark_s: f64,
    pub(crate) mark_mm: f64,
    pub(crate) worst_displacement_mm: f64,
    pub(crate) laser: Vec<Laser>,
    pub(crate) line_energy: LineEnergy,
    #[serde(default)]
    pub(crate) curves: Option<Curves>,
}

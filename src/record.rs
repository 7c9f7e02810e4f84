//! What is written down about a job: summary, manifest, run sheet.

use serde::Serialize;

/// Parts of the job time, s. They sum to the total.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Stage moves.
    pub stage: f64,
    /// Settling after them.
    pub settle: f64,
    /// Marks.
    pub mark: f64,
    /// Jumps.
    pub jump: f64,
    /// Scanner and laser delays.
    pub delay: f64,
    /// The sum.
    pub total: f64,
}

/// One candidate of `auto`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// Method.
    pub method: String,
    /// Its stops.
    pub stops: usize,
    /// Its fragments.
    pub fragments: usize,
    /// Its job time.
    pub time_s: Times,
}

/// The figures of a job; the keys are a promise, units are in the suffix.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    pub stops: usize,
    pub sub_blocks: usize,
    pub method: String,
    pub lower_bound_stops: Option<usize>,
    pub texture_mm: f64,
    pub mark_mm: f64,
    pub overlap_mm: f64,
    pub skipped_mm: f64,
    pub skipped_off_part_mm: f64,
    pub skipped_hidden_mm: f64,
    pub skipped_steep_mm: f64,
    pub skipped_small_mm: f64,
    pub fragments: usize,
    pub strokes_cut: usize,
    pub figures_whole: usize,
    pub figures_cut: usize,
    pub seam_mm: f64,
    pub jump_mm: f64,
    pub worst_defocus_um: f64,
    pub worst_defocus_mean_um: f64,
    pub worst_incidence_deg: f64,
    pub time_s: Times,
    pub candidates: Vec<Candidate>,
    pub warnings: Vec<serde_json::Value>,
}

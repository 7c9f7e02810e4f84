//! Reader of `manifest.json`: what verification needs, in structs of its own; which other keys may stand there is
//! stated by `leaves`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::read::leaves::Leaves;
use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::machine::Machine;
use terrace_input::job::{DepthRule, Level, Mode};

/// Name of the manifest in a job folder.
pub(crate) const NAME: &str = "manifest.json";

/// Version of the keys that is known.
const SCHEMA: u32 = 4;

/// Largest manifest that is read: some 600 bytes for each of a million blocks.
const MAX_FILE: u64 = 1 << 30;

/// The manifest of a job folder.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Manifest {
    /// The job file, relative to the folder.
    pub(crate) job: JobRef,
    /// The files that the job reads, relative to the job file.
    pub(crate) inputs: Vec<InputEntry>,
    pub(crate) machine: Machine,
    pub(crate) placement: Placement,
    #[serde(default)]
    pub(crate) fixtures: Vec<FixtureEntry>,
    pub(crate) focus: Focus,
    pub(crate) seams: Seams,
    pub(crate) passes: Vec<PassEntry>,
    pub(crate) setups: Vec<SetupEntry>,
    pub(crate) pens: Vec<PenEntry>,
    pub(crate) blocks: Vec<BlockEntry>,
    /// The blocks whose files the folder holds, where these are not all.
    #[serde(default)]
    pub(crate) subset: Option<SubsetEntry>,
    #[serde(default)]
    pub(crate) frames: Option<FramesEntry>,
    /// Every file of the folder but the manifest itself.
    pub(crate) files: Vec<FileEntry>,
    pub(crate) summary: Summary,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct JobRef {
    pub(crate) file: String,
    pub(crate) blake3: String,
}

/// A file that the job reads.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct InputEntry {
    /// Its role.
    pub(crate) role: String,
    pub(crate) file: String,
    pub(crate) bytes: u64,
    pub(crate) blake3: String,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct FileEntry {
    pub(crate) file: String,
    pub(crate) bytes: u64,
    pub(crate) blake3: String,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Placement {
    pub(crate) origin_mm: [f64; 3],
    #[serde(default)]
    pub(crate) laid_deg: Option<[f64; 3]>,
    pub(crate) turn_deg: f64,
    #[serde(default)]
    pub(crate) measured: Option<MeasuredPlacement>,
}

/// A fixture.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct FixtureEntry {
    pub(crate) name: String,
    pub(crate) box_mm: [[f64; 3]; 2],
    #[serde(default)]
    pub(crate) setups: Vec<u32>,
}

/// How a measured part lies beside its placement.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct MeasuredPlacement {
    pub(crate) points: usize,
    pub(crate) off_part: usize,
    pub(crate) rows: [[f64; 3]; 3],
    pub(crate) rest_nm: [f64; 3],
    pub(crate) lean_deg: f64,
    pub(crate) worst_residual_um: f64,
    pub(crate) warp: Option<WarpPlacement>,
}

/// How it is warped.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct WarpPlacement {
    pub(crate) points: usize,
    pub(crate) lengths_mm: Vec<f64>,
    pub(crate) amplitudes_um: Vec<f64>,
    pub(crate) weights: Vec<f64>,
    pub(crate) factor: f64,
    pub(crate) grid_origin_nm: [i64; 2],
    pub(crate) grid_pitch_nm: i64,
    pub(crate) grid_cells: [u32; 2],
    pub(crate) height_um: [f64; 2],
    pub(crate) deviation_um: [f64; 2],
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Focus {
    pub(crate) pdof_mm: f64,
    pub(crate) reserve_mm: f64,
    pub(crate) depth_range_mm: f64,
    pub(crate) level: Level,
    pub(crate) rule: DepthRule,
}

/// The grid of sections, read for what is filled along contours.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Sections {
    pub(crate) origin_mm: [f64; 2],
    pub(crate) pitch_mm: [f64; 2],
    pub(crate) columns: u32,
    pub(crate) rows: u32,
    pub(crate) direction_deg: Vec<f64>,
}

/// How cuts between blocks are made.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Seams {
    pub(crate) zone_mm: f64,
    pub(crate) overlap_mm: f64,
}

/// One pass.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct PassEntry {
    pub(crate) turn_deg: f64,
    pub(crate) lowered_mm: f64,
    #[serde(default)]
    pub(crate) sections: Sections,
}

/// One set-up.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct SetupEntry {
    pub(crate) origin_mm: [f64; 3],
    pub(crate) registration: Vec<RegistrationEntry>,
}

/// A point of the part, and the x and y commanded to find it.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RegistrationEntry {
    pub(crate) point_mm: [f64; 2],
    pub(crate) stage: [f64; 2],
}

/// Some blocks of the job.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct SubsetEntry {
    /// Names of its blocks, in machining order.
    pub(crate) blocks: Vec<String>,
    pub(crate) stops: usize,
    pub(crate) mark_mm: f64,
    pub(crate) time_s: f64,
    pub(crate) total_s: f64,
}

/// The frames of the blocks.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct FramesEntry {
    /// Name of their pen.
    pub(crate) pen: String,
    /// Names of the blocks of the outline, in machining order.
    pub(crate) outline: Vec<String>,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct PenEntry {
    pub(crate) name: String,
    pub(crate) speed_mm_s: f64,
    /// The power as the job file has it, percent or watts.
    pub(crate) power: String,
    pub(crate) power_w: f64,
    pub(crate) frequency_khz: f64,
    pub(crate) passes: u32,
    #[serde(default)]
    pub(crate) dwell_us: Option<f64>,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct BlockEntry {
    pub(crate) id: String,
    pub(crate) pass: u32,
    pub(crate) setup: u32,
    pub(crate) section: [u32; 2],
    pub(crate) level: i32,
    pub(crate) centre_mm: [f64; 2],
    pub(crate) lpfl_mm: f64,
    pub(crate) focus_shift_mm: f64,
    /// Where the stage lifts to on its way here; null where it does not.
    #[serde(deserialize_with = "stated")]
    pub(crate) lift_z_mm: Option<f64>,
    pub(crate) stage: [f64; 3],
    pub(crate) tilt_deg: [f64; 2],
    pub(crate) z_lo_mm: f64,
    pub(crate) z_hi_mm: f64,
    /// Names of the pens that mark in it.
    pub(crate) pens: Vec<String>,
    /// The block's own files, by format.
    pub(crate) files: BTreeMap<String, String>,
    pub(crate) strokes: usize,
    pub(crate) mark_mm: f64,
    pub(crate) jump_mm: f64,
    pub(crate) time_s: f64,
    /// Mean and worst of the angle between beam and surface, of the stretch of the texture, and of the dose.
    pub(crate) incidence_deg: [f64; 2],
    pub(crate) stretch: [f64; 2],
    pub(crate) dose: [f64; 2],
}

/// A value or null, which has to be there.
fn stated<'a, D: serde::Deserializer<'a>>(value: D) -> Result<Option<f64>, D::Error> {
    Option::deserialize(value)
}

/// The figures that verification finds again on its own.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Summary {
    pub(crate) part_mm: [f64; 3],
    pub(crate) stops: usize,
    pub(crate) blocks: usize,
    pub(crate) passes: u32,
    #[serde(default)]
    pub(crate) method: String,
    pub(crate) setups: usize,
    pub(crate) fragments: usize,
    pub(crate) strokes_cut: usize,
    pub(crate) figures_whole: usize,
    pub(crate) figures_cut: usize,
    pub(crate) dots: Dots,
    pub(crate) texture_mm: f64,
    pub(crate) mark_mm: f64,
    pub(crate) overlap_mm: f64,
    pub(crate) skipped_mm: f64,
    pub(crate) skipped_off_part_mm: f64,
    pub(crate) skipped_steep_mm: f64,
    pub(crate) skipped_small_mm: f64,
    pub(crate) worst_defocus_um: f64,
    pub(crate) worst_incidence_deg: f64,
    pub(crate) off_axis_mm: OffAxis,
    pub(crate) jump_mm: f64,
    pub(crate) time_s: Times,
    pub(crate) loading: Loading,
    #[serde(default)]
    pub(crate) candidates: Vec<Candidate>,
    #[serde(default)]
    pub(crate) lower_bound_stops: Option<f64>,
    #[serde(default)]
    pub(crate) curves: Option<Curves>,
}

/// Distances of marks from the optical axis, mm.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct OffAxis {
    pub(crate) largest: f64,
    pub(crate) p95: f64,
}

/// The space curves against the surface.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Curves {
    pub(crate) count: usize,
    pub(crate) plan_mm: f64,
    pub(crate) surface_mm: f64,
    pub(crate) worst_distance_um: f64,
}

/// How many dots there are.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub(crate) struct Dots {
    pub(crate) texture: u64,
    pub(crate) marked: u64,
    pub(crate) off_part: u64,
    pub(crate) steep: u64,
}

/// Who loads the blocks, and the job's time with it.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Loading {
    pub(crate) way: String,
    pub(crate) assumed: bool,
    pub(crate) load_s: f64,
    pub(crate) load_assumed: bool,
    pub(crate) total_s: f64,
}

/// A candidate of `auto`, of which only the one that was taken can be timed again.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Candidate {
    pub(crate) method: String,
    pub(crate) total_s: f64,
}

/// Estimated times, s.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Times {
    pub(crate) stage: f64,
    pub(crate) settle: f64,
    pub(crate) zoom: f64,
    pub(crate) mark: f64,
    pub(crate) jump: f64,
    pub(crate) delay: f64,
    pub(crate) total: f64,
}

/// The files that a manifest of either mode lists.
pub(crate) struct Listed<'a> {
    pub(crate) job: &'a JobRef,
    pub(crate) inputs: &'a [InputEntry],
    pub(crate) files: &'a [FileEntry],
}

impl Manifest {
    /// The files that it lists.
    pub(crate) fn listed(&self) -> Listed<'_> {
        Listed { job: &self.job, inputs: &self.inputs, files: &self.files }
    }
}

/// The keys by which every manifest is known.
#[derive(Deserialize)]
struct Head {
    schema: u32,
    mode: Mode,
}

/// Whether the folder holds an on-the-fly job.
pub(crate) fn is_on_the_fly(folder: &Path) -> bool {
    let bytes = diag::read_file(&folder.join(NAME), MAX_FILE).ok();
    let head = bytes.and_then(|b| serde_json::from_slice::<Head>(&b).ok());
    head.is_some_and(|h| h.mode == Mode::OnTheFly)
}

/// Reads the manifest of the job folder, of either mode.
///
/// # Errors
/// `job-folder` where there is none, `manifest` where it is not a manifest of a known version.
pub(crate) fn read<M: DeserializeOwned>(folder: &Path, leaves: &Leaves) -> Result<M, Error> {
    let path = folder.join(NAME);
    if !path.is_file() {
        let text = match folder.try_exists() {
            Ok(false) => "there is no such folder".to_owned(),
            _ => format!("the folder holds no {NAME}"),
        };
        return Err(Diag::input("job-folder", text)
            .at(Place::file(folder.display().to_string()))
            .hint("name a job folder as `terrace compile` writes it")
            .into());
    }
    let bytes = diag::read_file(&path, MAX_FILE)?;
    let broken = |message: String| {
        Diag::input("manifest", message)
            .at(Place::file(path.display().to_string()))
            .hint("the folder is damaged or of another version: compile it again")
    };
    let unreadable = |e: serde_json::Error| broken(format!("the manifest cannot be read: {e}"));
    let head: Head = serde_json::from_slice(&bytes).map_err(unreadable)?;
    if head.schema != SCHEMA {
        return Err(broken(format!("the manifest has schema {}, expected {SCHEMA}", head.schema)).into());
    }
    if let Some(unknown) = leaves.unknown(&bytes).map_err(unreadable)? {
        return Err(broken(format!("the manifest holds {unknown}, which is not a key of a manifest")).into());
    }
    Ok(serde_json::from_slice(&bytes).map_err(unreadable)?)
}

//! Reader of `manifest.json`: what verification needs, in structs of its own; which other keys may stand there is told by
//! `leaves`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::diag::{self, Diag, Error, Place};
use crate::job::{DepthRule, Level, Mode};
use crate::machine::Machine;
use crate::verify::read::leaves::Leaves;

/// Name of the manifest in a job folder.
pub(in crate::verify) const NAME: &str = "manifest.json";

/// Version of the keys that is known.
const SCHEMA: u32 = 4;

/// Largest manifest that is read: some 600 bytes for each of a million blocks.
const MAX_FILE: u64 = 1 << 30;

/// The manifest of a job folder.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Manifest {
    /// The job file, relative to the folder.
    pub(in crate::verify) job: JobRef,
    /// What the job reads, relative to the job file.
    pub(in crate::verify) inputs: Vec<InputEntry>,
    pub(in crate::verify) machine: Machine,
    pub(in crate::verify) placement: Placement,
    pub(in crate::verify) focus: Focus,
    pub(in crate::verify) seams: Seams,
    pub(in crate::verify) passes: Vec<PassEntry>,
    pub(in crate::verify) setups: Vec<SetupEntry>,
    pub(in crate::verify) pens: Vec<PenEntry>,
    pub(in crate::verify) blocks: Vec<BlockEntry>,
    /// The blocks whose files the folder holds, where these are not all.
    #[serde(default)]
    pub(in crate::verify) subset: Option<SubsetEntry>,
    #[serde(default)]
    pub(in crate::verify) frames: Option<FramesEntry>,
    /// Every file of the folder but the manifest itself.
    pub(in crate::verify) files: Vec<FileEntry>,
    pub(in crate::verify) summary: Summary,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct JobRef {
    pub(in crate::verify) file: String,
    pub(in crate::verify) blake3: String,
}

/// A file that the job reads.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct InputEntry {
    /// What it is for.
    pub(in crate::verify) role: String,
    pub(in crate::verify) file: String,
    pub(in crate::verify) bytes: u64,
    pub(in crate::verify) blake3: String,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct FileEntry {
    pub(in crate::verify) file: String,
    pub(in crate::verify) bytes: u64,
    pub(in crate::verify) blake3: String,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Placement {
    pub(in crate::verify) origin_mm: [f64; 3],
    #[serde(default)]
    pub(in crate::verify) laid_deg: Option<[f64; 3]>,
    pub(in crate::verify) turn_deg: f64,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Focus {
    pub(in crate::verify) pdof_mm: f64,
    pub(in crate::verify) reserve_mm: f64,
    pub(in crate::verify) depth_range_mm: f64,
    pub(in crate::verify) level: Level,
    pub(in crate::verify) rule: DepthRule,
}

/// The grid of sections, read for what is filled along contours.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(in crate::verify) struct Sections {
    pub(in crate::verify) origin_mm: [f64; 2],
    pub(in crate::verify) pitch_mm: [f64; 2],
    pub(in crate::verify) columns: u32,
    pub(in crate::verify) rows: u32,
    pub(in crate::verify) direction_deg: Vec<f64>,
}

/// How cuts between blocks are made.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Seams {
    pub(in crate::verify) zone_mm: f64,
    pub(in crate::verify) overlap_mm: f64,
}

/// One pass.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct PassEntry {
    pub(in crate::verify) turn_deg: f64,
    pub(in crate::verify) lowered_mm: f64,
    #[serde(default)]
    pub(in crate::verify) sections: Sections,
}

/// One set-up.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct SetupEntry {
    pub(in crate::verify) origin_mm: [f64; 3],
    pub(in crate::verify) registration: Vec<RegistrationEntry>,
}

/// A point of the part, and the x and y commanded to find it.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct RegistrationEntry {
    pub(in crate::verify) point_mm: [f64; 2],
    pub(in crate::verify) stage: [f64; 2],
}

/// Some blocks of the job.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct SubsetEntry {
    /// Names of its blocks, in machining order.
    pub(in crate::verify) blocks: Vec<String>,
    pub(in crate::verify) stops: usize,
    pub(in crate::verify) mark_mm: f64,
    pub(in crate::verify) time_s: f64,
    pub(in crate::verify) total_s: f64,
}

/// The frames of the blocks.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct FramesEntry {
    /// Name of their pen.
    pub(in crate::verify) pen: String,
    /// Names of the blocks of the outline, in machining order.
    pub(in crate::verify) outline: Vec<String>,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct PenEntry {
    pub(in crate::verify) name: String,
    pub(in crate::verify) speed_mm_s: f64,
    /// As the job file has it, percent or watts.
    pub(in crate::verify) power: String,
    pub(in crate::verify) power_w: f64,
    pub(in crate::verify) frequency_khz: f64,
    pub(in crate::verify) passes: u32,
    #[serde(default)]
    pub(in crate::verify) dwell_us: Option<f64>,
}

#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct BlockEntry {
    pub(in crate::verify) id: String,
    pub(in crate::verify) pass: u32,
    pub(in crate::verify) setup: u32,
    pub(in crate::verify) section: [u32; 2],
    pub(in crate::verify) level: i32,
    pub(in crate::verify) centre_mm: [f64; 2],
    pub(in crate::verify) lpfl_mm: f64,
    pub(in crate::verify) focus_shift_mm: f64,
    /// Where the stage lifts to on its way here; null where it does not.
    #[serde(deserialize_with = "stated")]
    pub(in crate::verify) lift_z_mm: Option<f64>,
    pub(in crate::verify) stage: [f64; 3],
    pub(in crate::verify) tilt_deg: [f64; 2],
    pub(in crate::verify) z_lo_mm: f64,
    pub(in crate::verify) z_hi_mm: f64,
    /// Names of the pens that mark in it.
    pub(in crate::verify) pens: Vec<String>,
    /// Its own files, by format.
    pub(in crate::verify) files: BTreeMap<String, String>,
    pub(in crate::verify) strokes: usize,
    pub(in crate::verify) mark_mm: f64,
    pub(in crate::verify) jump_mm: f64,
    pub(in crate::verify) time_s: f64,
    /// Mean and worst of the angle between beam and surface, of the stretch of the texture, and of the dose.
    pub(in crate::verify) incidence_deg: [f64; 2],
    pub(in crate::verify) stretch: [f64; 2],
    pub(in crate::verify) dose: [f64; 2],
}

/// A value or null, which has to be there.
fn stated<'a, D: serde::Deserializer<'a>>(value: D) -> Result<Option<f64>, D::Error> {
    Option::deserialize(value)
}

/// The figures that verification finds again on its own.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Summary {
    pub(in crate::verify) part_mm: [f64; 3],
    pub(in crate::verify) stops: usize,
    pub(in crate::verify) blocks: usize,
    pub(in crate::verify) passes: u32,
    #[serde(default)]
    pub(in crate::verify) method: String,
    pub(in crate::verify) setups: usize,
    pub(in crate::verify) fragments: usize,
    pub(in crate::verify) strokes_cut: usize,
    pub(in crate::verify) figures_whole: usize,
    pub(in crate::verify) figures_cut: usize,
    pub(in crate::verify) dots: Dots,
    pub(in crate::verify) texture_mm: f64,
    pub(in crate::verify) mark_mm: f64,
    pub(in crate::verify) overlap_mm: f64,
    pub(in crate::verify) skipped_mm: f64,
    pub(in crate::verify) skipped_off_part_mm: f64,
    pub(in crate::verify) skipped_steep_mm: f64,
    pub(in crate::verify) skipped_small_mm: f64,
    pub(in crate::verify) worst_defocus_um: f64,
    pub(in crate::verify) worst_incidence_deg: f64,
    pub(in crate::verify) off_axis_mm: OffAxis,
    pub(in crate::verify) jump_mm: f64,
    pub(in crate::verify) time_s: Times,
    pub(in crate::verify) loading: Loading,
    #[serde(default)]
    pub(in crate::verify) candidates: Vec<Candidate>,
    #[serde(default)]
    pub(in crate::verify) lower_bound_stops: Option<f64>,
    #[serde(default)]
    pub(in crate::verify) curves: Option<Curves>,
}

/// Distances of marks from the optical axis, mm.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(in crate::verify) struct OffAxis {
    pub(in crate::verify) largest: f64,
    pub(in crate::verify) p95: f64,
}

/// The space curves against the surface.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Curves {
    pub(in crate::verify) count: usize,
    pub(in crate::verify) plan_mm: f64,
    pub(in crate::verify) surface_mm: f64,
    pub(in crate::verify) worst_distance_um: f64,
}

/// How many dots there are.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub(in crate::verify) struct Dots {
    pub(in crate::verify) texture: u64,
    pub(in crate::verify) marked: u64,
    pub(in crate::verify) off_part: u64,
    pub(in crate::verify) steep: u64,
}

/// Who loads the blocks, and the job's time with it.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Loading {
    pub(in crate::verify) way: String,
    pub(in crate::verify) assumed: bool,
    pub(in crate::verify) load_s: f64,
    pub(in crate::verify) load_assumed: bool,
    pub(in crate::verify) total_s: f64,
}

/// A candidate of `auto`, of which only the one that was taken can be timed again.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Candidate {
    pub(in crate::verify) method: String,
    pub(in crate::verify) total_s: f64,
}

/// Estimated times, s.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::verify) struct Times {
    pub(in crate::verify) stage: f64,
    pub(in crate::verify) settle: f64,
    pub(in crate::verify) zoom: f64,
    pub(in crate::verify) mark: f64,
    pub(in crate::verify) jump: f64,
    pub(in crate::verify) delay: f64,
    pub(in crate::verify) total: f64,
}

/// What a manifest of either mode lists.
pub(in crate::verify) struct Listed<'a> {
    pub(in crate::verify) job: &'a JobRef,
    pub(in crate::verify) inputs: &'a [InputEntry],
    pub(in crate::verify) files: &'a [FileEntry],
}

impl Manifest {
    /// The files that it lists.
    pub(in crate::verify) fn listed(&self) -> Listed<'_> {
        Listed { job: &self.job, inputs: &self.inputs, files: &self.files }
    }
}

/// What every manifest tells first.
#[derive(Deserialize)]
struct Head {
    schema: u32,
    mode: Mode,
}

/// Whether the folder holds an on-the-fly job.
pub(in crate::verify) fn is_on_the_fly(folder: &Path) -> bool {
    let bytes = diag::read_file(&folder.join(NAME), MAX_FILE).ok();
    let head = bytes.and_then(|b| serde_json::from_slice::<Head>(&b).ok());
    head.is_some_and(|h| h.mode == Mode::OnTheFly)
}

/// Reads the manifest of the job folder, of either mode.
///
/// # Errors
/// `job-folder` where there is none, `manifest` where it is not a manifest of a known version.
pub(in crate::verify) fn read<M: DeserializeOwned>(folder: &Path, leaves: &Leaves) -> Result<M, Error> {
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
        return Err(broken(format!("the manifest holds {unknown}, which is no key of a manifest")).into());
    }
    Ok(serde_json::from_slice(&bytes).map_err(unreadable)?)
}

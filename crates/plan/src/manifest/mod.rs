//! Summary and manifest of a job, and the registration points of its set-ups.
//!
//! Consumes the checked program, its machine and job, and what the driver knows of times and files;
//! renders bytes. Lengths are mm (heights and positions exact to the nanometre), times s. Nothing here
//! depends on the clock, the computer or where the folder lies.

mod fixtures;
mod head;
mod load_time;
mod on_the_fly;
mod overview;
mod registration;
#[cfg(any(test, feature = "test-support"))]
pub mod sample;
mod stepped;
mod warnings;

pub use fixtures::FixtureEntry;
pub use head::{FileFact, Head, InputFact, JobRef, MANIFEST, with_file};
pub use head::{MAX_FILE, portable};
pub use load_time::Loading;
pub use on_the_fly::{
    AxisPeaks, Deviations, FlyAccuracy, FlyEnergy, FlyLengths, LaserSwitching, LeftOut, OnTheFlyFacts, OnTheFlySummary,
    on_the_fly_manifest,
};
pub use overview::{AnySummary, ManifestOverview, read};
pub use registration::{Registered, registered, registration};
pub use stepped::{BlockEntry, Manifest, MeasuredPlacement, RegistrationEntry, SetupEntry, manifest};
pub use warnings::warnings;

use serde::{Deserialize, Serialize};

use crate::budget::Budget;
use crate::check::Checked;
use crate::emit;
use crate::fixtures::Fixture;
use crate::measured::MeasuredPart;
use terrace_core::diag::Message;
use terrace_core::machine::Machine;
use terrace_core::program::{BlockFigures, OffAxis, Sections};
use terrace_input::job::Job;
use terrace_input::texture::Directions;

/// Parts of the job time, s. They sum to the total.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Stage moves.
    pub stage: f64,
    /// Settling after them.
    pub settle: f64,
    /// Moves of the zoom optic beyond those of the stage, settling included.
    pub zoom: f64,
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Method.
    pub method: String,
    /// Number of stops.
    pub stops: usize,
    /// Number of fragments.
    pub fragments: usize,
    /// The job time of the machine.
    pub time_s: Times,
    /// The job time with the loading of the blocks, s: what `auto` minimises.
    pub total_s: f64,
}

/// How many dots there are; each counts once, whatever the passes of its pen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dots {
    /// Dots of the texture.
    pub texture: u64,
    /// Dots that are marked.
    pub marked: u64,
    /// Not marked: off the part or over a hole.
    pub off_part: u64,
    /// Not marked: steeper than the limit.
    pub steep: u64,
}

/// The space curves of a job against the surface, as far as they may be marked; each counts once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SpaceCurves {
    /// How many there are.
    pub count: usize,
    /// Length of the curves seen along z, mm.
    pub plan_mm: f64,
    /// Length of the curves on the surface, mm.
    pub surface_mm: f64,
    /// Largest distance of the curves from the surface along z, um.
    pub worst_distance_um: f64,
}

/// The figures of a job; the keys are a promise, units are in the suffix. Lengths are measured in the
/// xy plane.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Sides of the box of the part as it is laid, along x, y and z, before it is turned.
    #[serde(default)]
    pub part_mm: [f64; 3],
    /// Standstills of the stage. Each is a block; with a zoom optic it may be several.
    pub stops: usize,
    /// How many stops more the method had chosen: each was merged with another.
    pub stops_merged: usize,
    /// Blocks: what is marked at one focal plane of one stop.
    pub blocks: usize,
    /// How many times the texture is marked, each time with its own stops.
    pub passes: u32,
    /// How often the part is placed on the table, where it is beyond the stage travel.
    pub setups: usize,
    /// Connected parts of one level in one section (the article's count).
    pub sub_blocks: usize,
    /// Method of partition that was kept.
    pub method: String,
    /// No partition has fewer stops; None where no bound was computed.
    pub lower_bound_stops: Option<usize>,
    /// Length of the texture, every pass counted.
    pub texture_mm: f64,
    /// Length that is marked, every pass counted.
    pub mark_mm: f64,
    /// Length that is marked twice on purpose, at seams.
    pub overlap_mm: f64,
    /// Length that is not marked; the sum of the three that follow.
    pub skipped_mm: f64,
    /// Not marked: off the part or over a hole.
    pub skipped_off_part_mm: f64,
    /// Not marked: steeper than the limit.
    pub skipped_steep_mm: f64,
    /// Not marked: fragments that are too short.
    pub skipped_small_mm: f64,
    /// Dots; no length counts them.
    #[serde(default)]
    pub dots: Dots,
    /// Pieces that the texture's strokes were cut into, dots among them.
    pub fragments: usize,
    /// Texture strokes that were cut.
    pub strokes_cut: usize,
    /// Closed figures that stayed whole.
    pub figures_whole: usize,
    /// Closed figures that were cut.
    pub figures_cut: usize,
    /// Length of the borders between blocks.
    pub seam_mm: f64,
    /// Jumps inside blocks, for one pass.
    pub jump_mm: f64,
    /// Largest distance of a mark from its block's focal plane, as the job sets that plane.
    pub worst_defocus_um: f64,
    /// Largest distance of a mark from the mean height of its block's marks.
    pub worst_defocus_mean_um: f64,
    /// Largest angle between the beam and the normal of a marked place.
    pub worst_incidence_deg: f64,
    /// How far from the optical axis marks lie.
    #[serde(default)]
    pub off_axis_mm: OffAxis,
    /// How far marks may lie from where they should.
    #[serde(default)]
    pub budget: Budget,
    /// The space curves; left out where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curves: Option<SpaceCurves>,
    /// The job's time: that of the machine.
    pub time_s: Times,
    /// Who loads the blocks, and the job's time with it.
    pub loading: Loading,
    /// What `auto` compared; empty where one method was asked for.
    pub candidates: Vec<Candidate>,
    /// What the user should know.
    pub warnings: Vec<Message>,
}

impl Summary {
    /// How many stops there are for each that is needed at least.
    pub fn over_bound(&self) -> Option<f64> {
        self.lower_bound_stops.filter(|&n| n > 0).map(|n| self.stops as f64 / n as f64)
    }
}

/// Some blocks of a job, of which alone a folder holds files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Subset {
    /// The names of the blocks, in machining order.
    pub blocks: Vec<String>,
    /// Standstills of the stage.
    pub stops: usize,
    /// Length of the blocks' marks, every pass counted.
    pub mark_mm: f64,
    /// Time of the blocks, as that of a job.
    pub time_s: f64,
    /// Time of the blocks with their loading, s.
    pub total_s: f64,
}

/// The frames of a job folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// Name of the pen that they are drawn with.
    pub pen: String,
    /// The blocks of the outline, in machining order.
    pub outline: Vec<String>,
}

impl Frames {
    /// The frames of a program, or of the blocks of one that a folder holds.
    pub fn new(pen: &str, checked: &Checked, machine: &Machine) -> Self {
        let outline = emit::frames::outline(checked, machine);
        Self { pen: pen.into(), outline: outline.into_iter().map(|i| checked.program().id(i).to_string()).collect() }
    }
}

/// Everything that the manifest says.
#[derive(Clone)]
pub struct Facts<'a> {
    /// Path from the job folder to the job file.
    pub job_file: &'a str,
    /// The job.
    pub job: &'a Job,
    /// The machine of the job.
    pub machine: &'a Machine,
    /// The checked program.
    pub checked: &'a Checked,
    /// The grid of sections of every pass, and the directions of what is filled along contours, if anything is.
    pub passes: Vec<(&'a Sections, Option<&'a Directions>)>,
    /// Largest depth range of a block, as used.
    pub depth_mm: f64,
    /// How far the facets lie from exact surfaces, where their reader knows that.
    pub tessellation_mm: Option<f64>,
    /// The part as it lies, where it was measured.
    pub measured: Option<&'a MeasuredPart>,
    /// What holds the part.
    pub fixtures: &'a [Fixture],
    /// The figures of every block.
    pub figures: &'a [BlockFigures],
    /// The figures.
    pub summary: &'a Summary,
}

/// The z to which the stage lifts before it moves to block `index` of a program, mm; None where it goes there at the z
/// where it stands. Before the first block that is unknown.
pub fn lift_mm(machine: &Machine, checked: &Checked, index: usize) -> Option<f64> {
    let lifts = index == 0 || checked.program().blocks[index].retract;
    lifts.then(|| machine.retract_z().mm())
}

#[cfg(test)]
mod tests;

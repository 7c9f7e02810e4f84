//! `manifest.json` of a stepped job: what its folder holds and how it came to be. What both modes have is in `head`.

use crate::emit::Target;
use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Map, Value};

use super::FixtureEntry;
use super::head::{bytes, parse, text};
use super::{Facts, Frames, Head, Registered, Subset, Summary, lift_mm, registration};
use crate::budget::StatedErrors;
use crate::emit::Files;
use crate::measured::{MeasuredPart, Warp};
use terrace_core::diag::Error;
use terrace_core::geom::{Correction, Nm, P2, Turned};
use terrace_core::machine::{Machine, Origin};
use terrace_core::motion::{LineEnergy, Rest};
use terrace_core::program::{self, PassId, Pen, Program};
use terrace_core::units::Time;
use terrace_input::job::{DepthRule, Job, Level};
use terrace_input::texture::{Directions, LostMarks};

/// The manifest of a stepped job. `B` is its list of blocks: entries where it is read; made entry by entry while it is
/// written, since there may be very many.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Manifest<B = Vec<BlockEntry>> {
    /// What both modes have.
    #[serde(flatten)]
    pub head: Head,
    /// The machine.
    pub machine: Machine,
    /// Where the part lies in the first set-up.
    pub placement: Placement,
    /// What holds the part.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixtures: Vec<FixtureEntry>,
    /// The depth of the blocks.
    pub focus: Focus,
    /// How blocks meet.
    pub seams: Seams,
    /// The passes.
    pub passes: Vec<PassEntry>,
    /// The set-ups.
    pub setups: Vec<SetupEntry>,
    /// The pens.
    pub pens: Vec<PenEntry>,
    /// The frames, where the job has any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<Frames>,
    /// The blocks, in machining order.
    pub blocks: B,
    /// The figures.
    pub summary: Summary,
    /// The blocks of which the folder holds files, where these are not all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subset: Option<Subset>,
}

impl<B: for<'a> Deserialize<'a>> Manifest<B> {
    /// Reads the manifest of a job folder.
    ///
    /// # Errors
    /// The errors of [`Head::read`]; `manifest` where it is that of an on-the-fly job.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        Self::parse(folder, &bytes(folder)?)
    }

    /// Reads the bytes of the manifest of a job folder.
    ///
    /// # Errors
    /// The errors of [`Manifest::read`].
    pub fn parse(folder: &Path, bytes: &[u8]) -> Result<Self, Error> {
        parse(folder, bytes)
    }
}

impl<B: Serialize> Manifest<B> {
    /// The text of the manifest: JSON, keys in a fixed order, a line feed at the end.
    pub fn bytes(&self) -> Vec<u8> {
        text(self, 4096 + 700 * self.summary.blocks)
    }
}

/// The text of the manifest of a stepped job whose folder holds all blocks.
pub fn manifest(head: &Head, facts: &Facts<'_>) -> Vec<u8> {
    let program = facts.checked.program();
    let manifest = Manifest {
        head: head.clone(),
        machine: facts.machine.clone(),
        placement: Placement::new(facts.checked.origin(), facts.job, facts.measured),
        fixtures: facts.fixtures.iter().map(FixtureEntry::new).collect(),
        focus: Focus {
            pdof_mm: facts.job.focus.pdof.mm(),
            reserve_mm: facts.job.focus.reserve.mm(),
            depth_range_mm: facts.depth_mm,
            level: facts.job.focus.level,
            rule: facts.job.focus.rule,
        },
        seams: Seams { zone_mm: facts.job.partition.zone.mm(), overlap_mm: facts.job.partition.overlap.mm() },
        passes: passes(facts),
        setups: setups(facts),
        pens: program.pens.iter().map(|pen| pen_entry(pen, facts.machine)).collect(),
        frames: facts.job.frames.map(|pen| Frames::new(&program.pens[pen.index()].name, facts.checked, facts.machine)),
        blocks: Blocks(facts),
        summary: facts.summary.clone(),
        // Only the folder of a resumed job holds some blocks alone; its writer sets this.
        subset: None,
    };
    manifest.bytes()
}

/// Where the part lies.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Placement {
    /// The part's origin in the table frame.
    pub origin_mm: [f64; 3],
    /// Rotations of the surface file about x, y and z, in this order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laid_deg: Option<[f64; 3]>,
    /// Turn about z.
    pub turn_deg: f64,
    /// How a measured part lies beside that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<MeasuredPlacement>,
}

impl Placement {
    pub(super) fn new(origin: Origin, job: &Job, measured: Option<&MeasuredPart>) -> Self {
        let placement = &job.placement;
        Self {
            origin_mm: origin.mm(),
            laid_deg: placement.laid_deg(),
            turn_deg: placement.turn.as_deg(),
            measured: measured.map(MeasuredPlacement::new),
        }
    }
}

/// How a measured part lies, beside its placement: a point p of the turned part lies at R p + rest + origin.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeasuredPlacement {
    /// Points that were measured.
    pub points: usize,
    /// Of them, touches that do not lie on the part and do not count.
    pub off_part: usize,
    /// The rows of the rotation R.
    pub rows: [[f64; 3]; 3],
    /// The rest, below an increment of the stage along each axis, nm.
    pub rest_nm: [f64; 3],
    /// Angle by which R leans the part's z axis.
    pub lean_deg: f64,
    /// Largest distance of a point that counts from where the fit has it.
    pub worst_residual_um: f64,
    /// Root of the mean square of residuals over the noise that the table states.
    pub noise_factor: f64,
    /// By how much more than its length the part is longer on the stage, and the standard deviation of that; the part
    /// is not scaled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_excess: Option<[f64; 2]>,
    /// Texture of the first pass that is not on the part as designed, and for that not among the lengths of the summary.
    pub off_part_mm: f64,
    /// Dots of that kind.
    pub off_part_dots: u64,
    /// Texture of the first pass that the part as it lies hides.
    pub hidden_mm: f64,
    /// Dots of that kind.
    pub hidden_dots: u64,
    /// Texture of the first pass that lies beside the part as it lies.
    pub beside_mm: f64,
    /// Dots of that kind.
    pub beside_dots: u64,
    /// How it is warped; absent where the job says that it is rigid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warp: Option<WarpPlacement>,
}

/// How a measured part is warped: docs/reference/measured.md states how it follows from the points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WarpPlacement {
    /// Points that say how, those of a cell together.
    pub points: usize,
    /// Lengths of the covariance that count.
    pub lengths_mm: Vec<f64>,
    /// The amplitude of each.
    pub amplitudes_um: Vec<f64>,
    /// How much each counts; the sum is 1.
    pub weights: Vec<f64>,
    /// How many times the deviation is larger than the covariances say.
    pub factor: f64,
    /// First node of the grid of the correction, beside the placement.
    pub grid_origin_nm: [i64; 2],
    /// Distance between its nodes.
    pub grid_pitch_nm: i64,
    /// Columns and rows of its cells.
    pub grid_cells: [u32; 2],
    /// Lowest and highest correction at a node.
    pub height_um: [f64; 2],
    /// Least and largest standard deviation at a node.
    pub deviation_um: [f64; 2],
}

impl WarpPlacement {
    fn new(warp: &Warp, correction: &Correction) -> Self {
        let candidates = warp.candidates();
        let grid = correction.grid();
        let [height_um, deviation_um] = correction.ranges().map(|range| range.map(|nm| nm / 1e3));
        Self {
            points: warp.points().len(),
            lengths_mm: candidates.iter().map(|c| c.length).collect(),
            amplitudes_um: candidates.iter().map(|c| c.amplitude * 1e3).collect(),
            weights: candidates.iter().map(|c| c.weight).collect(),
            factor: warp.factor(),
            grid_origin_nm: [grid.origin.x, grid.origin.y],
            grid_pitch_nm: grid.pitch[0].0,
            grid_cells: grid.count,
            height_um,
            deviation_um,
        }
    }
}

impl MeasuredPlacement {
    /// Of a part.
    pub fn new(part: &MeasuredPart) -> Self {
        let MeasuredPart { lying, lost, .. } = part;
        let mm = |marks: LostMarks| Nm(marks.nm).mm();
        Self {
            points: lying.points.len(),
            off_part: lying.points.iter().filter(|p| !p.counts()).count(),
            rows: lying.rows,
            rest_nm: lying.rest_nm,
            lean_deg: lying.fit.motion.lean().to_degrees(),
            worst_residual_um: lying.worst_residual_mm() * 1e3,
            noise_factor: lying.fit.noise_factor,
            scale_excess: lying.fit.scale.map(|scale| [scale.excess, scale.sigma]),
            off_part_mm: mm(lost.off_part),
            off_part_dots: lost.off_part.dots,
            hidden_mm: mm(lost.hidden),
            hidden_dots: lost.hidden.dots,
            beside_mm: mm(lost.beside),
            beside_dots: lost.beside.dots,
            warp: lying.warp.as_ref().zip(part.correction.as_deref()).map(|(warp, c)| WarpPlacement::new(warp, c)),
        }
    }
}

/// The depth of the blocks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Focus {
    /// PDOF.
    pub pdof_mm: f64,
    /// What of it is kept free.
    pub reserve_mm: f64,
    /// Largest depth range of a block, as used.
    pub depth_range_mm: f64,
    /// Where focal planes lie.
    pub level: Level,
    /// What PDOF bounds.
    pub rule: DepthRule,
}

/// The grid of sections of a pass.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sections {
    /// Lower left corner.
    pub origin_mm: [f64; 2],
    /// Size of a section.
    pub pitch_mm: [f64; 2],
    /// Sections in a row.
    pub columns: u32,
    /// Sections in a column.
    pub rows: u32,
    /// Directions of what is filled along contours, row by row; left out where nothing is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub direction_deg: Vec<f64>,
}

impl Sections {
    fn new(grid: &program::Sections, directions: &[u16]) -> Self {
        Self {
            origin_mm: grid.origin.mm(),
            pitch_mm: grid.pitch.map(Nm::mm),
            columns: grid.count[0],
            rows: grid.count[1],
            direction_deg: directions.iter().map(|&d| f64::from(d) / 100.0).collect(),
        }
    }
}

/// A pass.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PassEntry {
    /// How far its hatches are turned against those of the first.
    pub turn_deg: f64,
    /// How far the surface was lowered before it.
    pub lowered_mm: f64,
    /// The grid of sections.
    pub sections: Sections,
}

fn passes(facts: &Facts<'_>) -> Vec<PassEntry> {
    let passes = &facts.job.passes;
    let entry = |(k, &(grid, directions)): (u32, &(&program::Sections, Option<&Directions>))| PassEntry {
        turn_deg: f64::from(k) * passes.rotate.as_deg(),
        lowered_mm: passes.lowered(PassId(k)).mm(),
        sections: Sections::new(grid, directions.map_or(&[], |d| &d.hundredths)),
    };
    (0..).zip(&facts.passes).map(entry).collect()
}

/// A set-up.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SetupEntry {
    /// The part's origin in the table frame.
    pub origin_mm: [f64; 3],
    /// The registration points that it reaches.
    pub registration: Vec<RegistrationEntry>,
}

/// A registration point.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct RegistrationEntry {
    /// Where it is on the part.
    pub point_mm: [f64; 2],
    /// Commanded x and y at which it lies under the optical axis.
    pub stage: [f64; 2],
}

impl RegistrationEntry {
    /// The point in whole nanometres; None where it is beyond all travel.
    pub fn registered(&self) -> Option<Registered> {
        let [x, y] = self.stage.map(Nm::from_mm);
        Some(Registered { point_mm: self.point_mm, at: [x?, y?] })
    }
}

fn setups(facts: &Facts<'_>) -> Vec<SetupEntry> {
    facts.checked.origins().iter().map(|&origin| SetupEntry::new(facts, origin)).collect()
}

impl SetupEntry {
    /// The set-up in which the part lies at `origin`.
    fn new(facts: &Facts<'_>, origin: Origin) -> Self {
        let points = registration(facts.job, facts.machine, origin).into_iter();
        let registration = points.map(|r| RegistrationEntry { point_mm: r.point_mm, stage: r.at.map(Nm::mm) });
        Self { origin_mm: origin.mm(), registration: registration.collect() }
    }
}

/// How blocks meet.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seams {
    /// Width of the zone in which cuts are spread.
    pub zone_mm: f64,
    /// Length that is marked twice at a cut.
    pub overlap_mm: f64,
}

/// A pen.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PenEntry {
    /// The name of the pen.
    pub name: String,
    /// Speed of its marks.
    pub speed_mm_s: f64,
    /// Power, as the job file has it.
    pub power: String,
    /// Power.
    pub power_w: f64,
    /// Frequency of the pulses.
    pub frequency_khz: f64,
    /// How often each stroke is marked.
    pub passes: u32,
    /// Time on a dot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dwell_us: Option<f64>,
}

fn pen_entry(pen: &Pen, machine: &Machine) -> PenEntry {
    PenEntry {
        name: pen.name.clone(),
        speed_mm_s: pen.speed.as_mm_s(),
        power: pen.power.to_string(),
        power_w: pen.power.as_w(machine.laser.max_power),
        frequency_khz: pen.frequency.as_khz(),
        passes: pen.passes,
        dwell_us: pen.dwell.map(Time::as_us),
    }
}

/// The list of blocks, made entry by entry while it is written.
struct Blocks<'a>(&'a Facts<'a>);

impl Serialize for Blocks<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let stated = StatedErrors::new(self.0.job, self.0.machine, self.0.tessellation_mm);
        let stated = stated.with_lying(self.0.measured.map(|part| (&part.lying, part.reserve.as_ref())));
        s.collect_seq((0..self.0.checked.program().blocks.len()).map(|i| block_entry(self.0, &stated, i)))
    }
}

/// A block.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BlockEntry {
    /// The name of the block.
    pub id: String,
    /// The pass, from 1.
    pub pass: u32,
    /// The set-up, from 1.
    pub setup: u32,
    /// Column and row of its section.
    pub section: [u32; 2],
    /// The level.
    pub level: i32,
    /// Centre of its field, turned part frame.
    pub centre_mm: [f64; 2],
    /// Height of its focal plane, part frame.
    pub lpfl_mm: f64,
    /// What the zoom optic adds to the focal plane of the stage.
    pub focus_shift_mm: f64,
    /// The z to which the stage lifts on the way; null where it does not.
    pub lift_z_mm: Option<f64>,
    /// Commanded x, y and z, mm.
    pub stage: [f64; 3],
    /// Commanded tilt axes.
    pub tilt_deg: [f64; 2],
    /// Lowest height of its marks, part frame.
    pub z_lo_mm: f64,
    /// Highest height of its marks.
    pub z_hi_mm: f64,
    /// Names of its pens.
    pub pens: Vec<String>,
    /// The files of the block, by format.
    pub files: BTreeMap<String, String>,
    /// How many strokes it has.
    pub strokes: usize,
    /// Length of its marks.
    pub mark_mm: f64,
    /// Length of its jumps.
    pub jump_mm: f64,
    /// The time of the block, s.
    pub time_s: f64,
    /// Incidence and what follows from it.
    #[serde(flatten)]
    pub slope: SlopeEntry,
    /// The terms of its error budget, by name.
    pub errors_um: Map<String, Value>,
    /// Line energy of its marks; null of dots.
    pub line_energy: Option<EnergyEntry>,
}

/// Line energy of a block.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EnergyEntry {
    /// Mean over the length.
    pub mean_j_per_m: f64,
    /// Share of the length that is marked at the pen's speed.
    pub length_at_speed_percent: f64,
    /// The most that a line gets, as a multiple of P / v of its pen.
    pub worst_share: f64,
    /// Where, (turned) part frame.
    pub worst_at_mm: [f64; 2],
    /// What the spot does there.
    pub worst_where: Rest,
}

impl EnergyEntry {
    fn of(energy: &LineEnergy, block: &program::Block) -> Option<Self> {
        let worst = energy.worst()?;
        let centre = block.stop.centre;
        let at: P2<Turned> = P2::new(centre.x + i64::from(worst.at.x), centre.y + i64::from(worst.at.y));
        Some(Self {
            mean_j_per_m: energy.mean_j_per_m()?,
            length_at_speed_percent: 100.0 * energy.share_at_speed()?,
            worst_share: worst.ratio,
            worst_at_mm: at.mm(),
            worst_where: worst.rest,
        })
    }
}

/// Means and worst of a block.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SlopeEntry {
    /// Angle between beam and normal.
    pub incidence_deg: [f64; 2],
    /// Length on the part by that in the field.
    pub stretch: [f64; 2],
    /// Energy on an area by that where the beam is normal to it.
    pub dose: [f64; 2],
}

/// The files of a block, by format.
fn files(facts: &Facts<'_>, index: usize) -> BTreeMap<String, String> {
    let targets = facts.job.formats.iter().map(|&f| Target::of(f));
    let id = facts.checked.program().id(index);
    let of_block = targets.filter_map(|t| match t.stepped {
        Some(Files::Blocks(ending, _)) => Some((t.name().to_owned(), Program::block_file(id, ending))),
        _ => None,
    });
    of_block.collect()
}

fn block_entry(facts: &Facts<'_>, stated: &StatedErrors<'_>, index: usize) -> BlockEntry {
    let program = facts.checked.program();
    let block = &program.blocks[index];
    let figures = &facts.figures[index];
    let Ok(Value::Object(errors_um)) = serde_json::to_value(stated.of_block(block, figures)) else {
        unreachable!("errors are a map of numbers")
    };
    BlockEntry {
        id: program.id(index).to_string(),
        pass: block.pass.number(),
        setup: block.setup.number(),
        section: block.stop.section.0,
        level: block.stop.level,
        centre_mm: block.stop.centre.mm(),
        lpfl_mm: block.stop.lpfl.mm(),
        focus_shift_mm: block.focus_shift.mm(),
        lift_z_mm: lift_mm(facts.machine, facts.checked, index),
        stage: block.stage.mm(),
        tilt_deg: block.stop.tilt.deg(),
        z_lo_mm: block.z_lo.mm(),
        z_hi_mm: block.z_hi.mm(),
        pens: program.pen_names(block).into_iter().map(str::to_owned).collect(),
        files: files(facts, index),
        strokes: block.strokes.len(),
        mark_mm: program.mark_mm(block),
        jump_mm: program.jump_mm(block),
        time_s: figures.time_s,
        slope: SlopeEntry {
            incidence_deg: figures.slope.incidence_deg(),
            stretch: figures.slope.stretch(),
            dose: figures.slope.dose(),
        },
        errors_um,
        line_energy: EnergyEntry::of(&figures.energy, block),
    }
}

//! `manifest.json` of a stepped job: what its folder holds and how it came to be. What both modes have is in `head`.

use std::collections::BTreeMap;

use serde::{Serialize, Serializer};

use super::{Facts, Frames, Head, Summary, lift_mm, registration};
use crate::budget::{Errors, Stated};
use crate::emit::Files;
use crate::geom::{Nm, P2, Turned};
use crate::job::{DepthRule, Job, Level};
use crate::machine::{Machine, Origin};
use crate::motion::{LineEnergy, Rest};
use crate::program::{self, PassId, Pen, Program};
use crate::texture::Directions;
use crate::units::Time;

/// The manifest: JSON, keys in a fixed order, a line feed at the end.
pub fn manifest(head: &Head, facts: &Facts<'_>) -> Vec<u8> {
    let program = facts.checked.program();
    let document = Document {
        head,
        machine: facts.machine,
        placement: Placement::new(facts.checked.origin(), facts.job),
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
        summary: facts.summary,
    };
    bytes(&document, 4096 + 700 * program.blocks.len())
}

/// The text of a document, of about this length.
pub(super) fn bytes(document: &impl Serialize, length: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(length);
    serde_json::to_writer_pretty(&mut out, document).expect("a Vec takes every byte, and all keys are text");
    out.push(b'\n');
    out
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    head: &'a Head,
    machine: &'a Machine,
    placement: Placement,
    focus: Focus,
    seams: Seams,
    passes: Vec<PassEntry>,
    setups: Vec<SetupEntry>,
    pens: Vec<PenEntry<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frames: Option<Frames>,
    blocks: Blocks<'a>,
    summary: &'a Summary,
}

#[derive(Serialize)]
pub(super) struct Placement {
    pub(super) origin_mm: [f64; 3],
    /// Rotations of the surface file about x, y and z, in this order.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) laid_deg: Option<[f64; 3]>,
    pub(super) turn_deg: f64,
}

impl Placement {
    pub(super) fn new(origin: Origin, job: &Job) -> Self {
        let placement = &job.placement;
        Self { origin_mm: origin.mm(), laid_deg: placement.laid_deg(), turn_deg: placement.turn.as_deg() }
    }
}

#[derive(Serialize)]
struct Focus {
    pdof_mm: f64,
    reserve_mm: f64,
    depth_range_mm: f64,
    level: Level,
    rule: DepthRule,
}

#[derive(Serialize)]
struct Sections {
    origin_mm: [f64; 2],
    pitch_mm: [f64; 2],
    columns: u32,
    rows: u32,
    /// Of what is filled along contours, row by row; left out where nothing is.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    direction_deg: Vec<f64>,
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

#[derive(Serialize)]
struct PassEntry {
    turn_deg: f64,
    lowered_mm: f64,
    sections: Sections,
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

#[derive(Serialize)]
struct SetupEntry {
    origin_mm: [f64; 3],
    registration: Vec<RegistrationEntry>,
}

#[derive(Serialize)]
struct RegistrationEntry {
    point_mm: [f64; 2],
    stage: [f64; 2],
}

fn setups(facts: &Facts<'_>) -> Vec<SetupEntry> {
    let entry = |&origin: &Origin| SetupEntry {
        origin_mm: origin.mm(),
        registration: registration(facts.job, facts.machine, origin)
            .into_iter()
            .map(|r| RegistrationEntry { point_mm: r.point_mm, stage: r.at.map(Nm::mm) })
            .collect(),
    };
    facts.checked.origins().iter().map(entry).collect()
}

#[derive(Serialize)]
struct Seams {
    zone_mm: f64,
    overlap_mm: f64,
}

#[derive(Serialize)]
struct PenEntry<'a> {
    name: &'a str,
    speed_mm_s: f64,
    power: String,
    power_w: f64,
    frequency_khz: f64,
    passes: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    dwell_us: Option<f64>,
}

fn pen_entry<'a>(pen: &'a Pen, machine: &Machine) -> PenEntry<'a> {
    PenEntry {
        name: &pen.name,
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
        let stated = Stated::new(self.0.job, self.0.machine, self.0.tessellation_mm);
        s.collect_seq((0..self.0.checked.program().blocks.len()).map(|i| block_entry(self.0, &stated, i)))
    }
}

#[derive(Serialize)]
struct BlockEntry<'a> {
    id: String,
    pass: u32,
    setup: u32,
    section: [u32; 2],
    level: i32,
    centre_mm: [f64; 2],
    lpfl_mm: f64,
    focus_shift_mm: f64,
    lift_z_mm: Option<f64>,
    stage: [f64; 3],
    tilt_deg: [f64; 2],
    z_lo_mm: f64,
    z_hi_mm: f64,
    pens: Vec<&'a str>,
    files: BTreeMap<&'static str, String>,
    strokes: usize,
    mark_mm: f64,
    jump_mm: f64,
    time_s: f64,
    #[serde(flatten)]
    slope: SlopeEntry,
    errors_um: Errors,
    line_energy: Option<EnergyEntry>,
}

/// Line energy of a block; the place of the worst in the (turned) part frame.
#[derive(Serialize)]
struct EnergyEntry {
    mean_j_per_m: f64,
    length_at_speed_percent: f64,
    worst_share: f64,
    worst_at_mm: [f64; 2],
    worst_where: Rest,
}

impl EnergyEntry {
    fn of(energy: &LineEnergy, block: &program::Block) -> Option<Self> {
        let (worst, centre) = (energy.worst()?, block.stop.centre);
        let at: P2<Turned> = P2::new(centre.x + i64::from(worst.at.x), centre.y + i64::from(worst.at.y));
        Some(Self {
            mean_j_per_m: energy.mean_j_per_m()?,
            length_at_speed_percent: 100.0 * energy.share_at_speed()?,
            worst_share: worst.share,
            worst_at_mm: at.mm(),
            worst_where: worst.rest,
        })
    }
}

/// Means and worst.
#[derive(Serialize)]
struct SlopeEntry {
    incidence_deg: [f64; 2],
    stretch: [f64; 2],
    dose: [f64; 2],
}

/// The files of a block, by format.
fn files(facts: &Facts<'_>, index: usize) -> BTreeMap<&'static str, String> {
    let targets = facts.job.formats.iter().map(|f| f.target());
    let id = facts.checked.program().id(index);
    let of_block = targets.filter_map(|t| match t.stepped {
        Some(Files::Blocks(ending, _)) => Some((t.name, Program::block_file(id, ending))),
        _ => None,
    });
    of_block.collect()
}

fn block_entry<'a>(facts: &'a Facts<'a>, stated: &Stated<'_>, index: usize) -> BlockEntry<'a> {
    let program = facts.checked.program();
    let (block, figures) = (&program.blocks[index], &facts.figures[index]);
    BlockEntry {
        id: program.id(index).to_string(),
        pass: block.pass.number(),
        setup: block.setup.number(),
        section: block.stop.section.0,
        level: block.stop.level,
        centre_mm: block.stop.centre.mm(),
        lpfl_mm: block.stop.focus.mm(),
        focus_shift_mm: block.focus_shift.mm(),
        lift_z_mm: lift_mm(facts.machine, facts.checked, index),
        stage: block.stage.mm(),
        tilt_deg: block.stop.tilt.deg(),
        z_lo_mm: block.z_lo.mm(),
        z_hi_mm: block.z_hi.mm(),
        pens: program.pen_names(block),
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
        errors_um: stated.of_block(block, figures),
        line_energy: EnergyEntry::of(&figures.energy, block),
    }
}

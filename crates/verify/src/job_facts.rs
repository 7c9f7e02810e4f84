//! What the job itself says: machine, depth, pens, surface and texture, loaded again from the job file.

use std::path::Path;

use super::geometry::{Map, MeshBuilder, Shape};
use super::inputs::Inputs;
use super::read::manifest::Manifest;
use super::rotation::Rotation;
use super::unusable;
use terrace_core::diag::Error;
use terrace_core::geom::{BoxMm, NM_PER_MM, Nm};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, PassId, Pen};
use terrace_input::job::{DepthRule, Dose, Format, Job, Level, MachineInput, Mode, Overrides, Passes, Setups};
use terrace_input::surface::{self, Content};
use terrace_input::texture::Texture;

/// Facets up to this width in plan view, nm, have no height of their own: rounding to the nanometre
/// may have closed them.
pub(super) const THINNEST: f64 = 2.0;

/// The numbers that the rules are checked against.
#[derive(Clone, Debug)]
pub(super) struct JobFacts {
    pub(super) machine: Machine,
    /// Processing depth of focus.
    pub(super) pdof: Nm,
    /// The part of it that the job keeps for errors.
    pub(super) reserve: Nm,
    /// Largest depth range of a block.
    pub(super) depth_range: Nm,
    pub(super) level: Level,
    pub(super) rule: DepthRule,
    pub(super) max_incidence_rad: f64,
    pub(super) min_mark_nm: f64,
    /// Whether only slivers next to a mark may be left out, not every mark shorter than `min_mark_nm`.
    pub(super) only_slivers: bool,
    /// Length that two blocks may both mark at a cut, nm.
    pub(super) overlap_nm: f64,
    /// How far before a border a cut may fall at random, nm.
    pub(super) zone_nm: f64,
    /// How often, how turned, how lowered, how shifted.
    pub(super) passes: Passes,
    /// Set-ups and their registration points.
    pub(super) setups: Option<Setups>,
    /// Distance of figures that are to stay whole.
    pub(super) figure_pitch: Option<Nm>,
    /// Pitch of the sections, at most the usable field, nm.
    pub(super) section_nm: [f64; 2],
    pub(super) weld_nm: f64,
    pub(super) turn_deg: f64,
    /// Rotations of the surface file about x, y and z.
    pub(super) laid_deg: Option<[f64; 3]>,
    /// Part origin in the table frame, nm, where the job states one.
    pub(super) origin: Option<Origin>,
    /// Pens of the job; None where the job could not be read.
    pub(super) pens: Option<Vec<Pen>>,
    /// How pens compensate for the slope, if they do.
    pub(super) dose: Option<Dose>,
    /// Name of the pen of the frames that the job asks for; None where the job could not be read.
    pub(super) frames: Option<Option<String>>,
    /// Formats that the job asks for.
    pub(super) formats: Vec<Format>,
    /// The files that the job reads, each with its role, as the manifest names them; None where the job could not be
    /// read.
    pub(super) inputs: Option<Vec<(&'static str, String)>>,
    /// Whether the power of marks on the fly follows the speed of the spot.
    pub(super) power_by_speed: bool,
    /// Whether the job names a built-in machine, all of whose values are assumptions.
    pub(super) is_built_in: bool,
}

impl JobFacts {
    /// The facts that the manifest states, where the job itself cannot be had. Enough for the rules
    /// that need no inputs.
    pub(super) fn from_manifest(m: &Manifest) -> Self {
        Self {
            section_nm: m.machine.usable_field().map(Nm::f64),
            machine: m.machine.clone(),
            pdof: Nm::from_mm(m.focus.pdof_mm).unwrap_or_default(),
            reserve: Nm::from_mm(m.focus.reserve_mm).unwrap_or_default(),
            depth_range: Nm::from_mm(m.focus.depth_range_mm).unwrap_or_default(),
            level: m.focus.level,
            rule: m.focus.rule,
            max_incidence_rad: 0.0,
            min_mark_nm: 0.0,
            only_slivers: false,
            overlap_nm: m.seams.overlap_mm * NM_PER_MM,
            zone_nm: m.seams.zone_mm * NM_PER_MM,
            passes: Passes::default(),
            setups: None,
            figure_pitch: None,
            weld_nm: 0.0,
            turn_deg: m.placement.turn_deg,
            laid_deg: m.placement.laid_deg,
            origin: None,
            pens: None,
            dose: None,
            frames: None,
            formats: Vec::new(),
            inputs: None,
            power_by_speed: false,
            is_built_in: false,
        }
    }

    fn from_job(job: &Job, machine: Machine) -> Self {
        // Sections measure an even number of increments.
        let grid = 2.0 * machine.increment_nm().f64();
        let section = job.partition.section.map_or(f64::INFINITY, Nm::f64);
        let by_spot = job.partition.min_mark.is_none() && job.mode == Mode::Stepped;
        let half_spot_nm = machine.lens.spot.as_mm() * NM_PER_MM / 2.0;
        Self {
            section_nm: machine.usable_field().map(|f| (section.min(f.f64()) / grid).floor() * grid),
            machine,
            pdof: job.focus.pdof,
            reserve: job.focus.reserve,
            depth_range: match job.focus.rule {
                DepthRule::Range => job.focus.pdof - job.focus.reserve,
                DepthRule::Half => (job.focus.pdof - job.focus.reserve) * 2,
            },
            level: job.focus.level,
            rule: job.focus.rule,
            max_incidence_rad: job.limits.max_incidence.as_rad(),
            min_mark_nm: if by_spot { half_spot_nm } else { job.partition.min_mark.unwrap_or_default().f64() },
            only_slivers: by_spot,
            overlap_nm: job.partition.overlap.f64(),
            zone_nm: job.partition.zone.f64(),
            passes: job.passes,
            setups: job.setups.clone(),
            figure_pitch: job.figure_pitch(),
            weld_nm: job.surface.weld.f64(),
            turn_deg: job.placement.turn.as_deg(),
            laid_deg: job.placement.laid_deg(),
            // Of a measured part it is a start alone.
            origin: job.placement.origin.filter(|_| job.placement.measured.is_none()),
            pens: Some(job.pens.clone()),
            dose: job.dose,
            frames: Some(job.frames.map(|pen| job.pens[pen.index()].name.clone())),
            formats: job.formats.clone(),
            inputs: Some(inputs_of(job)),
            power_by_speed: job.power_by_speed,
            is_built_in: matches!(job.machine, MachineInput::Profile(_)),
        }
    }

    /// By how much the grid of sections of a pass lies lower than that of the first.
    pub(super) fn shift(&self, pass: PassId, pitch: [Nm; 2]) -> [Nm; 2] {
        self.passes.grid_shift(pass, pitch, self.figure_pitch.unwrap_or(Nm(1)))
    }

    /// A block with its heights on the surface before it was lowered.
    pub(super) fn raised(&self, block: &Block) -> Block {
        let by = self.passes.lowered(block.pass);
        let mut block = block.clone();
        let stop = &mut block.stop;
        for z in [&mut stop.lpfl, &mut stop.z_lo, &mut stop.z_hi, &mut block.z_lo, &mut block.z_hi] {
            *z = z.saturating_add(by);
        }
        block
    }

    /// Largest distance of a mark from its focal plane, nm. A focal plane in the middle of the
    /// interval is rounded to the stage increment; a mean one may stand anywhere in it.
    pub(super) fn defocus_limit_nm(&self) -> f64 {
        let range = self.depth_range_nm();
        match self.level {
            Level::Mid => range / 2.0 + self.machine.increment_nm().f64() / 2.0,
            Level::Mean => range,
        }
    }

    /// Largest depth range of a block, nm.
    pub(super) fn depth_range_nm(&self) -> f64 {
        self.depth_range.f64()
    }
}

/// A path as a manifest has it: with slashes where backslashes separate.
fn named(file: &Path) -> String {
    let text = file.to_string_lossy();
    if cfg!(windows) { text.replace('\\', "/") } else { text.into_owned() }
}

/// The files that a job reads, as a manifest lists them: a file that follows on itself once.
fn inputs_of(job: &Job) -> Vec<(&'static str, String)> {
    let mut all: Vec<_> = job.input_files().into_iter().map(|(role, file)| (role, named(file))).collect();
    all.dedup();
    all
}

/// Reads the job file as one of this mode, and its machine.
pub(super) fn load(inputs: &Inputs, mode: Mode) -> Result<(Job, JobFacts), Error> {
    let job = Job::load(&inputs.job, &Overrides { mode: Some(mode), ..Overrides::default() })?;
    let machine = job.machine()?;
    let facts = JobFacts::from_job(&job, machine);
    Ok((job, facts))
}

/// Reads the surface file, turned as the job says, and its box, mm, before the turn.
pub(super) fn shape(job: &Job) -> Result<(Shape, BoxMm<2>), Error> {
    let path = job.surface_path();
    let turn = job.placement.turn.as_rad();
    let mut builder = MeshBuilder::new(turn, THINNEST);
    // Points are laid by their reader, before they are triangulated; all else by the verifier's own arithmetic.
    let laid = job.placement.laid.filter(|_| !surface::is_cloud(&path));
    let mut options = job.surface.options.clone();
    let Some(rotation) = laid.map(|laid| Rotation::new(&laid)) else {
        let content = surface::read(&path, &options, &mut Vec::new(), &mut |f| builder.push(f))?;
        return finished(builder, content, turn, &path);
    };
    options.pose = None;
    let content = surface::read(&path, &options, &mut Vec::new(), &mut |f| builder.push(rotation.facet(f)))?;
    let content = match content {
        Content::Heightmap(map) => {
            let mut count = 0;
            map.facets(&mut |f| (count += 1, builder.push(rotation.facet(f))).1);
            Content::Facets(count)
        }
        content => content,
    };
    finished(builder, content, turn, &path)
}

/// The surface that was read, and its box, mm.
fn finished(builder: MeshBuilder, content: Content, turn: f64, path: &Path) -> Result<(Shape, BoxMm<2>), Error> {
    let empty = || unusable("surface-empty", "the surface file holds no surface", path);
    match content {
        Content::Facets(0) => Err(empty()),
        Content::Facets(_) | Content::Tessellated(..) => {
            let box_mm = builder.box_mm;
            Ok((Shape::Mesh(builder.finish()), box_mm))
        }
        Content::Heightmap(map) => {
            let box_mm = Map::box_mm(&map).ok_or_else(empty)?;
            Ok((Shape::Map(Map::new(map, turn).ok_or_else(empty)?), box_mm))
        }
    }
}

/// Places the textures of a pass of the job.
pub(super) fn texture(job: &Job, machine: &Machine, pass: PassId, part_box_mm: BoxMm<2>) -> Result<Texture, Error> {
    let (turn, spot) = (job.placement.turn.as_rad(), machine.lens.spot.as_mm());
    Texture::load(&job.textures_of_pass(pass), part_box_mm, turn, spot, &mut Vec::new())
}

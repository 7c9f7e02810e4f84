//! The input files of a job, each opened once.

use std::sync::Arc;

use super::early;
use super::operator_way;
use super::plausible;
use super::space_curves;
use crate::fixtures::{self, Fixture};
use crate::manifest::SpaceCurves;
use crate::marked;
use crate::measured::{self, Lying, MeasuredPart};
use crate::projection::HeightReserve;
use terrace_core::diag::{Diag, Error, Kind, stand_in};
use terrace_core::geom::{Box2, BoxMm, P2, cos_sin};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{PassId, PenId};
use terrace_core::progress::Task;
use terrace_input::job::{Job, Mode};
use terrace_input::surface::{Joining, Surface};
use terrace_input::texture::Texture;

/// What a job is planned from.
#[derive(Debug)]
pub struct Inputs {
    /// The machine.
    pub machine: Machine,
    /// The part's surface, turned as the job says; of a measured part as it lies.
    pub surface: Arc<Surface>,
    /// The texture of the first pass.
    pub texture: Texture,
    /// The space curves of the texture against the surface; None where it has none.
    pub curves: Option<SpaceCurves>,
    /// Where the part lies, if it was measured; surface and texture are as it lies then.
    pub measured: Option<MeasuredPart>,
    /// What holds the part, as it lies.
    pub fixtures: Vec<Fixture>,
    /// What the user should know of the files.
    pub warnings: Vec<Diag>,
}

/// What inputs are read for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Purpose {
    /// A job that is planned, checked and written in its formats.
    Write,
    /// Measures of a job: nothing is written.
    Measure,
}

impl Inputs {
    /// Reads machine, surface and drawings, and holds the job to what the machine can be; not to what its formats can
    /// carry, as nothing is to be written.
    ///
    /// # Errors
    /// Faults of the files; `operator-way`; pens that the machine cannot give; `pdof-large`, `pdof-small`,
    /// `pitch-small`; `job-empty` where the texture lies off the part; `curve-distance` where space curves lie off its
    /// surface.
    pub fn load(job: &Job) -> Result<Self, Error> {
        Self::load_with_progress(job, Task::silent())
    }

    /// Reads what [`Inputs::load`] does, and reports how far it is.
    ///
    /// # Errors
    /// The errors of [`Inputs::load`].
    pub fn load_with_progress(job: &Job, task: Task<'_>) -> Result<Self, Error> {
        Self::loaded(job, Purpose::Measure, None, &mut |_| {}, task)
    }

    /// Reads what [`Inputs::load`] does for a job that is to be written, and hands on each facet of the surface file as
    /// the file has it.
    ///
    /// # Errors
    /// The errors of [`Inputs::load`]; besides, before any other file is read, all that job and machine file do not
    /// allow: formats that cannot carry the job, sections, depth and methods that the machine cannot do.
    pub fn load_each(job: &Job, each: &mut dyn FnMut([[f64; 3]; 3]), task: Task<'_>) -> Result<Self, Error> {
        Self::loaded(job, Purpose::Write, None, each, task)
    }

    /// Reads the inputs of one of several jobs that are to be written; the surface of another is taken over where both
    /// read and turn it alike.
    ///
    /// # Errors
    /// The errors of [`Inputs::load_each`].
    pub fn load_beside(job: &Job, other: Option<(&Job, &Arc<Surface>)>) -> Result<Self, Error> {
        Self::loaded(job, Purpose::Write, other, &mut |_| {}, Task::silent())
    }

    fn loaded(
        job: &Job,
        purpose: Purpose,
        other: Option<(&Job, &Arc<Surface>)>,
        each: &mut dyn FnMut([[f64; 3]; 3]),
        task: Task<'_>,
    ) -> Result<Self, Error> {
        let surface = other.filter(|(other, _)| has_same_surface(other, job)).map(|(_, surface)| surface);
        let machine = job.machine().map_err(|e| job.at_keys(&e))?;
        operator_way::served(job, &machine)?;
        let mut warnings = job.warnings.clone();
        let unused = machine.unused().into_iter();
        warnings.extend(unused.map(|(key, warning)| warning.at(job.place_in_machine(&key))));
        let mut faults = match purpose {
            Purpose::Write => early::faults(job, &machine),
            Purpose::Measure => early::pens(job, &machine),
        };
        match job.plausible(&machine) {
            Ok(odd) => warnings.extend(odd),
            Err(e) => {
                // A depth range that the optics make implausible is reported once.
                faults.retain(|fault| fault.code != "depth-small");
                let (odd, implausible): (Vec<Diag>, Vec<Diag>) =
                    e.diags().iter().cloned().partition(|d| d.kind == Kind::Warning);
                warnings.extend(odd);
                faults.extend(implausible);
            }
        }
        if !faults.is_empty() {
            return Err(Error::many(faults).after(warnings));
        }
        // Warnings before an error often show its cause.
        match Self::read(job, purpose, surface, &machine, &mut warnings, each, task) {
            Ok(ReadFiles { surface, texture, curves, measured, fixtures }) => {
                Ok(Self { machine, surface, texture, curves, measured, fixtures, warnings })
            }
            Err(e) => Err(job.at_keys(&stand_in::explained(e)).after(warnings)),
        }
    }

    fn read(
        job: &Job,
        purpose: Purpose,
        surface: Option<&Arc<Surface>>,
        machine: &Machine,
        warnings: &mut Vec<Diag>,
        each: &mut dyn FnMut([[f64; 3]; 3]),
        task: Task<'_>,
    ) -> Result<ReadFiles, Error> {
        let [shape, drawings] = task.split([3, 1]);
        let turn = job.placement.turn.as_rad();
        let surface = match surface {
            Some(surface) => Arc::clone(surface),
            None => Arc::new(designed(job, machine, warnings, each, shape)?),
        };
        warnings.extend(plausible::odd_part(job, surface.size_mm(), machine));
        let texture = Texture::load(&job.textures, surface.part_box_mm(), turn, machine.lens.spot.as_mm(), warnings)?;
        drop(drawings);
        texture.ask_for_tracing()?;
        check_dots(job, machine, &texture, purpose)?;
        let part = turned(surface.part_box_mm(), turn);
        if let Some(fault) = off_part(job, part, texture.bounds()) {
            return Err(plausible::explained(&fault.into(), &texture));
        }
        let curves = space_curves::compare(job, &surface, &texture, warnings)?;
        let texture = marked::left(job, joining(job, machine), &surface, texture, warnings)?;
        let Some(lying) = measured::lying(job, machine, &surface, warnings)? else {
            let fixtures = fixtures::load(job, None, warnings)?;
            return Ok(ReadFiles { surface, texture, curves, measured: None, fixtures });
        };
        let fixtures = fixtures::load(job, Some(&lying), warnings)?;
        let (surface, texture, part) =
            measured::draped(job, lying, &surface, texture, joining(job, machine), warnings)?;
        Ok(ReadFiles { surface, texture, curves, measured: Some(part), fixtures })
    }

    /// The part as designed, turned as the job says.
    pub fn designed(&self) -> &Arc<Surface> {
        self.measured.as_ref().map_or(&self.surface, |part| part.draping.designed())
    }

    /// What is kept free of the depth for the height of a measured part.
    pub fn reserve(&self) -> Option<&HeightReserve> {
        self.measured.as_ref().map(|part| part.reserve.as_ref())
    }

    /// Where a measured part lies, and how surely its height is known.
    pub fn lying(&self) -> Option<(&Lying, &HeightReserve)> {
        self.measured.as_ref().map(|part| (&part.lying, part.reserve.as_ref()))
    }

    /// The texture of the first pass on the part as designed.
    pub fn texture_as_designed(&self) -> &Texture {
        self.measured.as_ref().map_or(&self.texture, |part| &part.texture)
    }

    /// Where the part's origin lies on the table: as it was measured, or as the job says; None where neither does.
    pub fn origin(&self, job: &Job) -> Option<Origin> {
        self.measured.as_ref().map(|part| part.lying.origin).or(job.placement.origin)
    }

    /// The box of the part as the job turns it, mm.
    pub(super) fn part_box(&self, job: &Job) -> BoxMm<2> {
        // A part as it lies is turned already.
        let turn = if self.measured.is_some() { 0.0 } else { job.placement.turn.as_rad() };
        turned(self.surface.part_box_mm(), turn)
    }

    /// The box of the part as the job turns it, in whole nanometres.
    pub fn part_box_nm(&self, job: &Job) -> Box2 {
        let part = self.part_box(job);
        let corner = |at: [f64; 2]| P2::from_mm(at[0], at[1]).expect("a part lies within 4 m of its origin");
        Box2 { lo: corner(part.lo), hi: corner(part.hi) }
    }

    /// The texture of pass `k`, from 0.
    ///
    /// # Errors
    /// Faults of patterns that the turn from pass to pass causes.
    pub(crate) fn texture_of_pass(&self, job: &Job, pass: PassId) -> Result<Texture, Error> {
        if pass == PassId(0) {
            return Ok(self.texture.clone());
        }
        let turn = job.placement.turn.as_rad();
        let requests = job.textures_of_pass(pass);
        let texture = self.texture_as_designed().of_pass(&requests, self.designed().part_box_mm(), turn)?;
        match &self.measured {
            None => Ok(texture),
            Some(part) => Ok(texture.draped(&part.draping)?.texture),
        }
    }
}

/// How the facets of a job's surface are joined.
fn joining(job: &Job, machine: &Machine) -> Joining {
    Joining {
        weld_mm: job.surface.weld.mm(),
        narrow_mm: machine.lens.spot.as_mm(),
        non_manifold: job.surface.non_manifold,
    }
}

/// The part of a job as designed, turned as the job says; `each` is called with each facet as the file has it.
///
/// # Errors
/// Faults of the surface file.
pub fn designed(
    job: &Job,
    machine: &Machine,
    warnings: &mut Vec<Diag>,
    each: &mut dyn FnMut([[f64; 3]; 3]),
    task: Task<'_>,
) -> Result<Surface, Error> {
    let turn = job.placement.turn.as_rad();
    let options = &job.surface.options;
    Surface::load(&job.surface_path(), options, joining(job, machine), turn, warnings, each, task)
}

/// What the files of a job hold.
struct ReadFiles {
    surface: Arc<Surface>,
    texture: Texture,
    curves: Option<SpaceCurves>,
    measured: Option<MeasuredPart>,
    fixtures: Vec<Fixture>,
}

/// Whether two jobs read one surface file alike and turn it alike.
fn has_same_surface(a: &Job, b: &Job) -> bool {
    let turns = [a, b].map(|job| job.placement.turn.as_rad());
    a.surface == b.surface && turns[0] == turns[1] && a.path == b.path
}

/// Refuses dots whose pens have no dwell, and those that the formats of a job that is to be written cannot carry.
///
/// # Errors
/// `pen-dwell`; what the formats refuse.
fn check_dots(job: &Job, machine: &Machine, texture: &Texture, purpose: Purpose) -> Result<(), Error> {
    let is_without_dwell = |&(pen, _): &(PenId, usize)| job.pens[pen.index()].dwell.is_none();
    if let Some((pen, number)) = texture.dot_pens().into_iter().find(is_without_dwell) {
        return Err(early::no_dwell(job, pen, number).into());
    }
    let is_written = purpose == Purpose::Write && job.mode == Mode::Stepped;
    let has_dots = !texture.dot_pens().is_empty();
    let not_carried = if has_dots && is_written { early::formats(job, machine, has_dots) } else { Vec::new() };
    if not_carried.is_empty() { Ok(()) } else { Err(Error::many(not_carried)) }
}

/// A texture in `marks` of which nothing lies in the box of the part as it is turned, mm.
fn off_part(job: &Job, part: BoxMm<2>, marks: Box2) -> Option<Diag> {
    let marks = BoxMm { lo: marks.lo.mm(), hi: marks.hi.mm() };
    let is_apart = (0..2).any(|k| part.lo[k] > marks.hi[k] || part.hi[k] < marks.lo[k]);
    is_apart.then(|| {
        let turned = if job.placement.turn.as_rad() == 0.0 { "" } else { " as they are turned" };
        let text = format!(
            "nothing would be marked: the texture lies at {}, off the part at {}{turned}",
            spanned(marks),
            spanned(part)
        );
        let hint = "move the texture with its area or origin, or check the unit of surface and drawing";
        Diag::limit("job-empty", text).at(job.place_of("texture")).hint(hint)
    })
}

/// The box, mm, around one that is turned about the origin.
fn turned(flat: BoxMm<2>, turn_rad: f64) -> BoxMm<2> {
    let [c, s] = cos_sin(turn_rad);
    BoxMm::of(flat.corners().map(|[x, y]| [c * x - s * y, s * x + c * y]))
}

/// Where a box lies, for messages.
fn spanned(BoxMm { lo, hi }: BoxMm<2>) -> String {
    format!("x {:.3} to {:.3} mm and y {:.3} to {:.3} mm", lo[0], hi[0], lo[1], hi[1])
}

//! The independent proof: re-reads an emitted job folder and holds every rule against it.
//!
//! Consumes a job folder, and the job file and inputs that it names; promises a [`Proof`] with each rule, what was
//! checked against it and where it is broken. Files are read by readers of this crate's own (`read`), heights are
//! found on the surface file's own facets (`geometry`), texture strokes are placed again; nothing here calls what
//! divided, cut, ordered or wrote the program.
//!
//! Every fault is reported by one rule. The rules of geometry judge `program.txt`; `agreement` ties the drawings,
//! the stage programs, the OVF and the manifest to it, number by number; `hash` ties bytes to the
//! manifest. So a damaged drawing breaks agreement and leaves depth alone. `docs/explanation/verify.md` lists the
//! rules with their tolerances and limits.
//!
//! Units: nm, integer in files and f64 in `geometry`; mm and um only in the proof.

mod findings;
mod fixtures;
mod geometry;
mod inputs;
mod job_facts;
mod marked;
mod measured;
mod on_the_fly;
mod pose_fit;
mod probe;
mod progress;
mod proof;
mod read;
mod rest_to_rest;
mod rotation;
mod rules;
#[cfg(test)]
mod tests;
mod warp_fit;

use std::path::Path;

pub use probe::{ProbeProof, probe};
pub use progress::{Phase, Progress};
pub use proof::{Input, Lengths, NotProved, Proof, Rule, Violation};

use findings::{Findings, RuleCode};
use fixtures::Fixture;
use geometry::Geometry;
use inputs::Inputs;
use job_facts::JobFacts;
use marked::MarkedBefore;
use read::manifest::Manifest;
use read::program::ProgramFile;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{BoxMm, NM_PER_MM, P2};
use terrace_core::parallel;
use terrace_core::program::{PassId, PenId};
use terrace_core::progress::Task;
use terrace_input::job::{Job, Mode};
use terrace_input::texture::Texture;

/// Writes the points of a stroke, given by its number, into the cleared buffer and returns its pen.
type PlaceStroke<'a> = dyn Fn(usize, &mut Vec<P2>) -> PenId + 'a;

/// The texture strokes of one pass, placed again from the job, by number.
pub(crate) struct Drawing<'a> {
    /// How many strokes there are.
    len: usize,
    stroke: Box<PlaceStroke<'a>>,
    /// The element that a stroke comes from, for messages.
    element: Box<dyn Fn(usize) -> String + 'a>,
}

impl<'a> Drawing<'a> {
    fn from_texture(texture: &'a Texture) -> Self {
        Self {
            len: texture.len(),
            stroke: Box::new(|i, out| texture.stroke(i, out)),
            element: Box::new(|i| texture.element(i)),
        }
    }
}

/// A job as loaded again from its job file and inputs.
pub(crate) struct LoadedJob<'a> {
    facts: &'a JobFacts,
    /// The facets of its surface file.
    geometry: &'a Geometry,
    /// What holds the part.
    fixtures: &'a [Fixture],
    /// The strokes of its texture, pass by pass.
    drawings: &'a [Drawing<'a>],
}

/// Verifies the job folder at `folder`. Job file and inputs are where the manifest says, or in
/// `inputs_override`: a folder that holds the job file and, relative to it, its inputs.
///
/// # Errors
/// `job-folder` and `manifest` where there is no readable manifest; faults of a job file or an input
/// whose bytes are as when the job was compiled, yet cannot be read. Anything else that is wrong with
/// the folder is a violation in the proof.
pub fn verify(folder: &Path, inputs_override: Option<&Path>) -> Result<Proof, Error> {
    verify_with_progress(folder, inputs_override, &|_, _| {})
}

/// Verifies a job folder like [`verify`], and reports to `progress` how far it is.
///
/// # Errors
/// The same as those of [`verify`].
pub fn verify_with_progress(
    folder: &Path,
    inputs_override: Option<&Path>,
    progress: Progress<'_>,
) -> Result<Proof, Error> {
    if read::manifest::is_on_the_fly(folder) {
        return on_the_fly::verify(folder, inputs_override, progress);
    }
    // The shares of each step in the time of this phase.
    let [listed, written, read, drawn] = Phase::Read.task(progress).split([1, 2, 3, 2]);
    let manifest: read::manifest::Manifest = read::manifest::read(folder, &read::leaves::STEPPED)?;
    let mut findings = Findings::new(findings::STEPPED);
    let inputs = Inputs::locate(folder, &manifest.job.file, inputs_override);
    let (unchanged, program) = parallel::both(
        || {
            findings.not_proved = rules::stated::not_proved(&manifest.listed(), &read::leaves::STEPPED);
            rules::hash::check(folder, &manifest.listed(), &inputs, &mut findings.rules[RuleCode::Hash])
        },
        || read::program::read(&folder.join("program.txt")),
    );
    let mut program = readable(program, &mut findings);
    drop((listed, written));
    if !unchanged {
        drop((read, drawn));
        let _comparing = Phase::Files.task(progress);
        // The job cannot be loaded again, but the files of the folder can still be compared with each other.
        let facts = JobFacts::from_manifest(&manifest);
        if let Some(program) = &mut program {
            rules::without_inputs(folder, &manifest, program, &facts, &mut findings);
        }
        return Ok(findings.into_proof());
    }
    let (job, facts) = job_facts::load(&inputs, Mode::Stepped)?;
    findings.against = inputs.used(&job, folder);
    let Some(mut program) = program else { return Ok(findings.into_proof()) };
    // The surface is read while the files of the folder are compared with each other.
    let (shaped, stages) = parallel::both(
        || {
            let (shape, box_mm) = job_facts::shape(&job)?;
            drop(read);
            Ok::<_, Error>((Geometry::new(shape, facts.max_incidence_rad, facts.weld_nm), box_mm))
        },
        || rules::without_inputs(folder, &manifest, &mut program, &facts, &mut findings),
    );
    let (geometry, box_mm) = shaped?;
    rules::summary::part(manifest.summary.part_mm, box_mm, &geometry, &facts, &mut findings.rules[RuleCode::Summary]);
    let Some(lying) = measured::lying(&job, &manifest, &facts, &geometry, &mut findings)? else {
        return Ok(findings.into_proof());
    };
    let part = Part { designed: &geometry, lying: &lying, box_mm };
    let Some(textures) = place_textures(&job, &manifest, &facts, &part, &mut findings, drawn)? else {
        return Ok(findings.into_proof());
    };
    let drawings: Vec<Drawing<'_>> = textures.iter().map(Drawing::from_texture).collect();
    // Where the folder's own positions have the part: of the fixtures on the table that is where the stage goes.
    let origin = program.origins.first().copied().unwrap_or_default();
    let fixtures = fixtures::load(&job, origin, lying.pose())?;
    fixtures::check(&manifest, &fixtures, &mut findings.rules[RuleCode::Agreement]);
    let geometry = lying.geometry().unwrap_or(&geometry);
    let job = LoadedJob { facts: &facts, geometry, fixtures: &fixtures, drawings: &drawings };
    check_folder(&stages, &manifest, &mut program, &job, &mut findings, progress);
    Ok(findings.into_proof())
}

/// The part as designed, turned as the job says, and as it lies where it was measured.
struct Part<'a> {
    designed: &'a Geometry,
    lying: &'a measured::Lying,
    /// Its box in plan before the turn.
    box_mm: BoxMm<2>,
}

/// Places the textures of every pass again, and holds the rules that compare them with their own files. Returns None
/// where the manifest does not give the lines along contours: without these the texture is not known.
fn place_textures(
    job: &Job,
    manifest: &Manifest,
    facts: &JobFacts,
    part: &Part<'_>,
    findings: &mut Findings,
    task: Task<'_>,
) -> Result<Option<Vec<Texture>>, Error> {
    let &Part { designed: geometry, lying, box_mm } = part;
    let site = rules::page::Site { part_box: box_mm, turn_rad: facts.turn_deg.to_radians() };
    let spot_mm = facts.machine.lens.spot.as_mm();
    let mut files = rules::drawing_files::Files::default();
    let before = MarkedBefore::read(job, spot_mm, geometry)?;
    findings.rules[RuleCode::Marked].ran = true;
    let mut textures = Vec::new();
    let task = task.of_steps(facts.passes.count as usize);
    for pass in (0..facts.passes.count).map(PassId) {
        let mut texture = job_facts::texture(job, &facts.machine, pass, box_mm)?;
        if !rules::fill::check(manifest, facts, pass, &mut texture, &mut findings.rules[RuleCode::Fill]) {
            return Ok(None);
        }
        let drawing = Drawing::from_texture(&texture);
        let placed = rules::drawing::PlacedTextures { job, texture: &texture, drawing: &drawing, site };
        let requests = job.textures_of_pass(pass);
        rules::drawing::check(&placed, spot_mm, &mut files, &mut findings.rules[RuleCode::Drawing]);
        rules::bitmap::check(&placed, &requests, spot_mm, &mut files, &mut findings.rules[RuleCode::Bitmap]);
        rules::mask::check(&placed, &mut files, &mut findings.rules[RuleCode::Mask]);
        drop(drawing);
        // Every pass marks the same space curves, and the manifest counts each curve once.
        if pass == PassId(0) {
            let rules = findings.rules.several([RuleCode::Curves, RuleCode::Summary]);
            rules::curves::check(job, &texture, geometry, manifest.summary.curves.as_ref(), rules);
        }
        let texture = without_marked(texture, &before, spot_mm, &mut findings.rules[RuleCode::Marked])?;
        textures.push(lying.texture(texture, geometry, findings)?);
        task.step();
    }
    Ok(Some(textures))
}

/// The texture without what jobs before have marked of it, held to their marks.
fn without_marked(texture: Texture, before: &MarkedBefore, spot_mm: f64, rule: &mut Rule) -> Result<Texture, Error> {
    if before.marks.is_empty() {
        return Ok(texture);
    }
    let left = texture.without(&before.left_out(spot_mm))?;
    {
        let strokes = rules::marked::Strokes {
            whole: &Drawing::from_texture(&texture),
            left: &Drawing::from_texture(&left.texture),
            pieces: &|i| left.pieces(i),
        };
        rules::marked::check(&strokes, &before.marks, spot_mm * NM_PER_MM / 2.0, rule);
    }
    Ok(left.texture)
}

/// Holds the rules that need the job and its inputs.
fn check_folder(
    stages: &rules::Stages,
    manifest: &Manifest,
    program: &mut ProgramFile,
    job: &LoadedJob<'_>,
    findings: &mut Findings,
    progress: Progress<'_>,
) {
    let LoadedJob { facts, geometry, fixtures, .. } = *job;
    let moves = Phase::Files.task(progress);
    let around = rules::Around { part: geometry, fixtures };
    rules::moves(stages, manifest, program, facts, &around, findings);
    rules::agreement::with_job(manifest, program, facts, &mut findings.rules[RuleCode::Agreement]);
    drop(moves);
    let [depth, dose] = Phase::Marks.task(progress).split([4, 1]);
    let marks = rules::depth_and_field::check(program, facts, geometry, findings, depth);
    rules::shadow::check(program, facts, fixtures, findings);
    rules::dose::check(program, facts, geometry, findings);
    drop(dose);
    let [pieces, sums] = Phase::Coverage.task(progress).split([9, 1]);
    let pieces = rules::coverage::check(manifest, program, job, &marks.drawn, findings, pieces);
    rules::summary::check(manifest, program, facts, &marks, &pieces, findings);
    rules::summary::slopes(manifest, program, facts, geometry, &marks, findings);
    drop(sums);
}

/// The program that was read from `program.txt`; a fault in reading it is reported by `agreement`.
fn readable(program: Result<ProgramFile, read::Fault>, findings: &mut Findings) -> Option<ProgramFile> {
    match program {
        Ok(program) => Some(program),
        Err(fault) => {
            findings.rules[RuleCode::Agreement].ran = true;
            findings.rules[RuleCode::Agreement].broken("", format!("program.txt:{}", fault.line), fault.message);
            None
        }
    }
}

/// The error for inputs that cannot be used.
fn unusable(code: &'static str, message: &str, path: &Path) -> Error {
    Diag::input(code, message).at(Place::file(path.display().to_string())).into()
}

//! The files of a job folder, by mode; the manifest is written last.

use std::fs;
use std::path::Path;

use super::{failed, inputs, path_from};
use crate::diag::Error;
use crate::emit::{self, Files, Stepped};
use crate::geom::{Box2, P2};
use crate::job::Job;
use crate::manifest::{self, Facts, FileFact, Head, MANIFEST, OnTheFlyFacts};
use crate::parallel;
use crate::plan::{OnTheFlyPlan, Pass, Plan, SteppedPlan};
use crate::program::{self, PenId, Program};
use crate::report::{self, Marks};
use crate::scene::{self, Relief, Scene};
use crate::surface::Surface;

/// A folder being filled.
pub(super) struct Filling<'a> {
    folder: &'a Path,
    files: Vec<FileFact>,
}

impl Filling<'_> {
    /// Writes one file and notes what was written.
    fn put(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.files.push(put(self.folder, name, bytes)?);
        Ok(())
    }
}

fn make(path: &Path) -> Result<(), Error> {
    fs::create_dir(path).map_err(|e| failed("make the folder", path, &e))
}

/// Writes one file of a job folder; answers with what the manifest says of it.
pub(crate) fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<FileFact, Error> {
    let path = folder.join(name);
    fs::write(&path, bytes).map_err(|e| failed("write the file", &path, &e))?;
    Ok(FileFact { file: name.into(), bytes: bytes.len() as u64, blake3: blake3::hash(bytes).to_hex().to_string() })
}

/// Writes the files of a job and answers with its manifest, which begins with the head given.
pub(super) type Fill<'a> = dyn Fn(&mut Filling<'_>, &Head) -> Result<Vec<u8>, Error> + 'a;

/// Makes the new folder of a job at `folder`, which will stand at `target`.
pub(super) fn fill(job: &Job, folder: &Path, target: &Path, fill: &Fill<'_>) -> Result<(), Error> {
    make(folder)?;
    let head = Head::new(job, path_from(&job.path, target)?, inputs(job)?);
    let manifest = fill(&mut Filling { folder, files: Vec::new() }, &head)?;
    put(folder, MANIFEST, &manifest)?;
    Ok(())
}

/// Writes the files of a stepped job; answers with its manifest.
pub(super) fn stepped(plan: &SteppedPlan, head: &Head, filling: &mut Filling<'_>) -> Result<Vec<u8>, Error> {
    let SteppedPlan { job, machine, checked, passes, summary, figures, .. } = plan;
    let (part, name) = (file_name(&job.surface.file), file_name(&job.path));
    filling.put("program.txt", &program::text::write(checked.program(), checked.origins()))?;
    let block_file = emit::block_file(&job.formats);
    let emitted = Stepped { checked, machine, figures, job: &name, part: &part, block_file, frames: None };
    for target in job.formats.iter().map(|f| f.target()) {
        match target.stepped {
            Some(Files::Whole(file, write)) => filling.put(file, &write(&emitted))?,
            Some(Files::Blocks(ending, write)) => blocks(&emitted, ending, write, filling)?,
            None => {}
        }
    }
    if let Some(pen) = job.frames {
        frames(&emitted, pen, job, filling)?;
    }
    let (scene, relief) = looks(plan);
    for (k, pass) in passes.iter().enumerate() {
        let marks = Marks::of(&scene, pass.blocks.clone());
        let layout = layout(plan, pass, &name, (&scene, &relief, &marks));
        if k == 0 {
            filling.put("layout.svg", report::layout_svg(&layout).as_bytes())?;
            let by_slope = report::Layout { shade: report::Shade::Incidence, ..layout.clone() };
            filling.put("slope.svg", report::layout_svg(&by_slope).as_bytes())?;
            filling.put("report.html", report::report_html(&layout).as_bytes())?;
        } else {
            filling.put(&report::pass_file(k as u32), report::layout_svg(&layout).as_bytes())?;
        }
    }
    let facts = Facts {
        job_file: &head.job.file,
        job,
        machine,
        checked,
        passes: passes.iter().map(|p| (&p.sections, p.directions.as_ref())).collect(),
        depth_mm: plan.depth.mm(),
        figures,
        summary,
    };
    let sheet = report::runsheet::Sheet::new(&facts);
    let sheets = [("runsheet.csv", report::runsheet::csv(&sheet)), ("runsheet.txt", report::runsheet::txt(&sheet))];
    sheets.iter().try_for_each(|(name, bytes)| filling.put(name, bytes))?;
    let mut files = std::mem::take(&mut filling.files);
    files.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(manifest::manifest(&Head { files, ..head.clone() }, &facts))
}

/// Writes one file for every block.
fn blocks(
    emitted: &Stepped<'_>,
    ending: &str,
    write: fn(&Stepped<'_>, usize) -> Vec<u8>,
    filling: &mut Filling<'_>,
) -> Result<(), Error> {
    let folder = filling.folder;
    let program = emitted.checked.program();
    let name = |i: usize| match emitted.frames {
        None => Program::block_file(program.id(i), ending),
        Some(_) => emit::frames::of_block(program.id(i), ending),
    };
    let one = |i: usize| put(folder, &name(i), &write(emitted, i));
    make_inner(folder, if emitted.frames.is_some() { "frames" } else { "blocks" })?;
    let written: Result<Vec<FileFact>, Error> = parallel::map(program.blocks.len(), one).into_iter().collect();
    filling.files.extend(written?);
    Ok(())
}

/// Makes a folder inside a job folder, unless it is there.
fn make_inner(folder: &Path, name: &str) -> Result<(), Error> {
    let inner = folder.join(name);
    if inner.exists() { Ok(()) } else { make(&inner) }
}

/// Writes the frames of all blocks, drawn with a pen, and those of the outline where one file holds the job.
fn frames(emitted: &Stepped<'_>, pen: PenId, job: &Job, filling: &mut Filling<'_>) -> Result<(), Error> {
    let Stepped { checked, machine, .. } = *emitted;
    let points = manifest::registered(job, machine, checked);
    let framed = emit::frames::frames(checked, pen);
    let all = Stepped { checked: &framed, figures: &[], frames: Some(&points), ..*emitted };
    let corners = emit::frames::of_outline(checked, pen, machine);
    let corners = Stepped { checked: &corners, ..all };
    for target in job.formats.iter().map(|f| f.target()) {
        match target.stepped {
            Some(Files::Whole(file, write)) => {
                make_inner(filling.folder, "frames")?;
                filling.put(&emit::frames::of_whole(file), &write(&corners))?;
            }
            Some(Files::Blocks(ending, write)) => blocks(&all, ending, write, filling)?,
            None => {}
        }
    }
    Ok(())
}

/// Writes the programs of an on-the-fly job; answers with its manifest.
pub(super) fn on_the_fly(plan: &OnTheFlyPlan, head: &Head, filling: &mut Filling<'_>) -> Result<Vec<u8>, Error> {
    let OnTheFlyPlan { job, machine, checked, .. } = plan;
    let kind = checked.program().kind;
    let files = job.formats.iter().filter_map(|f| f.target().on_the_fly);
    for file in files.filter(|f| f.kinds.contains(&kind)) {
        filling.put(file.name, &(file.write)(checked, machine))?;
    }
    filling.put("layout.svg", on_the_fly_svg(plan)?.as_bytes())?;
    let files = std::mem::take(&mut filling.files);
    let facts =
        OnTheFlyFacts { job, machine, program: checked.program(), left_out: &plan.left_out, summary: &plan.summary };
    Ok(manifest::on_the_fly_manifest(&Head { files, ..head.clone() }, &facts))
}

/// The picture of a plan, of a stepped one that of its first pass, as `layout.svg` has it.
///
/// # Errors
/// Those of a machine that does not have the axes of an on-the-fly program.
pub fn layout_svg(plan: &Plan) -> Result<String, Error> {
    match plan {
        Plan::Stepped(plan) => {
            let (scene, relief) = looks(plan);
            let pass = &plan.passes[0];
            let marks = Marks::of(&scene, pass.blocks.clone());
            let name = file_name(&plan.job.path);
            Ok(report::layout_svg(&layout(plan, pass, &name, (&scene, &relief, &marks))))
        }
        Plan::OnTheFly(plan) => on_the_fly_svg(plan),
    }
}

/// The picture of an on-the-fly job.
fn on_the_fly_svg(plan: &OnTheFlyPlan) -> Result<String, Error> {
    let (part, texture) = (part_box(&plan.inputs.surface), plan.texture.bounds());
    let relief = Relief::under(&plan.inputs.surface, report::relief_area(part, texture), report::RELIEF_CELLS);
    let scene = scene::of_on_the_fly(plan, &relief)?;
    let marks = Marks::of(&scene, 0..scene.groups.len());
    Ok(report::on_the_fly_svg(&report::OnTheFlyLayout {
        job: &file_name(&plan.job.path),
        program: plan.checked.program(),
        machine: &plan.machine,
        part,
        texture,
        scene: &scene,
        relief: &relief,
        marks: &marks,
        turn_rad: plan.job.placement.turn.as_rad(),
        summary: &plan.summary,
    }))
}

/// What all pictures of a stepped job share.
fn looks(plan: &SteppedPlan) -> (Scene, Relief) {
    let surface = &plan.inputs.surface;
    let area = report::relief_area(part_box(surface), plan.passes[0].texture);
    let relief = Relief::under(surface, area, report::RELIEF_CELLS);
    (scene::of_stepped(plan, &relief), relief)
}

fn part_box(surface: &Surface) -> Box2 {
    let part = surface.part_box_mm();
    let mut all = Box2::EMPTY;
    [part.lo, part.hi].into_iter().filter_map(|[x, y]| P2::from_mm(x, y)).for_each(|p| all.add(p));
    all
}

/// What the picture of a pass is drawn from; `job` is the name that it shows.
fn layout<'a>(
    plan: &'a SteppedPlan,
    pass: &'a Pass,
    job: &'a str,
    (scene, relief, marks): (&'a Scene, &'a Relief, &'a Marks),
) -> report::Layout<'a> {
    report::Layout {
        job,
        checked: &plan.checked,
        blocks: pass.blocks.clone(),
        passes: plan.summary.passes,
        machine: &plan.machine,
        sections: pass.sections,
        map: &pass.map,
        part: part_box(&plan.inputs.surface),
        texture: pass.texture,
        scene,
        relief,
        marks,
        turn_rad: plan.job.placement.turn.as_rad(),
        figures: &plan.figures,
        drawn: report::drawn(&plan.checked, &plan.machine),
        shade: report::Shade::Height,
        summary: &plan.summary,
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

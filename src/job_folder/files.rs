//! The files of a job folder, by mode; the manifest is written last.

use std::fs;
use std::path::Path;

use super::pictures::{Pictures, file_name};
use super::{failed, inputs, path_from};
use crate::diag::Error;
use crate::emit::{self, Files, Stepped};
use crate::job::Job;
use crate::manifest::{self, Facts, FileFact, Head, MANIFEST, OnTheFlyFacts};
use crate::parallel;
use crate::plan::{OnTheFlyPlan, Phase, Progress, SteppedPlan};
use crate::program::{self, PenId, Program};
use crate::progress::Task;
use crate::report;

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

/// Says in the report of a folder what was proved of it.
pub(super) fn tell_proof(folder: &Path, proved: &str) -> Result<(), Error> {
    let read = |name: &str| {
        let path = folder.join(name);
        fs::read(&path).map_err(|e| failed("read the file again", &path, &e))
    };
    let report =
        String::from_utf8_lossy(&read(REPORT)?).replacen(report::NOT_VERIFIED, &report::page::escape(proved), 1);
    let fact = put(folder, REPORT, report.as_bytes())?;
    put(folder, MANIFEST, &manifest::with_file(&read(MANIFEST)?, &fact)?)?;
    Ok(())
}

/// The report of a folder.
pub(super) const REPORT: &str = "report.html";

/// Writes the files of a stepped job; answers with its manifest.
pub(super) fn stepped(
    plan: &SteppedPlan,
    head: &Head,
    filling: &mut Filling<'_>,
    is_drawn: bool,
    progress: Progress<'_>,
) -> Result<Vec<u8>, Error> {
    let [whole, formats, framed] = Phase::Write.task(progress).split([1, 6, 3]);
    let SteppedPlan { job, machine, checked, passes, summary, figures, .. } = plan;
    let (part, name) = (file_name(&job.surface.file), file_name(&job.path));
    filling.put("program.txt", &program::text::write(checked.program(), checked.origins()))?;
    drop(whole);
    let block_file = emit::block_file(&job.formats);
    let emitted = Stepped { checked, machine, figures, job: &name, part: &part, block_file, frames: None };
    for (format, task) in job.formats.iter().zip(formats.parts(job.formats.len())) {
        match format.target().stepped {
            Some(Files::Whole(file, write)) => filling.put(file, &write(&emitted))?,
            Some(Files::Blocks(ending, write)) => blocks(&emitted, ending, write, filling, task)?,
            None => {}
        }
    }
    if let Some(pen) = job.frames {
        frames(&emitted, pen, job, filling, framed)?;
    } else {
        drop(framed);
    }
    if is_drawn {
        draw(&Pictures::of_stepped(plan), filling, progress)?;
    }
    let facts = Facts {
        job_file: &head.job.file,
        job,
        machine,
        checked,
        passes: passes.iter().map(|p| (&p.sections, p.directions.as_ref())).collect(),
        depth_mm: plan.depth.mm(),
        tessellation_mm: plan.inputs.surface.tessellation_mm(),
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

/// Draws the pictures of a plan.
fn draw(pictures: &Pictures<'_>, filling: &mut Filling<'_>, progress: Progress<'_>) -> Result<(), Error> {
    let drawing = Phase::Draw.task(progress).of_steps(pictures.count());
    pictures.write(&mut |name, bytes| filling.put(name, bytes), &drawing)
}

/// Writes one file for every block.
fn blocks(
    emitted: &Stepped<'_>,
    ending: &str,
    write: fn(&Stepped<'_>, usize) -> Vec<u8>,
    filling: &mut Filling<'_>,
    task: Task<'_>,
) -> Result<(), Error> {
    let folder = filling.folder;
    let program = emitted.checked.program();
    let name = |i: usize| match emitted.frames {
        None => Program::block_file(program.id(i), ending),
        Some(_) => emit::frames::of_block(program.id(i), ending),
    };
    let task = task.of_steps(program.blocks.len());
    let one = |i: usize| {
        let fact = put(folder, &name(i), &write(emitted, i));
        task.step();
        fact
    };
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
fn frames(
    emitted: &Stepped<'_>,
    pen: PenId,
    job: &Job,
    filling: &mut Filling<'_>,
    task: Task<'_>,
) -> Result<(), Error> {
    let Stepped { checked, machine, .. } = *emitted;
    let points = manifest::registered(job, machine, checked);
    let framed = emit::frames::frames(checked, pen, machine);
    let all = Stepped { checked: &framed, figures: &[], frames: Some(&points), ..*emitted };
    let corners = emit::frames::of_outline(checked, pen, machine);
    let corners = Stepped { checked: &corners, ..all };
    for (format, task) in job.formats.iter().zip(task.parts(job.formats.len())) {
        match format.target().stepped {
            Some(Files::Whole(file, write)) => {
                make_inner(filling.folder, "frames")?;
                filling.put(&emit::frames::of_whole(file), &write(&corners))?;
            }
            Some(Files::Blocks(ending, write)) => blocks(&all, ending, write, filling, task)?,
            None => {}
        }
    }
    Ok(())
}

/// Writes the programs of an on-the-fly job; answers with its manifest.
pub(super) fn on_the_fly(
    plan: &OnTheFlyPlan,
    head: &Head,
    filling: &mut Filling<'_>,
    is_drawn: bool,
    progress: Progress<'_>,
) -> Result<Vec<u8>, Error> {
    let writing = Phase::Write.task(progress).of_steps(plan.job.formats.len());
    let OnTheFlyPlan { job, machine, checked, .. } = plan;
    let kind = checked.program().kind;
    let files = job.formats.iter().filter_map(|f| f.target().on_the_fly);
    let mut programs = Vec::new();
    for file in files.filter(|f| f.kinds.contains(&kind)) {
        filling.put(file.name, &(file.write)(checked, machine))?;
        programs.push(file.name);
        writing.step();
    }
    drop(writing);
    if is_drawn {
        draw(&Pictures::of_on_the_fly(plan)?, filling, progress)?;
    }
    let facts =
        OnTheFlyFacts { job, machine, program: checked.program(), left_out: &plan.left_out, summary: &plan.summary };
    filling.put("runsheet.txt", &report::on_the_fly_txt(&facts, &head.job.file, &programs))?;
    let mut files = std::mem::take(&mut filling.files);
    files.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(manifest::on_the_fly_manifest(&Head { files, ..head.clone() }, &facts))
}

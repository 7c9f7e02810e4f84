//! The files of a job folder, by mode; the manifest is written last.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use terrace_plan::emit::Target;

use super::pictures::{Pictures, file_name};
use super::{failed, inputs, path_from};
use crate::report;
use terrace_core::diag::{self, Error};
use terrace_core::format::Format;
use terrace_core::geom::Nm;
use terrace_core::parallel;
use terrace_core::program::{self, PenId, Program};
use terrace_core::progress::Task;
use terrace_input::job::Job;
use terrace_plan::emit::{self, Files, Stepped};
use terrace_plan::manifest::{self, Facts, FileFact, Head, MANIFEST, OnTheFlyFacts};
use terrace_plan::plan::{OnTheFlyPlan, Phase, Progress, SteppedPlan};

/// A folder being filled.
pub struct Filling<'a> {
    folder: &'a Path,
    files: Vec<FileFact>,
}

impl<'a> Filling<'a> {
    fn new(folder: &'a Path) -> Self {
        Self { folder, files: Vec::new() }
    }

    /// Writes one file and notes what was written.
    pub fn put(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.files.push(put(self.folder, name, bytes)?);
        Ok(())
    }

    /// Writes one file piece by piece, so that it is never whole in memory, and notes what was written.
    fn stream(&mut self, name: &str, write: &dyn Fn(&mut dyn Write) -> io::Result<()>) -> Result<(), Error> {
        let path = self.folder.join(name);
        let written = File::create(&path).and_then(|file| {
            let mut to = Hashed { file, bytes: 0, hash: blake3::Hasher::new() };
            write(&mut to)?;
            Ok(to)
        });
        let Hashed { bytes, hash, .. } = written.map_err(|e| failed("write the file", &path, &e))?;
        self.files.push(FileFact { file: name.into(), bytes, blake3: hash.finalize().to_hex().to_string() });
        Ok(())
    }

    /// The files that were written, by name.
    pub fn into_files(self) -> Vec<FileFact> {
        let mut files = self.files;
        files.sort_by(|a, b| a.file.cmp(&b.file));
        files
    }
}

/// A file that is hashed while it is written.
struct Hashed {
    file: File,
    bytes: u64,
    hash: blake3::Hasher,
}

impl Write for Hashed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.bytes += count as u64;
        self.hash.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Makes a folder.
fn make(path: &Path) -> Result<(), Error> {
    fs::create_dir(path).map_err(|e| failed("make the folder", path, &e))
}

/// Writes one file of a job folder; returns what the manifest says of it.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<FileFact, Error> {
    let path = folder.join(name);
    fs::write(&path, bytes).map_err(|e| failed("write the file", &path, &e))?;
    Ok(FileFact { file: name.into(), bytes: bytes.len() as u64, blake3: blake3::hash(bytes).to_hex().to_string() })
}

/// Writes the files of a folder and returns its manifest.
pub(super) type Fill<'a> = dyn Fn(Filling<'_>) -> Result<Vec<u8>, Error> + 'a;

/// Fills the new folder of a job; its manifest is written last.
pub(super) fn fill(folder: &Path, fill: &Fill<'_>) -> Result<(), Error> {
    let manifest = fill(Filling::new(folder))?;
    put(folder, MANIFEST, &manifest)?;
    Ok(())
}

/// What the manifest of a job begins with in a folder that will stand at `target`.
pub(super) fn head(job: &Job, target: &Path) -> Result<Head, Error> {
    Ok(Head::new(job, path_from(&job.path, target)?, inputs(job)?))
}

/// Says in the report of a folder what was proved of it.
pub(super) fn tell_proof(folder: &Path, proved: &str) -> Result<(), Error> {
    let report = read_again(folder, REPORT)?;
    let report = String::from_utf8_lossy(&report).replacen(report::NOT_VERIFIED, &report::page::escape(proved), 1);
    let fact = put(folder, REPORT, report.as_bytes())?;
    put(folder, MANIFEST, &manifest::with_file(&read_again(folder, MANIFEST)?, &fact)?)?;
    Ok(())
}

/// The bytes of a file that was written before.
fn read_again(folder: &Path, name: &str) -> Result<Vec<u8>, Error> {
    let path = folder.join(name);
    fs::read(&path).map_err(|e| failed("read the file again", &path, &e))
}

/// The report of a folder.
pub(super) const REPORT: &str = "report.html";

/// Writes the files of a stepped job; returns its manifest.
pub(super) fn stepped(
    plan: &SteppedPlan,
    head: &Head,
    mut filling: Filling<'_>,
    is_drawn: bool,
    progress: Progress<'_>,
) -> Result<Vec<u8>, Error> {
    let [whole, formats, framed] = Phase::Write.task(progress).split([1, 6, 3]);
    let SteppedPlan { job, machine, checked, passes, summary, figures, .. } = plan;
    let part = file_name(&job.surface.file);
    let name = file_name(&job.path);
    filling.stream("program.txt", &|to| program::text::write(to, checked.program(), checked.origins()))?;
    drop(whole);
    let block_file = emit::block_file(&job.formats);
    let emitted = Stepped { checked, machine, figures, job: &name, part: &part, block_file, frames: None };
    let points = manifest::registered(job, machine, checked);
    let frames = job.frames.map(|pen| (pen, points.as_slice()));
    Programs { emitted, formats: &job.formats, frames, whole: None }.write(&mut filling, [formats, framed])?;
    if is_drawn {
        draw(&Pictures::of_stepped(plan), &mut filling, progress)?;
    }
    let facts = Facts {
        job_file: &head.job.file,
        job,
        machine,
        checked,
        passes: passes.iter().map(|p| (&p.sections, p.directions.as_ref())).collect(),
        depth_mm: plan.depth.mm(),
        tessellation_mm: plan.inputs.surface.tessellation_mm(),
        measured: plan.inputs.measured.as_ref(),
        fixtures: &plan.inputs.fixtures,
        figures,
        summary,
    };
    let sheet = report::runsheet::Sheet::new(&facts);
    let sheets = [("runsheet.csv", report::runsheet::csv(&sheet)), ("runsheet.txt", report::runsheet::txt(&sheet))];
    sheets.iter().try_for_each(|(name, bytes)| filling.put(name, bytes))?;
    Ok(manifest::manifest(&Head { files: filling.into_files(), ..head.clone() }, &facts))
}

/// Writes the file of a block.
type WriteBlock = fn(&Stepped<'_>, usize) -> Vec<u8>;

/// The program files of a stepped job, in all its formats.
pub struct Programs<'a> {
    /// The blocks that are written.
    pub emitted: Stepped<'a>,
    /// What is written of them.
    pub formats: &'a [Format],
    /// Pen of the frames, and commanded x and y of the registration points of every set-up; None where the job has no
    /// frames.
    pub frames: Option<(PenId, &'a [Vec<[Nm; 2]>])>,
    /// The folder of the whole job, of which the files of single blocks are copied; None where they are made.
    pub whole: Option<&'a Path>,
}

impl Programs<'_> {
    /// Writes the programs: those of the marks, then those of the frames.
    pub fn write(&self, filling: &mut Filling<'_>, [marked, framed]: [Task<'_>; 2]) -> Result<(), Error> {
        let Stepped { checked, machine, .. } = self.emitted;
        self.write_formats(filling, &self.emitted, &self.emitted, marked)?;
        let Some((pen, points)) = self.frames else { return Ok(()) };
        let block_frames = emit::frames::frames(checked, pen, machine);
        let by_block = Stepped { checked: &block_frames, figures: &[], frames: Some(points), ..self.emitted };
        // Where one file holds the job, it holds the frames of its outline.
        let outline_frames = emit::frames::of_outline(checked, pen, machine);
        self.write_formats(filling, &Stepped { checked: &outline_frames, ..by_block }, &by_block, framed)
    }

    /// Writes the files of every format: `of_job` to those with one file for the job, `by_block` to those with one for
    /// every block. With frames they differ: one file holds the frames of the outline alone.
    fn write_formats(
        &self,
        filling: &mut Filling<'_>,
        of_job: &Stepped<'_>,
        by_block: &Stepped<'_>,
        task: Task<'_>,
    ) -> Result<(), Error> {
        let is_framed = of_job.frames.is_some();
        // A part of the task is done when it is dropped; only files of single blocks are counted one by one.
        for (format, writing) in self.formats.iter().zip(task.parts(self.formats.len())) {
            match Target::of(*format).stepped {
                Some(Files::Whole(file, write)) if is_framed => {
                    make_inner(filling.folder, "frames")?;
                    filling.put(&emit::frames::of_whole(file), &write(of_job))?;
                }
                Some(Files::Whole(file, write)) => filling.put(file, &write(of_job))?,
                Some(Files::Blocks(ending, write)) => self.blocks(filling, by_block, ending, write, writing)?,
                // A format of on-the-fly jobs alone.
                None => {}
            }
        }
        Ok(())
    }

    /// One file for every block.
    fn blocks(
        &self,
        filling: &mut Filling<'_>,
        emitted: &Stepped<'_>,
        ending: &str,
        write: WriteBlock,
        task: Task<'_>,
    ) -> Result<(), Error> {
        let folder = filling.folder;
        let count = emitted.checked.program().blocks.len();
        let task = task.of_steps(count);
        make_inner(folder, if emitted.frames.is_some() { "frames" } else { "blocks" })?;
        let facts = parallel::map(count, |i| {
            let fact = self.block(folder, emitted, i, ending, write);
            task.step();
            fact
        });
        filling.files.extend(facts.into_iter().collect::<Result<Vec<FileFact>, Error>>()?);
        Ok(())
    }

    /// The file of block `i`: made, or copied from the folder of the whole job.
    fn block(
        &self,
        folder: &Path,
        emitted: &Stepped<'_>,
        i: usize,
        ending: &str,
        write: WriteBlock,
    ) -> Result<FileFact, Error> {
        let id = emitted.checked.program().id(i);
        let name = match emitted.frames {
            None => Program::block_file(id, ending),
            Some(_) => emit::frames::of_block(id, ending),
        };
        let bytes = match self.whole {
            None => write(emitted, i),
            Some(whole) => diag::read_file(&whole.join(&name), u64::MAX)?,
        };
        put(folder, &name, &bytes)
    }
}

/// Draws the pictures of a plan.
fn draw(pictures: &Pictures<'_>, filling: &mut Filling<'_>, progress: Progress<'_>) -> Result<(), Error> {
    let drawing = Phase::Draw.task(progress).of_steps(pictures.count());
    pictures.write(&mut |name, bytes| filling.put(name, bytes), &drawing)
}

/// Makes a folder inside a job folder, unless it is there.
fn make_inner(folder: &Path, name: &str) -> Result<(), Error> {
    let inner = folder.join(name);
    if inner.exists() { Ok(()) } else { make(&inner) }
}

/// Writes the programs of an on-the-fly job; returns its manifest.
pub(super) fn on_the_fly(
    plan: &OnTheFlyPlan,
    head: &Head,
    mut filling: Filling<'_>,
    is_drawn: bool,
    progress: Progress<'_>,
) -> Result<Vec<u8>, Error> {
    let writing = Phase::Write.task(progress).of_steps(plan.job.formats.len());
    let OnTheFlyPlan { job, machine, checked, .. } = plan;
    let kind = checked.program().kind;
    let files = job.formats.iter().filter_map(|&f| Target::of(f).on_the_fly);
    let mut programs = Vec::new();
    for file in files.filter(|f| f.kinds.contains(&kind)) {
        filling.put(file.name, &(file.write)(checked, machine))?;
        programs.push(file.name);
        writing.step();
    }
    drop(writing);
    if is_drawn {
        draw(&Pictures::of_on_the_fly(plan)?, &mut filling, progress)?;
    }
    let facts =
        OnTheFlyFacts { job, machine, program: checked.program(), left_out: &plan.left_out, summary: &plan.summary };
    filling.put("runsheet.txt", &report::on_the_fly_txt(&facts, &head.job.file, &programs))?;
    Ok(manifest::on_the_fly_manifest(&Head { files: filling.into_files(), ..head.clone() }, &facts))
}

//! The job folder: what it holds, and that it is written whole or not at all.
//!
//! Files are written into a hidden folder beside the target, the manifest last; when all are there the
//! folder takes the target's name (`target`). A job folder belongs to the program: replacing it removes
//! everything in it.

mod fly;
mod target;

use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::compile::{Pass, Plan};
use crate::diag::{Diag, Error, Place};
use crate::emit;
use crate::geom::mm_from_nm;
use crate::preview;
use crate::program;
use crate::record::{self, FileFact, InputFact};
use crate::spec::{Format, Job};
pub use fly::{summary_of_fly, write_fly};
use target::{Target, resolved};

/// The name of the file that makes a folder a job folder; written last.
pub const MANIFEST: &str = "manifest.json";

fn place(path: &Path) -> Place {
    Place::file(path.display().to_string())
}

fn failed(what: &str, path: &Path, e: &std::io::Error) -> Error {
    Diag::input("output-unwritable", format!("cannot {what}: {e}"))
        .at(place(path))
        .hint("check path, space and permissions")
        .into()
}

/// What the pictures of a plan are drawn from; `job` is the name they show.
pub fn layout<'a>(plan: &'a Plan, job: &'a str) -> preview::Layout<'a> {
    preview::Layout {
        job,
        checked: &plan.checked,
        blocks: 0..plan.more.first().map_or(plan.checked.program().blocks.len(), |p| p.blocks.start),
        passes: plan.summary.passes,
        machine: &plan.machine,
        sections: plan.sections,
        map: &plan.map,
        texture: plan.texture,
        turn_rad: plan.job.file.placement.turn.as_rad(),
        block_s: &plan.block_times,
        drawn: preview::drawn(&plan.checked, &plan.machine),
        slopes: &plan.slopes,
        shade: preview::Shade::Height,
        summary: &plan.summary,
    }
}

/// The same of a pass after the first.
fn layout_of<'a>(plan: &'a Plan, pass: &'a Pass, job: &'a str) -> preview::Layout<'a> {
    preview::Layout {
        sections: pass.sections,
        map: &pass.map,
        texture: pass.texture,
        blocks: pass.blocks.clone(),
        ..layout(plan, job)
    }
}

/// Finishes or undoes what a stopped run left beside `target`, and makes sure that a folder may be
/// written there, before time is spent on a plan.
///
/// # Errors
/// `output-not-a-job` where `target` exists and is no job folder; what the file system refuses.
pub fn prepare(target: &Path) -> Result<(), Error> {
    let target = Target::find(target)?;
    target.recover()?;
    target.may_be_replaced(&[])
}

/// Writes the folder of a plan and puts it in the place of `target`. A run that writes there already is
/// waited for.
///
/// # Errors
/// As [`prepare`]; `output-holds-input` where the folder to be replaced holds an input of the job.
/// Whatever fails, an older folder stands as it was.
pub fn write(plan: &Plan, target: &Path, seed: u64) -> Result<(), Error> {
    exchange(&plan.job, target, &|new, path| fill(plan, new, path, seed))
}

/// Lets `fill` make a folder (its first argument) and puts it in the place of `target` (its second).
fn exchange(job: &Job, target: &Path, fill: &dyn Fn(&Path, &Path) -> Result<(), Error>) -> Result<(), Error> {
    let target = Target::find(target)?;
    let parent = target.path.parent().unwrap_or(Path::new("/"));
    fs::create_dir_all(parent).map_err(|e| failed("make the folder", parent, &e))?;
    let lock = target.lock()?;
    target.tidy(&lock)?;
    target.may_be_replaced(&input_paths(job))?;
    let done = fill(&target.new, &target.path).and_then(|()| target.exchange(&lock));
    if done.is_err() {
        // What cannot be removed now, the next run removes.
        let _ = fs::remove_dir_all(&target.new);
    }
    done
}

/// Writes one file into the folder and says what was written.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<FileFact, Error> {
    let path = folder.join(name);
    fs::write(&path, bytes).map_err(|e| failed("write the file", &path, &e))?;
    Ok(FileFact { file: name.into(), bytes: bytes.len() as u64, blake3: blake3::hash(bytes).to_hex().to_string() })
}

fn fill(plan: &Plan, folder: &Path, target: &Path, seed: u64) -> Result<(), Error> {
    let make = |path: &Path| fs::create_dir(path).map_err(|e| failed("make the folder", path, &e));
    make(folder)?;
    let Plan { job, machine, checked, sections, directions, summary, block_times, slopes, .. } = plan;
    let formats = &job.file.emit.formats;
    let has = |f: Format| formats.contains(&f);
    let part_name = file_name(job.file.surface.file.get_ref());
    let job_name = file_name(&job.path);
    let drawings = if has(Format::Dxf) { emit::gcode::Drawings::Dxf } else { emit::gcode::Drawings::Absent };
    let mut files = Vec::new();
    files.push(put(folder, "program.txt", &program::text::write(checked.program(), checked.origins()))?);
    if has(Format::Dxf) {
        make(&folder.join("blocks"))?;
        let blocks: Result<Vec<FileFact>, Error> = (0..checked.program().blocks.len())
            .into_par_iter()
            .map(|i| put(folder, &program::Program::drawing_file(i), &emit::dxf::block(checked, machine, i)))
            .collect();
        files.extend(blocks?);
    }
    if has(Format::Linuxcnc) {
        files.push(put(folder, "stage.ngc", &emit::gcode::linuxcnc(checked, machine, block_times, drawings))?);
    }
    if has(Format::Gcode) {
        files.push(put(folder, "stage_m0.nc", &emit::gcode::m0(checked, machine, drawings))?);
    }
    if has(Format::Ovf) {
        files.push(put(folder, "job.ovf", &emit::ovf::write(checked, machine, &job_name, &part_name))?);
    }
    let layout = layout(plan, &job_name);
    files.push(put(folder, "layout.svg", preview::layout_svg(&layout).as_bytes())?);
    let by_slope = preview::Layout { shade: preview::Shade::Incidence, ..layout.clone() };
    files.push(put(folder, "slope.svg", preview::layout_svg(&by_slope).as_bytes())?);
    for (k, pass) in plan.more.iter().enumerate() {
        let name = preview::pass_file(k as u32 + 1);
        files.push(put(folder, &name, preview::layout_svg(&layout_of(plan, pass, &job_name)).as_bytes())?);
    }
    files.push(put(folder, "report.html", preview::report_html(&layout).as_bytes())?);
    let facts = record::Facts {
        job_file: job_file_from(&job.path, target)?,
        job_blake3: blake3::hash(job.source.as_bytes()).to_hex().to_string(),
        inputs: inputs(job)?,
        seed,
        job,
        machine,
        checked,
        sections,
        directions,
        more: plan.more.iter().map(|p| (&p.sections, p.directions.as_slice())).collect(),
        depth_mm: mm_from_nm(plan.depth),
        block_times,
        slopes,
        files: &[],
        summary,
    };
    files.push(put(folder, "runsheet.csv", &record::runsheet_csv(&facts))?);
    files.push(put(folder, "runsheet.txt", &record::runsheet_txt(&facts))?);
    files.sort_by(|a, b| a.file.cmp(&b.file));
    let facts = record::Facts { files: &files, ..facts };
    put(folder, MANIFEST, &record::manifest(&facts))?;
    Ok(())
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// Every input file of a job but the job file itself, with its hash.
///
/// # Errors
/// Where a file cannot be read.
pub fn inputs(job: &Job) -> Result<Vec<InputFact>, Error> {
    let mut list = vec![("surface", job.file.surface.file.get_ref().clone())];
    for t in &job.file.texture {
        list.extend(t.file.iter().map(|f| ("texture", f.get_ref().clone())));
    }
    list.extend(job.file.machine.file.iter().map(|f| ("machine", f.get_ref().clone())));
    list.dedup();
    list.into_iter()
        .map(|(role, file)| {
            let path = job.resolve(&file);
            let mut hasher = blake3::Hasher::new();
            let unreadable =
                |e| Error::from(Diag::input("file-unreadable", format!("cannot read the file: {e}")).at(place(&path)));
            let opened = fs::File::open(&path).map_err(unreadable)?;
            hasher.update_reader(opened).map_err(unreadable)?;
            let bytes = hasher.count();
            let shown = file.to_string_lossy().replace('\\', "/");
            Ok(InputFact { role: role.into(), file: shown, bytes, blake3: hasher.finalize().to_hex().to_string() })
        })
        .collect()
}

/// The job file and every other input file of a job, as they can be opened.
pub fn input_paths(job: &Job) -> Vec<PathBuf> {
    let file = &job.file;
    let named = std::iter::once(file.surface.file.get_ref())
        .chain(file.texture.iter().filter_map(|t| t.file.as_ref().map(|f| f.get_ref())))
        .chain(file.machine.file.iter().map(|f| f.get_ref()));
    std::iter::once(job.path.clone()).chain(named.map(|f| job.resolve(f))).collect()
}

/// The job file as seen from inside the folder at `target`, which need not exist yet.
///
/// # Errors
/// Where a folder on the way cannot be read.
pub fn job_file_from(job: &Path, target: &Path) -> Result<String, Error> {
    let real = |p: &Path| resolved(p).map_err(|e| failed("find the folder", p, &e));
    let from = real(target)?;
    // The job file may be a link: its inputs are relative to where it is named, not to where it leads.
    let folder = job.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let file = real(folder)?.join(job.file_name().unwrap_or_default());
    let common = file.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let mut out = vec!["..".to_owned(); from.components().count() - common];
    out.extend(file.components().skip(common).map(|c| c.as_os_str().to_string_lossy().into_owned()));
    Ok(out.join("/"))
}

//! What a file or folder holds, for the first look: boxes in mm, counts, warnings.

#[cfg(feature = "compare")]
mod nurbs;
mod surface;
mod texture;

use std::path::Path;

use serde_json::json;

use terrace_core::diag::{Diag, Error, Place};
use terrace_core::duration::duration;
use terrace_input::job::{FileUnit, Job, Overrides};
use terrace_input::surface::is_cad;
use terrace_plan::manifest::{self, AnySummary};

#[cfg(feature = "compare")]
pub use nurbs::nurbs;

/// What a file or folder holds, as text and as JSON.
pub struct Inspection {
    pub text: String,
    pub json: serde_json::Value,
    pub warnings: Vec<Diag>,
}

/// Looks at `path`; `unit` is taken for surfaces, DXF drawings and curves that may not state theirs.
///
/// # Errors
/// Faults of the file; `surface-unit-stated` where a unit is given and has no meaning.
pub fn inspect(path: &Path, unit: Option<FileUnit>) -> Result<Inspection, Error> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let without_unit = |why: &str| refuse_unit(path, unit, why);
    if path.is_dir() {
        return without_unit("a job folder has no unit").and_then(|()| folder(path));
    }
    match extension.as_str() {
        "toml" => without_unit("every length of a job file states its own unit").and_then(|()| job(path)),
        "svg" | "svgz" | "plt" | "hpgl" | "hpg" => {
            without_unit("SVG and HPGL drawings state their own unit").and_then(|()| texture::drawing(path, None))
        }
        "jpg" | "jpeg" | "bmp" => {
            without_unit("bitmaps have pixels and no unit").and_then(|()| texture::drawing(path, None))
        }
        "dxf" => texture::drawing(path, unit),
        _ if is_cad(path) => without_unit("STEP and IGES files state their own unit").and_then(|()| surface::cad(path)),
        _ => surface_file(path, unit, &extension),
    }
}

/// Refuses `--unit` where it has no meaning.
fn refuse_unit(path: &Path, unit: Option<FileUnit>, why: &str) -> Result<(), Error> {
    if unit.is_none() {
        return Ok(());
    }
    let d = Diag::input("surface-unit-stated", format!("--unit is given, but {why}"));
    Err(d.at(Place::file(path.display().to_string())).hint("leave out --unit").into())
}

/// A file that a job may name as its surface, and perhaps as a texture.
fn surface_file(path: &Path, unit: Option<FileUnit>, extension: &str) -> Result<Inspection, Error> {
    let surface = surface::surface_file(path, unit);
    let Some((other, kind)) = texture::besides(path, unit, extension) else { return surface };
    match (surface, other) {
        (Ok(mut shown), other) => {
            texture::add(&mut shown, &other, kind);
            Ok(shown)
        }
        (Err(e), Ok(mut shown)) => {
            let reason = e.diags().first().map_or(String::new(), |d| format!(": {} ({})", d.message, d.code));
            shown.text += &format!("it cannot be a surface{reason}\n");
            Ok(shown)
        }
        (Err(e), Err(_)) => Err(e),
    }
}

/// Three numbers in a line.
fn triple(v: [f64; 3], between: &str) -> String {
    v.map(|v| format!("{v:.4}")).join(between)
}

fn plural(n: usize) -> &'static str {
    if n == 1 { "" } else { "s" }
}

/// A job file.
fn job(path: &Path) -> Result<Inspection, Error> {
    let job = Job::load(path, &Overrides::default())?;
    let machine = job.machine()?;
    let surface = job.surface_path();
    let pdof_mm = job.focus.pdof.mm();
    let text = format!(
        "job file\nmode      {}\nsurface   {}\ntextures  {}\npdof      {pdof_mm} mm\nmachine   {}\nmethod    {}\n",
        job.mode.name(),
        surface.display(),
        job.textures.len(),
        machine.name,
        job.partition.method.name()
    );
    let json = json!({"kind": "job", "mode": job.mode.name(), "surface": surface.display().to_string(),
        "textures": job.textures.len(), "pdof_mm": pdof_mm, "machine": machine.name,
        "method": job.partition.method.name()});
    Ok(Inspection { text, json, warnings: Vec::new() })
}

/// A job folder.
fn folder(path: &Path) -> Result<Inspection, Error> {
    let manifest = manifest::read(path)?;
    let (figures, time_s, mark_mm) = match &manifest.summary {
        AnySummary::Stepped(s) => {
            let least = if s.loading.is_least() { " at least" } else { "" };
            let (loading, total) = (s.loading.sentence(s.blocks), duration(s.loading.total_s));
            (format!("stops    {}\nloading  {loading}\nin all   {total}{least}", s.stops), s.time_s.total, s.mark_mm)
        }
        AnySummary::OnTheFly(s) => (format!("moves    {}", s.moves), s.time_s, s.mark_mm),
    };
    let text = format!(
        "job folder made by terrace {}\nmode     {}\nmachine  {}\n{figures}\nmarks    {mark_mm:.3} mm\ntime     {}\nfiles    {}\n",
        manifest.head.terrace,
        manifest.head.mode.name(),
        manifest.machine,
        duration(time_s),
        manifest.head.files.len()
    );
    let json = json!({"kind": "folder", "mode": manifest.head.mode.name(), "summary": manifest.summary.to_json(),
        "machine": manifest.machine});
    Ok(Inspection { text, json, warnings: Vec::new() })
}

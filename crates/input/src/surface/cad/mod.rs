//! STEP and IGES files, through Open CASCADE in a process of its own.
//!
//! Consumes a file of exact surfaces, promises facets in mm that lie within a chord tolerance of them, with what the
//! converter says of the file, and without what the file hides. The file's own syntax is checked first ([`part21`], [`iges`]): Open CASCADE hangs or
//! crashes on some damaged files. The converter is `convert.py` beside this file; [`converter`] finds an interpreter
//! and runs it, [`answer`] reads what it writes, and [`cache`] keeps it, so that a file is converted once for each
//! tolerance. `verify` reads the same facets.
//!
//! Memory: the facets (24 bytes a vertex, 12 a facet) as long as they are handed on.

mod answer;
mod cache;
mod converter;
mod iges;
mod part21;
mod tessellation;

use std::path::Path;
use std::sync::Mutex;

pub use answer::{About, CadMesh};
pub use converter::PACKAGE;
pub use tessellation::Tessellation;

use super::facets::{Facets, Unit};
use super::{Content, lines};
use terrace_core::diag::{Diag, Error};

/// What the hint says where a file cannot be read.
const AGAIN: &str = "export the part again from the CAD program, as STEP AP214 or AP242";

/// The kinds of files of exact surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Step,
    Iges,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "step" | "stp" => Some(Self::Step),
            "iges" | "igs" => Some(Self::Iges),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Iges => "iges",
        }
    }
}

/// Reads a STEP or IGES file as facets in mm; what the converter warns of goes to `notes`.
///
/// # Errors
/// Faults of the file; `cad-...` where the converter is absent, fails, or needs too much.
pub fn load(path: &Path, fine: Tessellation, notes: &mut Vec<Diag>) -> Result<CadMesh, Error> {
    let Some(format) = Format::of(path) else {
        let d = Diag::input("surface-format", "this is no STEP or IGES file by its extension").at(lines::place(path));
        return Err(d.hint("surfaces of other formats are named in the job file as they are").into());
    };
    if format == Format::Iges {
        iges::check_scale(path, notes)?;
    }
    let file = cache::hash(path)?;
    let key = cache::key(&file, fine, converter::SCRIPT);
    if let Some(mesh) = cache::get(&key) {
        mesh.about.notes(path, fine, notes);
        return Ok(mesh);
    }
    match format {
        Format::Step => part21::check(path)?,
        Format::Iges => iges::check(path)?,
    }
    // One at a time: each takes a core and its memory, and jobs of a batch often name the same part.
    static ONE: Mutex<()> = Mutex::new(());
    let _one = ONE.lock();
    if let Some(mesh) = cache::get(&key) {
        mesh.about.notes(path, fine, notes);
        return Ok(mesh);
    }
    let bytes = converter::run(path, format.name(), fine)?;
    let mesh = CadMesh::read(&bytes).map_err(|why| converter::garbage(path, &why))?;
    if mesh.facet_count() == 0 {
        let d = Diag::input("surface-empty", format!("none of the {} faces has facets", mesh.about.faces));
        return Err(d.at(lines::place(path)).hint(AGAIN).into());
    }
    if cache::hash(path)? != file {
        let d = Diag::input("file-unreadable", "the file was changed while it was read").at(lines::place(path));
        return Err(d.hint("run the command again when the file is complete").into());
    }
    if let Err(e) = cache::put(&key, &bytes) {
        let text = format!("the facets of the file cannot be kept, so the next command converts it again: {e}");
        notes
            .push(Diag::warning("cad-cache", text).at(lines::place(path)).hint("check the cache folder and its space"));
    }
    mesh.about.notes(path, fine, notes);
    Ok(mesh)
}

/// Reads a STEP or IGES file as a surface.
pub(super) fn read(
    path: &Path,
    fine: Tessellation,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let mesh = load(path, fine, notes)?;
    let remedy = "check the unit that the file states; parts lie near their origin".to_owned();
    let mut facets = Facets::with_remedy(path, Unit::mm(1.0), remedy, sink);
    mesh.facets().for_each(|facet| facets.push(facet));
    facets.finish(notes)?;
    Ok(Content::Tessellated(mesh.facet_count(), mesh.about.worst_mm.max(fine.chord_mm)))
}

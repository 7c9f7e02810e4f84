//! `import`: the facets of a STEP or IGES file as PLY, and what `inspect` says of such a file.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::Args;
use super::progress::Steps;
use super::{show, write_file};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::BoxMm;
use terrace_core::units::{Angle, Length};
use terrace_input::surface::{CadMesh, Tessellation, load_cad};

/// Converts `file` and writes its facets to `output`, or beside it.
pub fn run(args: &Args, file: &Path, output: Option<&Path>, chord: Length, angle: Angle) -> Result<(), Error> {
    if !(1e-5..=100.0).contains(&chord.as_mm()) || !(0.1..=60.0).contains(&angle.as_deg()) {
        let text = format!("a chord tolerance of {chord} with an angle of {angle} cannot be used");
        let hint = "give --tolerance from 0.01 um to 100 mm and --angle from 0.1 deg to 60 deg";
        return Err(Diag::input("import-tolerance", text).hint(hint).into());
    }
    let mut warnings = Vec::new();
    let tessellation = Tessellation { chord_mm: chord.as_mm(), angle_rad: angle.as_rad() };
    let steps = Steps::new(args.quiet);
    steps.begin(format!("converting {}", file.display()));
    let mesh = load_cad(file, tessellation, &mut warnings)?;
    steps.done();
    super::warn(args, &warnings);
    let target = output.map_or_else(|| file.with_extension("ply"), Path::to_owned);
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    // A comment in PLY is one line, and a file name may hold line feeds.
    let name: String = name.chars().map(|c| if c.is_control() { '?' } else { c }).collect();
    let about = &mesh.about;
    let comments = [
        format!("made by terrace {} from {name}", env!("CARGO_PKG_VERSION")),
        format!("unit mm, chord tolerance {} mm, Open CASCADE {}", tessellation.chord_mm, about.occt),
    ];
    write_file(args, &target, &mesh.to_ply(&comments), &[PathBuf::from(file)])?;
    let (text, mut json) = shown(&mesh, tessellation);
    json["file"] = json!(target.display().to_string());
    super::print(&if args.json { show::json(&json) } else { format!("{text}{}\n", target.display()) })
}

/// A number with its noun, in the singular and the plural.
fn counted(n: usize, noun: [&str; 2]) -> String {
    format!("{n} {}", noun[usize::from(n != 1)])
}

/// What a converted file holds, as text and JSON.
pub fn shown(mesh: &CadMesh, tessellation: Tessellation) -> (String, Value) {
    let about = &mesh.about;
    let BoxMm { lo, hi } = BoxMm::<3>::of(mesh.facets().flatten());
    let size = [0, 1, 2].map(|k| hi[k] - lo[k]);
    let triple = |v: [f64; 3], between: &str| v.map(|v| format!("{v:.4}")).join(between);
    let text = format!(
        "CAD surface, {} in {}, {}\nunit    {}, converted to mm\nfacets  {}, within {} mm of \
         the surface (tolerance {} mm)\nsize    {} mm\nfrom    ({}) mm\nto      ({}) mm\nread by Open CASCADE {}\n",
        counted(about.faces, ["face", "faces"]),
        counted(about.bodies, ["body", "bodies"]),
        counted(about.free_edges, ["free edge", "free edges"]),
        about.unit,
        mesh.facet_count(),
        // Rounded up: never less than measured.
        (about.worst_mm * 1e6).ceil() / 1e6,
        tessellation.chord_mm,
        triple(size, " x "),
        triple(lo, ", "),
        triple(hi, ", "),
        about.occt
    );
    let json = json!({"kind": "cad", "unit": about.unit, "faces": about.faces, "bodies": about.bodies,
        "free_edges": about.free_edges, "facets": mesh.facet_count(), "tolerance_mm": tessellation.chord_mm,
        "worst_mm": about.worst_mm, "lo_mm": lo, "hi_mm": hi, "open_cascade": about.occt});
    (text, json)
}

//! `terrace compare`: tables to the terminal, tables and pictures to a folder.

use std::path::Path;

use serde_json::{Value, json};

use super::{show, unwritable};
use crate::compare::{Comparison, page, plots, tables};
use crate::diag::{Diag, Error, Place};
use crate::report::table::TERMINAL;

/// The tables for people.
pub(super) fn text(c: &Comparison) -> String {
    tables(c).iter().map(|(_, t)| t.text(TERMINAL)).collect::<Vec<_>>().join("\n")
}

/// The tables for machines.
pub(super) fn json(c: &Comparison) -> Value {
    let mut out = json!({
        "job": c.job,
        "machine": c.machine,
        "limits": {
            "fod_um": c.limits.focus * 1000.0,
            "bia_deg": c.limits.angle.to_degrees(),
            "displacement_mm": c.limits.field,
        },
    });
    for (name, table) in tables(c) {
        out[name.replace('-', "_")] = json!(table);
    }
    out
}

/// What tells a comparison's folder.
const PAGE: &str = "compare.html";
/// What it holds: tables, charts, and what has both.
const FILES: [(&[&str], &[&str]); 3] = [
    (&["compare"], &["html", "json"]),
    (&["systems", "deviations", "decompositions", "seven-axis-decompositions", "convergence"], &["txt", "csv", "md"]),
    (&["times", "back-off", "axes", "along", "paths"], &["svg"]),
];

fn is_ours(name: &Path) -> bool {
    let part = |part: Option<&std::ffi::OsStr>, list: &[&str]| part.is_some_and(|p| list.iter().any(|l| p == *l));
    FILES.iter().any(|(stems, formats)| part(name.file_stem(), stems) && part(name.extension(), formats))
}

/// Whether something stands at `folder`.
///
/// # Errors
/// It is not a comparison, or holds something else too.
pub(super) fn replaces(folder: &Path) -> Result<bool, Error> {
    let refused = |text: &str, hint: &str| -> Result<bool, Error> {
        let place = Place::file(folder.display().to_string());
        Err(Diag::input("output-not-a-comparison", text).at(place).hint(hint).into())
    };
    if std::fs::symlink_metadata(folder).is_err() {
        return Ok(false);
    }
    if !folder.join(PAGE).is_file() {
        let text = "the output exists and is not a comparison";
        return refused(text, "name another folder with -o, or remove it yourself");
    }
    for entry in std::fs::read_dir(folder).map_err(failed(folder, "list the old comparison"))? {
        let entry = entry.map_err(failed(folder, "list the old comparison"))?;
        let is_file = entry.file_type().map_err(failed(folder, "list the old comparison"))?.is_file();
        let name = entry.file_name();
        if !is_file || !is_ours(Path::new(&name)) {
            let text = format!("the output holds {}, which is not a part of a comparison", name.display());
            return refused(&text, "move it away, or name another folder with -o");
        }
    }
    Ok(true)
}

fn failed(folder: &Path, what: &'static str) -> impl Fn(std::io::Error) -> Error {
    move |e| unwritable(what, Place::file(folder.display().to_string()), &e)
}

/// Writes everything to a folder of its own, whole or not at all.
pub(super) fn write(c: &Comparison, folder: &Path) -> Result<(), Error> {
    let exists = replaces(folder)?;
    let failed = |what| failed(folder, what);
    let parent = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let new = tempfile::Builder::new().prefix(".compare").tempdir_in(parent).map_err(failed("make a folder"))?;
    let put = |name: &str, text: String| std::fs::write(new.path().join(name), text).map_err(failed("write a file"));
    put("compare.json", show::json(&json(c)))?;
    put(PAGE, page(c))?;
    for (name, table) in tables(c) {
        put(&format!("{name}.txt"), table.text(TERMINAL))?;
        put(&format!("{name}.csv"), table.csv())?;
        put(&format!("{name}.md"), table.markdown())?;
    }
    for (name, plot) in plots(c) {
        put(&format!("{name}.svg"), plot.file())?;
    }
    if exists {
        std::fs::remove_dir_all(folder).map_err(failed("replace the old comparison"))?;
    }
    // What is renamed is no longer temporary, and may be read by others as the parent's files may.
    let made = new.keep();
    std::fs::rename(&made, folder).map_err(failed("put the comparison in place"))?;
    open_to_others(folder);
    Ok(())
}

/// A temporary folder is its maker's alone; a result is not.
#[cfg(unix)]
fn open_to_others(folder: &Path) {
    use std::os::unix::fs::PermissionsExt;
    let _ = std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755));
}

#[cfg(not(unix))]
fn open_to_others(_: &Path) {}

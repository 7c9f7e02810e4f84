//! `terrace compare`: verdict and table to the terminal, all tables and pictures to a folder.

use std::path::Path;

use serde_json::{Value, json};

use super::{show, unwritable};
use terrace_compare::compare::{Comparison, Verdict, overview, page, plots, tables};
use terrace_core::diag::{Diag, Error, Place};
use terrace_report::job_folder::{self, Durability};
use terrace_report::report::table::TERMINAL;

/// The verdict and the table to choose by, for people.
pub(super) fn text(c: &Comparison) -> String {
    let verdict = Verdict::of(c).sentences.join("\n");
    let table = overview(c).text(TERMINAL);
    let galvo = c.galvo.name();
    let loading = c.loading.sentence_per_block();
    format!(
        "{verdict}\n\n{table}\ngalvo          {galvo}, in every row\nloading        of stepped rows: {loading}\nall figures    -o FOLDER writes them to FOLDER/{PAGE} and to tables; --json prints them\n"
    )
}

/// The tables for machines.
pub(super) fn json(c: &Comparison) -> Value {
    let mut out = json!({
        "job": c.job,
        "machine": c.machine,
        "galvo": c.galvo.name(),
        "verdict": Verdict::of(c),
        "loading": {
            "way": c.loading.way,
            "assumed": c.loading.assumed,
            "load_s": c.loading.load_s,
            "load_assumed": c.loading.load_assumed,
        },
        "key_costs": c.key_costs.iter().map(|cost| json!({
            "system": cost.system, "key": cost.key, "value": cost.value, "time_s": cost.time_s,
        })).collect::<Vec<_>>(),
        "marked_m": c.marked_mm / 1000.0,
        "limits": {
            "fod_um": c.limits.half_depth * 1000.0,
            "bia_deg": c.limits.angle.to_degrees(),
            "displacement_mm": c.limits.field,
        },
    });
    for (name, table) in tables(c) {
        out[name.replace('-', "_")] = json!(table);
    }
    out
}

/// What marks a comparison's folder.
const PAGE: &str = "compare.html";
/// What it holds: tables, charts, and what has both.
const FILES: [(&[&str], &[&str]); 3] = [
    (&["compare"], &["html", "json"]),
    (
        &[
            "overview",
            "systems",
            "deviations",
            "following-errors",
            "decompositions",
            "seven-axis-decompositions",
            "back-off",
            "seven-axis-rests",
            "convergence",
            "tool-servo",
            "heat",
        ],
        &["txt", "csv", "md"],
    ),
    (
        &["times", "back-off", "axes", "along", "space", "following-7-axis", "following-5-axis", "paths", "velocities"],
        &["svg"],
    ),
];

/// Whether a comparison has a file of this name.
fn is_ours(name: &Path) -> bool {
    let part = |part: Option<&std::ffi::OsStr>, list: &[&str]| part.is_some_and(|p| list.iter().any(|l| p == *l));
    FILES.iter().any(|(stems, formats)| part(name.file_stem(), stems) && part(name.extension(), formats))
}

/// Checks that `folder` holds nothing but a comparison.
///
/// # Errors
/// `output-not-a-comparison` where it is not one, or holds something else too.
pub(super) fn may_be_replaced(folder: &Path) -> Result<(), Error> {
    if std::fs::symlink_metadata(folder).is_err() {
        return Ok(());
    }
    if !folder.join(PAGE).is_file() {
        let text = "the output exists and is not a comparison";
        return Err(no_comparison(folder, text, "name another folder with -o, or remove it yourself"));
    }
    for entry in std::fs::read_dir(folder).map_err(failed(folder, "list the old comparison"))? {
        let entry = entry.map_err(failed(folder, "list the old comparison"))?;
        let is_file = entry.file_type().map_err(failed(folder, "list the old comparison"))?.is_file();
        let name = entry.file_name();
        if !is_file || !is_ours(Path::new(&name)) {
            let text = format!("the output holds {}, which is not a part of a comparison", name.display());
            return Err(no_comparison(folder, &text, "move it away, or name another folder with -o"));
        }
    }
    Ok(())
}

/// The fault of a folder that holds something else than a comparison.
fn no_comparison(folder: &Path, text: &str, hint: &str) -> Error {
    let place = Place::file(folder.display().to_string());
    Diag::input("output-not-a-comparison", text).at(place).hint(hint).into()
}

/// What makes the fault of something that the file system refuses.
fn failed(folder: &Path, what: &'static str) -> impl Fn(std::io::Error) -> Error {
    move |e| unwritable(what, Place::file(folder.display().to_string()), &e)
}

/// Writes everything to a folder of its own, whole or not at all.
pub(super) fn write(c: &Comparison, folder: &Path, durability: Durability) -> Result<(), Error> {
    job_folder::replace(folder, PAGE, durability, &|| may_be_replaced(folder), &|new| write_files(c, new))
}

/// Writes the files of a comparison into a folder.
fn write_files(c: &Comparison, folder: &Path) -> Result<(), Error> {
    let put = |name: &str, text: String| {
        let file = folder.join(name);
        std::fs::write(&file, text).map_err(failed(&file, "write the file"))
    };
    for (name, table) in tables(c) {
        put(&format!("{name}.txt"), table.text(TERMINAL))?;
        put(&format!("{name}.csv"), table.csv())?;
        put(&format!("{name}.md"), table.markdown())?;
    }
    for (name, plot) in plots(c) {
        put(&format!("{name}.svg"), plot.file())?;
    }
    put("compare.json", show::json(&json(c)))?;
    // Last: a folder without it is not whole.
    put(PAGE, page(c))
}

//! `terrace sweep`: a table to the terminal, as CSV and as a chart.

use std::path::Path;

use super::args::{Args, Choice};
use super::{STDIN, job_from_stdin, overrides, print, show, write_file};
use crate::diag::{Diag, Error, Place};
use crate::job::{Setting, read_file};
use crate::report::table::TERMINAL;
use crate::sweep;

/// Plans all combinations and shows them; `files` are those of the table and of the chart.
pub(super) fn run(
    args: &Args,
    (job, choice): (&Path, &Choice),
    settings: &[Setting],
    [csv, plot]: [Option<&Path>; 2],
) -> Result<(), Error> {
    let (path, text) =
        if job == Path::new("-") { (Path::new(STDIN), job_from_stdin()?) } else { (job, read_file(job)?) };
    let count = settings.iter().map(|s| s.values.len()).product();
    let view = show::SweepView::new(args.quiet, count);
    let found = sweep::sweep((path, &text), &overrides(args, choice), settings, &|| view.done());
    view.finish();
    let found = found?;
    let table = sweep::table(&found);
    let inputs = [job.to_owned()];
    if let Some(file) = csv {
        write_file(args, file, table.csv().as_bytes(), &inputs)?;
    }
    if let Some(file) = plot {
        let chart = sweep::chart(&found).ok_or_else(|| {
            let d = Diag::input("sweep-plot", "the values of the first setting are not numbers of one unit");
            d.at(Place::file(file.display().to_string())).hint("put a setting with numbers first")
        })?;
        write_file(args, file, chart.file().as_bytes(), &inputs)?;
    }
    print(&if args.json { show::json(&serde_json::json!({ "sweep": table })) } else { table.text(TERMINAL) })
}

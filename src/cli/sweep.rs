//! `terrace sweep`: a table to the terminal, as CSV and as a chart.

use std::path::Path;

use super::args::{Args, Choice};
use super::steps::Steps;
use super::{STDIN, job_from_stdin, overrides, print, show, write_file};
use crate::diag::{Diag, Error, Place};
use crate::job::{Setting, read_file};
use crate::job_folder;
use crate::progress::Task;
use crate::report::table::TERMINAL;
use crate::sweep;

/// Plans all combinations and shows them; table and chart are written where files are named for them.
pub(super) fn run(
    args: &Args,
    (job, choice): (&Path, &Choice),
    settings: &[Setting],
    [csv, plot]: [Option<&Path>; 2],
) -> Result<(), Error> {
    let (path, text) =
        if job == Path::new("-") { (Path::new(STDIN), job_from_stdin()?) } else { (job, read_file(job)?) };
    let steps = Steps::new(args.quiet);
    let count = sweep::combinations(settings)?;
    let task = Task::new(|percent| steps.told(&format!("planning {count} settings"), percent)).of_steps(count);
    let found = sweep::sweep((path, &text), &overrides(args, choice), settings, &|| task.step())?;
    drop(task);
    steps.done();
    let table = sweep::table(&found);
    let mut files = Vec::new();
    if let Some(file) = csv {
        files.push((file, table.csv()));
    }
    if let Some(file) = plot {
        let chart = sweep::chart(&found).ok_or_else(|| {
            let d = Diag::input("sweep-plot", "the values of the first setting are not numbers of one unit");
            d.at(Place::file(file.display().to_string())).hint("put a setting with numbers first")
        })?;
        files.push((file, chart.file()));
    }
    let inputs = job_folder::input_paths(&found.job);
    files.iter().try_for_each(|(file, text)| write_file(args, file, text.as_bytes(), &inputs))?;
    print(&if args.json { show::json(&serde_json::json!({ "sweep": table })) } else { table.text(TERMINAL) })
}

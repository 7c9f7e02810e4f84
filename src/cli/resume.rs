//! `terrace resume`: which blocks are left, and what was written.

use std::path::Path;

use super::args::{Args, Left};
use super::progress::Steps;
use super::{durability, named, print, show};
use crate::resume::{self, BlockChoice, MarkedBlocks};
use terrace_core::diag::Error;
use terrace_core::duration::duration;

/// Writes the folder of what is left.
pub(super) fn run(args: &Args, folder: &Path, left: &Left, again: bool, target: &Path) -> Result<(), Error> {
    named::job_folder(folder)?;
    let done = left.done.as_deref().map(resume::listed).transpose()?.unwrap_or_default();
    let marked = if again { Vec::new() } else { marked(folder)? };
    let choice = BlockChoice { from: left.from, only: left.only.clone(), done, marked };
    let steps = Steps::new(args.quiet);
    steps.begin("writing what is left");
    let found = resume::resume(folder, &choice, target, durability(args))?;
    steps.done();
    let s = &found.subset;
    if args.json {
        return print(&show::json(&serde_json::json!({"of": found.of, "subset": s})));
    }
    let [first, last] = [s.blocks.first(), s.blocks.last()].map(|id| id.map_or("", String::as_str));
    let layout = target.join("layout.svg");
    let open = if layout.exists() { format!("open           {}\n", layout.display()) } else { String::new() };
    print(&format!(
        "left           {} of {} blocks, {first} to {last}, at {} stops\nmarks          {:.3} mm\ntime           {}\n\
         with loading   {}\njob folder     {}\n{open}then run       terrace verify {}\n",
        s.blocks.len(),
        found.of,
        s.stops,
        s.mark_mm,
        duration(s.time_s),
        duration(s.total_s),
        target.display(),
        show::shown(target)
    ))
}

/// What runs of a folder have marked.
#[cfg(feature = "run")]
fn marked(folder: &Path) -> Result<Vec<MarkedBlocks>, Error> {
    let found = crate::run::marked(folder)?;
    let of_journal =
        |(journal, blocks): (_, Vec<String>)| MarkedBlocks { journal, blocks: blocks.into_iter().collect() };
    Ok(found.into_iter().map(of_journal).collect())
}

#[cfg(not(feature = "run"))]
fn marked(_: &Path) -> Result<Vec<MarkedBlocks>, Error> {
    Ok(Vec::new())
}

//! The page of a batch: a row per job with its picture, figures and links, the sums above.
//!
//! Pictures and files are linked where they lie, so the page grows by some 700 bytes a job whatever the size of its
//! pictures, and a browser reads those that are in view. It runs no script. Paths are relative: page and folders can
//! be moved together.

use std::fmt::Write;
use std::path::Path;

use super::{Outcome, Report};
use terrace_core::diag::Error;
use terrace_core::duration::duration;
use terrace_report::job_folder;
use terrace_report::report::page::{self, escape};

/// What the page adds to the style of all pages. On a narrow screen every row is a card: picture and name, and below
/// them the figures, each with its name.
const STYLE: &str = "html{color-scheme:light dark}td{vertical-align:top}td.l{overflow-wrap:anywhere;min-width:9em}.state{text-align:left}.l .warn{margin:.2em 0;text-align:left}\
.pic{width:144px}.pic img{display:block;width:144px;height:108px;object-fit:contain;background:#fff;border:1px solid #ddd}\
.failed b,.missing b,.left b{color:#c2410c}\
@media(max-width:52em){body{margin:1em auto}table,tbody{display:block}thead{display:none}\
tr{display:grid;grid-template-columns:144px 1fr;gap:0 .8em;padding:.6em 0;border-bottom:1px solid #ddd}\
td{display:block;border:0;padding:.1em 0;text-align:left;white-space:normal}td[data-of]:before{content:attr(data-of) \" \";color:#666}\
.pic{grid-row:1/9}.pic:empty{display:none}.pic:empty~td{grid-column:1/3}}\
@media(prefers-color-scheme:dark){body{background:#161616;color:#ddd}th{background:#262626}th,td,tr{border-color:#444}\
td[data-of]:before{color:#aaa}a{color:#8ab4f8}.warn{background:#33211a}.warn small{color:#bbb}.failed b,.missing b,.left b{color:#ff9d6e}}";

/// The page as a file of `folder`.
///
/// # Errors
/// Where a folder on the way to a job folder cannot be read.
pub fn index_html(report: &Report, folder: &Path) -> Result<String, Error> {
    let outcomes = report.outcomes();
    let heading = format!("Batch of {} job{}", outcomes.len(), if outcomes.len() == 1 { "" } else { "s" });
    let mut h = page::open(&heading, &heading, STYLE);
    let sums: Vec<String> = report.sums().iter().map(|line| escape(line)).collect();
    let _ = writeln!(h, "<p>{}</p>", sums.join("<br/>"));
    h.push_str(
        "<table>\n<thead><tr><th></th><th class=\"l\">job</th><th class=\"state\">state</th><th>stops</th>\
         <th>machine time</th><th>with loading</th><th>warnings</th><th class=\"l\">files</th></tr></thead>\n<tbody>\n",
    );
    for outcome in outcomes {
        row(&mut h, outcome, folder)?;
    }
    h.push_str("</tbody>\n</table>\n</body>\n</html>\n");
    Ok(h)
}

/// The address of a file of a job folder, seen from `folder`; None where there is no such file.
fn link(outcome: &Outcome, name: &str, folder: &Path) -> Result<Option<String>, Error> {
    let file = outcome.folder.join(name);
    if !file.is_file() {
        return Ok(None);
    }
    Ok(Some(page::address(&job_folder::path_from(&file, folder)?)))
}

/// The row of a job.
fn row(h: &mut String, outcome: &Outcome, folder: &Path) -> Result<(), Error> {
    let state = outcome.state.name();
    let job = escape(&outcome.job.display().to_string());
    let Some(figures) = outcome.state.figures() else {
        let _ = write!(
            h,
            "<tr class=\"{state}\"><td class=\"pic\"></td><td class=\"l\">{job}</td><td class=\"state\"><b>{state}</b></td>\
             <td class=\"l\" colspan=\"5\">"
        );
        outcome.errors().iter().for_each(|message| page::message(h, message));
        h.push_str("</td></tr>\n");
        return Ok(());
    };
    let picture = link(outcome, "layout.svg", folder)?.map_or(String::new(), |to| {
        format!("<a href=\"{to}\"><img src=\"{to}#part\" alt=\"block layout\" loading=\"lazy\"/></a>")
    });
    let mut links = Vec::new();
    for (name, shown) in
        [("view.html", "view"), ("report.html", "report"), ("runsheet.txt", "run sheet"), ("manifest.json", "manifest")]
    {
        links.extend(link(outcome, name, folder)?.map(|to| format!("<a href=\"{to}\">{shown}</a>")));
    }
    let _ = writeln!(
        h,
        "<tr class=\"{state}\"><td class=\"pic\">{picture}</td><td class=\"l\">{job}</td><td class=\"state\">{state}{}</td>\
         <td data-of=\"stops\">{}</td><td data-of=\"machine time\">{}</td><td data-of=\"with loading\">{}</td>\
         <td data-of=\"warnings\">{}</td><td class=\"l\">{}</td></tr>",
        if outcome.verified { ", verified" } else { "" },
        figures.stops.map_or("-".into(), |n| n.to_string()),
        duration(figures.time_s),
        duration(figures.total_s) + if figures.is_least { ", at least" } else { "" },
        figures.warnings,
        links.join(" &#183; ")
    );
    Ok(())
}

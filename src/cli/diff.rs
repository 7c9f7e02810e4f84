//! `terrace diff`: two job folders side by side, such as before and after a change of the job.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::Serialize;

use super::args::Args;
use super::{named, print, show, write_file};
use terrace_core::diag::{Diag, Error, Message, Place};
use terrace_core::duration::duration;
use terrace_plan::manifest::{self, AnySummary, ManifestOverview};
use terrace_report::job_folder::path_from;
use terrace_report::report::page;
use terrace_report::view::side_by_side;

/// The page of a job folder that is shown beside the other.
const VIEW: &str = "view.html";

/// A figure of both jobs.
#[derive(Debug, Serialize)]
struct Row {
    name: &'static str,
    before: String,
    after: String,
    change: String,
}

/// What differs between two folders.
#[derive(Debug, Serialize)]
struct Difference {
    figures: Vec<Row>,
    /// Files of the folders whose bytes differ, are in the first alone, in the second alone.
    changed: Vec<String>,
    removed: Vec<String>,
    added: Vec<String>,
    /// Files with equal bytes.
    equal: usize,
    /// Warnings of the first alone and of the second alone.
    warnings_gone: Vec<String>,
    warnings_new: Vec<String>,
}

/// Prints the figures of two folders, and writes a page with both views.
pub(super) fn run(args: &Args, [before, after]: [&Path; 2], output: Option<&Path>) -> Result<(), Error> {
    for folder in [before, after] {
        named::job_folder(folder)?;
    }
    let [first, second] = [manifest::read(before)?, manifest::read(after)?];
    if let Some(file) = output {
        let views = [view_of(before, file)?, view_of(after, file)?];
        let names = [before, after].map(|folder| folder.display().to_string());
        let text = side_by_side(&names, &views);
        write_file(args, file, text.as_bytes(), &[before.join(VIEW), after.join(VIEW)])?;
    }
    let found = Difference::of(&first, &second);
    if args.json {
        return print(&show::json(&serde_json::json!(found)));
    }
    let names = [before, after].map(|folder| folder.display().to_string());
    print(&(found.text(&names) + &output.map(|file| format!("open  {}\n", file.display())).unwrap_or_default()))
}

/// The address of a folder's view from a page.
///
/// # Errors
/// `diff-no-view`.
fn view_of(folder: &Path, file: &Path) -> Result<String, Error> {
    let view = folder.join(VIEW);
    if !view.is_file() {
        let d =
            Diag::input("diff-no-view", "the folder has no view.html").at(Place::file(folder.display().to_string()));
        return Err(d.hint("compile it again without --no-pictures, or leave out -o").into());
    }
    let beside = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok(page::address(&path_from(&view, beside)?))
}

impl Difference {
    fn of(first: &ManifestOverview, second: &ManifestOverview) -> Self {
        let files = |m: &ManifestOverview| -> BTreeMap<String, String> {
            m.head.files.iter().map(|fact| (fact.file.clone(), fact.blake3.clone())).collect()
        };
        let [a, b] = [files(first), files(second)];
        let only = |one: &BTreeMap<String, String>, other: &BTreeMap<String, String>| -> Vec<String> {
            one.keys().filter(|file| !other.contains_key(*file)).cloned().collect()
        };
        let (equal, changed): (Vec<_>, Vec<_>) =
            a.iter().filter(|(file, _)| b.contains_key(*file)).partition(|(file, hash)| b.get(*file) == Some(hash));
        let warnings = [first, second].map(|m| warnings(&m.summary));
        let texts = |k: usize| -> BTreeSet<String> { warnings[k].iter().map(|w| w.message.clone()).collect() };
        let [before, after] = [texts(0), texts(1)];
        Self {
            figures: rows(first, second),
            changed: changed.into_iter().map(|(file, _)| file.clone()).collect(),
            removed: only(&a, &b),
            added: only(&b, &a),
            equal: equal.len(),
            warnings_gone: before.difference(&after).cloned().collect(),
            warnings_new: after.difference(&before).cloned().collect(),
        }
    }

    fn text(&self, names: &[String; 2]) -> String {
        let heads = ["", &names[0], &names[1], "change"].map(str::to_owned);
        let mut lines = vec![heads];
        lines.extend(self.figures.iter().map(|r| {
            let cells = [r.name, &r.before, &r.after, &r.change];
            cells.map(str::to_owned)
        }));
        let mut text = aligned(&lines);
        for (words, list) in [("warning gone", &self.warnings_gone), ("new warning ", &self.warnings_new)] {
            list.iter().for_each(|warning| text += &format!("{words}  {warning}\n"));
        }
        text + &self.files_text()
    }

    /// What of the files differs; of many some are named.
    fn files_text(&self) -> String {
        const SHOWN: usize = 6;
        let differing: usize = [&self.changed, &self.removed, &self.added].map(Vec::len).iter().sum();
        if differing == 0 {
            return format!("files  all {} have equal bytes\n", self.equal);
        }
        let part = |words: &str, list: &[String]| match list {
            [] => String::new(),
            _ => {
                let more = if list.len() > SHOWN { format!(" and {} more", list.len() - SHOWN) } else { String::new() };
                format!("; {words} {}{more}", list[..list.len().min(SHOWN)].join(", "))
            }
        };
        let parts = [("changed", &self.changed), ("only before", &self.removed), ("only after", &self.added)];
        let parts: String = parts.iter().map(|(words, list)| part(words, list)).collect();
        format!("files  {} with equal bytes{parts}\n", self.equal)
    }
}

/// Columns as wide as what is in them, two blanks apart.
fn aligned(lines: &[[String; 4]]) -> String {
    let width = |k: usize| lines.iter().map(|line| line[k].chars().count()).max().unwrap_or(0);
    let widths = [0, 1, 2, 3].map(width);
    let line = |cells: &[String; 4]| {
        let padded: Vec<String> = cells.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    lines.iter().map(line).collect()
}

fn warnings(summary: &AnySummary) -> &[Message] {
    match summary {
        AnySummary::Stepped(s) => &s.warnings,
        AnySummary::OnTheFly(s) => &s.warnings,
    }
}

/// A figure and how it is written.
type Figure = (&'static str, f64, fn(f64) -> String);

/// The figures that the change of a job moves.
fn figures(summary: &AnySummary) -> Vec<Figure> {
    let count: fn(f64) -> String = |v| format!("{v}");
    let mm: fn(f64) -> String = |v| format!("{v:.3} mm");
    let um: fn(f64) -> String = |v| format!("{v:.1} um");
    let deg: fn(f64) -> String = |v| format!("{v:.2} deg");
    match summary {
        AnySummary::Stepped(s) => vec![
            ("stops", s.stops as f64, count),
            ("blocks", s.blocks as f64, count),
            ("time", s.time_s.total, duration),
            ("with loading", s.loading.total_s, duration),
            ("marked", s.mark_mm, mm),
            ("not marked", s.skipped_mm, mm),
            ("seams", s.seam_mm, mm),
            ("worst defocus", s.worst_defocus_um, um),
            ("worst incidence", s.worst_incidence_deg, deg),
        ],
        AnySummary::OnTheFly(s) => vec![
            ("marks", s.marks as f64, count),
            ("time", s.time_s, duration),
            ("marked", s.mark_mm, mm),
            ("not marked", s.lengths.skipped_mm, mm),
            ("worst defocus", s.deviations.worst_fod_um, um),
            ("worst incidence", s.deviations.worst_bia_deg, deg),
        ],
    }
}

fn rows(first: &ManifestOverview, second: &ManifestOverview) -> Vec<Row> {
    let words = |name, of: fn(&ManifestOverview) -> String| {
        let [before, after] = [of(first), of(second)];
        let change = if before == after { "" } else { "changed" }.into();
        Row { name, before, after, change }
    };
    let method = |m: &ManifestOverview| match &m.summary {
        AnySummary::Stepped(s) => s.method.clone(),
        AnySummary::OnTheFly(_) => String::new(),
    };
    let mut rows = vec![
        words("mode", |m| m.head.mode.name().into()),
        words("machine", |m| m.machine.clone()),
        words("method", method),
        words("terrace", |m| m.head.terrace.clone()),
    ];
    rows.retain(|row| !(row.before.is_empty() && row.after.is_empty()));
    let [a, b] = [figures(&first.summary), figures(&second.summary)];
    for (name, before, write) in &a {
        let Some((_, after, _)) = b.iter().find(|(other, ..)| other == name) else { continue };
        let change = change(*before, *after, *write);
        rows.push(Row { name, before: write(*before), after: write(*after), change });
    }
    rows
}

/// By how much a figure changed, with its sign.
fn change(before: f64, after: f64, write: fn(f64) -> String) -> String {
    let by = after - before;
    if write(before) == write(after) {
        return String::new();
    }
    let sign = if by < 0.0 { "-" } else { "+" };
    let percent = (100.0 * by / before).abs().round();
    // A change of less than half a percent has no share.
    let share = if before > 0.0 && percent > 0.0 { format!(" ({sign}{percent} %)") } else { String::new() };
    format!("{sign}{}{share}", write(by.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_has_its_sign_and_its_share() {
        let count: fn(f64) -> String = |v| format!("{v}");
        assert_eq!(change(157.0, 7.0, count), "-150 (-96 %)");
        assert_eq!(change(10.0, 15.0, count), "+5 (+50 %)");
        assert_eq!(change(0.0, 2.0, count), "+2");
        assert_eq!(change(1000.0, 1001.0, count), "+1");
        assert_eq!(change(2.0, 2.0, count), "");
        // No change that is not written.
        assert_eq!(change(1.00001, 1.00002, |v| format!("{v:.3} mm")), "");
    }

    #[test]
    fn columns_stand_below_each_other() {
        let lines = [["", "a.job", "b.job", "change"], ["stops", "157", "7", ""]].map(|l| l.map(str::to_owned));
        assert_eq!(aligned(&lines), "       a.job  b.job  change\nstops  157    7\n");
    }
}

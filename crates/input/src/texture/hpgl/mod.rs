//! HPGL and HP-GL/2 plots (PLT): the pen strokes, dots and filled polygons of a plot, in mm.
//!
//! Consumes instructions for plotters; a plotter unit is 0.025 mm unless `SC` scales it to the points of `IP`. Promises
//! an [`Artwork`] whose page is the box of all that is drawn: moves with the pen down, circles, arcs, rectangles and
//! polygons, with the label `pen:N` and the colour of pen N (1 black, 2 red, 3 green, 4 yellow, 5 blue, 6 magenta, 7
//! cyan, then round again). A pen that is put down and lifted without a move draws a point. Curves are flattened within
//! the tolerance, whatever chord the plot asks for. Lines are marked along their centre: pen widths serve for points
//! alone. Labels, line types, fill patterns, symbols and what is not known are reported by one warning each; what
//! rotates or scales the page in a way that is not read is an error. Time and memory are bounded by the file and by 20
//! million points.
//!
//! A plot is a state machine: `syntax` divides the file into instructions, `state` holds what they set, `polygon` the
//! polygon buffer, and `plotter` draws.

mod encoded;
mod plotter;
mod polygon;
mod state;
mod syntax;

use std::collections::BTreeMap;
use std::path::Path;

use super::artwork::{Artwork, Marking};
use plotter::Plotter;
use syntax::{Instruction, Instructions};
use terrace_core::diag::{Diag, Error, Place};

/// A plotter unit, mm.
const UNIT: f64 = 0.025;
type Fault = Box<Diag>;

/// How a plot is read.
pub(super) struct PlotOptions<'a> {
    /// The file.
    pub(super) path: &'a Path,
    /// Largest distance between a curve and its polyline, mm.
    pub(super) tolerance: f64,
    /// Width up to which what a pen draws is a line, mm.
    pub(super) widest_line: f64,
    pub(super) marking: &'a Marking,
}

/// Reads a plot.
///
/// # Errors
/// `hpgl-syntax`, `hpgl-page`, `texture-far`, `texture-large`.
pub(super) fn load(bytes: &[u8], options: &PlotOptions<'_>, notes: &mut Vec<Diag>) -> Result<Artwork, Error> {
    let name = options.path.display().to_string();
    let mut plotter = Plotter::new(options);
    for instruction in Instructions::new(bytes) {
        plotter.execute(&instruction).map_err(|d| d.at(Place::file(&name)))?;
    }
    plotter.lift().map_err(|d| d.at(Place::file(&name)))?;
    if !plotter.is_plot {
        let text = "this is not an HPGL plot: it holds no pen movement";
        let d = Diag::input("hpgl-syntax", text).hint("write the plot again as HPGL (PLT)");
        return Err(d.at(Place::file(&name)).into());
    }
    let messages = plotter.tally.messages(&name, options.marking);
    options.marking.tell(messages.into_iter(), notes)?;
    let mut art = plotter.art;
    art.fit_page();
    Ok(art)
}

/// What a plot holds that is not marked.
#[derive(Debug, Default)]
struct Tally {
    issues: BTreeMap<Issue, Occurrences>,
    /// Instructions that are not read, by their names.
    unread: BTreeMap<String, Occurrences>,
}

#[derive(Debug)]
struct Occurrences {
    count: usize,
    /// The byte at which the first stands.
    first: usize,
}

impl Occurrences {
    /// None, of which the first would stand at a byte.
    fn none(first: usize) -> Self {
        Self { count: 0, first }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Issue {
    Label,
    Dash,
    Fill,
}

impl Tally {
    fn note(&mut self, issue: Issue, at: usize) {
        self.issues.entry(issue).or_insert(Occurrences::none(at)).count += 1;
    }

    fn note_unread(&mut self, i: &Instruction) {
        self.unread.entry(i.name.clone()).or_insert(Occurrences::none(i.at)).count += 1;
    }

    /// What is not read: errors, or warnings where the job leaves it out.
    fn messages(&self, path: &str, marking: &Marking) -> Vec<Diag> {
        let mut out: Vec<Diag> = Vec::new();
        let mut add = |code, text: &str, count: &str, at: usize, hint| {
            let place = Place::Element { path: path.to_owned(), element: format!("at byte {at}") };
            out.push(marking.unmarkable(code, text, "; they are left out", count, hint).at(place));
        };
        for (issue, &Occurrences { count, first }) in &self.issues {
            let (code, what, hint) = match issue {
                Issue::Label => ("hpgl-text", "labels or symbols", "convert text to lines in the drawing program"),
                Issue::Dash => ("hpgl-dash", "dashed lines", "draw solid lines"),
                Issue::Fill => ("hpgl-fill", "areas filled by a pattern", "fill them solid and hatch them by the job"),
            };
            add(code, &format!("the plot has {what}"), &format!(" ({count})"), first, hint);
        }
        if let Some((_, first_name)) = self.unread.first_key_value() {
            let at = first_name.first;
            let list: Vec<String> = self
                .unread
                .iter()
                .take(40)
                .map(|(name, Occurrences { count, first })| format!("{count} {name} (first at byte {first})"))
                .collect();
            let hint = "write the plot with lines alone (PU, PD, PA, PR)";
            add(
                "hpgl-unread",
                "the plot has instructions that are not read",
                &format!(": {}", list.join(", ")),
                at,
                hint,
            );
        }
        out
    }
}

fn fault(i: &Instruction, what: &str) -> Fault {
    let text = format!("{} at byte {} {what}", i.name, i.at);
    Diag::input("hpgl-syntax", text).hint("write the plot again as HPGL (PLT)").into()
}

fn page(name: &str, at: usize) -> Fault {
    let text = format!("{name} at byte {at} turns or scales the page in a way that is not read");
    let hint = "write the plot in plotter units, without SC, IP, IW and RO, or state P1 and P2 by IP where SC is used";
    Diag::input("hpgl-page", text).hint(hint).into()
}

#[cfg(test)]
mod tests;

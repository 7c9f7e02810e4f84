//! How results and progress look on a terminal.

use std::path::Path;
#[cfg(feature = "run")]
use std::time::Duration;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use super::ProofCounts;
use crate::batch::Outcome;
#[cfg(feature = "run")]
use crate::run;
use terrace_core::diag::shell_word;
use terrace_core::duration::duration;
use terrace_core::machine::Machine;
use terrace_input::job::Focus;
use terrace_plan::budget::Budget;
use terrace_plan::manifest::{AnySummary, OnTheFlySummary, SpaceCurves, Summary};
use terrace_plan::plan::{HatchSaving, Phase};

/// Pretty JSON with a line end.
pub fn json(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

/// What a phase of a compilation does.
pub fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Read => "reading surface and texture",
        Phase::Footprint => "tracing the texture",
        Phase::Split => "cutting strokes",
        Phase::Order => "ordering strokes and stops",
        Phase::Passes => "planning the other passes",
        Phase::Motion => "planning the motion",
        Phase::Lean => "searching fixture angles",
        Phase::Write => "writing the job folder",
        Phase::Draw => "drawing pictures and report",
    }
}

/// What a phase of a verification does.
pub fn proving(phase: terrace_verify::Phase) -> &'static str {
    match phase {
        terrace_verify::Phase::Read => "reading program, surface and texture",
        terrace_verify::Phase::Files => "comparing files",
        terrace_verify::Phase::Marks => "checking every mark",
        terrace_verify::Phase::Coverage => "checking coverage",
    }
}

/// A bar for many jobs.
#[derive(Clone)]
pub struct Progress {
    bar: ProgressBar,
    quiet: bool,
    begin: Instant,
}

impl Progress {
    /// `items` says what is counted.
    pub fn new(quiet: bool, count: usize, items: &str) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(count as u64) };
        let style = format!("{{bar:30}} {{pos}}/{{len}} {items}, {{elapsed}}, left {{eta}}  {{msg}}");
        if let Ok(style) = ProgressStyle::with_template(&style) {
            bar.set_style(style);
        }
        Self { bar, quiet, begin: Instant::now() }
    }
    pub fn step(&self) {
        self.bar.inc(1);
    }
    /// A job of a batch that has ended, and of how many it is which.
    pub fn job(&self, outcome: &Outcome, [ended, all]: [usize; 2]) {
        if !self.quiet {
            self.say(&format!("{outcome} ({ended} of {all} after {})", duration(self.begin.elapsed().as_secs_f64())));
        }
        self.step();
    }
    /// A line above the bar, on a terminal or not.
    pub fn say(&self, line: &str) {
        self.bar.suspend(|| super::eprintln_all(line));
    }
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// How far a run is, in blocks.
#[cfg(feature = "run")]
pub struct Blocks(ProgressBar);

#[cfg(feature = "run")]
impl Blocks {
    pub fn new(quiet: bool) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        bar.enable_steady_tick(Duration::from_millis(120));
        Self(bar)
    }
    pub fn phase(&self, text: &'static str) {
        self.0.set_message(text);
    }
    pub fn block(&self, progress: &run::Progress<'_>) {
        if self.0.length().is_none() {
            self.0.set_length(progress.blocks as u64);
            if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} blocks, {elapsed}, {msg}") {
                self.0.set_style(style);
            }
        }
        self.0.set_position(progress.done as u64);
        let file = progress.file.map_or(String::new(), |file| format!(" ({file})"));
        let left = duration(progress.left.as_secs_f64());
        self.0.set_message(format!("left {left}, now {}{file}", progress.block));
    }
    /// A line above the bar, also where nothing else is shown.
    pub fn say(&self, text: &str) {
        self.0.suspend(|| super::eprintln_all(text));
    }
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

/// How many blocks are marked at the stops, where a zoom optic makes them more.
fn blocks(s: &Summary) -> String {
    if s.blocks > s.stops { format!(", {} blocks", s.blocks) } else { String::new() }
}

/// Who loads the blocks, and the time with it.
fn loading(s: &Summary) -> [String; 2] {
    let least = if s.loading.is_least() { " at least" } else { "" };
    [
        format!("loading        {}", s.loading.sentence(s.blocks)),
        format!("in all         {}{least}; a person attends all of it", duration(s.loading.total_s)),
    ]
}

/// How many stops any partition needs, and how near the job comes.
fn at_least(s: &Summary) -> String {
    let ratio = s.lower_bound_stops.filter(|&n| n > 0).zip(s.over_bound());
    ratio.map_or(String::new(), |(n, ratio)| format!(", at least {n} (x {ratio:.3})"))
}

/// How many stops were merged with others.
fn merged(s: &Summary) -> String {
    if s.stops_merged == 0 { String::new() } else { format!(", {} more merged into these", s.stops_merged) }
}

/// The figures of a job as a person reads them.
pub fn summary(s: &AnySummary) -> String {
    match s {
        AnySummary::Stepped(s) => stepped(s),
        AnySummary::OnTheFly(s) => on_the_fly(s),
    }
}

/// A path as a shell takes it.
pub fn shown(path: &Path) -> String {
    shell_word(&path.display().to_string())
}

/// The depth of focus of the optics, beside the PDOF that a job asks for.
pub fn optics(machine: &Machine, focus: &Focus) -> String {
    let depth = machine.depth_of_focus_mm();
    format!(
        "optics         depth of focus {depth:.3} mm (spot {}, {:.0} nm, M2 {}); PDOF is {:.3} of it\n",
        machine.lens.spot,
        machine.laser.wavelength.as_mm() * 1e6,
        machine.laser.m2,
        focus.pdof.mm() / depth
    )
}

/// What hatches in other directions would save of a job that takes `total` seconds; nothing where it is little.
pub(super) fn hatch(saving: &HatchSaving, total: f64) -> String {
    let line = |what: String, s: f64| {
        format!("hatch          {what} would save about {} ({:.0} %)\n", duration(s), 100.0 * s / total)
    };
    let contour = saving.contour_s.map(|s| line("direction = \"contour\"".into(), s));
    let turned = saving.turned.map(|(deg, s)| line(format!("lines turned by {deg} deg"), s));
    contour.into_iter().chain(turned).collect()
}

/// Where a job was written, what was proved of it, and what to do next; nothing of a job that was not.
pub(super) fn written(s: &AnySummary, written: Option<(&Path, Option<ProofCounts>)>) -> String {
    let Some((folder, proved)) = written else { return String::new() };
    let mut text = format!("job folder     {}\n", folder.display());
    let layout = folder.join("layout.svg");
    if matches!(s, AnySummary::Stepped(_)) && layout.is_file() {
        text += &format!("open           {}\n", layout.display());
    }
    text += &match proved {
        Some(ProofCounts { rules, checks }) => {
            format!("verified       the files were read back and hold all {rules} rules ({checks} checks)\n")
        }
        None => format!("then run       terrace verify {}\n", shown(folder)),
    };
    text
}

fn stepped(s: &Summary) -> String {
    let t = &s.time_s;
    let mut lines = vec![
        format!("part           {}", sides(s.part_mm)),
        format!("method         {}", s.method),
        format!("stops          {}{} ({} sub-blocks){}{}", s.stops, blocks(s), s.sub_blocks, at_least(s), merged(s)),
        format!(
            "marks          {:.3} mm in {} fragments ({} texture strokes cut)",
            s.mark_mm, s.fragments, s.strokes_cut
        ),
        format!("texture        {:.3} mm", s.texture_mm),
        format!(
            "not marked     {:.3} mm (off the part {:.3}, too steep {:.3}, too small {:.3})",
            s.skipped_mm, s.skipped_off_part_mm, s.skipped_steep_mm, s.skipped_small_mm
        ),
        format!(
            "worst defocus  {:.3} um ({:.3} um if focused at the mean height)",
            s.worst_defocus_um, s.worst_defocus_mean_um
        ),
        format!("worst slope    {:.2} deg", s.worst_incidence_deg),
        format!("off the axis   {:.3} mm at most, 95 % within {:.3} mm", s.off_axis_mm.largest, s.off_axis_mm.p95),
    ];
    lines.extend(errors(&s.budget));
    lines.push(format!(
        "time           {} (stage {}, settling {},{} marks {}, jumps {}, delays {})",
        duration(t.total),
        duration(t.stage),
        duration(t.settle),
        if s.blocks > s.stops { format!(" zoom {},", duration(t.zoom)) } else { String::new() },
        duration(t.mark),
        duration(t.jump),
        duration(t.delay)
    ));
    if s.dots.texture > 0 {
        lines.insert(
            3,
            format!(
                "dots           {} of {} (off the part {}, too steep {})",
                s.dots.marked, s.dots.texture, s.dots.off_part, s.dots.steep
            ),
        );
    }
    lines.extend(loading(s));
    lines.extend(s.curves.as_ref().map(curves));
    if s.setups > 1 {
        lines.insert(1, format!("set-ups        {}", s.setups));
    }
    if s.passes > 1 {
        lines.insert(1, format!("passes         {}", s.passes));
    }
    for c in &s.candidates {
        lines.push(format!(
            "candidate      {:<8} {} stops, {} fragments, {}{}",
            c.method,
            c.stops,
            c.fragments,
            duration(c.time_s.total),
            if c.total_s > c.time_s.total { format!(", {} with loading", duration(c.total_s)) } else { String::new() }
        ));
    }
    lines.join("\n") + "\n"
}

/// The sides of a box.
fn sides([x, y, z]: [f64; 3]) -> String {
    format!("{x:.3} x {y:.3} x {z:.3} mm")
}

fn on_the_fly(s: &OnTheFlySummary) -> String {
    let mut lines = vec![
        format!("part           {}", sides(s.part_mm)),
        format!("marks          {} in {} moves, {:.3} mm", s.marks, s.moves, s.mark_mm),
        format!("time           {:.3} s, {:.3} s of it with the laser on", s.time_s, s.mark_s),
        format!("worst focus    {:.1} um, angle {:.2} deg", s.deviations.worst_fod_um, s.deviations.worst_bia_deg),
        format!("in the field   up to {:.3} mm from its centre", s.worst_displacement_mm),
    ];
    lines.extend(s.laser.iter().map(|l| {
        let error = l.laser_error_mm;
        let speed = s.mark_speed_mm_s;
        let period = l.servo_period_s;
        format!("laser          up to {error:.4} mm early: {speed:.1} mm/s x {period} s in {}", l.file)
    }));
    lines.extend(errors(&s.budget));
    lines.extend(s.curves.as_ref().map(curves));
    lines.join("\n") + "\n"
}

/// How far marks may lie from where they should, and what is not stated of it.
fn errors(budget: &Budget) -> Vec<String> {
    let [lateral, depth, not_stated] = budget.lines();
    let lines = [("lateral errors", lateral), ("depth errors  ", depth), ("not stated    ", not_stated)];
    lines.iter().filter(|(_, text)| !text.is_empty()).map(|(name, text)| format!("{name} {text}")).collect()
}

/// How space curves lie on the surface.
fn curves(c: &SpaceCurves) -> String {
    format!(
        "space curves   {}, {:.3} mm seen from the lens, {:.3} mm on the surface, up to {:.3} um off it",
        c.count, c.plan_mm, c.surface_mm, c.worst_distance_um
    )
}

//! How results and progress look on a terminal.

use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::batch::Outcome;
use crate::manifest::{AnySummary, OnTheFlySummary, Summary, duration};
use crate::plan::Station;

/// Pretty JSON with a line end.
pub fn json(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

/// A spinner with the station at hand. indicatif hides it where stderr is not a terminal.
pub struct Spinner(ProgressBar);

impl Spinner {
    pub fn new(quiet: bool) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        bar.enable_steady_tick(Duration::from_millis(120));
        Self(bar)
    }
    pub fn text(&self, text: &'static str) {
        self.0.set_message(text);
    }
    pub fn station(&self, s: Station) {
        self.text(match s {
            Station::Read => "reading surface and texture",
            Station::Footprint => "tracing the texture",
            Station::Split => "cutting strokes",
            Station::Order => "ordering",
            Station::Write => "writing the job folder",
        });
    }
    pub fn done(&self) {
        self.0.finish_and_clear();
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        // Also where a fault ends the work: its message begins on a clean line.
        self.done();
    }
}

/// One bar for a whole batch.
pub struct BatchView(ProgressBar);

impl BatchView {
    pub fn new(quiet: bool, jobs: usize) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(jobs as u64) };
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} jobs, {elapsed}, left {eta}  {msg}") {
            bar.set_style(style);
        }
        Self(bar)
    }
    pub fn done(&self, outcome: &Outcome) {
        self.0.set_message(outcome.job.display().to_string());
        self.0.inc(1);
    }
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

/// How many stops any partition needs, and how near the job comes.
fn at_least(s: &Summary) -> String {
    let ratio = s.lower_bound_stops.filter(|&n| n > 0).zip(s.over_bound());
    ratio.map_or(String::new(), |(n, ratio)| format!(", at least {n} (x {ratio:.3})"))
}

/// The figures of a job as a person reads them.
pub fn summary(s: &AnySummary, folder: Option<&Path>) -> String {
    match s {
        AnySummary::Stepped(s) => stepped(s, folder),
        AnySummary::OnTheFly(s) => on_the_fly(s, folder),
    }
}

fn stepped(s: &Summary, folder: Option<&Path>) -> String {
    let t = &s.time_s;
    let mut lines = vec![
        format!("method         {}", s.method),
        format!("stops          {} ({} sub-blocks){}", s.stops, s.sub_blocks, at_least(s)),
        format!(
            "marks          {:.3} mm in {} strokes, {} of the texture's strokes cut",
            s.mark_mm, s.fragments, s.strokes_cut
        ),
        format!("texture        {:.3} mm", s.texture_mm),
        format!(
            "not marked     {:.3} mm (off the part {:.3}, too steep {:.3}, too small {:.3})",
            s.skipped_mm, s.skipped_off_part_mm, s.skipped_steep_mm, s.skipped_small_mm
        ),
        format!(
            "worst defocus  {:.3} um (with the mean as focal plane: {:.3} um)",
            s.worst_defocus_um, s.worst_defocus_mean_um
        ),
        format!("worst slope    {:.2} deg", s.worst_incidence_deg),
        format!(
            "time           {} (stage {}, settling {}, marks {}, jumps {}, delays {})",
            duration(t.total),
            duration(t.stage),
            duration(t.settle),
            duration(t.mark),
            duration(t.jump),
            duration(t.delay)
        ),
    ];
    if s.setups > 1 {
        lines.insert(1, format!("set-ups        {}", s.setups));
    }
    if s.passes > 1 {
        lines.insert(1, format!("passes         {}", s.passes));
    }
    for c in &s.candidates {
        lines.push(format!(
            "candidate      {:<8} {} stops, {} strokes, {}",
            c.method,
            c.stops,
            c.fragments,
            duration(c.time_s.total)
        ));
    }
    if let Some(folder) = folder {
        lines.push(format!("job folder     {}", folder.display()));
        lines.push(format!("look first at  {}", folder.join("layout.svg").display()));
        lines.push(format!("then run       terrace verify {}", folder.display()));
    }
    lines.join("\n") + "\n"
}

fn on_the_fly(s: &OnTheFlySummary, folder: Option<&Path>) -> String {
    let mut lines = vec![
        format!("marks          {} in {} moves, {:.3} mm", s.marks, s.moves, s.mark_mm),
        format!("time           {:.3} s, {:.3} s of it with the laser on", s.time_s, s.mark_s),
        format!("worst focus    {:.1} um, angle {:.2} deg", s.deviations.worst_fod_um, s.deviations.worst_bia_deg),
        format!("in the field   up to {:.3} mm from its centre", s.worst_displacement_mm),
        format!(
            "laser          up to {:.4} mm early: {:.1} mm/s x {} s",
            s.laser_error_mm, s.mark_speed_mm_s, s.servo_period_s
        ),
    ];
    if let Some(folder) = folder {
        lines.push(format!("job folder     {}", folder.display()));
        lines.push(format!("then run       terrace verify {}", folder.display()));
    }
    lines.join("\n") + "\n"
}

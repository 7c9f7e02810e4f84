//! What became of all jobs: JSON, and text for people.

use std::fmt;

use serde_json::{Value, json};

use super::{Figures, Outcome, State};
use crate::diag::Failure;
use crate::manifest::duration;

/// All outcomes, in the order of the list.
#[derive(Debug)]
pub struct Report(pub(super) Vec<Outcome>);

impl State {
    /// Its name in reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Compiled(_) => "compiled",
            Self::Unchanged(_) => "unchanged",
            Self::Failed(_) => "failed",
            Self::Left => "left",
        }
    }

    /// The figures of a job whose folder is there and holds.
    pub fn figures(&self) -> Option<&Figures> {
        match self {
            Self::Compiled(figures) | Self::Unchanged(figures) => Some(figures),
            Self::Failed(_) | Self::Left => None,
        }
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Compiled(_) | Self::Unchanged(_) => 0,
            Self::Failed(e) => e.exit_code(),
            Self::Left => 1,
        }
    }
}

impl Outcome {
    /// As the report lists it. Keys that do not apply are null.
    pub fn to_json(&self) -> Value {
        let mut v = json!({
            "job": self.job.display().to_string(),
            "folder": self.folder.display().to_string(),
            "state": self.state.name(),
        });
        if let Some(f) = self.state.figures() {
            v["stops"] = json!(f.stops);
            v["time_s"] = json!(f.time_s);
            v["by_hand_s"] = json!(f.by_hand_s);
            v["warnings"] = json!(f.warnings);
            v["verified"] = json!(self.verified.then_some(true));
        }
        if let State::Failed(e) = &self.state {
            v["exit_code"] = json!(e.exit_code());
            v["errors"] = json!(Failure::from(e).errors);
        }
        v
    }
}

/// One line: state, job, and its figures or what is wrong first of all.
impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<9}  {}", self.state.name(), self.job.display())?;
        if let State::Failed(e) = &self.state {
            write!(f, "  {}", e.diags()[0].message)?;
        }
        if let Some(figures) = self.state.figures() {
            write!(f, "  {figures}")?;
        }
        if self.verified { write!(f, ", verified") } else { Ok(()) }
    }
}

/// `12 stops, 3 min 5 s, by hand 6 min 5 s, 1 warning`.
impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.stops.iter().try_for_each(|&n| write!(f, "{}, ", counted(n, "stop")))?;
        write!(f, "{}", duration(self.time_s))?;
        self.by_hand_s.iter().try_for_each(|&s| write!(f, ", by hand {}", duration(s)))?;
        if self.warnings > 0 { write!(f, ", {}", counted(self.warnings, "warning")) } else { Ok(()) }
    }
}

fn counted(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// Figures of all jobs whose folders are there and hold.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Stops.
    pub stops: usize,
    /// Job time, s.
    pub time_s: f64,
    /// Jobs whose blocks a person loads.
    pub by_hand: usize,
    /// Their time with that person, s.
    pub by_hand_s: f64,
}

impl Report {
    /// What became of each job.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.0
    }

    /// The highest exit code of all jobs.
    pub fn exit_code(&self) -> u8 {
        self.0.iter().map(|o| o.state.exit_code()).max().unwrap_or(0)
    }

    /// How many jobs were compiled, unchanged, failed, left.
    fn counts(&self) -> [usize; 4] {
        let count = |name: &str| self.0.iter().filter(|o| o.state.name() == name).count();
        ["compiled", "unchanged", "failed", "left"].map(count)
    }

    /// The sums over all jobs.
    pub fn totals(&self) -> Totals {
        let mut t = Totals::default();
        for f in self.0.iter().filter_map(|o| o.state.figures()) {
            t.stops += f.stops.unwrap_or(0);
            t.time_s += f.time_s;
            t.by_hand += usize::from(f.by_hand_s.is_some());
            t.by_hand_s += f.by_hand_s.unwrap_or(0.0);
        }
        t
    }

    /// The report as JSON.
    pub fn to_json(&self) -> Value {
        let [compiled, unchanged, failed, left] = self.counts();
        let t = self.totals();
        let jobs: Vec<Value> = self.0.iter().map(Outcome::to_json).collect();
        json!({"compiled": compiled, "unchanged": unchanged, "failed": failed, "left": left,
            "exit_code": self.exit_code(), "stops": t.stops, "time_s": t.time_s,
            "by_hand_s": (t.by_hand > 0).then_some(t.by_hand_s), "jobs": jobs})
    }

    /// The sums, a line each.
    pub fn sums(&self) -> Vec<String> {
        let [compiled, unchanged, failed, left] = self.counts();
        let t = self.totals();
        let mut lines = vec![
            format!("{compiled} compiled, {unchanged} unchanged, {failed} failed"),
            format!("machine time {}, {}", duration(t.time_s), counted(t.stops, "stop")),
        ];
        if t.by_hand > 0 {
            let jobs = counted(t.by_hand, "job");
            lines.push(format!("by hand {} for {jobs} whose blocks a person loads", duration(t.by_hand_s)));
        }
        if left > 0 {
            let all = self.0.len();
            lines.push(format!(
                "{left} of {all} jobs not started: run the same command again; finished folders are kept"
            ));
        }
        lines
    }
}

/// The jobs that failed, with all that is wrong with them, and the sums.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for o in &self.0 {
            let State::Failed(e) = &o.state else { continue };
            writeln!(f, "failed     {}", o.job.display())?;
            for d in e.diags() {
                for line in d.render(false).lines() {
                    writeln!(f, "           {line}")?;
                }
            }
        }
        self.sums().iter().try_for_each(|line| writeln!(f, "{line}"))
    }
}

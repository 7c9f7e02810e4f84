//! What became of all jobs: JSON, and text for people.

use std::fmt;

use serde_json::{Value, json};

use super::outcome::{Outcome, counted};
use terrace_core::duration::duration;
use terrace_core::machine::LoadingWay;

/// All outcomes, in the order of the list.
#[derive(Debug)]
pub struct Report(pub(super) Vec<Outcome>);

/// Figures of all jobs whose folders are there and hold.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Stops.
    pub stops: usize,
    /// Job time, s.
    pub time_s: f64,
    /// Jobs whose blocks a person loads.
    pub by_person: usize,
    /// Time of all jobs with the loading of their blocks, s.
    pub total_s: f64,
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

    /// How many jobs were compiled, unchanged, failed, missing, left.
    fn counts(&self) -> [usize; 5] {
        let count = |name: &str| self.0.iter().filter(|o| o.state.name() == name).count();
        ["compiled", "unchanged", "failed", "missing", "left"].map(count)
    }

    /// The sums over all jobs.
    pub fn totals(&self) -> Totals {
        let mut t = Totals::default();
        for f in self.0.iter().filter_map(|o| o.state.figures()) {
            t.stops += f.stops.unwrap_or(0);
            t.time_s += f.time_s;
            t.by_person += usize::from(f.way == Some(LoadingWay::Person));
            t.total_s += f.total_s;
        }
        t
    }

    /// The report as JSON.
    pub fn to_json(&self) -> Value {
        let [compiled, unchanged, failed, missing, left] = self.counts();
        let t = self.totals();
        let jobs: Vec<Value> = self.0.iter().map(Outcome::to_json).collect();
        json!({"compiled": compiled, "unchanged": unchanged, "failed": failed, "missing": missing,
            "left": left, "exit_code": self.exit_code(), "stops": t.stops, "time_s": t.time_s,
            "total_s": t.total_s, "jobs": jobs})
    }

    /// The sums, a line each.
    pub fn sums(&self) -> Vec<String> {
        let [compiled, unchanged, failed, missing, left] = self.counts();
        let t = self.totals();
        let missed = if missing > 0 { format!(", {missing} missing") } else { String::new() };
        let mut lines = vec![
            format!("{compiled} compiled, {unchanged} unchanged, {failed} failed{missed}"),
            format!("machine time {}, {}", duration(t.time_s), counted(t.stops, "stop")),
        ];
        if t.total_s > t.time_s {
            let jobs = counted(t.by_person, "job");
            lines.push(format!("with loading {}; a person loads the blocks of {jobs}", duration(t.total_s)));
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

/// The jobs that failed or are missing, with all that is wrong with them, and the sums.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for o in &self.0 {
            let Some(fault) = o.state.fault() else { continue };
            writeln!(f, "{:<9}  {}", o.state.name(), o.job.display())?;
            fault.text.lines().try_for_each(|line| writeln!(f, "           {line}"))?;
        }
        self.sums().iter().try_for_each(|line| writeln!(f, "{line}"))
    }
}

//! What became of a unit, as JSON and as a line for people.

use std::fmt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::unit::{Unit, with_slashes};
use terrace_core::diag::{Fault, Message};
use terrace_core::duration::duration;
use terrace_core::machine::LoadingWay;
use terrace_plan::manifest::AnySummary;

/// What the manifest of a job's folder says of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Number of stops; None of on-the-fly jobs.
    pub stops: Option<usize>,
    /// Job time, s: that of the machine.
    pub time_s: f64,
    /// Time of the machine with the loading of the blocks, s.
    pub total_s: f64,
    /// Whether that leaves out a time that is not known.
    pub is_least: bool,
    /// Who loads the blocks; None of on-the-fly jobs.
    pub way: Option<LoadingWay>,
    /// Number of warnings.
    pub warnings: usize,
}

impl From<&AnySummary> for Figures {
    fn from(summary: &AnySummary) -> Self {
        match summary {
            AnySummary::Stepped(s) => Self {
                stops: Some(s.stops),
                time_s: s.time_s.total,
                total_s: s.loading.total_s,
                is_least: s.loading.is_least(),
                way: Some(s.loading.way),
                warnings: s.warnings.len(),
            },
            AnySummary::OnTheFly(s) => {
                let warnings = s.warnings.len();
                Self { stops: None, time_s: s.time_s, total_s: s.time_s, is_least: false, way: None, warnings }
            }
        }
    }
}

/// What became of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// The unit was compiled.
    Compiled(Figures),
    /// Nothing had changed: the figures of the folder that is there.
    Unchanged(Figures),
    /// The unit could not be compiled, and any older folder is unchanged; or its folder does not verify.
    Failed(Fault),
    /// Nobody knows: it was given to an engine and left no report, or its folder is not here.
    Missing(Fault),
    /// The batch was stopped before this job began.
    Left,
}

impl State {
    /// The state's name in reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Compiled(_) => "compiled",
            Self::Unchanged(_) => "unchanged",
            Self::Failed(_) => "failed",
            Self::Missing(_) => "missing",
            Self::Left => "left",
        }
    }

    /// The figures of a job whose folder is there and holds.
    pub fn figures(&self) -> Option<&Figures> {
        match self {
            Self::Compiled(figures) | Self::Unchanged(figures) => Some(figures),
            Self::Failed(_) | Self::Missing(_) | Self::Left => None,
        }
    }

    /// What is wrong with a job that has no folder.
    pub fn fault(&self) -> Option<&Fault> {
        match self {
            Self::Failed(fault) | Self::Missing(fault) => Some(fault),
            Self::Compiled(_) | Self::Unchanged(_) | Self::Left => None,
        }
    }

    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Compiled(_) | Self::Unchanged(_) => 0,
            Self::Failed(fault) | Self::Missing(fault) => fault.failure.exit_code,
            Self::Left => 1,
        }
    }
}

/// A job and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Job file.
    #[serde(serialize_with = "with_slashes")]
    pub job: PathBuf,
    /// The folder of the unit.
    #[serde(serialize_with = "with_slashes")]
    pub folder: PathBuf,
    /// What became of it.
    pub state: State,
    /// Whether its folder was verified, without a fault.
    pub verified: bool,
}

impl Outcome {
    /// The outcome of a unit whose folder was not verified.
    pub(super) fn of(unit: &Unit, state: State) -> Self {
        Self { job: unit.job.clone(), folder: unit.folder().to_owned(), state, verified: false }
    }

    /// The outcome as the report lists it. Keys that do not apply are null.
    pub fn to_json(&self) -> Value {
        let mut v = json!({
            "job": self.job.display().to_string(),
            "folder": self.folder.display().to_string(),
            "state": self.state.name(),
        });
        if let Some(f) = self.state.figures() {
            v["stops"] = json!(f.stops);
            v["time_s"] = json!(f.time_s);
            v["total_s"] = json!(f.total_s);
            v["way"] = json!(f.way);
            v["warnings"] = json!(f.warnings);
            v["verified"] = json!(self.verified.then_some(true));
        }
        if let Some(fault) = self.state.fault() {
            v["exit_code"] = json!(fault.failure.exit_code);
            v["errors"] = json!(fault.failure.errors);
        }
        v
    }

    /// The errors of a job that has no folder.
    pub(super) fn errors(&self) -> &[Message] {
        self.state.fault().map_or(&[], |fault| &fault.failure.errors)
    }
}

/// One line: state, job, and its figures or what is wrong first of all.
impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<9}  {}", self.state.name(), self.job.display())?;
        if let Some(fault) = self.state.fault() {
            write!(f, "  {}", fault.message())?;
        }
        if let Some(figures) = self.state.figures() {
            write!(f, "  {figures}")?;
        }
        if self.verified { write!(f, ", verified") } else { Ok(()) }
    }
}

/// `12 stops, 3 min 5 s, with loading 6 min 5 s, 1 warning`.
impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.stops.iter().try_for_each(|&n| write!(f, "{}, ", counted(n, "stop")))?;
        write!(f, "{}", duration(self.time_s))?;
        if self.total_s > self.time_s {
            write!(f, ", with loading {}", duration(self.total_s))?;
        }
        if self.warnings > 0 { write!(f, ", {}", counted(self.warnings, "warning")) } else { Ok(()) }
    }
}

pub(super) fn counted(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

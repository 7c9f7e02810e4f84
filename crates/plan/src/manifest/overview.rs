//! What the product reads of the manifest of a job folder, whatever its mode.

use std::path::Path;

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::head::{bytes, parse};
use super::{Head, Manifest, OnTheFlySummary, Summary};
use terrace_core::diag::{Diag, Error};
use terrace_core::machine::Machine;
use terrace_input::job::{Job, Mode};

/// A manifest as the product reads it.
#[derive(Clone, Debug)]
pub struct ManifestOverview {
    /// What both modes have.
    pub head: Head,
    /// The machine's name.
    pub machine: String,
    /// The figures.
    pub summary: AnySummary,
}

/// Figures by mode.
#[derive(Clone, Debug)]
pub enum AnySummary {
    /// The figures of a stepped job.
    Stepped(Box<Summary>),
    /// The figures of an on-the-fly job.
    OnTheFly(Box<OnTheFlySummary>),
}

impl AnySummary {
    /// The summary as `compile --json` prints it.
    pub fn to_json(&self) -> serde_json::Value {
        let value = match self {
            Self::Stepped(summary) => serde_json::to_value(summary),
            Self::OnTheFly(summary) => serde_json::to_value(summary),
        };
        value.expect("summaries are plain JSON")
    }

    /// With further warnings of its job.
    #[must_use]
    pub fn warned(mut self, job: &Job, further: &[Diag]) -> Self {
        let warnings = match &mut self {
            Self::Stepped(summary) => &mut summary.warnings,
            Self::OnTheFly(summary) => &mut summary.warnings,
        };
        warnings.extend(super::warnings(job, further));
        self
    }
}

/// Reads the manifest of a job folder.
///
/// # Errors
/// The errors of [`Head::read`].
pub fn read(folder: &Path) -> Result<ManifestOverview, Error> {
    #[derive(Deserialize)]
    struct Rest {
        machine: Machine,
        summary: OnTheFlySummary,
    }
    let bytes = bytes(folder)?;
    let head: Head = parse(folder, &bytes)?;
    let (machine, summary) = match head.mode {
        Mode::Stepped => {
            let manifest: Manifest<IgnoredAny> = parse(folder, &bytes)?;
            (manifest.machine.name, AnySummary::Stepped(Box::new(manifest.summary)))
        }
        Mode::OnTheFly => {
            let rest: Rest = parse(folder, &bytes)?;
            (rest.machine.name, AnySummary::OnTheFly(Box::new(rest.summary)))
        }
    };
    Ok(ManifestOverview { head, machine, summary })
}

//! The fixtures of a job in its manifest.

use serde::{Deserialize, Serialize};

use crate::fixtures::Fixture;
use terrace_core::geom::{NM_PER_MM, SpacePoint};
use terrace_core::program::SetupId;

/// A fixture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FixtureEntry {
    /// Its name.
    pub name: String,
    /// Its lowest and its highest corner, turned part frame.
    pub box_mm: [SpacePoint; 2],
    /// The set-ups in which it is there; empty: all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub setups: Vec<u32>,
}

impl FixtureEntry {
    /// Of a fixture.
    pub fn new(fixture: &Fixture) -> Self {
        // To a tenth of a micrometre: it stands for a place to look at, not for one to stop at.
        let mm = |nm: f64| (nm / NM_PER_MM * 1e4).round() / 1e4 + 0.0;
        Self {
            name: fixture.name.clone(),
            box_mm: fixture.ends().map(|p| p.map(mm)),
            setups: fixture.setups.iter().map(|setup| setup.number()).collect(),
        }
    }

    /// Whether it is there in a set-up.
    pub fn is_in(&self, setup: SetupId) -> bool {
        self.setups.is_empty() || self.setups.contains(&setup.number())
    }
}

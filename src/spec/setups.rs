//! `[setups]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::units::Length;

/// `[setups]`: a part beyond the stage travel is moved on the table and marked from several places.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SetupsSpec {
    /// Into how many columns the stops are parted along x.
    #[serde(default)]
    pub columns: Parts,
    /// Into how many rows along y.
    #[serde(default)]
    pub rows: Parts,
    /// Points of the part's own frame that the operator finds with the pilot laser, x and y; every set-up
    /// must reach two.
    pub registration: Vec<[Length; 2]>,
}

/// How many columns or rows of set-ups there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged, expecting = "a number of set-ups, or \"auto\"")]
pub enum Parts {
    /// `"auto"`.
    Named(PartsName),
    /// So many.
    Number(u32),
}

impl Default for Parts {
    fn default() -> Self {
        Self::Named(PartsName::Auto)
    }
}

/// Numbers with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PartsName {
    /// The fewest that the travel allows.
    Auto,
}

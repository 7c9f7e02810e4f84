//! `[dose]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What of a pen makes up for the slope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Compensate {
    /// Marks are slower by the cosine of the slope.
    Speed,
    /// Power is higher by one over the cosine.
    Power,
}

/// `[dose]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DoseSpec {
    /// What is changed.
    pub compensate: Compensate,
    /// By how much at most: 1.5 is a speed of two thirds, or half as much power again.
    #[serde(default = "default_cap")]
    pub cap: f64,
    /// Factors are multiples of this.
    #[serde(default = "default_step")]
    pub step: f64,
}

fn default_cap() -> f64 {
    1.5
}

fn default_step() -> f64 {
    0.01
}

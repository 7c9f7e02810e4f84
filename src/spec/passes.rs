//! `[passes]`, and what follows from its numbers for every pass.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::units::{Angle, Length, non_negative, non_negative_option};

/// `[passes]`: the whole texture again, each time with stops of its own.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PassesSpec {
    /// How many there are, 1 to 100.
    #[serde(default = "default_count")]
    #[schemars(with = "u32")]
    pub count: Spanned<u32>,
    /// By how much straight hatches turn from pass to pass, counter-clockwise.
    #[serde(default)]
    pub rotate: Angle,
    /// By how much focal planes sink from pass to pass, because the one before has removed so much.
    #[serde(default, deserialize_with = "non_negative")]
    pub lower: Length,
    /// By how much the grid of sections moves along x and y from pass to pass, so that seams do not lie on
    /// each other; default: the golden part of a section. With "0 mm" levels do not move either.
    #[serde(default, deserialize_with = "non_negative_option")]
    #[schemars(with = "Option<Length>")]
    pub shift: Option<Length>,
}

fn default_count() -> Spanned<u32> {
    Spanned::new(0..0, 1)
}

impl Default for PassesSpec {
    fn default() -> Self {
        Self { count: default_count(), rotate: Angle::default(), lower: Length::default(), shift: None }
    }
}

impl PassesSpec {
    /// The golden section: its multiples fill an interval evenly, however many there are.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;

    /// How many passes there are.
    pub fn count(&self) -> u32 {
        *self.count.get_ref()
    }
    /// What part of a repeated length pass `k` is shifted by, from 0 to 1.
    pub fn share(k: u32) -> f64 {
        (f64::from(k) * Self::GOLDEN).fract()
    }
    /// By how much the grid of sections lies lower along x and y in pass `k` than in the first, less than the
    /// sections' `pitch` and a multiple of `grain`, nm.
    pub fn shift_nm(&self, k: u32, pitch: [i64; 2], grain: i64) -> [i64; 2] {
        let shift = |pitch: i64| match self.shift.map(|s| s.as_nm().unwrap_or(0)) {
            Some(shift) => (i128::from(shift) * i128::from(k) % i128::from(pitch.max(1))) as i64,
            None => (pitch as f64 * Self::share(k)) as i64,
        };
        pitch.map(|pitch| shift(pitch) / grain * grain)
    }
    /// By how much levels lie lower in pass `k` than in the first, nm.
    pub fn level_shift_nm(&self, k: u32, depth: i64) -> f64 {
        let stays = self.shift.is_some_and(|s| s.as_mm() == 0.0);
        if stays { 0.0 } else { depth as f64 * Self::share(k) }
    }
    /// By how much the surface is lower in pass `k` than in the first, nm.
    pub fn lowered_nm(&self, k: u32) -> i64 {
        self.lower.as_nm().unwrap_or(i64::MAX).saturating_mul(i64::from(k))
    }
}

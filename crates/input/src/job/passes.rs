//! The passes of a job: how far grid, levels and surface lie from those of the first pass.

use terrace_core::geom::Nm;
use terrace_core::program::PassId;
use terrace_core::units::Angle;

/// How often the texture is gone over, and what changes from pass to pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passes {
    /// How many there are, from 1.
    pub count: u32,
    /// By how much straight hatches turn.
    pub rotate: Angle,
    /// By how much focal planes sink.
    pub lower: Nm,
    /// By how much the grid of sections moves along x and y; None: the golden part of a section.
    pub shift: Option<Nm>,
}

impl Default for Passes {
    fn default() -> Self {
        Self { count: 1, rotate: Angle::default(), lower: Nm(0), shift: None }
    }
}

impl Passes {
    /// The golden section: its multiples fill an interval evenly, however many there are.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;

    /// What part of a repeated length pass `k` is shifted by, from 0 to 1.
    pub fn share(k: u32) -> f64 {
        (f64::from(k) * Self::GOLDEN).fract()
    }
    /// By how much the grid of sections lies lower along x and y in pass `k` than in the first, less than the
    /// sections' `pitch` and a multiple of `grain`.
    pub fn grid_shift(&self, PassId(k): PassId, pitch: [Nm; 2], grain: Nm) -> [Nm; 2] {
        pitch.map(|pitch| grain * (self.shift_of_pass(k, pitch) / grain))
    }

    /// The shift in pass `k` of a grid of this pitch, less than the pitch.
    fn shift_of_pass(&self, k: u32, pitch: Nm) -> Nm {
        match self.shift {
            Some(Nm(shift)) => Nm((i128::from(shift) * i128::from(k) % i128::from(pitch.0.max(1))) as i64),
            None => Nm((pitch.f64() * Self::share(k)) as i64),
        }
    }

    /// By how much levels lie lower in pass `k` than in the first, nm.
    pub fn level_shift_nm(&self, PassId(k): PassId, depth: Nm) -> f64 {
        if self.shift == Some(Nm(0)) { 0.0 } else { depth.f64() * Self::share(k) }
    }
    /// By how much the surface is lower in pass `k` than in the first.
    pub fn lowered(&self, PassId(k): PassId) -> Nm {
        self.lower * i64::from(k)
    }
}

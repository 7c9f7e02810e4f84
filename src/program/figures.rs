//! What is estimated of a block: its time, and how the surface lies under its marks.

/// The figures of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockFigures {
    /// Time of its marks, jumps and delays, without the stage's moves, s.
    pub time_s: f64,
    /// Slope under its marks, against the beam.
    pub slope: Slope,
}

/// How the surface lies under the marks of a block, and what dose they get; means are over the length of
/// the marks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    length: f64,
    cos_length: f64,
    dose_length: f64,
    least_cos: f64,
    least_dose: f64,
}

impl Default for Slope {
    fn default() -> Self {
        Self { length: 0.0, cos_length: 0.0, dose_length: 0.0, least_cos: 1.0, least_dose: f64::INFINITY }
    }
}

impl Slope {
    /// Adds marks of a length over which the cosine of the slope has the given mean, at most a squared slope,
    /// whose pen raises the dose by `gain`.
    pub fn add(&mut self, length: f64, cos: f64, slope2: f64, gain: f64) {
        let least = 1.0 / (1.0 + slope2).sqrt();
        self.length += length;
        self.cos_length += length * cos;
        self.dose_length += length * cos * gain;
        self.least_cos = self.least_cos.min(least);
        self.least_dose = self.least_dose.min(least * gain);
    }
    /// Mean and least cosine of the angle between beam and surface normal.
    pub fn cos(&self) -> [f64; 2] {
        [if self.length > 0.0 { (self.cos_length / self.length).min(1.0) } else { self.least_cos }, self.least_cos]
    }
    /// That angle: of the mean cosine, and the largest.
    pub fn incidence_deg(&self) -> [f64; 2] {
        self.cos().map(|c| c.acos().to_degrees())
    }
    /// How much longer the texture is on the surface than in the drawing, straight uphill: of the mean cosine,
    /// and at most.
    pub fn stretch(&self) -> [f64; 2] {
        self.cos().map(|c| 1.0 / c)
    }
    /// Energy on the area, 1 as on a level surface with the job's own pen: mean and least.
    pub fn dose(&self) -> [f64; 2] {
        let least = if self.least_dose.is_finite() { self.least_dose } else { 1.0 };
        [if self.length > 0.0 { self.dose_length / self.length } else { least }, least]
    }
}

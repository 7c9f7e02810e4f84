//! What is estimated of a block: its time, how the surface lies under its marks, and what energy its lines get.

use super::{Block, Pen, Program};
use crate::machine::Machine;
use crate::math;
use crate::motion::{Beam, GalvoModel, LineEnergy};
use crate::parallel;

/// The figures of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockFigures {
    /// Time of its marks, jumps and delays, without the stage's moves, s.
    pub time_s: f64,
    /// Slope under its marks, against the beam.
    pub slope: Slope,
    /// What energy its lines get.
    pub energy: LineEnergy,
    /// How far from the optical axis its marks lie at most, mm.
    pub off_axis_mm: f64,
}

impl Pen {
    /// Laser and scanner as the pen sets them.
    pub fn beam(&self, machine: &Machine) -> Beam {
        let (speed, power) = (self.speed.as_mm_s(), self.power.as_w(machine.laser.max_power));
        Beam { model: GalvoModel::of(machine), speed, power, spot: machine.lens.spot.as_mm() }
    }
}

impl Program {
    /// What energy the lines of each block get.
    pub fn line_energies(&self, machine: &Machine) -> Vec<LineEnergy> {
        let beams: Vec<Beam> = self.pens.iter().map(|pen| pen.beam(machine)).collect();
        parallel::map(self.blocks.len(), |i| self.line_energy(&self.blocks[i], &beams))
    }

    /// What energy the lines of a block get from the beams of the pens.
    fn line_energy(&self, block: &Block, beams: &[Beam]) -> LineEnergy {
        let mut out = LineEnergy::default();
        for stroke in self.strokes_of(block) {
            out.add(self.points_of(stroke), beams[stroke.pen.index()]);
        }
        out
    }
}

/// How the surface lies under the marks of a block, and what dose they get; means are over the length of
/// the lines, or over the dots where there are no lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    length: f64,
    cos_length: f64,
    dose_length: f64,
    dots: f64,
    cos_dots: f64,
    dose_dots: f64,
    least_cos: f64,
    least_dose: f64,
}

impl Default for Slope {
    fn default() -> Self {
        let (length, cos_length, dose_length) = (0.0, 0.0, 0.0);
        let (dots, cos_dots, dose_dots) = (0.0, 0.0, 0.0);
        let (least_cos, least_dose) = (1.0, f64::INFINITY);
        Self { length, cos_length, dose_length, dots, cos_dots, dose_dots, least_cos, least_dose }
    }
}

impl Slope {
    /// Adds marks of a length over which the cosine of the slope has the given mean, at most a squared slope,
    /// whose pen raises the dose by `gain`; of a dot the length is 0.
    pub fn add(&mut self, length: f64, cos: f64, slope2: f64, gain: f64) {
        let least = 1.0 / (1.0 + slope2).sqrt();
        if length == 0.0 {
            self.dots += 1.0;
            self.cos_dots += cos;
            self.dose_dots += cos * gain;
        }
        self.length += length;
        self.cos_length += length * cos;
        self.dose_length += length * cos * gain;
        self.least_cos = self.least_cos.min(least);
        self.least_dose = self.least_dose.min(least * gain);
    }
    /// Mean and least cosine of the angle between beam and surface normal.
    pub fn cos(&self) -> [f64; 2] {
        [self.mean(self.cos_length, self.cos_dots).map_or(self.least_cos, |cos| cos.min(1.0)), self.least_cos]
    }
    /// Angles of incidence: that of the mean cosine, and the largest.
    pub fn incidence_deg(&self) -> [f64; 2] {
        self.cos().map(|c| math::acos(c).to_degrees())
    }
    /// How much longer the texture is on the surface than in the drawing, straight uphill: of the mean cosine,
    /// and at most.
    pub fn stretch(&self) -> [f64; 2] {
        self.cos().map(|c| 1.0 / c)
    }
    /// Energy on the area, 1 as on a level surface with the job's own pen: mean and least.
    pub fn dose(&self) -> [f64; 2] {
        let least = if self.least_dose.is_finite() { self.least_dose } else { 1.0 };
        [self.mean(self.dose_length, self.dose_dots).unwrap_or(least), least]
    }

    /// The mean of a sum over lines, or of one over dots where there are no lines.
    fn mean(&self, of_lines: f64, of_dots: f64) -> Option<f64> {
        if self.length > 0.0 { Some(of_lines / self.length) } else { (self.dots > 0.0).then(|| of_dots / self.dots) }
    }
}

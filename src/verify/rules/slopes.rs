//! How the surface file's own facets lie under the marks of a block: bounds of the mean and of the least cosine of
//! the angle between beam and surface, and of the dose.

use super::dose;
use crate::geom::FieldPoint;
use crate::job::Compensate;
use crate::program::{Block, Stroke};
use crate::verify::geometry::{Geometry, Line, Scratch, Slope};
use crate::verify::job_facts::JobFacts;
use crate::verify::read::program::ProgramFile;

/// Ends of marks are rounded in the plane: lengths by which means are weighed are off by at most this, nm.
const ROUNDED: f64 = 1.5;

/// Lowest and highest that a figure may be.
type Range = [f64; 2];

/// Mean and least, each as a range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Cosine of the angle between beam and surface.
    pub(super) cos: [Range; 2],
    /// Dose, 1 as on a level surface with the job's own pen.
    pub(super) dose: [Range; 2],
}

/// What lies under one mark.
#[derive(Clone, Copy)]
struct Under {
    length: f64,
    /// Integral of the cosine over the length.
    sum: Range,
    least: Range,
}

/// Bounds for a block; with `sides`, a mark along an edge may be on either side of it. None where nothing lies under
/// its marks.
pub(super) fn of(
    file: &ProgramFile,
    block: &Block,
    facts: &JobFacts,
    geometry: &Geometry,
    sides: bool,
    scratch: &mut Scratch,
) -> Option<Bounds> {
    let (mut length, mut count) = (0.0, 0.0);
    let (mut cos, mut dosed) = ([0.0; 2], [0.0; 2]);
    let mut least = [[f64::INFINITY; 2]; 2];
    for stroke in file.program.strokes_of(block) {
        let gain = gain(file, stroke, facts);
        let mut found = under(file, block, stroke, 0.0, geometry, scratch);
        if sides {
            for side in [geometry.reach(), -geometry.reach()] {
                found = match (found, under(file, block, stroke, side, geometry, scratch)) {
                    (Some(a), Some(b)) => Some(a.or(&b)),
                    (a, b) => a.or(b),
                };
            }
        }
        let Some(mut u) = found else { continue };
        if sides {
            u.least[0] = u.least[0].min(touched(file, block, stroke, geometry, scratch));
        }
        length += u.length;
        count += 1.0;
        for k in 0..2 {
            cos[k] += u.sum[k];
            dosed[k] += u.sum[k] * gain;
            least[0][k] = least[0][k].min(u.least[k]);
            least[1][k] = least[1][k].min(u.least[k] * gain);
        }
    }
    // A cosine is off from the mean by 1 at most, a dose by as much as doses are.
    let off = |most: f64| ROUNDED * count / length * most;
    let mean = |[lo, hi]: Range, most: f64| [lo / length - off(most), hi / length + off(most)];
    let most = dosed[1] / cos[1].max(f64::MIN_POSITIVE);
    (length > 0.0).then(|| Bounds { cos: [mean(cos, 1.0), least[0]], dose: [mean(dosed, most.max(1.0)), least[1]] })
}

impl Under {
    /// Either of both.
    fn or(&self, other: &Self) -> Self {
        let share = |u: &Self| u.sum.map(|s| s / u.length);
        let (a, b) = (share(self), share(other));
        Self {
            length: self.length,
            sum: [a[0].min(b[0]) * self.length, a[1].max(b[1]) * self.length],
            least: [self.least[0].min(other.least[0]), self.least[1].max(other.least[1])],
        }
    }
}

/// By how much its pen raises the dose of a mark.
fn gain(file: &ProgramFile, stroke: &Stroke, facts: &JobFacts) -> f64 {
    let factor = dose::origin(&file.program.pens, stroke.pen.index(), facts).map_or(1.0, |(_, factor)| factor);
    match facts.dose.map(|d| d.compensate) {
        Some(Compensate::Speed) => 1.0 / factor,
        Some(Compensate::Power) => factor,
        None => 1.0,
    }
}

/// The least cosine of what a mark may touch: rounding decides whether a mark that ends on an edge has the facet beyond
/// under its end.
fn touched(file: &ProgramFile, block: &Block, stroke: &Stroke, geometry: &Geometry, scratch: &mut Scratch) -> f64 {
    let c = block.stop.centre;
    let part = |p: FieldPoint| [c.x as f64 + f64::from(p.x), c.y as f64 + f64::from(p.y)];
    let reach = geometry.reach();
    let mut least = 1.0f64;
    for w in file.program.points_of(stroke).windows(2).filter(|w| w[0] != w[1]) {
        let line = Line::new(part(w[0]), part(w[1]));
        for side in [0.0, reach, -reach] {
            geometry.along(&line.part([-reach, line.len + reach], side), scratch, |p| {
                if let Some(s) = p.sheet.filter(|s| s.slope != Slope::Steep) {
                    least = least.min(1.0 / (s.slope2.sqrt() + geometry.slope_doubt(&s)).hypot(1.0));
                }
            });
        }
    }
    least
}

/// What lies under a mark moved sideways by `side`. Facets know their slope to the rounding of their vertices, and
/// where the mark goes from one to the next to the grain of the geometry; a facet met for less than that may be met or
/// not.
fn under(
    file: &ProgramFile,
    block: &Block,
    stroke: &Stroke,
    side: f64,
    geometry: &Geometry,
    scratch: &mut Scratch,
) -> Option<Under> {
    let c = block.stop.centre;
    let part = |p: FieldPoint| [c.x as f64 + f64::from(p.x), c.y as f64 + f64::from(p.y)];
    let grain = geometry.grain();
    let mut out = Under { length: 0.0, sum: [0.0; 2], least: [1.0, f64::INFINITY] };
    let mut before: Option<f64> = None;
    for w in file.program.points_of(stroke).windows(2).filter(|w| w[0] != w[1]) {
        let line = Line::new(part(w[0]), part(w[1]));
        geometry.along(&line.part([0.0, line.len], side), scratch, |p| {
            let Some(s) = p.sheet.filter(|s| s.slope != Slope::Steep) else { return };
            let (slope, doubt) = (s.slope2.sqrt(), geometry.slope_doubt(&s));
            let cos = [slope + doubt, (slope - doubt).max(0.0)].map(|t| 1.0 / t.hypot(1.0));
            let step = before.map_or(0.0, |b| (b - cos[1]).abs() * grain.min(p.len()));
            before = Some(cos[1]);
            out.length += p.len();
            out.sum = [out.sum[0] + cos[0] * p.len() - step, out.sum[1] + cos[1] * p.len() + step];
            out.least[0] = out.least[0].min(cos[0]);
            if p.len() > grain {
                out.least[1] = out.least[1].min(cos[1]);
            }
        });
    }
    out.least[1] = out.least[1].min(1.0);
    (out.length > 0.0).then_some(out)
}

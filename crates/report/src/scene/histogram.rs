//! How much length of the marks has which defocus and which incidence.

use super::{Point, Scene};
use terrace_core::geom::NM_PER_MM;
use terrace_core::math;

/// Marked length by value: bins of equal width.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Histogram {
    /// Least and greatest value.
    pub range: [f64; 2],
    /// Length of the marks in each bin, mm; every pass of a pen counts. Of a job of dots alone their number.
    pub bins: Vec<f64>,
}

/// Bins of a histogram.
const BINS: usize = 40;

impl Histogram {
    /// Of the defocus, um, without sign.
    pub(crate) fn of_defocus(scene: &Scene, passes: &[u32]) -> Self {
        Self::of(scene, passes, |p| f64::from(p.defocus_um))
    }

    /// Of the incidence, deg.
    pub(crate) fn of_incidence(scene: &Scene, passes: &[u32]) -> Self {
        Self::of(scene, passes, |p| f64::from(p.incidence_deg))
    }

    /// Of the size, without sign, of a value that is linear between the points of a mark; `passes` are those of each
    /// pen. Dots have no length: they are counted only where there are no lines.
    fn of(scene: &Scene, passes: &[u32], value: impl Fn(&Point) -> f64) -> Self {
        let most = scene.points().map(|p| value(p).abs()).fold(0.0, f64::max);
        // Bins need a width.
        let most = if most > 0.0 { most } else { 1.0 };
        let mut lengths = Lengths::new(most);
        let marks = || scene.groups.iter().flat_map(|g| g.marks.iter().map(move |m| (m, g.points_of(m))));
        let has_lines = marks().any(|(mark, _)| mark.len > 1);
        for (mark, points) in marks() {
            let pen_passes = f64::from(passes.get(mark.pen.index()).copied().unwrap_or(1));
            if let ([dot], false) = (points, has_lines) {
                lengths.add([value(dot); 2], pen_passes);
            }
            for w in points.windows(2) {
                // nm; without z, as lengths of marks are.
                let d = [0, 1].map(|k| f64::from(w[1].at[k]) - f64::from(w[0].at[k]));
                lengths.add([value(&w[0]), value(&w[1])], pen_passes * math::hypot(d[0], d[1]) / NM_PER_MM);
            }
        }
        Self { range: [0.0, most], bins: lengths.bins() }
    }

    /// The borders of the bins, one more than there are bins.
    pub fn edges(&self) -> Vec<f64> {
        let [lo, hi] = self.range;
        (0..=self.bins.len()).map(|k| lo + (hi - lo) * k as f64 / self.bins.len() as f64).collect()
    }
}

/// Lengths by the size of a value, while they are added up.
struct Lengths {
    /// The largest size.
    most: f64,
    /// What lies in a bin of a length that ends there.
    ends: [f64; BINS],
    /// By how much the length that passes through a bin as a whole is more than through the bin before.
    steps: [f64; BINS],
}

impl Lengths {
    fn new(most: f64) -> Self {
        Self { most, ends: [0.0; BINS], steps: [0.0; BINS] }
    }

    /// Spreads a length evenly over the values from one to another.
    fn add(&mut self, [from, to]: [f64; 2], length: f64) {
        if from * to < 0.0 {
            // In between the size falls to 0.
            let share = from.abs() / (from.abs() + to.abs());
            self.add_sizes([from.abs(), 0.0], length * share);
            self.add_sizes([0.0, to.abs()], length * (1.0 - share));
        } else {
            self.add_sizes([from.abs(), to.abs()], length);
        }
    }

    fn add_sizes(&mut self, sizes: [f64; 2], length: f64) {
        let last = BINS - 1;
        let [a, b] = sizes.map(|v| (v / self.most).clamp(0.0, 1.0) * BINS as f64);
        let (lo, hi) = (a.min(b), a.max(b));
        let (first, end) = ((lo as usize).min(last), (hi as usize).min(last));
        if first == end {
            self.ends[first] += length;
            return;
        }
        let of_bin = length / (hi - lo);
        self.ends[first] += of_bin * ((first + 1) as f64 - lo);
        self.ends[end] += of_bin * (hi - end as f64);
        self.steps[first + 1] += of_bin;
        self.steps[end] -= of_bin;
    }

    fn bins(&self) -> Vec<f64> {
        let through = self.steps.iter().scan(0.0, |through, step| {
            *through += step;
            Some(*through)
        });
        // Where nothing passes through, sums leave a rounding.
        self.ends.iter().zip(through).map(|(ends, through)| ends + f64::max(through, 0.0)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lengths in four parts of the bins.
    fn quarters(of: &[([f64; 2], f64)]) -> Vec<f64> {
        let mut lengths = Lengths::new(4.0);
        of.iter().for_each(|&(values, length)| lengths.add(values, length));
        lengths.bins().chunks(BINS / 4).map(|bins| (bins.iter().sum::<f64>() * 1e9).round() / 1e9).collect()
    }

    #[test]
    fn a_length_is_spread_evenly_over_the_values_that_it_runs_through() {
        assert_eq!(quarters(&[([4.0, 0.0], 8.0), ([1.5, 1.5], 1.0), ([0.5, 2.5], 4.0)]), [3.0, 5.0, 3.0, 2.0]);
        // From one side of the focal plane to the other.
        assert_eq!(quarters(&[([-4.0, 2.0], 6.0)]), [2.0, 2.0, 1.0, 1.0]);
        // Within one bin, and in neighbouring ones.
        assert_eq!(quarters(&[([0.01, 0.02], 2.0), ([0.95, 1.05], 1.0)]), [2.5, 0.5, 0.0, 0.0]);
    }
}

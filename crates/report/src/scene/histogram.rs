//! How much length of the marks has which defocus and which incidence.

use super::{Point, Scene};

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

    /// Of the size of a value that is linear between points; `passes` are those of the pens.
    fn of(scene: &Scene, passes: &[u32], value: impl Fn(&Point) -> f64) -> Self {
        let most = scene.points().map(|p| value(p).abs()).fold(0.0, f64::max);
        let range = [0.0, if most > 0.0 { most } else { 1.0 }];
        let mut bins = vec![0.0; BINS];
        let marks = || scene.groups.iter().flat_map(|g| g.marks.iter().map(move |m| (m, g.points_of(m))));
        let has_lines = marks().any(|(mark, _)| mark.len > 1);
        for (mark, points) in marks() {
            let weight = f64::from(passes.get(mark.pen.index()).copied().unwrap_or(1));
            if let ([dot], false) = (points, has_lines) {
                add(&mut bins, [value(dot); 2], weight, range[1]);
            }
            for w in points.windows(2) {
                let d = [0, 1].map(|k| f64::from(w[1].at[k]) - f64::from(w[0].at[k]));
                add(&mut bins, [value(&w[0]), value(&w[1])], weight * d[0].hypot(d[1]) / 1e6, range[1]);
            }
        }
        Self { range, bins }
    }

    /// The borders of the bins, one more than there are bins.
    pub fn edges(&self) -> Vec<f64> {
        let [lo, hi] = self.range;
        (0..=self.bins.len()).map(|k| lo + (hi - lo) * k as f64 / self.bins.len() as f64).collect()
    }
}

/// Spreads a length over the bins of the sizes from one value to another.
fn add(bins: &mut [f64], values: [f64; 2], length: f64, most: f64) {
    let [from, to] = values;
    if from * to < 0.0 {
        // In between the size falls to 0.
        let share = from.abs() / (from.abs() + to.abs());
        add(bins, [from, 0.0], length * share, most);
        add(bins, [0.0, to], length * (1.0 - share), most);
        return;
    }
    let last = bins.len() - 1;
    let [a, b] = values.map(|v| (v.abs() / most).clamp(0.0, 1.0) * bins.len() as f64);
    let (lo, hi) = (a.min(b), a.max(b));
    let (first, end) = ((lo as usize).min(last), (hi as usize).min(last));
    if first == end {
        bins[first] += length;
        return;
    }
    for (k, bin) in bins.iter_mut().enumerate().take(end + 1).skip(first) {
        let part = hi.min((k + 1) as f64) - lo.max(k as f64);
        *bin += length * part.max(0.0) / (hi - lo);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_spread_evenly_over_the_values_that_it_runs_through() {
        let mut bins = vec![0.0; 4];
        add(&mut bins, [4.0, 0.0], 8.0, 4.0);
        add(&mut bins, [1.5, 1.5], 1.0, 4.0);
        add(&mut bins, [0.5, 2.5], 4.0, 4.0);
        assert_eq!(bins, [3.0, 5.0, 3.0, 2.0]);
        // From one side of the focal plane to the other.
        let mut bins = vec![0.0; 4];
        add(&mut bins, [-4.0, 2.0], 6.0, 4.0);
        assert_eq!(bins, [2.0, 2.0, 1.0, 1.0]);
    }
}

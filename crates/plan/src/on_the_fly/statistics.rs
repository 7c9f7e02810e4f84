//! How a figure is spread over the marks.

use serde::Serialize;

/// Mean, quantiles and worst of the size of a figure, every mark weighing as much as it is long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Mean size.
    pub mean: f64,
    /// Half of the marked length has less.
    pub median: f64,
    /// 95 of 100 mm have less.
    pub p95: f64,
    /// Largest.
    pub worst: f64,
}

impl Statistics {
    /// Of figures and their weights; of weight 0 they do not count.
    pub fn of(figures: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut list: Vec<(f64, f64)> =
            figures.into_iter().map(|(f, w)| (f.abs(), w)).filter(|&(_, w)| w > 0.0).collect();
        list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let total: f64 = list.iter().map(|&(_, w)| w).sum();
        let Some(&(worst, _)) = list.last() else { return Self::default() };
        let mut below = 0.0;
        let mut at = |share: f64| {
            let mut sum = 0.0;
            let found = list.iter().find(|&&(_, w)| {
                sum += w;
                sum >= share * total
            });
            below = sum;
            found.map_or(worst, |&(f, _)| f)
        };
        let (median, p95) = (at(0.5), at(0.95));
        Self { mean: list.iter().map(|&(f, w)| f * w).sum::<f64>() / total, median, p95, worst }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_marks_weigh_more() {
        let spread = Statistics::of([(3.0, 1.0), (-1.0, 97.0), (2.0, 2.0), (9.0, 0.0)]);
        assert_eq!(spread, Statistics { mean: 1.04, median: 1.0, p95: 1.0, worst: 3.0 });
        assert_eq!(Statistics::of([]), Statistics::default());
    }
}

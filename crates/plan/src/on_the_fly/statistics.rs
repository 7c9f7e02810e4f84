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
    /// The spread of figures with their weights; those of weight 0 do not count.
    pub fn of(figures: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut sorted: Vec<(f64, f64)> =
            figures.into_iter().map(|(figure, weight)| (figure.abs(), weight)).filter(|&(_, w)| w > 0.0).collect();
        sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let Some(&(worst, _)) = sorted.last() else { return Self::default() };
        let total: f64 = sorted.iter().map(|&(_, w)| w).sum();
        Self {
            mean: sorted.iter().map(|&(f, w)| f * w).sum::<f64>() / total,
            median: quantile(&sorted, 0.5 * total).unwrap_or(worst),
            p95: quantile(&sorted, 0.95 * total).unwrap_or(worst),
            worst,
        }
    }
}

/// The figure up to which sorted figures weigh `weight` together; None where rounding leaves their sum below it.
fn quantile(sorted: &[(f64, f64)], weight: f64) -> Option<f64> {
    let mut sum = 0.0;
    for &(figure, own) in sorted {
        sum += own;
        if sum >= weight {
            return Some(figure);
        }
    }
    None
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

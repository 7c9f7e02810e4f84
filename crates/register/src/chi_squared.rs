//! Quantiles of the chi-squared distribution.

use terrace_core::math;

/// The value that a sum of squares of `dof` normal errors exceeds with the chance that one normal error exceeds
/// `sigmas` on one side; Wilson and Hilferty (1931), within 3 % from 2.5 sigmas and two degrees of freedom on.
pub fn quantile(dof: usize, sigmas: f64) -> f64 {
    let k = dof as f64;
    let spread = 2.0 / (9.0 * k);
    let root = 1.0 - spread + sigmas * spread.sqrt();
    k * math::pow(root.max(0.0), 3.0)
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn quantiles_are_those_of_tables() {
        // 99.9 % is 3.0902 sigmas on one side.
        for (dof, wanted) in [(2, 13.816), (3, 16.266), (6, 22.458), (20, 45.315), (100, 149.449)] {
            let found = quantile(dof, 3.0902);
            assert!((found / wanted - 1.0).abs() < 0.03, "{dof}: {found} {wanted}");
        }
    }
}

//! Natural cubic splines of several coordinates over one rising parameter.
//!
//! Consumes nodes, `axes` coordinates each, side by side; promises second derivatives at the nodes that make the curve
//! twice continuously differentiable, 0 at both ends.

/// Second derivatives at all nodes but the last, where they are 0 as at the first.
pub(crate) fn bends(positions: &[f64], s: &[f64], axes: usize, out: &mut [f64]) {
    let n = s.len() - 1;
    // h₀ m₋ + 2 (h₀ + h₁) m + h₁ m₊ = 6 (slope₁ - slope₀) at every inner node, m the second derivatives.
    let width = |i: usize| s[i + 1] - s[i];
    let at = |i: usize, a: usize| positions[i * axes + a];
    // Thomas' method; the upper factors are the same for all axes.
    let mut upper = vec![0.0; n];
    for i in 1..n {
        let (h0, h1) = (width(i - 1), width(i));
        let pivot = 2.0 * (h0 + h1) - h0 * upper[i - 1];
        upper[i] = h1 / pivot;
        for a in 0..axes {
            let turn = (at(i + 1, a) - at(i, a)) / h1 - (at(i, a) - at(i - 1, a)) / h0;
            out[i * axes + a] = (6.0 * turn - h0 * out[(i - 1) * axes + a]) / pivot;
        }
    }
    for i in (1..n.saturating_sub(1)).rev() {
        for a in 0..axes {
            out[i * axes + a] -= upper[i] * out[(i + 1) * axes + a];
        }
    }
}

/// Value, first and second derivative of a segment of width `h`, `x` after its start, from values and second
/// derivatives at its ends.
#[inline]
pub(crate) fn segment(ends: [f64; 2], bends: [f64; 2], h: f64, x: f64) -> [f64; 3] {
    let v = x / h;
    let u = 1.0 - v;
    let [m, n] = bends;
    [
        u * ends[0] + v * ends[1] - u * v * ((1.0 + u) * m + (1.0 + v) * n) * h * h / 6.0,
        (ends[1] - ends[0]) / h + ((3.0 * v * v - 1.0) * n - (3.0 * u * u - 1.0) * m) * h / 6.0,
        u * m + v * n,
    ]
}

/// The cell of rising `borders` that holds a value, and the value within them all; `hint` is the cell of the last call.
pub(crate) fn cell(borders: &[f64], value: f64, hint: &mut usize) -> (usize, f64) {
    let cells = borders.len() - 1;
    let v = value.clamp(borders[0], borders[cells]);
    let near = (*hint).min(cells - 1);
    let here = |i: usize| i < cells && borders[i] <= v && v <= borders[i + 1];
    let i = match [near, near + 1].into_iter().find(|&i| here(i)) {
        Some(i) => i,
        None => borders.partition_point(|&b| b <= v).clamp(1, cells) - 1,
    };
    *hint = i;
    (i, v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spline_meets_its_nodes_and_the_closed_form_of_three() {
        // 3/2 s - 1/2 s^3 on the first half, mirrored on the second; the other coordinate is straight.
        let (s, positions) = ([0.0, 1.0, 2.0], [0.0, 5.0, 1.0, 6.0, 0.0, 7.0]);
        let mut out = [0.0; 6];
        bends(&positions, &s, 2, &mut out);
        assert_eq!([out[1], out[3], out[5]], [0.0; 3]);
        let mut hint = 0;
        for t in [0.0, 0.25, 0.5, 1.0, 1.5, 2.0] {
            let (i, t) = cell(&s, t, &mut hint);
            let ends = [positions[2 * i], positions[2 * i + 2]];
            let [value, slope, bend] = segment(ends, [out[2 * i], out[2 * i + 2]], 1.0, t - s[i]);
            let near = t.min(2.0 - t);
            assert!((value - (1.5 * near - 0.5 * near.powi(3))).abs() < 1e-14, "{t}");
            assert!(
                (slope.abs() - (1.5 - 1.5 * near * near)).abs() < 1e-14 && (bend + 3.0 * near).abs() < 1e-14,
                "{t}"
            );
        }
    }

    #[test]
    fn cell_is_found_from_any_hint_and_values_beyond_are_drawn_in() {
        let borders = [0.0, 1.0, 2.0, 4.0];
        for hint in 0..9 {
            let at = |value: f64| cell(&borders, value, &mut hint.clone());
            assert_eq!([at(-1.0), at(0.5), at(3.0), at(9.0)], [(0, 0.0), (0, 0.5), (2, 3.0), (2, 4.0)], "{hint}");
        }
    }
}

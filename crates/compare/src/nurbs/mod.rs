//! NURBS surfaces: tensor-product rational B-splines, and three ways to their height z(x, y).
//!
//! A set-point generator for a machine that follows a surface needs z at given x and y in every control cycle, while
//! the surface is given over parameters u and v. Brecher et al. name three ways, here with the floating-point
//! operations of each, counted ([`Counted`]):
//! - I: a grid of heights and Gaussian weights ([`HeightGrid`]); cheap, and off by the smoothing of the weights;
//! - II: x and y are linear in the parameters ([`Decoupled`]); exact, for such nets alone;
//! - III: inversion of S_xy(u, v) = (x, y) ([`Inversion`]); exact, for any surface that is a height map.
//!
//! Consumes a net, knots and weights ([`Surface::new`], or a file by [`Surface::load`]); promises points and
//! derivatives to rounding. Units: mm. Frame: that of the file.
//!
//! # Source
//! Brecher et al., online trajectory generation from NURBS surfaces for a fast tool servo, eq. 2 to 7
//! (`docs/explanation/references.md`); basis functions by L. Piegl, W. Tiller, The NURBS Book (1997), A2.2 and A4.4.

mod basis;
mod decoupled;
mod examine;
mod file;
mod height_grid;
mod inversion;
mod scalar;

pub use decoupled::Decoupled;
pub use examine::{Convergence, Examination, GridSteps, examine};
pub use height_grid::HeightGrid;
pub use inversion::{Inversion, InvertedPoint, Method, NotConverged};
pub use scalar::{Counted, Scalar, counted};

use basis::{Basis, MAX_DEGREE};
use terrace_core::diag::{Diag, Error};

/// A tensor-product rational B-spline surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Along u and v, 1 to 9.
    degree: [usize; 2],
    knots: [Vec<f64>; 2],
    /// Control points along u and v.
    count: [usize; 2],
    /// Control points as x w, y w, z w, w; those of one u side by side.
    net: Vec<[f64; 4]>,
}

/// The partial derivatives of a point, in the order of [`Surface::derivatives`]: how often by u and by v.
const PARTIALS: [[usize; 2]; 6] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];
/// How many of these there are up to each order.
const UP_TO: [usize; 3] = [1, 3, 6];
/// Largest coordinate of a control point, mm.
const FARTHEST: f64 = 1e4;
/// Largest ratio of two weights.
const MAX_WEIGHT_RATIO: f64 = 1e6;
/// Farthest knot from 0, as a multiple of the range of the parameter.
const FARTHEST_KNOT: f64 = 1e6;
/// Least distance of two knots that differ, as a share of the range of the parameter.
const LEAST_KNOT_DISTANCE: f64 = 1e-9;

impl Surface {
    /// The surface of control points (`points[i][j]`: i along u, j along v), their weights, and knots as in STEP with
    /// every multiplicity written out: as many as points and degree together and one.
    ///
    /// # Errors
    /// `nurbs-surface` with what does not fit.
    pub fn new(
        degree: [usize; 2],
        knots: [Vec<f64>; 2],
        points: &[Vec<[f64; 3]>],
        weights: Option<&[Vec<f64>]>,
    ) -> Result<Self, Error> {
        let refused = |text: String, hint: &str| Err(Diag::input("nurbs-surface", text).hint(hint).into());
        let count = [points.len(), points.first().map_or(0, Vec::len)];
        if let Some(i) = points.iter().position(|row| row.len() != count[1]) {
            return refused(format!("row {i} of points is not as long as row 0"), "give every row the same count");
        }
        if let Some(weights) = weights
            && (weights.len() != count[0] || weights.iter().any(|row| row.len() != count[1]))
        {
            return refused("weights are not as many as points".into(), "give one weight for every point, or none");
        }
        for (k, name) in ["u", "v"].into_iter().enumerate() {
            let (p, n, knots) = (degree[k], count[k], &knots[k]);
            if !(1..=MAX_DEGREE).contains(&p) {
                let text = format!("degree {p} along {name} is not between 1 and {MAX_DEGREE}");
                return refused(text, "degrees 2 and 3 are usual");
            }
            if n <= p {
                let text = format!("{n} control points along {name} are too few for degree {p}");
                return refused(text, "it takes one more than the degree");
            }
            if knots.len() != n + p + 1 {
                let text =
                    format!("{} knots along {name}, but {n} points of degree {p} take {}", knots.len(), n + p + 1);
                return refused(text, "write every knot as often as its multiplicity");
            }
            if knots.iter().any(|t| !t.is_finite()) || knots.windows(2).any(|w| w[0] > w[1]) {
                return refused(format!("knots along {name} do not ascend"), "sort them");
            }
            // The parameter ranges from knot p to knot n.
            if knots[p] >= knots[n] {
                return refused(format!("knots along {name} leave no range of the parameter"), "check the knots");
            }
            let range = knots[n] - knots[p];
            if !(range.is_normal() && knots.iter().all(|t| t.abs() <= FARTHEST_KNOT * range)) {
                let text = format!("knots along {name} lie beyond 1e6 times the range of the parameter, {range}");
                return refused(text, "let them begin at 0");
            }
            if knots.windows(2).any(|w| w[0] < w[1] && w[1] - w[0] < LEAST_KNOT_DISTANCE * range) {
                let text = format!("two knots along {name} differ by less than 1e-9 of the range of the parameter");
                return refused(text, "write them as one knot of a higher multiplicity");
            }
            // At a knot inside the range that is there p + 1 times the surface may have a gap.
            if (1..n).any(|i| knots[i] == knots[i + p]) {
                let text = format!("a knot along {name} inside the range is there more than {p} times");
                return refused(text, "divide the surface there");
            }
        }
        // Only the ratios of weights count, so they are divided by the largest.
        let largest = weights.into_iter().flatten().flatten().fold(0.0, |most: f64, &w| most.max(w));
        let mut net = Vec::with_capacity(count[0] * count[1]);
        for (i, row) in points.iter().enumerate() {
            for (j, point) in row.iter().enumerate() {
                let stated = weights.map_or(1.0, |all| all[i][j]);
                if !point.iter().all(|c| c.abs() <= FARTHEST) {
                    return refused(format!("point {i}, {j} is not within 10 m of the origin"), "check the unit");
                }
                if !(stated > 0.0 && stated.is_finite()) {
                    return refused(format!("weight {i}, {j} is not positive"), "1 is the weight of a plain B-spline");
                }
                if largest > MAX_WEIGHT_RATIO * stated {
                    let text = format!("weight {i}, {j} is {stated}, the largest {largest}");
                    return refused(text, "a factor of 1e6 is the most");
                }
                let w = if weights.is_some() { stated / largest } else { 1.0 };
                let [x, y, z] = point.map(|c| c * w);
                net.push([x, y, z, w]);
            }
        }
        Ok(Self { degree, knots, count, net })
    }

    /// Degrees along u and v.
    pub fn degree(&self) -> [usize; 2] {
        self.degree
    }

    /// Counts of control points along u and v.
    pub fn count(&self) -> [usize; 2] {
        self.count
    }

    /// Whether weights differ.
    pub fn is_rational(&self) -> bool {
        self.net.iter().any(|p| p[3] != self.net[0][3])
    }

    /// The range of u and that of v.
    pub fn range(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|k| [self.knots[k][self.degree[k]], self.knots[k][self.count[k]]])
    }

    /// Control point i along u, j along v.
    pub fn control(&self, [i, j]: [usize; 2]) -> [f64; 3] {
        let [x, y, z, w] = self.net[i * self.count[1] + j];
        [x / w, y / w, z / w]
    }

    /// Box around the control points, in which the surface lies: least and largest x, y, z.
    pub fn hull(&self) -> [[f64; 3]; 2] {
        let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let points = self.net.iter().map(|[x, y, z, w]| [x / w, y / w, z / w]);
        points.fold(none, |[lo, hi], p| {
            [std::array::from_fn(|k| lo[k].min(p[k])), std::array::from_fn(|k| hi[k].max(p[k]))]
        })
    }

    /// Greville abscissa of a control point: the mean of the `degree` knots that follow its first. With control
    /// coordinates linear in them, the coordinate is linear in the parameter.
    pub fn greville(&self, axis: usize, i: usize) -> f64 {
        let p = self.degree[axis];
        self.knots[axis][i + 1..=i + p].iter().sum::<f64>() / p as f64
    }

    /// The point at (u, v). Beyond the range of the parameters the outermost pieces continue.
    pub fn point<T: Scalar>(&self, uv: [T; 2]) -> [T; 3] {
        self.derivatives::<T, 0>(uv)[0]
    }

    /// The point at (u, v) and its partial derivatives up to `ORDER`, at most 2: S, S_u, S_v, S_uu, S_uv, S_vv; those
    /// of higher orders are 0. (The NURBS Book, eq. 4.20.)
    pub fn derivatives<T: Scalar, const ORDER: usize>(&self, uv: [T; 2]) -> [[T; 3]; 6] {
        let [along_u, along_v] = [0, 1].map(|k| Basis::of::<ORDER>(self.degree[k], &self.knots[k], uv[k]));
        let zero = T::of(0.0);
        // Of the homogeneous coordinates first: they are polynomials.
        let mut h = [[zero; 4]; 6];
        for i in 0..=self.degree[0] {
            let line = (along_u.first + i) * self.count[1] + along_v.first;
            let mut across = [[zero; 4]; 3];
            for (j, control) in self.net[line..=line + self.degree[1]].iter().enumerate() {
                let control = control.map(T::of);
                for (sum, values) in across[..=ORDER].iter_mut().zip(&along_v.values) {
                    add(sum, values[j], control);
                }
            }
            for (k, [du, dv]) in PARTIALS[..UP_TO[ORDER]].iter().enumerate() {
                add(&mut h[k], along_u.values[*du][i], across[*dv]);
            }
        }
        let mut out = [[zero; 3]; 6];
        let w = h[0][3];
        let quotient = |k: usize, less: &dyn Fn(usize, T) -> T| std::array::from_fn(|c| less(c, h[k][c]) / w);
        out[0] = quotient(0, &|_, a| a);
        if ORDER >= 1 {
            for k in [1, 2] {
                out[k] = quotient(k, &|c, a| a - h[k][3] * out[0][c]);
            }
        }
        if ORDER >= 2 {
            for (k, first) in [(3, 1), (5, 2)] {
                let twice = T::of(2.0) * h[first][3];
                out[k] = quotient(k, &|c, a| a - twice * out[first][c] - h[k][3] * out[0][c]);
            }
            out[4] = quotient(4, &|c, a| a - h[1][3] * out[2][c] - h[2][3] * out[1][c] - h[4][3] * out[0][c]);
        }
        out
    }
}

/// Adds `by` times a point.
fn add<T: Scalar>(to: &mut [T; 4], by: T, point: [T; 4]) {
    for (sum, c) in to.iter_mut().zip(point) {
        *sum = *sum + by * c;
    }
}

#[cfg(test)]
mod tests;

//! Algorithm III: the parameters at which the surface passes over (x, y), by iteration (Brecher et al., eq. 4 to 7).
//!
//! Minimised is half of |r|², r = S_xy(u, v) - (x, y), all products of x and y alone. Its second derivatives (eq. 6)
//! hold S_u S_u + r S_uu and so on; Newton's method needs second derivatives of the surface, and far from the solution
//! it may go to a saddle. Gauss-Newton leaves out what is multiplied by r. There are as many unknowns as equations, so
//! its step solves S_u du + S_v dv = -r; it converges quadratically too, since r is 0 at the solution.

use super::{Counted, Scalar, Surface, counted};

/// How the step is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// By first derivatives; a step that takes the point no nearer is halved.
    GaussNewton,
    /// By second derivatives, as eq. 4 to 7 have it, for comparison.
    Newton,
}

/// A point of the surface over (x, y), with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvertedPoint<T> {
    /// u and v.
    pub uv: [T; 2],
    /// The point; its z is the height.
    pub at: [T; 3],
    /// Steps that it took.
    pub steps: usize,
}

/// No parameters were found: the surface does not pass there, or the iteration went astray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotConverged {
    /// Steps that were made.
    pub steps: usize,
    /// Distance to (x, y) at the last, mm.
    pub off: f64,
}

/// Distance to (x, y) at which a point counts as found, mm.
const FOUND_MM: f64 = 1e-9;
/// Most steps, halved ones among them.
const MAX_STEPS: usize = 50;

/// Parameters that were tried.
#[derive(Clone, Copy)]
struct Trial<T> {
    uv: [T; 2],
    /// From there to what is tried next.
    step: [T; 2],
    /// Square of the distance to (x, y), mm².
    distance2: T,
}

/// The surface at parameters, against the point that is looked for.
struct Residual<T> {
    /// The point and its derivatives: S, S_u, S_v, S_uu, S_uv, S_vv; the second ones for Newton's method alone.
    s: [[T; 3]; 6],
    /// S_xy - (x, y).
    r: [T; 2],
    /// Square of the distance to (x, y), mm².
    distance2: T,
}

/// The inversion of a surface, with the last point found to start from.
#[derive(Clone, Debug)]
pub struct Inversion<'a> {
    surface: &'a Surface,
    method: Method,
    /// u and v as if they were linear in x and y: at the origin, by x, by y.
    guess: [[f64; 2]; 3],
    last: Option<[f64; 2]>,
}

impl<'a> Inversion<'a> {
    /// The inversion of a surface by a method.
    pub fn new(surface: &'a Surface, method: Method) -> Self {
        let [[u0, u1], [v0, v1]] = surface.range();
        let [a, b, c] = [[u0, v0], [u1, v0], [u0, v1]].map(|uv| surface.point(uv));
        let along_u = [0, 1].map(|k| (b[k] - a[k]) / (u1 - u0));
        let along_v = [0, 1].map(|k| (c[k] - a[k]) / (v1 - v0));
        let det = along_u[0] * along_v[1] - along_u[1] * along_v[0];
        // Of a corner without an angle nothing can be said: from the middle.
        let by_x = [along_v[1] / det, -along_u[1] / det];
        let by_y = [-along_v[0] / det, along_u[0] / det];
        let origin = [0, 1].map(|k| [u0, v0][k] - by_x[k] * a[0] - by_y[k] * a[1]);
        let linear = [origin, by_x, by_y];
        let is_known = linear.iter().flatten().all(|v| v.is_finite());
        let guess = if is_known { linear } else { [[0.5 * (u0 + u1), 0.5 * (v0 + v1)], [0.0; 2], [0.0; 2]] };
        Self { surface, method, guess, last: None }
    }

    /// The point over (x, y) from the linear guess.
    ///
    /// # Errors
    /// That none was found.
    pub fn cold<T: Scalar>(&self, xy: [T; 2]) -> Result<InvertedPoint<T>, NotConverged> {
        let [origin, by_x, by_y] = self.guess.map(|uv| uv.map(T::of));
        self.from(std::array::from_fn(|k| origin[k] + by_x[k] * xy[0] + by_y[k] * xy[1]), xy)
    }

    /// The point over (x, y) from the last one found, or else from the linear guess.
    ///
    /// # Errors
    /// That none was found; the next starts where the last good one was.
    pub fn next(&mut self, xy: [f64; 2]) -> Result<InvertedPoint<f64>, NotConverged> {
        let near = self.last.map(|last| self.from(last, xy));
        let found = near.and_then(Result::ok).map_or_else(|| self.cold(xy), Ok)?;
        self.last = Some(found.uv);
        Ok(found)
    }

    /// The point over (x, y) from parameters near it.
    ///
    /// # Errors
    /// That none was found.
    pub fn from<T: Scalar>(&self, from: [T; 2], xy: [T; 2]) -> Result<InvertedPoint<T>, NotConverged> {
        let range = self.surface.range();
        let inside = |uv: [T; 2]| [0, 1].map(|k| clamped(uv[k], range[k]));
        let mut uv = inside(from);
        let mut best = Trial { uv, step: [T::of(0.0); 2], distance2: T::of(f64::INFINITY) };
        let mut steps = 0;
        loop {
            let residual = self.residual(uv, xy);
            let distance2 = residual.distance2;
            if distance2.value() <= FOUND_MM * FOUND_MM {
                return Ok(InvertedPoint { uv, at: residual.s[0], steps });
            }
            if steps == MAX_STEPS {
                return Err(NotConverged { steps, off: distance2.value().sqrt() });
            }
            steps += 1;
            // Newton is here for comparison, and takes every step.
            let is_worse = self.method == Method::GaussNewton && distance2 >= best.distance2;
            // Invariant: `best` is the nearest point so far, with the step that was last tried from there.
            best = if is_worse {
                Trial { step: best.step.map(|d| T::of(0.5) * d), ..best }
            } else {
                Trial { uv, step: self.step(&residual), distance2 }
            };
            uv = inside([best.uv[0] + best.step[0], best.uv[1] + best.step[1]]);
        }
    }

    /// Operations on numbers that count them, of one whole step.
    pub(super) fn operations_of_a_step(&self) -> u64 {
        let middle = self.surface.range().map(|[lo, hi]| Counted::of(0.5 * (lo + hi)));
        let (_, operations) = counted(|| {
            let step = self.step(&self.residual(middle, [Counted::of(0.0); 2]));
            [middle[0] + step[0], middle[1] + step[1]]
        });
        operations
    }

    /// The surface at parameters, against (x, y).
    fn residual<T: Scalar>(&self, uv: [T; 2], xy: [T; 2]) -> Residual<T> {
        let s = match self.method {
            Method::GaussNewton => self.surface.derivatives::<T, 1>(uv),
            Method::Newton => self.surface.derivatives::<T, 2>(uv),
        };
        let r = [s[0][0] - xy[0], s[0][1] - xy[1]];
        Residual { s, r, distance2: r[0] * r[0] + r[1] * r[1] }
    }

    /// The step that the method makes.
    fn step<T: Scalar>(&self, residual: &Residual<T>) -> [T; 2] {
        let [_, u, v, uu, uv, vv] = &residual.s;
        let r = residual.r;
        let dot = |a: &[T; 3], b: &[T; 3]| a[0] * b[0] + a[1] * b[1];
        let along = |a: &[T; 3]| r[0] * a[0] + r[1] * a[1];
        // Rows of a symmetric matrix (eq. 6) or of the plain derivatives, and what they must come to.
        let ([[a, b], [c, d]], [e, f]) = match self.method {
            Method::GaussNewton => ([[u[0], v[0]], [u[1], v[1]]], r),
            Method::Newton => {
                let mixed = dot(u, v) + along(uv);
                ([[dot(u, u) + along(uu), mixed], [mixed, dot(v, v) + along(vv)]], [along(u), along(v)])
            }
        };
        let det = a * d - b * c;
        [(b * f - d * e) / det, (c * e - a * f) / det]
    }
}

/// A parameter in its range; at the lower end where it is not a number.
fn clamped<T: Scalar>(t: T, [lo, hi]: [f64; 2]) -> T {
    match t.value() {
        v if v >= hi => T::of(hi),
        v if v > lo => t,
        _ => T::of(lo),
    }
}

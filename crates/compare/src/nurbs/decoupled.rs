//! Algorithm II: x and y are linear in the parameters (Brecher et al., eq. 3).
//!
//! x is linear in u exactly where the x of the control points are linear in the Greville abscissae and all weights are
//! equal. Control points at even distances over clamped knots are not: near the ends the surface is then up to some
//! millimetres beside the x that was asked for, so such a net is refused.

use super::{Scalar, Surface};
use terrace_core::diag::{Diag, Error};

/// How far a control point may lie from where linearity puts it, mm: the place of a height is off by no more.
const LINEAR: f64 = 1e-9;

/// A surface whose x depends on u alone and whose y on v alone, linearly.
#[derive(Clone, Debug)]
pub struct Decoupled<'a> {
    surface: &'a Surface,
    /// x at u = 0 and y at v = 0.
    zero: [f64; 2],
    /// x by u and y by v.
    slope: [f64; 2],
    /// Least and largest x and y.
    ends: [[f64; 2]; 2],
}

impl<'a> Decoupled<'a> {
    /// The decoupled form of a surface.
    ///
    /// # Errors
    /// `nurbs-decoupled` where it is not one, with the control point that is farthest off.
    pub fn of(surface: &'a Surface) -> Result<Self, Error> {
        let refused = |text: String, hint: &str| Err(Diag::limit("nurbs-decoupled", text).hint(hint).into());
        const OTHERWISE: &str = "use algorithm III, which inverts any height map";
        if surface.is_rational() {
            return refused("the net is not decoupled: weights differ".into(), OTHERWISE);
        }
        let [nu, nv] = surface.count;
        let (mut zero, mut slope, mut ends) = ([0.0; 2], [0.0; 2], [[0.0; 2]; 2]);
        for (k, names) in [("x", "u"), ("y", "v")].into_iter().enumerate() {
            let (name, parameter) = names;
            let last = surface.count[k] - 1;
            let far = surface.control(if k == 0 { [last, 0] } else { [0, last] })[k];
            let near = surface.control([0, 0])[k];
            let [from, to] = [0, last].map(|i| surface.greville(k, i));
            slope[k] = (far - near) / (to - from);
            if slope[k] == 0.0 || !slope[k].is_finite() {
                let text = format!("the net is not decoupled: {name} does not change with {parameter}");
                return refused(text, OTHERWISE);
            }
            zero[k] = near - slope[k] * from;
            let off = |&[i, j]: &[usize; 2]| {
                let wanted = zero[k] + slope[k] * surface.greville(k, [i, j][k]);
                (surface.control([i, j])[k] - wanted).abs()
            };
            let all = (0..nu).flat_map(|i| (0..nv).map(move |j| [i, j]));
            let worst = all.max_by(|a, b| off(a).total_cmp(&off(b))).expect("a net has points");
            if off(&worst) > LINEAR {
                let text = format!(
                    "the net is not decoupled: {name} of point {}, {} is {:.6} mm from where {name} is linear in \
                     {parameter}",
                    worst[0],
                    worst[1],
                    off(&worst)
                );
                return refused(text, "put control points at the Greville abscissae, or use algorithm III");
            }
            let [a, b] = surface.range()[k].map(|t| zero[k] + slope[k] * t);
            ends[k] = [a.min(b), a.max(b)];
        }
        Ok(Self { surface, zero, slope, ends })
    }

    /// The point over (x, y), whose z is the height.
    pub fn point<T: Scalar>(&self, xy: [T; 2]) -> [T; 3] {
        let uv = std::array::from_fn(|k| (xy[k] - T::of(self.zero[k])) / T::of(self.slope[k]));
        self.surface.point(uv)
    }

    /// The height at (x, y), mm; None beside the surface.
    pub fn height(&self, xy: [f64; 2]) -> Option<f64> {
        let is_on = (0..2).all(|k| (self.ends[k][0]..=self.ends[k][1]).contains(&xy[k]));
        is_on.then(|| self.point(xy)[2])
    }
}

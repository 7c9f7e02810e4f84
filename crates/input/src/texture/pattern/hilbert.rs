//! One Hilbert curve over a rectangle, from its lower left to its lower right corner.
//!
//! 2^n × 2^n points at distance width / (2^n - 1) and height / (2^n - 1): the outer points lie on the
//! area's border. One stroke.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{Fault, Keys};
use crate::texture::Figure;
use crate::texture::kind::Kind;
use crate::texture::place::{LEAST, Turn};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, BoxMm, P2};

/// One Hilbert curve.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct HilbertKeys {
    /// A curve of 4^order points.
    #[schemars(example = 8, extend("x-value" = "1 to 13"))]
    pub order: u32,
}

impl Keys for HilbertKeys {
    fn kind(&self, _: u64) -> Kind {
        Kind::Hilbert { order: self.order }
    }

    fn faults(&self) -> Vec<Fault> {
        if (1..=MAX_ORDER).contains(&self.order) {
            return Vec::new();
        }
        let text = format!("Hilbert order {} is not between 1 and {MAX_ORDER}", self.order);
        vec![("order", Diag::input("texture-order", text))]
    }
}

/// The highest order: 67 million points, which is 1 GB while the stroke is held.
const MAX_ORDER: u32 = 13;

#[derive(Debug)]
pub(in crate::texture) struct Hilbert {
    order: u32,
    area: BoxMm<2>,
    /// Coordinates of the columns and rows, mm.
    xs: Vec<f64>,
    ys: Vec<f64>,
    turn: Turn,
}

impl Figure for Hilbert {
    fn len(&self) -> u64 {
        1
    }

    fn points(&self) -> u64 {
        1 << (2 * self.order)
    }

    fn bounds(&self) -> Box2 {
        let mut bounds = Box2::EMPTY;
        self.area.corners().into_iter().for_each(|c| bounds.add(self.turn.nm(c)));
        bounds
    }

    fn stroke(&self, _: u64, out: &mut Vec<P2>) {
        out.reserve(1 << (2 * self.order));
        self.walk(1 << self.order, [0, 0], [1, 0], [0, 1], out);
    }

    fn element(&self, _: u64) -> String {
        "hilbert curve".into()
    }
}

impl Hilbert {
    pub(in crate::texture) fn new(area: BoxMm<2>, order: u32, turn: Turn) -> Result<Self, Error> {
        if !(1..=MAX_ORDER).contains(&order) {
            let text = format!("Hilbert order {order} is not between 1 and {MAX_ORDER}");
            return Err(Diag::input("texture-order", text).into());
        }
        let last = (1u32 << order) - 1;
        let [width, height] = area.size();
        let spacing = width.min(height) / f64::from(last);
        if spacing < LEAST {
            let text =
                format!("the area is too small for Hilbert order {order}: neighbours would be {spacing} mm apart");
            return Err(Diag::input("texture-area", text).hint("use a lower order or a larger area").into());
        }
        let [xs, ys] = [0, 1].map(|k| divided(area.lo[k], area.hi[k], last));
        Ok(Self { order, area, xs, ys, turn })
    }

    /// Visits the `n` × `n` cells spanned by the unit steps `u` and `v` from cell `p`: starts at `p`,
    /// ends at `p + (n - 1) u`. Recursion is as deep as the order.
    fn walk(&self, n: i32, p: [i32; 2], u: [i32; 2], v: [i32; 2], out: &mut Vec<P2>) {
        if n == 1 {
            // Cells of the walk lie in 0..2^order by construction.
            out.push(self.turn.nm([self.xs[p[0] as usize], self.ys[p[1] as usize]]));
            return;
        }
        let h = n / 2;
        let cell = |a: i32, b: i32| [p[0] + a * u[0] + b * v[0], p[1] + a * u[1] + b * v[1]];
        let minus = |w: [i32; 2]| [-w[0], -w[1]];
        self.walk(h, p, v, u, out);
        self.walk(h, cell(0, h), u, v, out);
        self.walk(h, cell(h, h), u, v, out);
        self.walk(h, cell(n - 1, h - 1), minus(v), minus(u), out);
    }
}

/// A stretch divided into `parts` equal ones: the places between them and its ends, which are exact.
fn divided(lo: f64, hi: f64, parts: u32) -> Vec<f64> {
    let place = |i: u32| if i == parts { hi } else { lo + (hi - lo) * f64::from(i) / f64::from(parts) };
    (0..=parts).map(place).collect()
}

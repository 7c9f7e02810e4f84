//! The stored part of the seven-axis article, for tests: a sum of three hills and a Hilbert curve over it.

use serde_json::Value;
use terrace_core::math;

use crate::on_the_fly::axes::kinematics::{Pivot, Pose};
use crate::on_the_fly::decompose::on_surface;

/// What a file of `fixtures/anchors` holds.
pub(crate) fn stored(name: &str) -> Value {
    let file = format!("{}/../../fixtures/anchors/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{file}: {e}"));
    serde_json::from_str(&text).expect("JSON")
}

/// Surface and figures of the stored part.
pub(crate) struct Part {
    /// The file.
    pub json: Value,
    base: f64,
    /// Height, standard deviation and place of each hill.
    hills: Vec<[f64; 4]>,
}

impl Part {
    /// The stored part, whose pivot is its origin.
    pub fn stored() -> Self {
        let json = stored("seven_axis.json");
        let surface = &json["surface"];
        let number = |v: &Value| v.as_f64().expect("number");
        let hills = (0..3)
            .map(|i| {
                let at = &surface["m"][i];
                [number(&surface["a"][i]), number(&surface["s"][i]), number(&at[0]), number(&at[1])]
            })
            .collect();
        Self { base: number(&surface["c0"]), hills, json }
    }

    fn height(&self, x: f64, y: f64) -> (f64, f64, f64) {
        self.hills.iter().fold((self.base, 0.0, 0.0), |(z, zx, zy), &[a, s, mx, my]| {
            let (dx, dy) = (x - mx, y - my);
            let e = a * math::exp(-(dx * dx + dy * dy) / (2.0 * s * s));
            (z + e, zx - e * dx / (s * s), zy - e * dy / (s * s))
        })
    }

    /// On the surface over a place in plan.
    pub fn pose(&self, at: [f64; 2]) -> Pose<Pivot> {
        Pose::on_surface(at, |x, y| self.height(x, y))
    }

    /// On the surface over a path in plan.
    pub fn poses(&self, plan: &[[f64; 2]]) -> Vec<Pose<Pivot>> {
        on_surface(plan, |x, y| self.height(x, y))
    }

    /// Distance of points of the curve, mm.
    pub fn pitch(&self) -> f64 {
        40.0 / 255.0
    }

    /// The Hilbert curve of order 8 over 40 x 40 mm about 0.
    pub fn hilbert(&self) -> Vec<[f64; 2]> {
        (0..1u32 << 16)
            .map(|d| {
                let (x, y) = place(d);
                [f64::from(x) * self.pitch() - 20.0, f64::from(y) * self.pitch() - 20.0]
            })
            .collect()
    }
}

/// Column and row of the cell at a distance, in cells, along the Hilbert curve of order 8.
fn place(distance: u32) -> (u32, u32) {
    let (mut x, mut y, mut rest) = (0, 0, distance);
    // Invariant: (x, y) is the cell on the curve of order `level`, whose square is `size` cells wide. The next two bits
    // of the distance say which quadrant that square is: lower left, upper left, upper right, lower right.
    for level in 0..8 {
        let size = 1 << level;
        let right = 1 & (rest / 2);
        let up = 1 & (rest ^ right);
        // In the lower quadrants the curve is mirrored on a diagonal, so that its ends lie next to the others.
        if up == 0 {
            if right == 1 {
                (x, y) = (size - 1 - x, size - 1 - y);
            }
            (x, y) = (y, x);
        }
        x += size * right;
        y += size * up;
        rest /= 4;
    }
    (x, y)
}

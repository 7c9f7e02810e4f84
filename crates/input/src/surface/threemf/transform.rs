//! Affine transforms as 3MF writes them: twelve numbers, points are rows.

use super::super::lines::{number, shown};

/// A transform: three rows that the coordinates are multiplied with, and the shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform([[f64; 3]; 4]);

impl Transform {
    pub(super) const IDENTITY: Self = Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]]);

    /// The transform of this text: finite, and not flat.
    pub(super) fn parsed(text: &str) -> Result<Self, String> {
        let mut rows = [[0.0; 3]; 4];
        let mut count = 0;
        for word in text.split_ascii_whitespace() {
            let v = number(word.as_bytes());
            let v = v.map_err(|_| format!("\"{}\" in a transform is not a finite number", shown(word.as_bytes())))?;
            if count < 12 {
                rows[count / 3][count % 3] = v;
            }
            count += 1;
        }
        if count != 12 {
            return Err(format!("a transform has 12 numbers, this one has {count}"));
        }
        let transform = Self(rows);
        if transform.is_flat() { Err(format!("the transform \"{text}\" makes everything flat")) } else { Ok(transform) }
    }

    /// This transform, then `outer`.
    pub(super) fn then(&self, outer: &Self) -> Self {
        let [x, y, z, shift] = self.0;
        Self([outer.turned(x), outer.turned(y), outer.turned(z), outer.apply(shift)])
    }

    pub(super) fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        let turned = self.turned(p);
        [0, 1, 2].map(|k| turned[k] + self.0[3][k])
    }

    /// Without the shift.
    fn turned(&self, p: [f64; 3]) -> [f64; 3] {
        let [x, y, z, _] = self.0;
        [0, 1, 2].map(|k| p[0] * x[k] + p[1] * y[k] + p[2] * z[k])
    }

    fn determinant(&self) -> f64 {
        let [x, y, z, _] = self.0;
        x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0]) + x[2] * (y[0] * z[1] - y[1] * z[0])
    }

    /// Whether it mirrors, so that facets turn inside out.
    pub(super) fn mirrors(&self) -> bool {
        self.determinant() < 0.0
    }

    /// Whether it takes space to a plane, up to the rounding of twelve digits.
    fn is_flat(&self) -> bool {
        let length = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let [x, y, z, _] = self.0;
        let full = length(x) * length(y) * length(z);
        let volume = self.determinant().abs();
        volume <= 1e-12 * full || !volume.is_finite() || !full.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_are_rows_applied_from_the_inside_out() {
        // x to y, y to -x, doubled; then a shift.
        let turn = Transform::parsed(" 0 2 0  -2 0 0  0 0 2  10 20 30\n").expect("a transform");
        assert_eq!(turn.apply([1.0, 3.0, 5.0]), [10.0 - 6.0, 20.0 + 2.0, 40.0]);
        let mirror = Transform::parsed("-1 0 0 0 1 0 0 0 1 0 0 7").expect("a transform");
        assert!(mirror.mirrors() && !turn.mirrors() && turn.then(&mirror).mirrors());
        for p in [[0.0; 3], [1.0, -2.0, 0.5]] {
            assert_eq!(turn.then(&mirror).apply(p), mirror.apply(turn.apply(p)));
        }
        assert_eq!(turn.then(&Transform::IDENTITY), turn);
    }

    #[test]
    fn faults_of_transforms_are_named() {
        for (text, say) in [
            ("1 0 0 0 1 0 0 0 1 0 0", "this one has 11"),
            ("1 0 0 0 1 0 0 0 1 0 0 0 0", "this one has 13"),
            ("nan 0 0 0 1 0 0 0 1 0 0 0", "\"nan\" in a transform"),
            ("1e999 0 0 0 1 0 0 0 1 0 0 0", "not a finite number"),
            ("1 0 0 0 1 0 0 0 0 0 0 0", "flat"),
            ("1 2 3 2 4 6 0 0 1 0 0 0", "flat"),
            ("1e300 0 0 0 1e300 0 0 0 1e300 0 0 0", "flat"),
        ] {
            assert!(Transform::parsed(text).expect_err(text).contains(say), "{text}");
        }
    }
}

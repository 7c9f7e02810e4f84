//! From mm in the part frame to nanometres in the turned part frame, rounding once.

use super::{Area, Kind, Request};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{BoxMm, MAX_NM, NM_PER_MM, P2, cos_sin};

/// One nanometre in mm.
pub(super) const NM: f64 = 1e-6;

/// The least extent of a stroke, mm: points further apart than sqrt(2) nm stay apart when rounded.
pub(super) const LEAST: f64 = 2.0 * NM;

/// Counts that come out of a division are held to be exact when they miss an integer by this much.
pub(super) const SLACK: f64 = 1e-9;

/// The turn of the part about the origin of its frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    cos: f64,
    sin: f64,
}

impl Turn {
    pub(super) fn new(rad: f64) -> Self {
        let [cos, sin] = cos_sin(rad);
        Self { cos, sin }
    }

    /// The point in the turned frame, mm.
    #[inline]
    pub(super) fn turned(self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.cos * x - self.sin * y, self.sin * x + self.cos * y]
    }

    /// The axes of the turned frame, in the part frame.
    pub(super) fn axes(self) -> [[f64; 2]; 2] {
        [[self.cos, -self.sin], [self.sin, self.cos]]
    }

    /// The point in the turned frame on the nanometre grid. Callers hold it within 4 m.
    #[inline]
    pub(super) fn nm(self, p: [f64; 2]) -> P2 {
        let [x, y] = self.turned(p);
        P2::new((x * NM_PER_MM).round() as i64, (y * NM_PER_MM).round() as i64)
    }
}

/// Where a request is placed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    /// What patterns fill, part frame, mm.
    pub(super) area: BoxMm<2>,
    /// The part's box, part frame, mm.
    pub(super) part_box: BoxMm<2>,
    /// Largest distance between a curve and its polyline, mm.
    pub(super) tolerance: f64,
    /// The part's turn.
    pub(super) turn: Turn,
    /// Diameter of the spot.
    pub(super) spot_mm: f64,
}

impl Site {
    /// # Errors
    /// `texture-area` where the area is empty or not finite, `texture-far` where it is beyond 4 m.
    pub(super) fn new(request: &Request, part_box: BoxMm<2>, turn: Turn, spot_mm: f64) -> Result<Self, Error> {
        let area = match request.area {
            Area::Part | Area::Unlimited => part_box,
            Area::Rectangle(r) => r,
        };
        let is_file = matches!(request.kind, Kind::Drawing { .. } | Kind::Curves { .. });
        if request.area != Area::Unlimited || !is_file {
            check_area(area, turn)?;
        }
        Ok(Self { area, part_box, tolerance: request.tolerance_mm.max(NM), turn, spot_mm })
    }
}

/// Whether the point is finite and within 4 m.
pub(super) fn is_near([x, y]: [f64; 2]) -> bool {
    let far = MAX_NM.f64() * NM;
    x.abs() <= far && y.abs() <= far
}

/// Refuses areas that are empty, not finite or beyond 4 m.
pub(super) fn check_area(area: BoxMm<2>, turn: Turn) -> Result<(), Error> {
    if area.corners().into_iter().any(|c| !is_near(turn.turned(c))) {
        return Err(far().into());
    }
    let [w, h] = area.size();
    if w < LEAST || h < LEAST {
        let text = format!("the texture's area measures {w} mm x {h} mm, which holds nothing");
        return Err(Diag::input("texture-area", text)
            .hint("write [x0, y0, x1, y1] with the lower left corner first")
            .into());
    }
    Ok(())
}

pub(super) fn far() -> Diag {
    Diag::input("texture-far", "the texture reaches beyond 4 m from the part's origin")
        .hint("check units, size and origin of the texture")
}

/// The fault of [`far`], for a drawing.
pub(super) fn far_in(path: &str) -> Diag {
    far().at(Place::file(path))
}

/// How many whole steps fit into a length.
pub(super) fn steps(length: f64, step: f64) -> f64 {
    (length / step * (1.0 + SLACK)).floor()
}

/// Appends a point unless it equals the last one.
#[inline]
pub(super) fn push(out: &mut Vec<P2>, p: P2) {
    if out.last() != Some(&p) {
        out.push(p);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_quarter_turns_are_the_identity() {
        let quarter = Turn::new(90f64.to_radians());
        for p in [[12.3456789, -0.0000004], [-399.9999995, 0.1], [0.0, 3999.999]] {
            let mut q = p;
            for _ in 0..4 {
                q = quarter.turned(q);
            }
            assert_eq!(q, p);
        }
        for k in -9..9 {
            let [c, s] = cos_sin((90.0 * f64::from(k)).to_radians());
            assert_eq!(c.abs() + s.abs(), 1.0, "{k} quarter turns");
        }
        let [c, s] = cos_sin(1e-6);
        assert!(c < 1.0 && s > 0.0, "a small turn stays one");
    }
}

//! How large the page of a drawing becomes, and where it lies on the part.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Request, place::Site};
use terrace_core::diag::Diag;
use terrace_core::geom::{BoxMm, cos_sin};

/// What the size of a page follows from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Size {
    /// From the file.
    #[default]
    File,
    /// Width and height, mm.
    Mm([f64; 2]),
    /// So many times that of the file.
    Scaled(f64),
    /// From the area, or the part's box, with the proportions of the file.
    Fit(Fit),
}

/// How the page of a drawing fills its area, its proportions kept; a page that is turned with the box around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Fit {
    /// The largest page inside the area.
    Contain,
    /// The smallest page that leaves nothing of the area free.
    Cover,
    /// As wide as the area.
    Width,
    /// As high as the area.
    Height,
}

/// Which side or corner of the area the page touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
pub enum Align {
    /// Middle on middle.
    #[serde(rename = "centre")]
    Centre,
    /// In the middle of the left side.
    #[serde(rename = "left")]
    Left,
    /// In the middle of the right side.
    #[serde(rename = "right")]
    Right,
    /// In the middle of the upper side.
    #[serde(rename = "top")]
    Top,
    /// In the middle of the lower side.
    #[serde(rename = "bottom")]
    Bottom,
    /// In the upper left corner.
    #[serde(rename = "left top")]
    LeftTop,
    /// In the lower left corner.
    #[serde(rename = "left bottom")]
    LeftBottom,
    /// In the upper right corner.
    #[serde(rename = "right top")]
    RightTop,
    /// In the lower right corner.
    #[serde(rename = "right bottom")]
    RightBottom,
}

impl Align {
    /// Which share of the space beside the page lies left of it and below it.
    pub(super) fn shares(self) -> [f64; 2] {
        match self {
            Self::Centre => [0.5, 0.5],
            Self::Left => [0.0, 0.5],
            Self::Right => [1.0, 0.5],
            Self::Top => [0.5, 1.0],
            Self::Bottom => [0.5, 0.0],
            Self::LeftTop => [0.0, 1.0],
            Self::LeftBottom => [0.0, 0.0],
            Self::RightTop => [1.0, 1.0],
            Self::RightBottom => [1.0, 0.0],
        }
    }
}

/// Where a page lies, part frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Position {
    /// With its lower left corner in that of the area; without an area where the coordinates of the drawing say, or
    /// with its middle in that of the part's box where it has none.
    #[default]
    Usual,
    /// With its lower left corner here, mm.
    Origin([f64; 2]),
    /// In the area, or in the part's box, the box around a turned page like a page.
    Aligned(Align),
}

impl Position {
    /// The position of a page with coordinates of its own, which count where nothing is said and no area is given.
    pub(super) fn of_page(self, corner: Option<[f64; 2]>, has_area: bool) -> Self {
        match (self, corner) {
            (Self::Usual, Some(corner)) if !has_area => Self::Origin(corner),
            (position, _) => position,
        }
    }
}

/// The size that a request wants for a page.
#[derive(Clone, Copy, Debug)]
pub(super) struct WantedSize {
    size: Size,
    /// Of the area or of the part's box.
    area: [f64; 2],
    /// Cosine and sine of the page's turn.
    turn: [f64; 2],
}

impl WantedSize {
    pub(super) fn of(size: Size, turn_rad: f64, site: &Site) -> Self {
        Self { size, area: site.area.size(), turn: cos_sin(turn_rad) }
    }

    /// The size of a page with these sides, which are mm or, where the file does not say how large it is, proportions;
    /// None where nobody says how large it is.
    pub(super) fn size(&self, sides: [f64; 2], is_physical: bool) -> Result<Option<[f64; 2]>, Box<Diag>> {
        let scaled = |factor: f64| Some(sides.map(|s| s * factor));
        Ok(match self.size {
            Size::Mm(size) => Some(size),
            Size::Fit(fit) => scaled(self.factor(fit, sides)?),
            Size::Scaled(factor) if is_physical => scaled(factor),
            Size::File if is_physical => Some(sides),
            Size::Scaled(_) | Size::File => None,
        })
    }

    /// By what a page with these sides is multiplied.
    fn factor(&self, fit: Fit, sides: [f64; 2]) -> Result<f64, Box<Diag>> {
        // The box around a turned rectangle.
        let [c, s] = self.turn.map(f64::abs);
        let around = |[w, h]: [f64; 2]| [c * w + s * h, s * w + c * h];
        let ratios = |to: [f64; 2], from: [f64; 2]| [0, 1].map(|k| to[k] / from[k]);
        let [x, y] = ratios(self.area, around(sides));
        let factor = match fit {
            Fit::Contain => x.min(y),
            Fit::Width => x,
            Fit::Height => y,
            // Seen from the page it is the area that is turned.
            Fit::Cover => {
                let [x, y] = ratios(around(self.area), sides);
                x.max(y)
            }
        };
        if factor > 0.0 && factor.is_finite() {
            return Ok(factor);
        }
        let text = format!("a drawing of {} mm x {} mm cannot be fitted to its area", sides[0], sides[1]);
        Err(Diag::input("texture-fit", text).hint("give the texture a size or a scale").into())
    }
}

impl Request {
    /// The size that is wanted for the page of a drawing.
    pub(super) fn wanted(&self, site: &Site) -> WantedSize {
        match self.kind {
            super::Kind::Drawing { size, turn_rad, .. } => WantedSize::of(size, turn_rad, site),
            _ => WantedSize { size: Size::File, area: [0.0; 2], turn: [1.0, 0.0] },
        }
    }
}

/// Where the lower left corner of a turned page lies, if its box lies in a corner or the middle of an area; `part` maps
/// the page to the part but for that corner.
pub(super) fn aligned(align: Align, size: [f64; 2], area: BoxMm<2>, part: impl Fn([f64; 2]) -> [f64; 2]) -> [f64; 2] {
    let page = BoxMm { lo: [0.0; 2], hi: size };
    let around = BoxMm::of(page.corners().map(part));
    let shares = align.shares();
    let free = |k: usize| (area.hi[k] - area.lo[k]) - (around.hi[k] - around.lo[k]);
    [0, 1].map(|k| area.lo[k] + shares[k] * free(k) - around.lo[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_fitted_with_their_proportions() {
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        let upright = [1.0, 0.0];
        for (fit, turn, want) in [
            (Fit::Contain, upright, [40.0, 20.0]),
            (Fit::Cover, upright, [60.0, 30.0]),
            (Fit::Width, upright, [40.0, 20.0]),
            (Fit::Height, upright, [60.0, 30.0]),
            (Fit::Contain, [0.0, 1.0], [30.0, 15.0]),
            (Fit::Width, [0.0, 1.0], [80.0, 40.0]),
            // The box of the page is (w + h)/√2 wide and high; the area seen from the page measures (40 + 30)/√2.
            (Fit::Contain, [diagonal; 2], [2.0, 1.0].map(|v| 30.0 / (3.0 * diagonal) * v)),
            (Fit::Cover, [diagonal; 2], [2.0, 1.0].map(|v| 70.0 * diagonal * v)),
        ] {
            let wanted = WantedSize { size: Size::Fit(fit), area: [40.0, 30.0], turn };
            let size = wanted.size([2.0, 1.0], false).expect("fits").expect("a size");
            assert!((0..2).all(|k| (size[k] - want[k]).abs() < 1e-12), "{fit:?} {turn:?}: {size:?}");
        }
        let wanted = WantedSize { size: Size::Fit(Fit::Width), area: [40.0, 30.0], turn: upright };
        assert_eq!(wanted.size([0.0, 5.0], true).expect_err("no width").code, "texture-fit");
        let twice = WantedSize { size: Size::Scaled(2.0), ..wanted };
        assert_eq!(twice.size([3.0, 4.0], true).expect("ok"), Some([6.0, 8.0]));
        assert_eq!(twice.size([3.0, 4.0], false).expect("ok"), None);
    }

    #[test]
    fn pages_are_aligned_by_the_box_around_them() {
        let area = BoxMm::rectangle(10.0, 20.0, 50.0, 50.0);
        let upright = |p: [f64; 2]| p;
        // A quarter turn: the page lies left of its lower left corner.
        let turned = |[x, y]: [f64; 2]| [-y, x];
        assert_eq!(aligned(Align::Centre, [8.0, 4.0], area, upright), [26.0, 33.0]);
        assert_eq!(aligned(Align::RightTop, [8.0, 4.0], area, upright), [42.0, 46.0]);
        assert_eq!(aligned(Align::LeftBottom, [8.0, 4.0], area, turned), [14.0, 20.0]);
        assert_eq!(aligned(Align::Right, [8.0, 4.0], area, turned), [50.0, 31.0]);
    }
}

//! Generated patterns: every stroke is computed from its index in constant time, none is stored.
//!
//! A pattern is a file here, with its keys and its figure, and a variant of `PatternKeys` and of [`Kind`]; `place`
//! builds the figure. Keys forbid no others: what stands beside them in the table is sorted out before
//! they are read, and belongs to every texture. Areas are boxes in the part frame, mm, borders included.

mod cell;
mod cell_keys;
mod contour_hatch;
mod dots;
mod hatch;
mod hilbert;
mod honeycomb;
mod loops;
mod radial;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use cell_keys::{CirclesKeys, CrossesKeys, HexagonsKeys, JerusalemKeys, RingsKeys, SquaresKeys};
pub(super) use contour_hatch::ContourCell;
pub use contour_hatch::{Contour, Directions};
use dots::{Dots, DotsKeys, PoissonKeys, Scattered};
use hatch::{Hatch, HatchKeys, RibletsKeys};
use hilbert::{Hilbert, HilbertKeys};
use honeycomb::{Honeycomb, HoneycombKeys};
use loops::Loops;
use radial::{ConcentricKeys, Curve, Radial, SpiralKeys};

use super::artwork::{FillMode, Screen, StrokeMode};
use super::kind::{Kind, Lattice};
use super::{Figure, PlacedStrokes, place, place::Site};
use terrace_core::diag::{Diag, Error};
use terrace_core::units::Length;

/// Most points of one stroke, which is held while it is followed: 1 GB.
const MAX_STROKE_POINTS: u64 = 1 << 26;

/// A generated pattern, see below.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(tag = "pattern", extend("x-default" = "this, `file` or `curves`"))]
pub(crate) enum PatternKeys {
    /// Parallel lines.
    Hatch(HatchKeys),
    /// One Hilbert curve.
    Hilbert(HilbertKeys),
    /// Square loops on a lattice (FSS cells).
    Squares(SquaresKeys),
    /// Circles on a lattice (FSS cells).
    Circles(CirclesKeys),
    /// Hexagonal loops on a lattice (FSS cells).
    Hexagons(HexagonsKeys),
    /// Outlines of crosses on a lattice (FSS cells).
    Crosses(CrossesKeys),
    /// Outlines of Jerusalem crosses on a lattice (FSS cells).
    Jerusalem(JerusalemKeys),
    /// Pairs of circles about one centre on a lattice (FSS cells).
    Rings(RingsKeys),
    /// Dots on a lattice.
    Dots(DotsKeys),
    /// Dots at random that keep a distance.
    Poisson(PoissonKeys),
    /// The walls of a hexagonal tiling.
    Honeycomb(HoneycombKeys),
    /// Parallel grooves of several lines each.
    Riblets(RibletsKeys),
    /// Circles about one centre.
    Concentric(ConcentricKeys),
    /// An Archimedean spiral.
    Spiral(SpiralKeys),
}

impl PatternKeys {
    fn keys(&self) -> &dyn Keys {
        match self {
            Self::Hatch(keys) => keys,
            Self::Hilbert(keys) => keys,
            Self::Squares(keys) => keys,
            Self::Circles(keys) => keys,
            Self::Hexagons(keys) => keys,
            Self::Crosses(keys) => keys,
            Self::Jerusalem(keys) => keys,
            Self::Rings(keys) => keys,
            Self::Dots(keys) => keys,
            Self::Poisson(keys) => keys,
            Self::Honeycomb(keys) => keys,
            Self::Riblets(keys) => keys,
            Self::Concentric(keys) => keys,
            Self::Spiral(keys) => keys,
        }
    }

    /// What is drawn; random places follow from the seed.
    pub fn kind(&self, seed: u64) -> Kind {
        self.keys().kind(seed)
    }

    /// Values that the pattern cannot have, each with its key.
    pub fn faults(&self) -> Vec<Fault> {
        self.keys().faults()
    }
}

/// A key, and what is wrong with its value.
pub type Fault = (&'static str, Diag);

/// The keys of one pattern.
pub(super) trait Keys {
    /// What is drawn; random places follow from the seed.
    fn kind(&self, seed: u64) -> Kind;

    /// Values that the pattern cannot have.
    fn faults(&self) -> Vec<Fault> {
        Vec::new()
    }
}

/// The fault of figures that are wider than they are apart.
pub(super) fn needs_room(cell: Length, pitch: Length) -> Vec<Fault> {
    if cell <= pitch {
        return Vec::new();
    }
    let text = format!("cell {cell} is larger than pitch {pitch}, so figures would overlap");
    vec![("cell", Diag::input("texture-cell", text))]
}

impl Lattice {
    /// How far a point lies from the centre of a tile along the normals of its sides, at most.
    fn reach(self, [x, y]: [f64; 2]) -> f64 {
        let x = x.abs();
        let y = y.abs();
        match self {
            Self::Square => x.max(y),
            Self::Hex => x.max((x + 3f64.sqrt() * y) / 2.0),
        }
    }
}

impl Kind {
    /// Distance of the figures of patterns that repeat closed ones in columns and rows, mm.
    ///
    /// None on a hexagonal lattice: its rows are another distance apart than its cells, and a line along y that passes
    /// between the tiles of one row halves those of the next, so that no pitch of sections keeps cells wider than half
    /// a pitch off their borders. Windows that reach over the border of their section keep such cells whole.
    pub(crate) fn figure_pitch_mm(&self) -> Option<f64> {
        match self {
            Self::Cells { pitch_mm, lattice: Lattice::Square, .. } => Some(*pitch_mm),
            _ => None,
        }
    }

    /// Distance of neighbouring lines of patterns of lines, mm, with the key that states it.
    pub(crate) fn line_pitch_mm(&self) -> Option<(f64, &'static str)> {
        match self {
            Self::Hatch { pitch_mm, .. }
            | Self::Contour { pitch_mm, .. }
            | Self::Concentric { pitch_mm, .. }
            | Self::Spiral { pitch_mm, .. } => Some((*pitch_mm, "pitch")),
            Self::Riblets { line_mm, .. } => Some((*line_mm, "line")),
            _ => None,
        }
    }

    /// Distance of the lines of patterns of lines, of riblets that of the grooves, mm.
    pub(crate) fn texture_pitch_mm(&self) -> Option<f64> {
        match self {
            Self::Riblets { pitch_mm, .. } => Some(*pitch_mm),
            _ => self.line_pitch_mm().map(|(pitch, _)| pitch),
        }
    }

    /// Distance of neighbours in the texture, mm: of lines, cells, dots, tiles or grooves. None of Hilbert curves, of
    /// drawings whose filled areas state none, and of space curves.
    pub fn spacing_mm(&self) -> Option<f64> {
        match self {
            Self::Cells { pitch_mm, .. }
            | Self::Dots { pitch_mm, .. }
            | Self::Poisson { pitch_mm, .. }
            | Self::Honeycomb { pitch_mm } => Some(*pitch_mm),
            _ => self.texture_pitch_mm().or(self.fill_pitch_mm()),
        }
    }

    /// Distance of the lines that fill areas of a drawing or a bitmap, mm, where the job states it.
    pub(crate) fn fill_pitch_mm(&self) -> Option<f64> {
        let Self::Drawing { marking, .. } = self else { return None };
        let is_area = marking.tone.is_none_or(|tone| tone.screen == Screen::Threshold);
        let is_filled =
            matches!(marking.fill, FillMode::Hatch | FillMode::Rings) || marking.stroke == StrokeMode::Hatch;
        marking.pitch_mm.filter(|_| is_area && is_filled)
    }

    /// Whether it is of dots, whatever a file holds. A drawing may have points besides, which are dots too.
    pub fn is_of_dots(&self) -> bool {
        match self {
            Self::Dots { .. } | Self::Poisson { .. } => true,
            Self::Drawing { marking, .. } => marking.tone.is_some_and(|tone| tone.screen.is_of_dots()),
            _ => false,
        }
    }

    /// Whether it is a pattern: made from its keys alone, and marked with the pen of its texture alone.
    pub fn is_pattern(&self) -> bool {
        !matches!(self, Self::Drawing { .. } | Self::Curves { .. })
    }

    /// The pattern in a later pass: straight hatches turn by `turned_rad`, lines along contours move by a `share` of
    /// their pitch, all else stays.
    #[must_use]
    pub fn of_pass(mut self, turned_rad: f64, share: f64) -> Self {
        match &mut self {
            Self::Hatch { direction_rad, .. } => *direction_rad += turned_rad,
            Self::Contour { phase, .. } => *phase = share,
            Self::Drawing { marking, .. } => match &mut marking.along_contours {
                Some(phase) => *phase = share,
                None => marking.direction_rad += turned_rad,
            },
            _ => {}
        }
        self
    }
}

/// The error for a pitch that lines cannot have.
fn bad_pitch(what: &str, pitch: f64, least: f64) -> Error {
    let nm = (least / place::NM).round();
    Diag::input("texture-pitch", format!("a {what} pitch of {pitch} mm is not possible"))
        .hint(format!("use a pitch of at least {nm} nm"))
        .into()
}

/// The error for a stroke of more points than can be held.
fn long_stroke(what: &str) -> Error {
    let text = format!("{what} would be one stroke of more than {MAX_STROKE_POINTS} points");
    Diag::limit("texture-large", text).hint("use a larger pitch, a larger tolerance or a smaller area").into()
}

/// Places a pattern.
///
/// # Errors
/// `texture-pitch`, `texture-cell`, `texture-order`, `texture-far`, `texture-large`.
pub(super) fn place(kind: &Kind, site: &Site) -> Result<PlacedStrokes, Error> {
    let Site { area, tolerance, turn, .. } = *site;
    let figure: Arc<dyn Figure> = match kind {
        Kind::Hatch { pitch_mm, direction_rad } => Arc::new(Hatch::new(area, *pitch_mm, *direction_rad, turn)?),
        Kind::Contour { pitch_mm, phase } => {
            return Ok(PlacedStrokes::Contour(Contour::new(area, *pitch_mm, *phase, turn)?));
        }
        Kind::Hilbert { order } => Arc::new(Hilbert::new(area, *order, turn)?),
        Kind::Cells { shape, cell_mm, pitch_mm, lattice } => {
            Arc::new(Loops::new(*shape, *cell_mm, *pitch_mm, *lattice, area, tolerance, turn)?)
        }
        Kind::Dots { pitch_mm, lattice, jitter, seed } => {
            Arc::new(Dots::new(area, *pitch_mm, *lattice, *jitter, *seed, turn)?)
        }
        Kind::Poisson { pitch_mm, seed } => Arc::new(Scattered::new(area, *pitch_mm, *seed, turn)?),
        Kind::Honeycomb { pitch_mm } => Arc::new(Honeycomb::new(area, *pitch_mm, turn)?),
        Kind::Riblets { pitch_mm, cell_mm, line_mm, direction_rad } => {
            Arc::new(Hatch::riblets(area, [*pitch_mm, *cell_mm, *line_mm], *direction_rad, turn)?)
        }
        Kind::Concentric { pitch_mm, centre_mm } | Kind::Spiral { pitch_mm, centre_mm } => {
            let curve = if matches!(kind, Kind::Spiral { .. }) { Curve::Spiral } else { Curve::Concentric };
            let middle = [0, 1].map(|a| (area.lo[a] + area.hi[a]) / 2.0);
            Arc::new(Radial::new(curve, area, centre_mm.unwrap_or(middle), *pitch_mm, tolerance, turn)?)
        }
        Kind::Drawing { .. } | Kind::Curves { .. } => unreachable!("files are placed by their reader"),
    };
    Ok(PlacedStrokes::Figure(figure))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_keep_step_with_cells_on_a_square_lattice_only() {
        for (keys, pitch) in [
            ("rings = { pitch = \"2 mm\", cell = \"1 mm\", inner = \"0.5 mm\" }", Some(2.0)),
            ("rings = { pitch = \"2 mm\", cell = \"1 mm\", inner = \"0.5 mm\", lattice = \"hex\" }", None),
            ("hexagons = { pitch = \"2 mm\", cell = \"1 mm\" }", None),
            ("hexagons = { pitch = \"2 mm\", cell = \"1 mm\", lattice = \"square\" }", Some(2.0)),
            ("honeycomb = { pitch = \"2 mm\" }", None),
        ] {
            let keys: PatternKeys = toml::from_str(keys).unwrap_or_else(|e| panic!("{keys}: {e}"));
            assert_eq!(keys.kind(0).figure_pitch_mm(), pitch, "{keys:?}");
        }
    }
}

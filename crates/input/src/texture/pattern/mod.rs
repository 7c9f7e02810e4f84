//! Generated patterns: every stroke is computed from its index in constant time, none is stored.
//!
//! A pattern is a file here, a variant of [`Pattern`] and of [`Kind`], and a row of the table below; `place`
//! builds it. Areas are boxes in the part frame, mm, borders included.

mod cell;
mod contour_hatch;
mod dots;
mod hatch;
mod hilbert;
mod honeycomb;
mod loops;
mod radial;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use contour_hatch::{Contour, Directions};
use dots::{Dots, Scattered};
use hatch::Hatch;
use hilbert::Hilbert;
use honeycomb::Honeycomb;
use loops::Loops;
use radial::{Curve, Radial};

use super::artwork::{FillMode, Screen, StrokeMode};
use super::kind::{Kind, Lattice, Shape};
use super::{Figure, Placed, place, place::Site};
use terrace_core::diag::{Diag, Error};

/// Most points of one stroke, which is held while it is followed: 1 GB.
const MAX_STROKE_POINTS: u64 = 1 << 26;

/// Made patterns, by the name that the job file gives them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pattern {
    /// Parallel lines.
    Hatch,
    /// One Hilbert curve.
    Hilbert,
    /// Square loops on a lattice (FSS cells).
    Squares,
    /// Circles on a lattice (FSS cells).
    Circles,
    /// Hexagonal loops on a lattice (FSS cells).
    Hexagons,
    /// Outlines of crosses on a lattice (FSS cells).
    Crosses,
    /// Outlines of Jerusalem crosses on a lattice (FSS cells).
    Jerusalem,
    /// Pairs of circles about one centre on a lattice (FSS cells).
    Rings,
    /// Dots on a lattice.
    Dots,
    /// Dots at random that keep a distance.
    Poisson,
    /// The walls of a hexagonal tiling.
    Honeycomb,
    /// Parallel grooves of several lines each.
    Riblets,
    /// Circles about one centre.
    Concentric,
    /// An Archimedean spiral.
    Spiral,
}

impl Lattice {
    /// How far a point lies from the centre of a tile along the normals of its sides, at most.
    fn reach(self, [x, y]: [f64; 2]) -> f64 {
        let (x, y) = (x.abs(), y.abs());
        match self {
            Self::Square => x.max(y),
            Self::Hex => x.max((x + 3f64.sqrt() * y) / 2.0),
        }
    }
}

/// The values of a `[[texture]]` that patterns are made from.
#[derive(Clone, Copy, Debug, Default)]
pub struct Values {
    /// `pitch`, mm.
    pub pitch_mm: Option<f64>,
    /// `cell`, mm.
    pub cell_mm: Option<f64>,
    /// `order`.
    pub order: Option<u32>,
    /// `direction`, rad; None along contours.
    pub direction_rad: Option<f64>,
    /// `lattice`.
    pub lattice: Option<Lattice>,
    /// `width`, mm.
    pub width_mm: Option<f64>,
    /// `bar`, mm.
    pub bar_mm: Option<f64>,
    /// `inner`, mm.
    pub inner_mm: Option<f64>,
    /// `line`, mm.
    pub line_mm: Option<f64>,
    /// `centre`, mm.
    pub centre_mm: Option<[f64; 2]>,
    /// `jitter`, 0 to 1.
    pub jitter: Option<f64>,
    /// `seed`.
    pub seed: Option<u64>,
}

impl Values {
    /// Cells of a shape.
    fn cells(&self, shape: Shape) -> Option<Kind> {
        let usual = if shape == Shape::Hexagon { Lattice::Hex } else { Lattice::Square };
        let lattice = self.lattice.unwrap_or(usual);
        Some(Kind::Cells { shape, cell_mm: self.cell_mm?, pitch_mm: self.pitch_mm?, lattice })
    }
}

/// What a job file says of a pattern.
pub struct Row {
    /// Which.
    pub pattern: Pattern,
    /// Its name in messages.
    pub name: &'static str,
    /// Keys that it needs.
    pub needs: &'static [&'static str],
    /// Further keys that it takes.
    pub takes: &'static [&'static str],
    /// The request for it; None where a value that it needs is missing.
    pub kind: fn(&Values) -> Option<Kind>,
}

/// All patterns.
const PATTERNS: [Row; 14] = [
    Row {
        pattern: Pattern::Hatch,
        name: "hatch",
        needs: &["pitch"],
        takes: &["direction"],
        kind: |v| {
            let pitch_mm = v.pitch_mm?;
            Some(match v.direction_rad {
                Some(direction_rad) => Kind::Hatch { pitch_mm, direction_rad },
                None => Kind::Contour { pitch_mm, phase: 0.0 },
            })
        },
    },
    Row {
        pattern: Pattern::Hilbert,
        name: "hilbert",
        needs: &["order"],
        takes: &[],
        kind: |v| Some(Kind::Hilbert { order: v.order? }),
    },
    Row {
        pattern: Pattern::Squares,
        name: "squares",
        needs: &["pitch", "cell"],
        takes: &["lattice"],
        kind: |v| v.cells(Shape::Square),
    },
    Row {
        pattern: Pattern::Circles,
        name: "circles",
        needs: &["pitch", "cell"],
        takes: &["lattice"],
        kind: |v| v.cells(Shape::Circle),
    },
    Row {
        pattern: Pattern::Hexagons,
        name: "hexagons",
        needs: &["pitch", "cell"],
        takes: &["lattice"],
        kind: |v| v.cells(Shape::Hexagon),
    },
    Row {
        pattern: Pattern::Crosses,
        name: "crosses",
        needs: &["pitch", "cell", "width"],
        takes: &["lattice"],
        kind: |v| v.cells(Shape::Cross { width_mm: v.width_mm? }),
    },
    Row {
        pattern: Pattern::Jerusalem,
        name: "jerusalem",
        needs: &["pitch", "cell", "width", "bar"],
        takes: &["lattice"],
        kind: |v| v.cells(Shape::Jerusalem { width_mm: v.width_mm?, bar_mm: v.bar_mm? }),
    },
    Row {
        pattern: Pattern::Rings,
        name: "rings",
        needs: &["pitch", "cell", "inner"],
        takes: &["lattice"],
        kind: |v| v.cells(Shape::Ring { inner_mm: v.inner_mm? }),
    },
    Row {
        pattern: Pattern::Dots,
        name: "dots",
        needs: &["pitch"],
        takes: &["lattice", "jitter", "seed"],
        kind: |v| {
            let (lattice, jitter) = (v.lattice.unwrap_or_default(), v.jitter.unwrap_or(0.0));
            Some(Kind::Dots { pitch_mm: v.pitch_mm?, lattice, jitter, seed: v.seed.unwrap_or(0) })
        },
    },
    Row {
        pattern: Pattern::Poisson,
        name: "poisson",
        needs: &["pitch"],
        takes: &["seed"],
        kind: |v| Some(Kind::Poisson { pitch_mm: v.pitch_mm?, seed: v.seed.unwrap_or(0) }),
    },
    Row {
        pattern: Pattern::Honeycomb,
        name: "honeycomb",
        needs: &["pitch"],
        takes: &[],
        kind: |v| Some(Kind::Honeycomb { pitch_mm: v.pitch_mm? }),
    },
    Row {
        pattern: Pattern::Riblets,
        name: "riblets",
        needs: &["pitch", "cell", "line"],
        takes: &["direction"],
        kind: |v| {
            let (pitch_mm, cell_mm, line_mm) = (v.pitch_mm?, v.cell_mm?, v.line_mm?);
            Some(Kind::Riblets { pitch_mm, cell_mm, line_mm, direction_rad: v.direction_rad? })
        },
    },
    Row {
        pattern: Pattern::Concentric,
        name: "concentric",
        needs: &["pitch"],
        takes: &["centre"],
        kind: |v| Some(Kind::Concentric { pitch_mm: v.pitch_mm?, centre_mm: v.centre_mm }),
    },
    Row {
        pattern: Pattern::Spiral,
        name: "spiral",
        needs: &["pitch"],
        takes: &["centre"],
        kind: |v| Some(Kind::Spiral { pitch_mm: v.pitch_mm?, centre_mm: v.centre_mm }),
    },
];

/// The row of a pattern.
pub fn row(pattern: Pattern) -> &'static Row {
    PATTERNS.iter().find(|row| row.pattern == pattern).expect("every pattern has a row, as a test holds")
}

impl Kind {
    /// Distance of the figures of patterns that repeat closed ones in columns and rows, mm.
    ///
    /// None on a hexagonal lattice: its rows are another distance apart than its cells, and a line along y that passes
    /// between the tiles of one row halves those of the next, so that no pitch of sections keeps cells wider than half
    /// a pitch off their borders. Windows that reach over the border of their section keep such cells whole.
    pub fn figure_pitch_mm(&self) -> Option<f64> {
        match self {
            Self::Cells { pitch_mm, lattice: Lattice::Square, .. } => Some(*pitch_mm),
            _ => None,
        }
    }

    /// Distance of neighbouring lines of patterns of lines, mm, with the key that states it.
    pub fn line_pitch_mm(&self) -> Option<(f64, &'static str)> {
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
    pub fn texture_pitch_mm(&self) -> Option<f64> {
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
    pub fn fill_pitch_mm(&self) -> Option<f64> {
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
pub(super) fn place(kind: &Kind, site: &Site) -> Result<Placed, Error> {
    let Site { area, tolerance, turn, .. } = *site;
    let figure: Arc<dyn Figure> = match kind {
        Kind::Hatch { pitch_mm, direction_rad } => Arc::new(Hatch::new(area, *pitch_mm, *direction_rad, turn)?),
        Kind::Contour { pitch_mm, phase } => {
            return Ok(Placed::Contour(Contour::new(area, *pitch_mm, *phase, turn)?));
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
    Ok(Placed::Figure(figure))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::variants::variants;

    #[test]
    fn sections_keep_step_with_cells_on_a_square_lattice_only() {
        let v = Values { pitch_mm: Some(2.0), cell_mm: Some(1.0), inner_mm: Some(0.5), ..Values::default() };
        for (pattern, lattice, pitch) in [
            (Pattern::Rings, None, Some(2.0)),
            (Pattern::Rings, Some(Lattice::Hex), None),
            (Pattern::Hexagons, None, None),
            (Pattern::Hexagons, Some(Lattice::Square), Some(2.0)),
            (Pattern::Honeycomb, None, None),
        ] {
            let kind = (row(pattern).kind)(&Values { lattice, ..v }).expect("all keys are there");
            assert_eq!(kind.figure_pitch_mm(), pitch, "{pattern:?} {lattice:?}");
        }
    }

    #[test]
    fn every_pattern_row_builds_from_its_required_keys() {
        let all = Values {
            pitch_mm: Some(1.0),
            cell_mm: Some(0.8),
            order: Some(3),
            direction_rad: Some(0.0),
            lattice: Some(Lattice::Square),
            width_mm: Some(0.1),
            bar_mm: Some(0.4),
            inner_mm: Some(0.5),
            line_mm: Some(0.1),
            centre_mm: Some([0.0, 0.0]),
            jitter: Some(0.5),
            seed: Some(1),
        };
        let patterns: Vec<Pattern> = variants();
        assert_eq!(patterns.len(), PATTERNS.len());
        for pattern in patterns {
            let row = row(pattern);
            assert!((row.kind)(&all).is_some(), "{}", row.name);
            assert!((row.kind)(&Values::default()).is_none(), "{} needs {:?}", row.name, row.needs);
            // The name in the job file is the name of the row.
            assert_eq!(serde_json::to_value(pattern).expect("a name"), row.name);
        }
    }
}

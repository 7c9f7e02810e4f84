//! Generated patterns: every stroke is computed from its index in constant time, none is stored.
//!
//! A pattern is a file here, a variant of [`Pattern`] and of [`Kind`], and a row of the table below; `place`
//! builds it. Areas are boxes in the part frame, mm, borders included.

mod contour_hatch;
mod hatch;
mod hilbert;
mod loops;

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use contour_hatch::{Contour, Directions};
use hatch::Hatch;
use hilbert::Hilbert;
use loops::Loops;

use super::artwork::Marking;
use super::{Figure, Placed, place::Site};
use crate::diag::Error;

/// Made patterns, by the name that the job file gives them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pattern {
    /// Parallel lines.
    Hatch,
    /// One Hilbert curve.
    Hilbert,
    /// Square loops on a square grid (FSS cells).
    Squares,
    /// Circles on a square grid (FSS cells).
    Circles,
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Parallel lines.
    Hatch {
        /// Distance of lines.
        pitch_mm: f64,
        /// Direction of lines from +x, counter-clockwise.
        direction_rad: f64,
    },
    /// Parallel lines along the level lines of the part, their direction told later.
    Contour {
        /// Distance of lines.
        pitch_mm: f64,
        /// By which part of their distance all lines are moved, 0 to 1.
        phase: f64,
    },
    /// One Hilbert curve of 4^order points.
    Hilbert {
        /// 4^order points.
        order: u32,
    },
    /// Square loops of side `cell_mm`.
    Squares {
        /// Side.
        cell_mm: f64,
        /// Distance of centres.
        pitch_mm: f64,
    },
    /// Circles of diameter `cell_mm`.
    Circles {
        /// Diameter.
        cell_mm: f64,
        /// Distance of centres.
        pitch_mm: f64,
    },
    /// A drawing (SVG, DXF or HPGL) or a bitmap.
    Drawing {
        /// The file.
        path: PathBuf,
        /// Width and height of the whole page; None for those that the file states.
        size_mm: Option<[f64; 2]>,
        /// A drawing unit where the file may not say so; None for that of the file.
        unit_mm: Option<f64>,
        /// Lower left corner of the page; None for that of the area.
        origin_mm: Option<[f64; 2]>,
        /// Turn of the page about its lower left corner, counter-clockwise.
        turn_rad: f64,
        /// Whether the page is repeated over the area.
        tile: bool,
        /// How its lines and areas are marked.
        marking: Box<Marking>,
    },
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
const PATTERNS: [Row; 4] = [
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
        takes: &[],
        kind: |v| Some(Kind::Squares { cell_mm: v.cell_mm?, pitch_mm: v.pitch_mm? }),
    },
    Row {
        pattern: Pattern::Circles,
        name: "circles",
        needs: &["pitch", "cell"],
        takes: &[],
        kind: |v| Some(Kind::Circles { cell_mm: v.cell_mm?, pitch_mm: v.pitch_mm? }),
    },
];

/// The row of a pattern.
pub fn row(pattern: Pattern) -> &'static Row {
    PATTERNS.iter().find(|row| row.pattern == pattern).expect("every pattern has a row, as a test holds")
}

impl Kind {
    /// Distance of the figures of patterns that repeat closed ones, mm.
    pub fn figure_pitch_mm(&self) -> Option<f64> {
        match self {
            Self::Squares { pitch_mm, .. } | Self::Circles { pitch_mm, .. } => Some(*pitch_mm),
            _ => None,
        }
    }

    /// The pattern in a later pass: straight hatches turn by `turned_rad`, lines along contours move by a `share` of
    /// their pitch, all else stays.
    #[must_use]
    pub fn of_pass(mut self, turned_rad: f64, share: f64) -> Self {
        match &mut self {
            Self::Hatch { direction_rad, .. } => *direction_rad += turned_rad,
            Self::Contour { phase, .. } => *phase = share,
            Self::Drawing { marking, .. } => marking.direction_rad += turned_rad,
            _ => {}
        }
        self
    }
}

/// Places a pattern.
///
/// # Errors
/// `texture-pitch`, `texture-cell`, `texture-order`, `texture-large`.
pub(super) fn place(kind: &Kind, site: &Site) -> Result<Placed, Error> {
    let Site { area, tolerance, turn, .. } = *site;
    let figure: Arc<dyn Figure> = match kind {
        Kind::Hatch { pitch_mm, direction_rad } => Arc::new(Hatch::new(area, *pitch_mm, *direction_rad, turn)?),
        Kind::Contour { pitch_mm, phase } => {
            return Ok(Placed::Contour(Contour::new(area, *pitch_mm, *phase, turn)?));
        }
        Kind::Hilbert { order } => Arc::new(Hilbert::new(area, *order, turn)?),
        Kind::Squares { cell_mm, pitch_mm } => Arc::new(Loops::squares(area, *cell_mm, *pitch_mm, turn)?),
        Kind::Circles { cell_mm, pitch_mm } => Arc::new(Loops::circles(area, *cell_mm, *pitch_mm, tolerance, turn)?),
        Kind::Drawing { .. } => unreachable!("drawings are placed by their reader"),
    };
    Ok(Placed::Figure(figure))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_row_builds_from_its_required_keys() {
        let all = Values { pitch_mm: Some(1.0), cell_mm: Some(0.5), order: Some(3), direction_rad: Some(0.0) };
        for pattern in [Pattern::Hatch, Pattern::Hilbert, Pattern::Squares, Pattern::Circles] {
            let row = row(pattern);
            assert!((row.kind)(&all).is_some(), "{}", row.name);
            assert!((row.kind)(&Values::default()).is_none(), "{} needs {:?}", row.name, row.needs);
        }
    }
}

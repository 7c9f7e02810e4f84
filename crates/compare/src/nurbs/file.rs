//! NURBS files: a surface as JSON (`docs/reference/cli.md`). The fields are those of STEP's
//! `B_SPLINE_SURFACE_WITH_KNOTS` and `RATIONAL_B_SPLINE_SURFACE`, knots with their multiplicities written out.

use std::path::Path;

use serde::Deserialize;

use super::Surface;
use terrace_core::diag::{self, Diag, Error, Place};

/// Largest file that is read.
const MOST: u64 = 256 << 20;

/// A NURBS file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    unit: Unit,
    degree: [usize; 2],
    knots: [Vec<f64>; 2],
    points: Vec<Vec<[f64; 3]>>,
    #[serde(default)]
    weights: Option<Vec<Vec<f64>>>,
}

/// Unit of the points.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Unit {
    Mm,
}

impl Surface {
    /// Reads a NURBS file.
    ///
    /// # Errors
    /// `nurbs-file` where it is no JSON of this form, `nurbs-surface` where the numbers make no surface.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let shown = path.display().to_string();
        let bytes = diag::read_file(path, MOST)?;
        let File { unit: Unit::Mm, degree, knots, points, weights } = serde_json::from_slice(&bytes).map_err(|e| {
            let d = Diag::input("nurbs-file", format!("the file is no NURBS surface: {e}"));
            let place = if e.line() > 0 { Place::line(&shown, e.line()) } else { Place::file(&shown) };
            d.at(place).hint(
                "it is JSON with unit, degree, knots, points and perhaps weights; see docs/reference/cli.md, inspect",
            )
        })?;
        Self::new(degree, knots, &points, weights.as_deref())
            .map_err(|e| Error::many(e.diags().iter().map(|d| d.clone().at(Place::file(&shown))).collect()))
    }
}

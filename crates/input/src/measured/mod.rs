//! Measured points of a part: the table that a job names, and the logs of controllers that one is made of.
//!
//! Consumes a table of rows with named columns (`docs/reference/measured.md`). Promises points with what they are and
//! how surely they are known: stage positions as the controller shows them, mm, not yet in any other frame; all faults
//! of the table with their rows. Limits: 100,000 points, 64 MB.

mod log;
mod table;

pub use log::{LoggedZero, MarkedLog, read_log};
pub use table::{COLUMNS, read_table, written};

use terrace_core::diag::Place;
use terrace_core::geom::SpacePoint;

/// Most points of a table, and most bytes of a file.
pub const MAX_POINTS: usize = 100_000;
pub(crate) const MAX_BYTES: u64 = 64 << 20;

/// How a point was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measure {
    /// The beam, or a pilot in it, stands on a feature of the part whose place is known: mm, part frame before
    /// `placement.turn`.
    Optical {
        /// Where the feature lies on the part.
        part: SpacePoint,
    },
    /// A tip of this radius, mm, has touched the part; the point is its centre.
    Touch {
        /// Radius of the tip.
        tip_mm: f64,
    },
    /// A sensor along the beam has seen the part.
    Distance,
}

/// One row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredPoint {
    /// What the user calls it; its row in the file where it has no name.
    pub name: String,
    /// Its line in the file.
    pub place: Place,
    /// How it was measured.
    pub measure: Measure,
    /// Positions of the stage's axes with the focus of the beam on the point, mm.
    pub stage: SpacePoint,
    /// Standard deviation of the position in x and y, and in z, mm.
    pub sigma_mm: [f64; 2],
}

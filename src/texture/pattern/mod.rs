//! Made patterns: every stroke is computed from its index in constant time, none is held.
//!
//! Areas are rectangles [x0, y0, x1, y1] in the part frame, mm, borders included.

mod contour;
mod hatch;
mod hilbert;
mod loops;

pub use contour::{Contour, Directions};
pub(super) use hatch::Hatch;
pub(super) use hilbert::Hilbert;
pub(super) use loops::Loops;

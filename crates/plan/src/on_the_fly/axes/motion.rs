//! What all axes do, timed: the common end of every decomposition.

use terrace_core::program::{PenId, PieceId};

/// Axes of a motion, in this order: stage X, Y, Z in mm, turns A and C in rad, scanner U and V in mm.
pub const AXES: usize = 7;

/// Axes of the stage, the first of them.
pub(crate) const STAGE: usize = 5;

/// Where all axes are at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// When it is reached, s.
    pub time: f64,
    /// Where all axes are then.
    pub axes: [f64; AXES],
    /// Pen of the stretch that ends here; None with the beam off.
    pub pen: Option<PenId>,
    /// Stroke of the program that it belongs to.
    pub stroke: PieceId,
}

/// Waypoints of all axes, in times that never fall, with straight lines between them.
///
/// The part frame is turned by -C about z, then by A about x, before the stage and the scanner reach it
/// (`kinematics`); with A = C = 0 a mark lies at X + U, Y + V and its focus at Z.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// One after the other.
    pub waypoints: Vec<Waypoint>,
}

impl Motion {
    /// When the last waypoint is reached, s.
    pub fn total_s(&self) -> f64 {
        self.waypoints.last().map_or(0.0, |w| w.time)
    }
}

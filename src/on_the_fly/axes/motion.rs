//! What all axes do, timed: the common end of every decomposition.

/// Axes of a motion, in this order: stage X, Y, Z in mm, turns A and C in rad, scanner U and V in mm.
pub const AXES: usize = 7;

/// Positions of all axes at nodes, with straight lines between them.
///
/// The part frame is turned by -C about z, then by A about x, before the stage and the scanner reach it
/// (`kinematics`); with A = C = 0 a mark lies at X + U, Y + V and its focus at Z.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// When each node is reached, s; never falling.
    pub time: Vec<f64>,
    /// Where all axes are then.
    pub axes: Vec<[f64; AXES]>,
    /// Pen of the stretch that ends at each node; None with the beam off.
    pub pen: Vec<Option<u16>>,
    /// Stroke of the program that each node belongs to.
    pub stroke: Vec<u32>,
}

impl Motion {
    /// When the last node is reached, s.
    pub fn total_s(&self) -> f64 {
        self.time.last().copied().unwrap_or_default()
    }
}

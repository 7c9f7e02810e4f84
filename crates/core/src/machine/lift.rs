//! How high the head is lifted.

use super::Machine;
use crate::geom::Nm;

impl Machine {
    /// The z command at the end of travel that lies farthest from the part: where the stage programs
    /// lift the head to before a move that could come too near, at their start and at their end.
    pub fn retract_z(&self) -> Nm {
        let [lowest, highest] = self.stage.z.travel_nm();
        let grid = self.increment_nm().max(Nm(1));
        // Rounded into the travel, onto the grid of commands.
        if self.stage.z.sign() > 0 { highest - highest.rem_euclid(grid) } else { lowest + (-lowest).rem_euclid(grid) }
    }
}

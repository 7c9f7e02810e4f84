//! How long the machine takes: stage moves, marks, jumps, delays.
//!
//! Consumes the machine and plain geometry; promises estimates whose parts sum to their totals. Units
//! are mm and s inside, nm where the program hands over positions.
//!
//! # Limits
//! A stage axis follows a jerk-limited profile from rest to rest and stops at every target. A galvo whose
//! acceleration the machine file states does the same between corners; on curves the limits hold along
//! the path, and what turning itself takes is left out. Without that figure it is taken as always at its
//! mark or jump speed, and what it loses at starts, ends and corners is what the delays of the machine
//! file stand for. Laser-on and laser-off delays run inside the scanner's own delays and cost no time of
//! their own.

mod energy;
mod galvo;
mod profile;
mod stage;

pub use energy::{Beam, LineEnergy, Overshoot, Rest, deposits};
pub use galvo::{CORNER, DelaysS, GalvoModel, Mark, Marking, Run, angle, is_corner, marking};
pub use profile::{RestToRest, rest_to_rest};
pub use stage::{StageMove, stage_move, tilting_move};

//! Marking on the fly: the stage follows while the scanner marks. For comparison with stepped jobs, and for
//! programs of machines that can.
//!
//! Consumes a timed or untimed path of marks on the part; promises a decomposition of it into what the stage
//! does and what the scanner does, the time of both under the limits of all axes together, and how far each
//! mark is out of focus, out of the beam's angle and out of the field. Units: mm, s, rad, unless a name says
//! otherwise.
//!
//! # Sources
//! Ma et al., Int. J. Extrem. Manuf. 7 (2025) 015103: seven axes. Cui et al., Engineering (2021): scanner and
//! stage synchronised. Where their print was damaged, the equations here are restored and tested as such.

pub mod axes;
pub mod banded_qp;
pub mod beam_hits;
pub mod check;
pub mod decompose;
pub mod in_step;
pub mod kinematic_model;
pub mod path;
pub mod program;
mod spline;
pub mod spot;
pub mod stage_path;
pub mod statistics;
pub mod stop_at_every_point;
pub mod topp;
pub mod turnaround;
pub mod xyzacuv;
pub mod xyzuv;

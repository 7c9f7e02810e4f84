//! The axes of machines that mark on the fly: kinematics, motion, following error. Units: mm, s, rad.

pub mod following_error;
pub mod kinematics;
pub mod motion;

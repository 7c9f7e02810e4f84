//! The axes of machines that mark on the fly: how they stand, how stage and scanner share a path, and how far they lag
//! behind their commands. Units: mm, s, rad.

pub mod following_error;
pub mod kinematics;
pub mod motion;
pub mod xyzacuv;
pub mod xyzuv;

//! The axes of machines that mark on the fly: kinematics, decomposition into stage and scanner, following error. Units:
//! mm, s, rad.

pub mod following_error;
pub mod kinematics;
pub mod motion;
pub mod xyzacuv;
pub mod xyzuv;

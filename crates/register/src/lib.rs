//! Where a part lies on the stage, from measured points, and how surely.
//!
//! Consumes points in mm: pairs of a point of the part and its position on the stage, and touched points whose partner
//! on the part is not known. Promises the rigid motion from part to stage that fits them best (weighted least squares;
//! touches against the facets, robustly), its covariance, the residual of each point, and the motions that the points
//! leave free. Nothing is invented: a free motion keeps what the start says, and a scale is reported, never applied.
//!
//! Frames: the part as the job turns it, and the table frame of the stage. Lengths are mm, angles rad.

mod chi_squared;
mod choose;
mod closed_form;
mod equations;
mod facets;
mod fit;
mod hull;
mod motion;
mod neighbours;
mod pairs;
mod points;
mod solver;
mod uncertainty;
mod warp;

pub use choose::{Cost, Known, Prior, Site, Unknown, even_net, regular_net};
pub use closed_form::Pair;
pub use equations::Scale;
pub use facets::{Contact, Facets};
pub use fit::{Fit, FreeMotion, TouchResidual, fit};
pub use motion::Motion;
pub use neighbours::Neighbours;
pub use pairs::{PairsFault, fault as pairs_fault};
pub use points::{Points, Touch};
pub use uncertainty::Uncertainty;
pub use warp::{Candidate, DEVIATION_OF_LIMIT, Observation, Told, Warp, lengths, warp};

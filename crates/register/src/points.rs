//! What was measured, and how touched points meet the part.

use nalgebra::Vector3;

use super::closed_form::Pair;
use super::facets::{Contact, Facets};
use super::motion::Motion;
use terrace_core::geom::SpacePoint;

/// A point of the stage that lies on the part, at a place that is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The centre of the tip, or the point that a sensor saw; table frame, mm.
    pub stage: SpacePoint,
    /// How far it stands off the part: the radius of the tip, mm.
    pub off: f64,
    /// Standard deviation, mm: along the normal of a touch, along z of a sensor.
    pub sigma: f64,
    /// Whether the noise is along z, as a sensor's.
    pub is_along_z: bool,
}

/// What was measured.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// Points with partners.
    pub pairs: &'a [Pair],
    /// Points without.
    pub touches: &'a [Touch],
    /// The part; used where there are touches.
    pub part: &'a Facets,
    /// Standard deviation of the height of a part that may be warped, mm. Touches then count by how far they spread, and
    /// along z all together as one of this deviation: what they are off by is the warp, which must not shift the part aside.
    pub warp: Option<f64>,
}

impl Points<'_> {
    /// How many times its noise a touch counts as being off, one of `count` that spread so.
    pub(crate) fn counted(&self, spread: f64, touch: &Met, count: usize) -> f64 {
        let Some(warp) = self.warp else { return 1.0 };
        let shared = touch.normal.z * warp / touch.sigma;
        (spread * spread + shared * shared * count as f64).sqrt()
    }
}

/// A touch against the part as it lies by some motion.
pub(crate) struct Met {
    pub(crate) arm_end: Vector3<f64>,
    /// Normal in the table frame.
    pub(crate) normal: Vector3<f64>,
    /// Above the part, less what it should stand off.
    pub(crate) distance: f64,
    /// Along the normal.
    pub(crate) sigma: f64,
    pub(crate) bend2: f64,
}

impl Touch {
    pub(crate) fn met(&self, part: &Facets, motion: &Motion) -> Option<Met> {
        let centre = motion.back(self.stage);
        let Contact { at, normal, bend2 } = part.nearest(centre)?;
        let (at, n) = (Vector3::from(at), Vector3::from(normal));
        let to = Vector3::from(centre) - at;
        let length = to.norm();
        // At an edge the tip stands off along the line to it.
        let is_beside = length > 1e-3 && (to.dot(&n) / length).abs() > 0.7;
        let along = if is_beside { to * (to.dot(&n).signum() / length) } else { n };
        let normal = motion.turn(&along);
        let sigma = if self.is_along_z { self.sigma * normal.z.abs().max(0.1) } else { self.sigma };
        Some(Met { arm_end: motion.move_point(&at), normal, distance: along.dot(&to) - self.off, sigma, bend2 })
    }
}

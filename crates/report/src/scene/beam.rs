//! Where beams meet the part.

use terrace_core::geom::P2;
use terrace_input::surface::Surface;
use terrace_plan::projection::{Piece, Tracer};

/// Steps until the place where a leaning beam meets a smooth surface is known to a nanometre.
const STEPS: usize = 24;

/// A place so near to the part lies at its rim, nm: a beam that is followed from above or below it may miss the part.
const RIM: f64 = 2000.0;

/// Follows beams to the surface; holds what can be reused from one to the next.
pub(super) struct Beams<'a> {
    tracer: Tracer<'a>,
}

/// Where a beam meets the part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Height over the point that the beam was followed from, along the beam, nm.
    pub(super) height: f64,
    /// Cosine of the angle between beam and normal.
    pub(super) cos: f64,
}

impl<'a> Beams<'a> {
    pub(super) fn new(surface: &'a Surface) -> Self {
        Self { tracer: Tracer::new(surface, f64::INFINITY) }
    }

    /// Height, nm, and normal of the topmost surface at a place; None off the part.
    fn surface_under(&mut self, x: f64, y: f64) -> Option<(f64, [f64; 3])> {
        let p = P2::new(x.round() as i64, y.round() as i64);
        let normals = self.tracer.normals();
        let mut surface = None;
        self.tracer.segment(p, p, |piece| {
            if piece.skip.is_none() && surface.is_none() {
                surface = Some((piece.z0, normals.under(&piece)));
            }
        });
        surface
    }

    /// Where the beam through `at`, nm, whose direction against the light is `up`, meets the part; the search begins at
    /// `height` along it. None where it leaves the part. Newton's method on the facets: exact on the facet where it
    /// ends.
    pub(super) fn hit(&mut self, at: [f64; 3], up: [f64; 3], height: f64) -> Option<Hit> {
        let mut w = height;
        let mut hit = None;
        for _ in 0..STEPS {
            let p = [0, 1, 2].map(|k| at[k] + w * up[k]);
            let mut offsets = [[0.0; 2], [RIM, 0.0], [-RIM, 0.0], [0.0, RIM], [0.0, -RIM]].into_iter();
            let surface = offsets.find_map(|[x, y]| self.surface_under(p[0] + x, p[1] + y));
            let Some((z, normal)) = surface else { break };
            let cos: f64 = (0..3).map(|k| normal[k] * up[k]).sum();
            // A facet that looks away from the beam is met by none; the search continues from the height under the
            // place.
            let step = if cos > 1e-3 { (z - p[2]) * normal[2] / cos } else { (z - p[2]) / up[2].max(1e-3) };
            w += step;
            hit = Some(Hit { height: w, cos });
            // The scene rounds heights to nanometres.
            if step.abs() < 0.5 {
                break;
            }
        }
        hit
    }

    /// The pieces of the segment from `a` to `b` that lie on the part, in order.
    pub(super) fn along(&mut self, a: P2, b: P2, mut sink: impl FnMut(Piece)) {
        self.tracer.segment(a, b, |piece| {
            if piece.skip.is_none() {
                sink(piece);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::math;

    #[test]
    fn a_leaning_beam_meets_a_slope_where_the_two_cross() {
        // z = x / 2.
        let [a, b, c, d] = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, y]| [x, y, x / 2.0]);
        let surface = Surface::from_facets([[a, b, c], [a, c, d]], &mut Vec::new()).expect("facets");
        let mut beams = Beams::new(&surface);
        let (sin, cos) = math::sin_cos(20f64.to_radians());
        let hit = beams.hit([1e6, 0.0, 2e6], [sin, 0.0, cos], 0.0).expect("on the part");
        // 1 + w sin = 2 (2 + w cos).
        let w = 3e6 / (sin - 2.0 * cos);
        assert!((hit.height - w).abs() < 2.0, "{hit:?} {w}");
        let normal = [-0.5 / 1.25f64.sqrt(), 1.0 / 1.25f64.sqrt()];
        assert!((hit.cos - (normal[0] * sin + normal[1] * cos)).abs() < 1e-9, "{hit:?}");
        assert!(beams.hit([50e6, 0.0, 0.0], [0.0, 0.0, 1.0], 0.0).is_none());
    }
}

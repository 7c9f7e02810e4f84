//! The facets of a part, to find the one that a point has touched.

use nalgebra::Vector3;
use rstar::{AABB, PointDistance, RTree, RTreeObject};
use terrace_core::geom::SpacePoint;

/// Facets whose normals differ by less belong to one smooth face: cosine of 20 degrees.
const SMOOTH_COS: f64 = 0.94;

/// Facets that are no farther than the nearest by this, mm, are as near.
const SAME_PLACE: f64 = 1e-3;

/// Facets whose upward normals rise by no more of a difference are as steep as one another: those of a chamfer, whose
/// corners are rounded.
const SAME_STEEPNESS: f64 = 1e-3;

/// The facets of a part in its frame, mm.
#[derive(Debug)]
pub struct Facets {
    tree: RTree<Facet>,
}

#[derive(Clone, Copy, Debug)]
struct Facet {
    corners: [SpacePoint; 3],
    /// Of length 1, upwards.
    normal: SpacePoint,
    /// Mean square of the angle between this normal and those of the smooth face around it, rad^2.
    bend2: f64,
}

/// Where a point of the part is touched.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// The point of the part that is nearest, mm.
    pub at: SpacePoint,
    /// The normal of its facet: of length 1, upwards.
    pub normal: SpacePoint,
    /// How well the facet knows its normal: mean square of the angle to those of its neighbours, rad^2.
    pub bend2: f64,
}

impl Facets {
    /// Takes facets, mm; such as have no area are left out.
    pub fn new(facets: impl IntoIterator<Item = [SpacePoint; 3]>) -> Self {
        let mut all: Vec<Facet> = facets.into_iter().filter_map(Facet::new).collect();
        bend(&mut all);
        Self { tree: RTree::bulk_load(all) }
    }

    /// Where the part is nearest to a point; None where it has no facet.
    pub fn nearest(&self, p: SpacePoint) -> Option<Contact> {
        let facet = self.tree.nearest_neighbor(&p)?;
        Some(Contact { at: facet.nearest(&Vector3::from(p)).into(), normal: facet.normal, bend2: facet.bend2 })
    }

    /// The upward normal of the part at a feature: a corner or the rim of a hole is on a face and on a wall, of which the
    /// least steep counts, and where several are, their mean. None where the part has no facet.
    pub fn flattest(&self, p: SpacePoint) -> Option<SpacePoint> {
        let near = self.tree.nearest_neighbor(&p)?.distance_2(&p).sqrt() + SAME_PLACE;
        let all: Vec<SpacePoint> = self.tree.locate_within_distance(p, near * near).map(|facet| facet.normal).collect();
        let up = all.iter().map(|n| n[2]).fold(f64::NEG_INFINITY, f64::max);
        let flat = all.iter().filter(|n| n[2] >= up - SAME_STEEPNESS);
        let sum: Vector3<f64> = flat.map(|n| Vector3::from(*n)).sum();
        Some(sum.normalize().into())
    }
}

/// Finds how much facets that share a corner differ in their normals.
fn bend(all: &mut [Facet]) {
    // Corners as they are written: neighbours of a welded mesh have the same bits.
    let mut corners: Vec<([u64; 3], u32)> = Vec::with_capacity(3 * all.len());
    for (k, facet) in all.iter().enumerate() {
        corners.extend(facet.corners.iter().map(|c| (c.map(|v| (v + 0.0).to_bits()), k as u32)));
    }
    corners.sort_unstable();
    let mut sums = vec![[0.0; 2]; all.len()];
    for around in corners.chunk_by(|a, b| a.0 == b.0) {
        for (i, &(_, a)) in around.iter().enumerate() {
            for &(_, b) in &around[i + 1..] {
                let cos = dot(all[a as usize].normal, all[b as usize].normal);
                if cos > SMOOTH_COS {
                    // 2 (1 - cos) is the square of the angle, to its fourth power.
                    for k in [a, b] {
                        let [sum, count] = &mut sums[k as usize];
                        (*sum, *count) = (*sum + 2.0 * (1.0 - cos).max(0.0), *count + 1.0);
                    }
                }
            }
        }
    }
    for (facet, [sum, count]) in all.iter_mut().zip(sums) {
        // The face turns from one facet to the next by this angle; within one, a quarter of it either way.
        facet.bend2 = if count > 0.0 { sum / count / 12.0 } else { 0.0 };
    }
}

fn dot(a: SpacePoint, b: SpacePoint) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

impl Facet {
    fn new(corners: [SpacePoint; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(Vector3::from);
        let normal = (b - a).cross(&(c - a)).try_normalize(1e-300)?;
        let normal = if normal.z < 0.0 { -normal } else { normal };
        Some(Self { corners, normal: normal.into(), bend2: 0.0 })
    }

    /// The point of it that is nearest (Ericson, Real-Time Collision Detection, 5.1.5).
    fn nearest(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let [a, b, c] = self.corners.map(Vector3::from);
        let (ab, ac) = (b - a, c - a);
        let (d1, d2) = (ab.dot(&(p - a)), ac.dot(&(p - a)));
        if d1 <= 0.0 && d2 <= 0.0 {
            return a;
        }
        let (d3, d4) = (ab.dot(&(p - b)), ac.dot(&(p - b)));
        if d3 >= 0.0 && d4 <= d3 {
            return b;
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return a + ab * (d1 / (d1 - d3));
        }
        let (d5, d6) = (ab.dot(&(p - c)), ac.dot(&(p - c)));
        if d6 >= 0.0 && d5 <= d6 {
            return c;
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return a + ac * (d2 / (d2 - d6));
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
        }
        let sum = va + vb + vc;
        a + ab * (vb / sum) + ac * (vc / sum)
    }
}

impl RTreeObject for Facet {
    type Envelope = AABB<SpacePoint>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_points(&self.corners)
    }
}

impl PointDistance for Facet {
    fn distance_2(&self, p: &SpacePoint) -> f64 {
        let p = Vector3::from(*p);
        (self.nearest(&p) - p).norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::random::Random;

    #[test]
    fn a_feature_at_a_corner_is_of_the_least_steep_face() {
        let top =
            [[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0]], [[0.0; 3], [10.0, 10.0, 0.0], [0.0, 10.0, 0.0]]];
        let walls = [[[0.0; 3], [10.0, 0.0, 0.0], [0.0, 0.0, -9.0]], [[0.0; 3], [0.0, 10.0, 0.0], [0.0, 0.0, -9.0]]];
        let part = Facets::new(walls.into_iter().chain(top));
        for p in [[0.0; 3], [5.0, 0.0, 0.0], [-0.5, -0.5, 0.2]] {
            assert_eq!(part.flattest(p), Some([0.0, 0.0, 1.0]), "{p:?}");
        }
        // Both sides of a ridge count.
        let ridge = [[[0.0; 3], [0.0, 10.0, 0.0], [5.0, 5.0, -1.0]], [[0.0; 3], [0.0, 10.0, 0.0], [-5.0, 5.0, -1.0]]];
        let [x, y, z] = Facets::new(ridge).flattest([0.0, 5.0, 0.0]).expect("facets");
        assert!(x.abs() < 1e-12 && y.abs() < 1e-12 && (z - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_nearest_point_of_a_facet_is_the_least_of_many() {
        for seed in 0..200 {
            let mut random = Random::case(seed);
            let mut point = || [0; 3].map(|_| random.range(-1.0, 1.0));
            let (corners, p) = ([0; 3].map(|_| point()), Vector3::from(point()));
            let Some(facet) = Facet::new(corners) else { continue };
            let found = (facet.nearest(&p) - p).norm();
            let [a, b, c] = corners.map(Vector3::from);
            let tried = (0..=60).flat_map(|i| (0..=60 - i).map(move |k| (f64::from(i) / 60.0, f64::from(k) / 60.0)));
            let least = tried.map(|(u, v)| (a + (b - a) * u + (c - a) * v - p).norm()).fold(f64::INFINITY, f64::min);
            assert!(found <= least + 1e-12 && found >= least - 0.05, "seed {seed}: {found} {least}");
        }
    }

    #[test]
    fn a_plane_has_no_bend_and_a_fold_does_not_count() {
        let square = |z: [f64; 4]| {
            let [a, b, c, d] = [[0.0, 0.0, z[0]], [1.0, 0.0, z[1]], [1.0, 1.0, z[2]], [0.0, 1.0, z[3]]];
            [[a, b, c], [a, c, d]]
        };
        let bend = |z: [f64; 4]| Facets::new(square(z)).nearest([0.5, 0.4, 1.0]).expect("a facet").bend2;
        assert_eq!(bend([0.0; 4]), 0.0);
        assert_eq!(bend([0.0, 2.0, 0.0, 2.0]), 0.0);
        assert!(bend([0.0, 0.01, 0.0, 0.01]) > 1e-6);
    }
}

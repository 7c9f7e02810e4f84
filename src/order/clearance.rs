//! Where the head could touch the part: boxes over the part's high places, asked for by culling.
//!
//! Boxes are f32 inside the library that holds them, so they are grown outward by a micrometre; the
//! decision compares integers. The part is taken as higher than it is, never as lower.

use parry2d::bounding_volume::Aabb;
use parry2d::math::Vec2;
use parry2d::partitioning::{Bvh, BvhBuildStrategy};

use crate::geom::{Box2, P2, mm_from_nm};
use crate::machine::Machine;

/// The part's height by tiles.
pub struct Clearance {
    bvh: Bvh,
    tops: Vec<i64>,
    radius: i64,
    gap: i64,
}

impl Clearance {
    /// `tiles` are boxes of the part (nm) with the highest surface point in each (nm).
    pub fn new(tiles: &[(Box2, i64)], machine: &Machine) -> Self {
        let nm = |l: crate::units::Length| l.as_nm().unwrap_or(i64::MAX / 4);
        let boxes: Vec<Aabb> = tiles.iter().map(|(b, _)| aabb(*b)).collect();
        Self {
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            tops: tiles.iter().map(|t| t.1).collect(),
            radius: nm(machine.lens.diameter) / 2,
            gap: nm(machine.lens.working_distance) - nm(machine.stage.clearance),
        }
    }

    /// The lowest focal plane (nm, part frame) at which the head may move in a straight line over the
    /// part from `a` to `b`: its lens then stays clear of everything under its path.
    pub fn lowest_focus(&self, a: P2, b: P2) -> i64 {
        let mut path = Box2::EMPTY;
        for p in [a, b] {
            path.add(P2::new(p.x - self.radius, p.y - self.radius));
            path.add(P2::new(p.x + self.radius, p.y + self.radius));
        }
        let path = aabb(path);
        let top = self.bvh.intersect_aabb(&path).map(|i| self.tops[i as usize]).max();
        top.map_or(i64::MIN, |t| t - self.gap)
    }
}

fn aabb(b: Box2) -> Aabb {
    let at = |p: P2, grow: f64| Vec2::new((mm_from_nm(p.x) + grow) as f32, (mm_from_nm(p.y) + grow) as f32);
    Aabb::new(at(b.lo, -1e-3), at(b.hi, 1e-3))
}

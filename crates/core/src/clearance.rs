//! Where the head could touch the part: boxes over the surface under a square around the head, which say where it
//! lifts and let most of a program pass; and the facets themselves under the round head, for what they do not let pass.
//!
//! Boxes are f32 inside the library that holds them, so they are grown outward by a micrometre; the
//! decision compares integers. The part is taken as higher than it is, never as lower.

mod facets;
mod head;

pub use facets::{EachFacet, Facets, Intrusion, Way};
pub use head::Head;

use parry2d::bounding_volume::Aabb;
use parry2d::math::Vec2;
use parry2d::partitioning::{Bvh, BvhBuildStrategy};

use crate::geom::{Box2, NM_PER_MM, Nm, P2, P3, Turn, Turned, mm_from_nm};
use crate::machine::Machine;

/// The part's height by tiles.
pub struct Clearance {
    bvh: Bvh,
    /// Boxes of the part with the highest surface point in each.
    tiles: Vec<(Box2, Nm)>,
    /// Half the lens's diameter.
    radius: Nm,
    /// How far above the focal plane the part may reach under the head: the working distance less the clearance.
    gap: Nm,
}

impl Clearance {
    /// `tiles` are boxes of the part with the highest surface point in each.
    pub fn new(tiles: &[(Box2, Nm)], machine: &Machine) -> Self {
        let nm = |l: crate::units::Length| Nm::round(l.as_mm() * NM_PER_MM);
        let boxes: Vec<Aabb> = tiles.iter().map(|(b, _)| aabb(*b)).collect();
        Self {
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            tiles: tiles.to_vec(),
            radius: nm(machine.lens.diameter) / 2,
            gap: nm(machine.lens.working_distance) - nm(machine.stage.clearance),
        }
    }

    /// How far above the focal plane the part may reach under the head.
    pub fn gap(&self) -> Nm {
        self.gap
    }

    /// The way of a head whose field's centre goes straight from one place of the part as turned to another, nm.
    pub fn way(&self, turn: Turn, ends: [[f64; 3]; 2]) -> Way {
        Way { turn, ends: ends.map(|[x, y, z]| [x, y, z + self.gap.f64()]), radius: self.radius.f64() }
    }

    /// Whether all of the part as turned lies below a way.
    pub fn is_below(&self, way: &Way) -> bool {
        let (area, top) =
            self.tiles.iter().fold((Box2::EMPTY, Nm::MIN), |(area, top), (b, t)| (area.union(*b), top.max(*t)));
        let lowest = way.ends[0][2].min(way.ends[1][2]);
        // Of a part turned beyond upright what is highest says nothing.
        let is_upright = way.turn.rows()[2][2] > 0.0;
        self.tiles.is_empty() || is_upright && TurnedTile::new(&area, top, &way.turn).top.f64() <= lowest
    }

    /// The lowest focal plane (part frame) at which the head may move in a straight line over the
    /// part, which is not tilted, from `a` to `b`: its lens then stays clear of everything under its path.
    pub fn lowest_focus(&self, a: P2<Turned>, b: P2<Turned>) -> Nm {
        let mut path = Box2::EMPTY;
        for p in [a, b].map(Turn::drawn) {
            path = path.union(Box2::around(p, [self.radius; 2]));
        }
        let path = aabb(path);
        // The box of the path holds what the lens sweeps over and more: a part that is high next to a slanting path may
        // cost a lift, never a collision.
        let top = self.bvh.intersect_aabb(&path).map(|i| self.tiles[i as usize].1).max();
        top.map_or(Nm::MIN, |t| t - self.gap)
    }

    /// The lowest focal plane at which the head may stay anywhere while two tilt axes go from one pair of
    /// angles to another, each in its own time. `turns` are those of all four pairs of their angles. Between
    /// them a place rises above the highest of the four by less than they lie apart.
    pub fn lowest_swing(&self, turns: [Turn; 4]) -> Nm {
        // The axes need not arrive together, so all pairs of angles between the four can occur on the way.
        let tiles = |turn| self.tiles.iter().map(move |(area, top)| TurnedTile::new(area, *top, turn));
        let top = turns.iter().flat_map(tiles).map(|tile| tile.top).max();
        let lift = self.tiles.iter().map(|(area, top)| swing(area, *top, &turns)).fold(0.0, f64::max);
        let lift = Nm::ceil(lift);
        top.map_or(Nm::MIN, |t| t + lift - self.gap)
    }
}

/// How far apart the middle of a tile at its highest point lies in two of four turns, at most, along an axis, nm.
fn swing(area: &Box2, top: Nm, turns: &[Turn; 4]) -> f64 {
    let p = [(area.lo.x + area.hi.x) as f64 / 2.0, (area.lo.y + area.hi.y) as f64 / 2.0, top.f64()];
    let at = turns.map(|turn| turn.apply(P3::new(p)).at);
    let apart = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
    at.iter().flat_map(|&a| at.map(|b| apart(a, b))).fold(0.0, f64::max)
}

/// A tile as it lies on the turned part.
struct TurnedTile {
    /// The box about the tile.
    area: Box2<Turned>,
    /// Its highest point.
    top: Nm,
}

impl TurnedTile {
    /// The tile of an area and its highest point, turned: the highest point may lie over any of its corners.
    fn new(area: &Box2, top: Nm, turn: &Turn) -> Self {
        let mut out = Self { area: Box2::EMPTY, top: Nm::MIN };
        let Box2 { lo, hi, .. } = area;
        for [x, y] in [[lo.x, lo.y], [hi.x, lo.y], [lo.x, hi.y], [hi.x, hi.y]] {
            let [x, y, z] = turn.apply(P3::new([x as f64, y as f64, top.f64()])).at.map(|v| v.ceil() as i64);
            out.area.add(P2::new(x, y));
            out.top = out.top.max(Nm(z));
        }
        out
    }
}

/// A box in mm, grown by a micrometre for the rounding of its corners to f32.
fn aabb(b: Box2) -> Aabb {
    let at = |p: P2, grow: f64| Vec2::new((mm_from_nm(p.x) + grow) as f32, (mm_from_nm(p.y) + grow) as f32);
    Aabb::new(at(b.lo, -1e-3), at(b.hi, 1e-3))
}

//! Where the head could touch a part that is turned, or leans over it.
//!
//! At one tilt the head stands or moves straight through the turned part, along its beam or not: the way is cut into pieces, and
//! over each the part is looked at as under a head that stands. While the tilt axes turn, each in its own time, the
//! lower end of the head must stay above the highest place of the whole part.

use super::{Clearance, TurnedTile};
use crate::geom::{Box2, NM_PER_MM, Nm, P2, P3, Turn, Turned};
use crate::machine::{Commanded, Machine, Origin, TiltAngles};

/// Pieces into which a way is cut.
const PIECES: u32 = 64;
/// Steps of a tilt axis that are looked at.
const STEPS: u32 = 16;

/// A head on its way over a part.
#[derive(Clone, Copy)]
pub struct Head<'a> {
    /// The machine, whose tilt axes carry the head.
    pub machine: &'a Machine,
    /// Where the part's origin lies.
    pub origin: Origin,
    /// Where the part is high.
    pub clearance: &'a Clearance,
}

/// The straight way of a head's field centre in the frame of the turned part.
struct Way {
    /// The ends of the way, nm.
    ends: [[f64; 3]; 2],
    /// How far what lies lower along z of the part lies beside it as the head sees it, along x and y.
    lean: [f64; 2],
    /// How much of a height along z of the part lies along the beam.
    up: f64,
    /// Half the width of the head.
    radius: Nm,
    /// From the focal plane up to the lowest place that the part may reach.
    gap: Nm,
}

/// A piece of a way: a box about it, and the height of the head's lower end over its lowest place.
struct Piece {
    path: Box2<Turned>,
    limit: Nm,
}

impl Piece {
    /// The piece with this much more of everything.
    fn grown(self, by: Nm) -> Self {
        let Box2 { lo, hi, .. } = self.path;
        let path = Box2 { lo: P2::new(lo.x - by.0, lo.y - by.0), hi: P2::new(hi.x + by.0, hi.y + by.0) };
        Self { path, limit: self.limit - by }
    }
}

impl Way {
    /// Place `i` of those that divide the way into [`PIECES`].
    fn place(&self, i: u32) -> [f64; 3] {
        let t = f64::from(i.min(PIECES)) / f64::from(PIECES);
        [0, 1, 2].map(|k| self.ends[0][k] + t * (self.ends[1][k] - self.ends[0][k]))
    }

    /// The piece from one of these places to another.
    fn piece(&self, from: u32, to: u32) -> Piece {
        let (from, to) = (self.place(from), self.place(to));
        let mut path = Box2::<Turned>::EMPTY;
        for p in [from, to] {
            path.add(P2::new(p[0].floor() as i64, p[1].floor() as i64));
            path.add(P2::new(p[0].ceil() as i64, p[1].ceil() as i64));
        }
        Piece { path, limit: self.gap + Nm::floor(from[2].min(to[2])) }
    }

    /// How far a tile rises into the head along a piece; None where it lies beside the head.
    fn over(&self, tile: &TurnedTile, Piece { path, limit }: &Piece) -> Option<Nm> {
        let TurnedTile { area, top } = tile;
        let over = *top - *limit;
        // What stands below the top of a tile, and still above the limit, lies beside it as the head sees it. As a
        // head lies down that is ever farther away.
        let down = over.max(Nm(0)).f64() / self.up.max(0.0);
        let [dx, dy] = self.lean.map(|lean| (lean * down) as i64);
        let r = self.radius.0;
        let reaches = |lo: i64, hi: i64, d: i64, from: i64, to: i64| {
            lo.saturating_add(d.min(0)).saturating_sub(1) <= to + r
                && from - r <= hi.saturating_add(d.max(0)).saturating_add(1)
        };
        let is_near = reaches(area.lo.x, area.hi.x, dx, path.lo.x, path.hi.x)
            && reaches(area.lo.y, area.hi.y, dy, path.lo.y, path.hi.y);
        is_near.then_some(over)
    }
}

impl Clearance {
    /// How far the head comes too near to the part as turned where its field's centre goes straight from one of `ends` to
    /// the other, nm; 0 or less where it keeps clear, the least number where no tile is near.
    pub fn over_turned(&self, turn: &Turn, ends: [[f64; 3]; 2]) -> Nm {
        let [x, y, z] = turn.rows();
        let way = Way { ends, lean: [-x[2], -y[2]], up: z[2], radius: self.radius, gap: self.gap };
        // A piece that holds the whole way, and what rounding of the places on it may do, is as near to every tile as
        // any piece of it, or nearer. A tile that does not rise into the head there rises into it nowhere.
        let whole = way.piece(0, PIECES).grown(Nm(1));
        let mut clear = Nm::MIN;
        let mut doubtful = Vec::new();
        for (area, top) in &self.tiles {
            let tile = TurnedTile::new(area, *top, turn);
            match way.over(&tile, &whole) {
                // It may touch, and is looked at piece by piece.
                Some(over) if over > Nm(0) => doubtful.push(tile),
                // It keeps clear even of the box about the whole way.
                Some(over) => clear = clear.max(over),
                None => {}
            }
        }
        if doubtful.is_empty() {
            return clear;
        }
        let pieces = if ends[0] == ends[1] { 1 } else { PIECES };
        // A piece more on both sides, so that another division of the way finds nothing nearer.
        let wider = (0..pieces).map(|i| way.piece(i.saturating_sub(1), i + 2));
        let over = |piece: Piece| doubtful.iter().filter_map(|tile| way.over(tile, &piece)).max();
        wider.map(|piece| over(piece).unwrap_or(Nm::MIN)).max().unwrap_or(Nm::MIN)
    }
}

impl Head<'_> {
    /// How far the head comes too near to the part on the straight way of the stage from `a` to `b` at one tilt; 0 or
    /// less where it keeps clear, the least number where no tile is near.
    pub(crate) fn over_way(&self, tilt: TiltAngles, a: Commanded, b: Commanded) -> Nm {
        let turn = self.machine.turn(tilt, self.origin);
        let ends = [a, b].map(|at| turn.apply(self.machine.field_centre(at, tilt, self.origin)).at);
        self.clearance.over_turned(&turn, ends)
    }
    /// How far the head comes too near, at most, to the highest place of the part while its axes turn from one tilt to
    /// another, the stage at `z` (as commanded, nm) and anywhere in x and y. For axes that carry the head.
    pub fn over_swing(&self, from: TiltAngles, to: TiltAngles, z: i64) -> Nm {
        let Some(top) = self.clearance.tiles.iter().map(|t| t.1).max() else { return Nm::MIN };
        let Some(axes) = &self.machine.tilt else { return Nm::MIN };
        let gap = self.clearance.gap.f64();
        let r = self.clearance.radius.f64();
        let pivot = axes.pivot.map(|p| p.as_mm() * NM_PER_MM);
        let corners = [[-r, -r], [r, -r], [-r, r], [r, r]].map(|[x, y]| [x - pivot[0], y - pivot[1], gap - pivot[2]]);
        let far = corners.iter().map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt()).fold(0.0, f64::max);
        let swept = [0, 1].map(|k| ((from[k] - to[k]) as f64 * 1e-6).to_radians().abs());
        // Between two angles that are looked at no corner goes farther than its distance from the pivot times half of
        // what lies between them, for either axis.
        let unseen = far * (swept[0] + swept[1]) / f64::from(2 * STEPS);
        let angle = |k: usize, i: u32| from[k] + (to[k] - from[k]) * i64::from(i) / i64::from(STEPS);
        let steps = [0, 1].map(|k| if from[k] == to[k] { 0 } else { STEPS });
        let mut lowest = f64::INFINITY;
        // The axes need not arrive together: all pairs of their angles may occur.
        for i in 0..=steps[0] {
            for j in 0..=steps[1] {
                let up = self.machine.turn(TiltAngles([angle(0, i), angle(1, j)]), Origin::default());
                // Of the head turned by R, the z of R d is the z of the turned frame's inverse.
                for d in corners {
                    lowest = lowest.min(up.back(P3::new(d)).at[2]);
                }
            }
        }
        let stands = (self.machine.stage.z.sign() * z - self.origin[2]) as f64 + pivot[2];
        top - Nm::floor(stands + lowest - unseen)
    }

    /// How much too near it comes on the way of the stage programs from one stop to the next, without a lift: x, y and
    /// the tilt axes together, then z.
    pub fn over_move(&self, from: (Commanded, TiltAngles), to: (Commanded, TiltAngles)) -> Nm {
        let ((a, before), (b, tilt)) = (from, to);
        let over = Commanded([b[0], b[1], a[2]]);
        let across = if before == tilt { self.over_way(tilt, a, over) } else { self.over_swing(before, tilt, a[2]) };
        across.max(self.over_way(tilt, over, b))
    }

    /// How much too near it comes between a stop and the end of travel above it.
    pub fn over_lift(&self, tilt: TiltAngles, at: Commanded) -> Nm {
        self.over_way(tilt, Commanded([at[0], at[1], self.machine.retract_z().0]), at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Box2;
    use crate::math;
    use crate::units::Length;

    /// A head 50 mm wide, 20 mm above its focal plane with 10 mm to be kept, over a plate with a mast.
    fn machine() -> Machine {
        let mut machine = Machine::built_in("xyz-headtilt-galvo-40").expect("a profile");
        machine.lens.diameter = Length::mm(50.0);
        machine.lens.working_distance = Length::mm(20.0);
        machine
    }

    fn mm(v: f64) -> i64 {
        (v * NM_PER_MM) as i64
    }

    fn tile(lo: [f64; 2], hi: [f64; 2], top: f64) -> (Box2, Nm) {
        let corner = |p: [f64; 2]| P2::new(mm(p[0]), mm(p[1]));
        (Box2 { lo: corner(lo), hi: corner(hi) }, Nm(mm(top)))
    }

    #[test]
    fn a_leaning_head_is_lifted_along_z_past_what_it_leans_over() {
        let machine = machine();
        let level = TiltAngles::UPRIGHT;
        let leaning = machine.tilt.as_ref().expect("axes").commands([0.3, 0.0, 1.0]);
        let at = |x: f64, tilt: TiltAngles| {
            let turn = machine.turn(tilt, Origin::default()).apply(P3::new([x * NM_PER_MM, 0.0, 0.0])).at;
            machine.stand(tilt, P2::new(turn[0] as i64, turn[1] as i64), Nm(turn[2] as i64), Origin::default()).stage
        };
        // The head leans to +x, over a mast that an upright one does not reach, and that stands 60 mm high.
        let clearance = Clearance::new(&[tile([31.0, -5.0], [33.0, 5.0], 60.0)], &machine);
        let head = Head { machine: &machine, origin: Origin::default(), clearance: &clearance };
        assert!(head.over_lift(level, at(0.0, level)) <= Nm(0));
        assert!(head.over_lift(leaning, at(0.0, leaning)) > Nm(0));
        assert!(head.over_lift(leaning, at(-40.0, leaning)) <= Nm(0));
        assert!(head.over_move((at(-40.0, level), level), (at(-40.0, leaning), leaning)) > Nm(0), "it must lift first");
    }

    #[test]
    fn the_lower_part_of_a_wall_that_a_table_has_turned_lies_beside_its_top() {
        let machine = machine();
        let clearance = Clearance::new(&[tile([0.0, -5.0], [1.0, 5.0], 300.0)], &machine);
        let table = Machine::built_in("xyz-tilt-galvo-40").expect("a profile");
        let lean = table.tilt.as_ref().expect("axes").commands([
            math::sin(20f64.to_radians()),
            0.0,
            math::cos(20f64.to_radians()),
        ]);
        let turn = table.turn(lean, Origin::default());
        // Where the wall stands 100 mm high, 200 mm below its top. The head is 50 mm wide.
        let wall = turn.apply(P3::new([0.0, 0.0, 100.0 * NM_PER_MM])).at;
        let top = turn.apply(P3::new([0.0, 0.0, 300.0 * NM_PER_MM])).at;
        assert!((wall[0] - top[0]).abs() > 60.0 * NM_PER_MM, "{wall:?} {top:?}");
        let over = |below: f64, beside: f64| {
            let at = [wall[0], wall[1] + beside * NM_PER_MM, wall[2] - below * NM_PER_MM];
            clearance.over_turned(&turn, [at; 2])
        };
        // The lower end keeps 10 mm above the focal plane.
        assert!(over(12.0, 0.0) > Nm(0));
        assert!(over(12.0, 100.0) <= Nm(0));
        assert!(over(-400.0, 0.0) <= Nm(0));
    }

    #[test]
    fn a_head_that_lies_down_is_near_to_whatever_rises_above_it() {
        let machine = machine();
        let clearance = Clearance::new(&[tile([1e4, -5.0], [1.1e4, 5.0], 300.0)], &machine);
        let head = Head { machine: &machine, origin: Origin::default(), clearance: &clearance };
        let near =
            |deg: f64| head.over_way(TiltAngles([(deg * 1e6) as i64, 0]), Commanded::default(), Commanded::default());
        assert!(near(0.0) < Nm(0));
        for deg in [90.0, 90.0 - 1e-6, 95.0] {
            assert!(near(deg).max(near(-deg)) > Nm(0), "{deg}");
        }
    }

    #[test]
    fn the_lowest_corner_of_a_swinging_head_decides() {
        let machine = machine();
        let clearance = Clearance::new(&[tile([0.0, 0.0], [1.0, 1.0], 0.0)], &machine);
        let head = Head { machine: &machine, origin: Origin::default(), clearance: &clearance };
        let to = TiltAngles([0, 20_000_000]);
        // 240 mm below the pivot and 25 mm beside it, turned by 20 deg about y.
        let (s, c) = math::sin_cos(20f64.to_radians());
        // It is lowest where the corner is below the pivot.
        let lowest = 250.0 - math::hypot(240f64, 25.0);
        let nearer = |z: f64| head.over_swing(TiltAngles::UPRIGHT, to, mm(z)).mm();
        // What is not seen between the steps is 242 mm times 20 deg / 32.
        let unseen = (240f64.powi(2) + 2.0 * 25f64.powi(2)).sqrt() * 20f64.to_radians() / 32.0;
        let exact = |z: f64| unseen - (z + lowest);
        assert!((nearer(50.0) - exact(50.0)).abs() < 0.05, "{} {}", nearer(50.0), exact(50.0));
        assert!(nearer(50.0) < 0.0 && nearer(-20.0) > 0.0);
        assert_eq!(head.over_swing(to, to, 0).mm().signum(), -(250.0 - 240.0 * c - 25.0 * s).signum());
    }
}

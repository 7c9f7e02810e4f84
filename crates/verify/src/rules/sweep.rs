//! What a head with a round lower end sweeps along a straight way, and which facets rise into it.
//!
//! At a place of the way a facet is cut at the height of the lower end; what is left above it is a convex polygon, and
//! the facet rises into the head if that polygon lies nearer to the optical axis than the head's radius. Facet and way
//! are straight, so that distance is a convex function of the place on the way: its least value is found by sections.

use crate::geometry::BoxNm;
use terrace_core::math;

/// Sections by which the nearest place on a way is found. Each leaves 0.618 of the way: of 4 m less than a nanometre.
const SECTIONS: usize = 50;

/// Halvings by which is found how far a facet rises: of 4 m they leave 4 m / 2^42, less than a nanometre.
const HALVINGS: usize = 42;

/// The way of a head.
pub(crate) struct Sweep {
    /// Places of the lower end on the optical axis where the way begins and ends, nm.
    ends: [[f64; 3]; 2],
    /// Radius of the head, nm.
    reach: f64,
    /// The box around it all.
    pub(crate) bounds: BoxNm,
}

impl Sweep {
    pub(crate) fn new(ends: [[f64; 3]; 2], reach: f64) -> Self {
        let mut bounds = BoxNm::EMPTY;
        ends.iter().for_each(|&[x, y, _]| bounds.add([x, y]));
        Self { ends, reach, bounds: bounds.grown(reach) }
    }

    /// By how much a facet rises into the head; None where by no more than `least`.
    pub(crate) fn rise(&self, corners: &[[f64; 3]; 3], least: f64) -> Option<f64> {
        if !self.rises(corners, least) {
            return None;
        }
        let lowest = self.ends[0][2].min(self.ends[1][2]);
        let (mut low, mut high) = (least, highest(corners) - lowest);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if self.rises(corners, middle) { low = middle } else { high = middle }
        }
        Some(high)
    }

    /// Whether a facet rises into the head by more than `least`.
    fn rises(&self, corners: &[[f64; 3]; 3], least: f64) -> bool {
        let mut around = BoxNm::EMPTY;
        corners.iter().for_each(|&[x, y, _]| around.add([x, y]));
        let Some([from, to]) = self.over(&around, highest(corners) - least) else { return false };
        let from_axis = |t: f64| {
            let [x, y, z] = self.at(t);
            distance([x, y], &above(corners, z + least))
        };
        least_value(from_axis, from, to, self.reach) < self.reach
    }

    /// Whether anything in a box whose highest place is `top` can rise into the head.
    pub(crate) fn may_meet(&self, around: &BoxNm, top: f64) -> bool {
        self.over(around, top).is_some()
    }

    /// The stretch of the way, from 0 to 1, on which the square around the head is over a box and the lower end is
    /// lower than `top`.
    fn over(&self, around: &BoxNm, top: f64) -> Option<[f64; 2]> {
        let mut stretch = [0.0f64, 1.0];
        for k in 0..2 {
            stretch = self.within(stretch, k, around.lo[k] - self.reach, around.hi[k] + self.reach);
        }
        stretch = self.within(stretch, 2, f64::NEG_INFINITY, top);
        (stretch[0] <= stretch[1] && self.ends.iter().any(|end| end[2] < top)).then_some(stretch)
    }

    /// The part of a stretch of the way whose coordinate `k` lies between `lo` and `hi`; from 1 to 0 where there is
    /// none.
    fn within(&self, stretch: [f64; 2], k: usize, lo: f64, hi: f64) -> [f64; 2] {
        let start = self.ends[0][k];
        let way = self.ends[1][k] - start;
        if way == 0.0 {
            return if start < lo || start > hi { [1.0, 0.0] } else { stretch };
        }
        let [a, b] = [(lo - start) / way, (hi - start) / way];
        [stretch[0].max(a.min(b)), stretch[1].min(a.max(b))]
    }

    /// The place of the lower end at `t` of the way.
    fn at(&self, t: f64) -> [f64; 3] {
        [0, 1, 2].map(|k| self.ends[0][k] + t * (self.ends[1][k] - self.ends[0][k]))
    }
}

fn highest(corners: &[[f64; 3]; 3]) -> f64 {
    corners.iter().map(|p| p[2]).fold(f64::NEG_INFINITY, f64::max)
}

/// The least value of a convex function between two places by golden sections, or one below `enough`.
fn least_value(off: impl Fn(f64) -> f64, mut from: f64, mut to: f64, enough: f64) -> f64 {
    let section = (5f64.sqrt() - 1.0) / 2.0;
    // The least value lies between `from` and `to`; `at` are the two places that divide what is left, and `found` their
    // values. Each section keeps one of them, so that one value a section is computed.
    let mut at = [to - section * (to - from), from + section * (to - from)];
    let mut found = at.map(&off);
    let mut least = off(from).min(off(to)).min(found[0]).min(found[1]);
    for _ in 0..SECTIONS {
        if least < enough || from >= to {
            break;
        }
        if found[0] <= found[1] {
            (to, at[1], found[1]) = (at[1], at[0], found[0]);
            at[0] = to - section * (to - from);
            found[0] = off(at[0]);
        } else {
            (from, at[0], found[0]) = (at[0], at[1], found[1]);
            at[1] = from + section * (to - from);
            found[1] = off(at[1]);
        }
        least = least.min(found[0]).min(found[1]);
    }
    least
}

/// The part of a facet that is not below `z`, as a ring in the plane.
fn above(corners: &[[f64; 3]; 3], z: f64) -> Vec<[f64; 2]> {
    let mut ring = Vec::with_capacity(4);
    for (i, p) in corners.iter().enumerate() {
        let q = &corners[(i + 1) % 3];
        if p[2] >= z {
            ring.push([p[0], p[1]]);
        }
        if (p[2] < z && q[2] > z) || (p[2] > z && q[2] < z) {
            let t = (z - p[2]) / (q[2] - p[2]);
            ring.push([0, 1].map(|k| p[k] + t * (q[k] - p[k])));
        }
    }
    ring
}

/// How far a place lies from a convex polygon; infinitely far from one without corners.
fn distance(p: [f64; 2], ring: &[[f64; 2]]) -> f64 {
    let edges = || ring.iter().zip(ring.iter().cycle().skip(1));
    let side = |(a, b): (&[f64; 2], &[f64; 2])| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    if ring.len() > 2 && (edges().all(|e| side(e) > 0.0) || edges().all(|e| side(e) < 0.0)) {
        return 0.0;
    }
    edges().map(|(a, b)| from_edge(p, *a, *b)).fold(f64::INFINITY, f64::min)
}

fn from_edge(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (edge, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = edge[0] * edge[0] + edge[1] * edge[1];
    let t = if square > 0.0 { ((edge[0] * to[0] + edge[1] * to[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    math::hypot(to[0] - t * edge[0], to[1] - t * edge[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const REACH: f64 = 50.0;

    fn rise(facet: [[f64; 3]; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
        Sweep::new([a, b], REACH).rise(&facet, 0.0).unwrap_or(0.0)
    }

    /// A small level facet at a height of 17.
    fn chip(x: f64, y: f64) -> [[f64; 3]; 3] {
        [[x, y, 17.0], [x + 0.1, y, 17.0], [x, y + 0.1, 17.0]]
    }

    #[test]
    fn a_way_is_cut_at_two_places_of_an_axis() {
        let way = Sweep::new([[0.0; 3], [100.0, 0.0, 10.0]], REACH);
        assert_eq!(way.within([0.0, 1.0], 0, 25.0, 50.0), [0.25, 0.5]);
        assert_eq!(way.within([0.0, 0.4], 2, f64::NEG_INFINITY, 5.0), [0.0, 0.4]);
        assert_eq!(way.within([0.0, 1.0], 1, 1.0, 2.0), [1.0, 0.0], "beside it");
    }

    #[test]
    fn a_standing_head_is_round() {
        let stands = [0.0, 0.0, 10.0];
        for (x, y) in [(0.0, 0.0), (49.9, 0.0), (-50.0, 0.0), (35.3, 35.3), (-35.4, -35.4)] {
            assert!((rise(chip(x, y), stands, stands) - 7.0).abs() < 1e-6, "{x} {y}");
        }
        for (x, y) in [(50.1, 0.0), (-50.2, 0.0), (35.5, 35.5), (49.0, 49.0), (-36.0, -36.0)] {
            assert_eq!(rise(chip(x, y), stands, stands), 0.0, "{x} {y}");
        }
        assert_eq!(rise(chip(0.0, 0.0), [0.0, 0.0, 17.0], [0.0, 0.0, 17.0]), 0.0);
    }

    #[test]
    fn a_way_is_a_band_with_round_ends() {
        let (a, b) = ([0.0, 0.0, 10.0], [300.0, 300.0, 10.0]);
        // 49 and 52 beside the middle of the way, and beyond its begin.
        let s = 0.5f64.sqrt();
        for (x, y) in [(150.0 - 49.0 * s, 150.0 + 49.0 * s), (-49.0 * s, -49.0 * s), (350.0 - 0.1, 300.0)] {
            assert!((rise(chip(x, y), a, b) - 7.0).abs() < 1e-6, "{x} {y}");
        }
        for (x, y) in [(150.0 - 52.0 * s, 150.0 + 52.0 * s), (-52.0 * s, -52.0 * s), (351.0, 300.0), (-40.0, -40.0)] {
            assert_eq!(rise(chip(x, y), a, b), 0.0, "{x} {y}");
        }
    }

    #[test]
    fn edges_walls_and_wide_facets_rise_as_high_as_they_stand_in_the_circle() {
        let stands = [0.0, 0.0, 10.0];
        let blade = [[49.0, -1000.0, 0.0], [49.0, 1000.0, 100.0], [400.0, 0.0, 0.0]];
        let exact = 40.0 + 0.05 * (50f64.powi(2) - 49f64.powi(2)).sqrt();
        assert!((rise(blade, stands, stands) - exact).abs() < 1e-6);
        assert_eq!(rise(blade.map(|[x, y, z]| [x + 2.0, y, z]), stands, stands), 0.0);
        let wall = |x: f64| [[x, -9.0, 0.0], [x, 9.0, 0.0], [x, 0.0, 30.0]];
        assert!((rise(wall(49.0), stands, stands) - 20.0).abs() < 1e-6);
        assert_eq!(rise(wall(50.5), stands, stands), 0.0);
        let fin = [[40.0, 0.0, 0.0], [60.0, 0.0, 0.0], [60.0, 0.0, 40.0]];
        assert!((rise(fin, stands, stands) - 10.0).abs() < 1e-6);
        let plain = [[-9e3, -9e3, 12.0], [9e3, -9e3, 12.0], [0.0, 9e3, 12.0]];
        assert!((rise(plain, stands, stands) - 2.0).abs() < 1e-6);
        let ramp = plain.map(|[x, y, _]| [x, y, 0.75 * (0.6 * x + 0.8 * y)]);
        assert!((rise(ramp, stands, stands) - 27.5).abs() < 1e-6);
    }

    #[test]
    fn a_head_that_comes_down_along_its_way_meets_what_stands_beside_its_end() {
        let (up, end) = ([200.0, 0.0, 210.0], [0.0, 0.0, 10.0]);
        // Over x = 60 the lower end is 10 lower where the disc first leaves it, at an axis of x = 10.
        assert!((rise([[60.0, 0.0, 25.0], [60.1, 0.0, 25.0], [60.0, 0.1, 25.0]], up, end) - 5.0).abs() < 0.11);
        assert_eq!(rise([[60.0, 0.0, 19.9], [60.1, 0.0, 19.9], [60.0, 0.1, 19.9]], up, end), 0.0);
        assert_eq!(rise([[-51.0, 0.0, 90.0], [-50.1, 0.0, 90.0], [-51.0, 0.1, 90.0]], up, end), 0.0);
    }
}

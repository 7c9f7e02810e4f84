//! The facets of a part against a head whose lower end is round: exact, for what the boxes do not let pass.
//!
//! A head is everything within a radius of the optical axis and above the lower end of the lens. That it goes straight
//! over a part is the same as that it stands and the part goes the other way. A facet that goes sweeps a prism, and the
//! highest place of a prism under the head lies on one of its sides: the facet at either end of the way, or what one of
//! its edges sweeps. So all that is needed is the highest place of a triangle over a disc.

use crate::math;
use std::ops::Range;

use crate::geom::{P3, Turn};

/// Calls its argument with the corners, nm, part frame, of every facet of a surface.
pub type EachFacet<'a> = &'a dyn Fn(&mut dyn FnMut([[f64; 3]; 3]));

/// Facets in a leaf of the tree.
const LEAF: usize = 8;

/// A straight way of a head over a part.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// How the part lies under the head.
    pub turn: Turn,
    /// Where the way begins and ends: what the part must stay below, on the optical axis, part as turned, nm.
    pub ends: [[f64; 3]; 2],
    /// Radius of the head, nm.
    pub radius: f64,
}

/// A place of the part that is too high for a head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrusion {
    /// By how much, along the optical axis, nm.
    pub by: f64,
    /// The place.
    pub at: P3,
}

/// A place from the begin of a head's way, part as turned, and the same place in the part frame.
type HeadPoint = [f64; 6];

impl Way {
    /// The highest place of a facet that enters the head by more than `least`.
    fn entered(&self, corners: &[[f64; 3]; 3], least: f64) -> Option<Intrusion> {
        let goes = [0, 1, 2].map(|k| self.ends[1][k] - self.ends[0][k]);
        let first = corners.map(|p| {
            let [x, y, z] = self.turn.apply(P3::new(p)).at;
            let [x0, y0, z0] = self.ends[0];
            [x - x0, y - y0, z - z0, p[0], p[1], p[2]]
        });
        let mut highest = highest(first, self.radius);
        if goes != [0.0; 3] {
            let last = first.map(|s: HeadPoint| [s[0] - goes[0], s[1] - goes[1], s[2] - goes[2], s[3], s[4], s[5]]);
            let sides = [0, 1, 2].map(|i| (i, (i + 1) % 3));
            let swept = sides.iter().flat_map(|&(i, j)| [[first[i], first[j], last[i]], [first[j], last[j], last[i]]]);
            let others = swept.chain([last]).filter_map(|triangle| self::highest(triangle, self.radius));
            highest = highest.into_iter().chain(others).reduce(|a, b| if b[2] > a[2] { b } else { a });
        }
        let [_, _, by, x, y, z] = highest?;
        (by > least).then_some(Intrusion { by, at: P3::new([x, y, z]) })
    }

    /// By how much what lies in a box can enter at most.
    fn most(&self, [lo, hi]: [[f64; 3]; 2]) -> f64 {
        let middle = self.turn.apply(P3::new([0, 1, 2].map(|k| f64::midpoint(lo[k], hi[k])))).at;
        let rows = self.turn.rows();
        let half = [0, 1, 2].map(|i| (0..3).map(|k| rows[i][k].abs() * (hi[k] - lo[k]) / 2.0).sum::<f64>());
        let [a, b] = self.ends;
        // From where to where on the way the head is over the box, at most.
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for k in 0..2 {
            let [near, far] = [-1.0, 1.0].map(|side| middle[k] - a[k] + side * (half[k] + self.radius));
            let goes = b[k] - a[k];
            if goes == 0.0 && (near > 0.0 || far < 0.0) {
                return f64::NEG_INFINITY;
            }
            if goes != 0.0 {
                (from, to) = (from.max((near / goes).min(far / goes)), to.min((near / goes).max(far / goes)));
            }
        }
        let z = |t: f64| a[2] + t * (b[2] - a[2]);
        if from > to { f64::NEG_INFINITY } else { middle[2] + half[2] - z(from).min(z(to)) }
    }
}

/// The highest place of a triangle over the disc around the origin; None where none lies over it.
fn highest(triangle: [HeadPoint; 3], radius: f64) -> Option<HeadPoint> {
    let edges = [0, 1, 2].into_iter().flat_map(|i| over_disc(triangle[i], triangle[(i + 1) % 3], radius));
    edges.chain(uphill(triangle, radius)).reduce(|a, b| if b[2] > a[2] { b } else { a })
}

/// The two ends of what lies of an edge over the disc.
fn over_disc(a: HeadPoint, b: HeadPoint, radius: f64) -> impl Iterator<Item = HeadPoint> {
    let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    let (square, along) = (dx * dx + dy * dy, a[0] * dx + a[1] * dy);
    let beyond = a[0] * a[0] + a[1] * a[1] - radius * radius;
    let root = along * along - square * beyond;
    let [from, to] = if square == 0.0 {
        if beyond > 0.0 { [1.0, 0.0] } else { [0.0, 1.0] }
    } else if root < 0.0 {
        [1.0, 0.0]
    } else {
        [((-along - root.sqrt()) / square).max(0.0), ((-along + root.sqrt()) / square).min(1.0)]
    };
    let at = move |t: f64| std::array::from_fn(|k| a[k] + t * (b[k] - a[k]));
    [from, to].into_iter().filter(move |_| from <= to).map(at)
}

/// Where the rim of the disc lies farthest uphill, if that is in the triangle; the middle of the disc where the
/// triangle is level.
fn uphill([p, q, r]: [HeadPoint; 3], radius: f64) -> Option<HeadPoint> {
    let [u, v]: [HeadPoint; 2] = [q, r].map(|c| std::array::from_fn(|k| c[k] - p[k]));
    let area = u[0] * v[1] - u[1] * v[0];
    let up = [u[2] * v[1] - v[2] * u[1], v[2] * u[0] - u[2] * v[0]].map(|v| v * area.signum());
    let steep = math::hypot(up[0], up[1]);
    let [x, y] = if steep == 0.0 { [0.0; 2] } else { up.map(|v| radius * v / steep) };
    let [x, y] = [x - p[0], y - p[1]];
    let [s, t] = [(x * v[1] - y * v[0]) / area, (u[0] * y - u[1] * x) / area];
    let is_inside = area != 0.0 && s >= 0.0 && t >= 0.0 && s + t <= 1.0;
    is_inside.then(|| std::array::from_fn(|k| p[k] + s * u[k] + t * v[k]))
}

/// A box around facets; the child that follows it in the list has the first half of them.
struct Node {
    around: [[f64; 3]; 2],
    facets: Range<usize>,
    /// The child with the second half; 0 of a leaf.
    second: usize,
}

/// Facets of a part, found by where they lie.
pub struct Facets {
    facets: Vec<[[f64; 3]; 3]>,
    nodes: Vec<Node>,
}

impl Facets {
    /// The facets of a surface that rise above `lowest`, nm.
    pub fn above(lowest: f64, each: EachFacet<'_>) -> Self {
        let mut facets = Vec::new();
        each(&mut |corners| {
            if corners.iter().any(|p| p[2] > lowest) {
                facets.push(corners);
            }
        });
        let all = 0..facets.len();
        let mut tree = Self { facets, nodes: Vec::new() };
        if !all.is_empty() {
            tree.grow(all);
        }
        tree
    }

    /// Appends the nodes of some facets, which are sorted by that.
    fn grow(&mut self, facets: Range<usize>) {
        let mut around = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for p in self.facets[facets.clone()].iter().flatten() {
            (0..3).for_each(|k| (around[0][k], around[1][k]) = (around[0][k].min(p[k]), around[1][k].max(p[k])));
        }
        let node = self.nodes.len();
        self.nodes.push(Node { around, facets: facets.clone(), second: 0 });
        if facets.len() <= LEAF {
            return;
        }
        let size = |k: usize| around[1][k] - around[0][k];
        let axis = (1..3).fold(0, |widest, k| if size(k) > size(widest) { k } else { widest });
        let middle = |facet: &[[f64; 3]; 3]| facet.iter().map(|p| p[axis]).sum::<f64>();
        let half = facets.len() / 2;
        self.facets[facets.clone()].select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
        self.grow(facets.start..facets.start + half);
        self.nodes[node].second = self.nodes.len();
        self.grow(facets.start + half..facets.end);
    }

    /// The place that enters a head farthest on its way, if any does.
    pub fn entered(&self, way: &Way) -> Option<Intrusion> {
        let mut worst = None;
        if !self.nodes.is_empty() {
            self.search(0, way, &mut worst);
        }
        worst
    }

    /// Looks below a node for a place that enters farther than `worst`.
    fn search(&self, node: usize, way: &Way, worst: &mut Option<Intrusion>) {
        let least = |worst: &Option<Intrusion>| worst.map_or(0.0, |w| w.by);
        let Node { around, facets, second } = &self.nodes[node];
        if way.most(*around) <= least(worst) {
            return;
        }
        if *second == 0 {
            for facet in &self.facets[facets.clone()] {
                *worst = way.entered(facet, least(worst)).or(*worst);
            }
            return;
        }
        // What can enter farther is looked at first: it may settle the other.
        let mut children = [node + 1, *second];
        if way.most(self.nodes[children[1]].around) > way.most(self.nodes[children[0]].around) {
            children.reverse();
        }
        children.into_iter().for_each(|child| self.search(child, way, worst));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What enters a head of radius 50 that goes from `a` to `b`, its lower end at z.
    fn entered(facets: &[[[f64; 3]; 3]], a: [f64; 3], b: [f64; 3]) -> Option<Intrusion> {
        let all = Facets::above(f64::NEG_INFINITY, &|sink| facets.iter().for_each(|f| sink(*f)));
        all.entered(&Way { turn: Turn::none(), ends: [a, b], radius: 50.0 })
    }

    fn by(facets: &[[[f64; 3]; 3]], a: [f64; 3], b: [f64; 3]) -> f64 {
        entered(facets, a, b).map_or(0.0, |e| e.by)
    }

    /// The level square with sides of 2 around a place.
    fn top([x, y]: [f64; 2], z: f64) -> [[[f64; 3]; 3]; 2] {
        let corner = |i: f64, j: f64| [x + i, y + j, z];
        let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        [[a, b, c], [a, c, d]]
    }

    #[test]
    fn a_pillar_in_the_corner_of_the_square_does_not_enter_the_circle() {
        let stands = [0.0, 0.0, 10.0];
        assert_eq!(by(&top([40.0, 40.0], 17.0), stands, stands), 0.0, "its near corner is 55 away");
        // The near corner of the pillar lies at 49.9 and at 50.1.
        let near = |far: f64| [far / 2f64.sqrt() + 1.0; 2];
        assert_eq!(by(&top(near(50.1), 17.0), stands, stands), 0.0);
        let found = entered(&top(near(49.9), 17.0), stands, stands).expect("it enters");
        let [x, y, z] = found.at.at;
        assert!((found.by, z) == (7.0, 17.0) && math::hypot(x, y) <= 50.0 + 1e-9, "{found:?}");
        assert_eq!(by(&top([0.0, 0.0], 10.0), stands, stands), 0.0, "what reaches the lower end does not enter");
    }

    #[test]
    fn a_way_sweeps_a_circle_at_its_ends_and_a_band_between_them() {
        let (a, b) = ([0.0, 0.0, 10.0], [300.0, 300.0, 10.0]);
        let beside = |along: f64, across: f64| {
            let s = 0.5f64.sqrt();
            by(&top([s * (along - across), s * (along + across)], 17.0), a, b)
        };
        assert_eq!(beside(200.0, 51.0 - 0.1), 7.0, "a corner reaches into the band");
        assert_eq!(beside(200.0, 51.5), 0.0);
        assert_eq!(beside(-49.0, 0.0), 7.0);
        assert_eq!(beside(-52.0, 0.0), 0.0);
        // The corner of the square that sweeps, which the circle never reaches.
        assert_eq!(by(&top([-40.0, -40.0], 17.0), a, b), 0.0);
        assert_eq!(by(&top([-30.0, -30.0], 17.0), a, b), 7.0);
    }

    #[test]
    fn an_edge_enters_whose_ends_lie_outside_and_a_facet_larger_than_the_head() {
        let stands = [0.0, 0.0, 10.0];
        // The edge x = 49 from z 0 to 100: it enters at y² < 50² - 49².
        let blade = [[49.0, -1000.0, 0.0], [49.0, 1000.0, 100.0], [400.0, 0.0, 0.0]];
        let y = (50f64.powi(2) - 49f64.powi(2)).sqrt();
        assert!((by(&[blade], stands, stands) - (40.0 + 0.05 * y)).abs() < 1e-9);
        assert_eq!(by(&[blade.map(|[x, y, z]| [x + 2.0, y, z])], stands, stands), 0.0);
        let plain = [[-9e3, -9e3, 12.0], [9e3, -9e3, 12.0], [0.0, 9e3, 12.0]];
        let found = entered(&[plain], stands, stands).expect("it enters");
        assert!((found.by - 2.0).abs() < 1e-9 && math::hypot(found.at[0], found.at[1]) < 1e-6, "{found:?}");
        // It rises by 3 in 4 towards (3, 4).
        let ramp = plain.map(|[x, y, _]| [x, y, 0.75 * (0.6 * x + 0.8 * y)]);
        let found = entered(&[ramp], stands, stands).expect("it enters");
        assert!((found.by - 27.5).abs() < 1e-9 && (found.at[0] - 30.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn an_upright_wall_enters_as_high_as_it_stands_within_the_circle() {
        let stands = [0.0, 0.0, 10.0];
        let wall = |x: f64| [[[x, -9.0, 0.0], [x, 9.0, 0.0], [x, 0.0, 30.0]]];
        assert_eq!(by(&wall(49.0), stands, stands), 20.0);
        assert_eq!(by(&wall(50.5), stands, stands), 0.0);
        // A wall that points to the axis, of which the circle cuts off what lies beyond 50.
        let fin = [[[40.0, 0.0, 0.0], [60.0, 0.0, 0.0], [60.0, 0.0, 40.0]]];
        assert!((by(&fin, stands, stands) - 10.0).abs() < 1e-9);
        let post = [[[49.0, 0.0, 0.0], [49.0, 0.0, 5.0], [49.0, 0.0, 30.0]]];
        assert_eq!(by(&post, stands, stands), 20.0);
    }

    /// A sloping way, against the facet looked at from many places of the way.
    #[test]
    fn a_sloping_way_is_as_near_as_the_nearest_place_on_it() {
        let mut seed = 1u64;
        let mut random = |size: f64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((seed >> 33) as f64 / f64::from(1u32 << 31) - 0.5) * size
        };
        let mut entering = 0;
        for _ in 0..300 {
            let facet = [0; 3].map(|_| [0; 3].map(|_| random(200.0)));
            let [a, b] = [0; 2].map(|_| [random(300.0), random(300.0), random(100.0)]);
            let found = by(&[facet], a, b);
            let at = |i: i32| [0, 1, 2].map(|k| a[k] + f64::from(i) / 1e3 * (b[k] - a[k]));
            let sampled = (0..=1000).map(|i| by(&[facet], at(i), at(i))).fold(0.0, f64::max);
            assert!(found >= sampled - 1e-9 && found <= sampled + 3.0, "{found} {sampled}");
            entering += i32::from(found > 0.0);
        }
        assert!((60..240).contains(&entering), "{entering}");
    }

    #[test]
    fn the_tree_finds_what_a_look_at_every_facet_finds() {
        let height = |x: f64, y: f64| 60.0 * (math::sin(x / 37.0) + math::cos(y / 53.0));
        let cells = (0..60).flat_map(|i| (0..60).map(move |j| [f64::from(i) * 10.0, f64::from(j) * 10.0]));
        let at = |x: f64, y: f64| [x, y, height(x, y)];
        let facets: Vec<_> = cells.map(|[x, y]| [at(x, y), at(x + 10.0, y), at(x, y + 10.0)]).collect();
        let tree = Facets::above(f64::NEG_INFINITY, &|sink| facets.iter().for_each(|f| sink(*f)));
        for i in 0..40 {
            let (s, c) = math::sin_cos(f64::from(i));
            let turn = Turn::about([300.0, 300.0, 0.0], [(0, 0.3 * s), (1, 0.3 * c)]);
            let ends = [[300.0 + 250.0 * s, 300.0 + 250.0 * c, 90.0], [300.0 - 200.0 * c, 300.0, 80.0 + 9.0 * s]];
            let way = Way { turn, ends, radius: 50.0 };
            let all = facets.iter().filter_map(|f| way.entered(f, 0.0)).map(|e| e.by).fold(0.0, f64::max);
            assert_eq!(tree.entered(&way).map_or(0.0, |e| e.by), all, "{i}");
        }
    }
}

//! The order of strokes within a block: short jumps.
//!
//! Open strokes may be marked from either end; a closed stroke may begin at any of its vertices. First
//! greedy: from where the beam is to the nearest end or vertex of a stroke. Then improvement by 2-opt and
//! Or-opt, see the `tour` module; last, ends and vertices are chosen for the order that was found.
//! Distances are Euclidean in nm.
//!
//! # Limits
//! Of closed strokes with more than eight vertices the search knows the outermost eight; the last step looks
//! at all. A move changes at most a thousand places. Strokes of all pens are ordered together.

use super::endpoints::{Endpoints, greedy};
use super::kd_tree::Tree;
use super::tour::Tour;
use terrace_core::geom::FieldPoint;

/// A stroke as far as its order needs it.
#[derive(Clone, Copy, Debug)]
pub struct Path<'a> {
    /// Points in the direction of drawing, field frame, nm; one of a dot.
    pub points: &'a [FieldPoint],
    /// Whether it ends where it begins and may begin at any of its vertices.
    pub is_closed: bool,
}

/// One stroke of the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visit {
    /// Index of the stroke.
    pub stroke: u32,
    /// Vertex at which a closed stroke begins and ends; 0 for open ones.
    pub start: u32,
    /// Whether it is marked against the direction of drawing; closed strokes never are.
    pub reversed: bool,
}

/// Most places that one move changes: bounds the cost on huge blocks.
const LONGEST: usize = 1000;
/// Ends looked at around each end.
const NEIGHBOURS: usize = 6;
/// Rounds of choosing ends and of moves.
const ROUNDS: usize = 3;
/// A gain below this, nm, is rounding.
const LEAST: f64 = 0.5;
/// Most vertices of a closed stroke that the search knows.
const CORNERS: usize = 8;

/// Strokes in the order and direction in which they were drawn.
pub fn as_drawn(strokes: usize) -> Vec<Visit> {
    (0..strokes as u32).map(|stroke| Visit { stroke, start: 0, reversed: false }).collect()
}

/// The order in which strokes are marked, the beam starting in the centre of the field.
pub fn order(paths: &[Path<'_>]) -> Vec<Visit> {
    let strokes = StrokeEndpoints::new(paths);
    let StrokeEndpoints { endpoints, places } = &strokes;
    let mut tree = Tree::new(places[1..].iter().map(|endpoint| endpoint.at));
    let seq = greedy(endpoints, &mut tree, |endpoint| places[endpoint as usize].at, square);
    tree.fill();
    let cost = |a: u32, b: u32| {
        let (a, b) = (places[a as usize].at, places[b as usize].at);
        square([a[0] - b[0], a[1] - b[1]]).sqrt()
    };
    let mut tour = Tour::new(endpoints, seq, LONGEST, LEAST, cost, |endpoint, limit, found| {
        nearer(&strokes, &tree, endpoint, limit, found);
    });
    tour.settle();
    // Moves change the order with the endpoints at hand, `settle` the endpoints in the order at hand: each opens ways
    // for the other.
    for _ in 0..ROUNDS {
        if !tour.improve() {
            break;
        }
        tour.settle();
    }
    let mut visits: Vec<Visit> = tour.into_seq()[1..]
        .iter()
        .map(|&endpoint| {
            let stroke = endpoints.item(endpoint) - 1;
            let vertex = places[endpoint as usize].vertex;
            let is_closed = paths[stroke].is_closed;
            Visit {
                stroke: stroke as u32,
                start: if is_closed { vertex } else { 0 },
                reversed: !is_closed && vertex > 0,
            }
        })
        .collect();
    refine(paths, &mut visits);
    visits
}

fn square([x, y]: [f64; 2]) -> f64 {
    x * x + y * y
}

/// The places at which strokes may be entered, as the search knows them: item 0 is the field's centre, stroke i is item
/// i + 1.
struct StrokeEndpoints {
    endpoints: Endpoints,
    /// Every endpoint of these.
    places: Vec<EndpointPlace>,
}

/// Where an endpoint is, nm, and which vertex of its stroke.
struct EndpointPlace {
    at: [f64; 2],
    vertex: u32,
}

impl StrokeEndpoints {
    fn new(paths: &[Path<'_>]) -> Self {
        let size = |p: &Path<'_>| match p.points.len() {
            1 => 1,
            n if p.is_closed => CORNERS.min(n - 1),
            _ => 2,
        };
        let count = paths.iter().map(size).sum::<usize>() + 1;
        let mut strokes =
            Self { endpoints: Endpoints::with_capacity(paths.len() + 1, count), places: Vec::with_capacity(count) };
        strokes.add(0, FieldPoint::AXIS);
        strokes.endpoints.closed(1);
        for path in paths {
            let last = path.points.len() - 1;
            if last == 0 {
                strokes.add(0, path.points[0]);
                strokes.endpoints.closed(1);
            } else if path.is_closed {
                let before = strokes.places.len();
                corners(&path.points[..last], |i| strokes.add(i, path.points[i]));
                strokes.endpoints.closed(strokes.places.len() - before);
            } else {
                strokes.add(0, path.points[0]);
                strokes.add(last, path.points[last]);
                strokes.endpoints.open();
            }
        }
        strokes
    }

    fn add(&mut self, vertex: usize, FieldPoint { x, y }: FieldPoint) {
        self.places.push(EndpointPlace { at: [f64::from(x), f64::from(y)], vertex: vertex as u32 });
    }
}

/// Calls `f` with the vertices that lie outermost in eight directions, or with all if there are few.
fn corners(points: &[FieldPoint], mut f: impl FnMut(usize)) {
    if points.len() <= CORNERS {
        return (0..points.len()).for_each(f);
    }
    // Most jumps come from outside, to one of these or near it; `refine` looks at all vertices in the end.
    let mut most = [(i64::MIN, 0); CORNERS];
    for (i, p) in points.iter().enumerate() {
        let [x, y] = [p.x, p.y].map(i64::from);
        for (best, v) in most.iter_mut().zip([x, x + y, y, y - x, -x, -x - y, -y, x - y]) {
            if v > best.0 {
                *best = (v, i);
            }
        }
    }
    for k in 0..CORNERS {
        if most[..k].iter().all(|m| m.1 != most[k].1) {
            f(most[k].1);
        }
    }
}

/// The nearest endpoints of other strokes that are nearer than `limit`, nearest first.
fn nearer(strokes: &StrokeEndpoints, tree: &Tree<2>, endpoint: u32, limit: f64, found: &mut Vec<(f64, u32)>) {
    found.clear();
    let item = strokes.endpoints.item(endpoint);
    let mut limit = limit * limit;
    let start = endpoint.checked_sub(1);
    tree.around(strokes.places[endpoint as usize].at, start, limit, square, |d, number| {
        // Insertion into a list of at most NEIGHBOURS; once it is full, nothing farther than its last matters.
        if strokes.endpoints.item(number + 1) != item {
            let at = found.partition_point(|&(other, _)| other <= d);
            found.insert(at, (d, number + 1));
            if found.len() > NEIGHBOURS {
                found.pop();
                limit = found[NEIGHBOURS - 1].0;
            }
        }
        limit
    });
    found.iter_mut().for_each(|f| f.0 = f.0.sqrt());
}

/// Lets closed strokes whose vertices were not all known begin where the jumps are shortest.
fn refine(paths: &[Path<'_>], visits: &mut [Visit]) {
    let distance = |a: FieldPoint, b: FieldPoint| {
        let gap = [f64::from(a.x) - f64::from(b.x), f64::from(a.y) - f64::from(b.y)];
        square(gap).sqrt()
    };
    let mut from = FieldPoint::AXIS;
    for i in 0..visits.len() {
        let Visit { stroke, start, .. } = visits[i];
        let path = &paths[stroke as usize];
        let vertices = path.points.split_last().map_or(&[][..], |(_, vertices)| vertices);
        if path.is_closed && vertices.len() > CORNERS {
            // One pass in the order of marking: where the stroke before is left is final, where the next is entered
            // may still move.
            let to = visits.get(i + 1).map(|next| ends(paths, next)[0]);
            let jumps = |p: FieldPoint| distance(from, p) + to.map_or(0.0, |to| distance(p, to));
            let mut best = (jumps(vertices[start as usize]), start);
            for (&p, v) in vertices.iter().zip(0..) {
                let sum = jumps(p);
                if sum < best.0 {
                    best = (sum, v);
                }
            }
            visits[i].start = best.1;
        }
        from = ends(paths, &visits[i])[1];
    }
}

/// Where the beam enters and leaves a stroke.
fn ends(paths: &[Path<'_>], visit: &Visit) -> [FieldPoint; 2] {
    let points = paths[visit.stroke as usize].points;
    let last = points.len() - 1;
    if visit.start > 0 {
        [points[visit.start as usize]; 2]
    } else if visit.reversed {
        [points[last], points[0]]
    } else {
        [points[0], points[last]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::math;
    use terrace_core::random::Random;

    fn jumps(paths: &[Path<'_>], visits: &[Visit]) -> f64 {
        let mut at = FieldPoint::AXIS;
        let mut sum = 0.0;
        for v in visits {
            let [a, b] = ends(paths, v);
            sum += square([f64::from(at.x) - f64::from(a.x), f64::from(at.y) - f64::from(a.y)]).sqrt();
            at = b;
        }
        sum
    }

    fn shuffled<T>(mut list: Vec<T>, seed: u64) -> Vec<T> {
        Random::new(seed).shuffle(&mut list);
        list
    }

    fn line(a: [i32; 2], b: [i32; 2]) -> Vec<FieldPoint> {
        vec![a.into(), b.into()]
    }

    /// Lines between random points.
    fn random(n: usize, seed: u64) -> Vec<Vec<FieldPoint>> {
        let mut random = Random::new(seed);
        let mut v = || random.below(1_000_000) as i32;
        (0..n).map(|_| line([v(), v()], [v(), v()])).collect()
    }

    fn squares(columns: i32, rows: i32, seed: u64) -> Vec<Vec<FieldPoint>> {
        let mm = 1_000_000;
        let cell = |i: i32| {
            let (x, y) = ((i % columns - columns / 2) * mm, (i / columns - rows / 2) * mm);
            let (u, v) = (x + 600_000, y + 600_000);
            [[x, y], [u, y], [u, v], [x, v], [x, y]].map(FieldPoint::from).to_vec()
        };
        shuffled((0..columns * rows).map(cell).collect(), seed)
    }

    fn paths(strokes: &[Vec<FieldPoint>]) -> Vec<Path<'_>> {
        strokes.iter().map(|s| Path { points: s, is_closed: s.len() > 2 && s[0] == s[s.len() - 1] }).collect()
    }

    #[test]
    fn every_stroke_is_marked_once() {
        for n in [0, 1, 2, 3, 50, 500] {
            let strokes = random(n, n as u64 + 1);
            let mut seen: Vec<u32> = order(&paths(&strokes)).iter().map(|v| v.stroke).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..n as u32).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_field_of_squares_needs_three_quarters_of_a_pitch_each() {
        for seed in 1..6 {
            let strokes = squares(40, 40, seed);
            let paths = paths(&strokes);
            let visits = order(&paths);
            let each = jumps(&paths, &visits) / 1600.0 / 1e6;
            assert!(each <= 0.75, "seed {seed}: {each} mm");
            assert!(visits.iter().any(|v| v.start > 0) && visits.iter().all(|v| !v.reversed && v.start < 4));
        }
    }

    #[test]
    fn shuffled_hatch_becomes_a_serpentine() {
        let strokes: Vec<_> = (0..100).map(|i| line([-500_000, i * 1000], [500_000, i * 1000])).collect();
        let strokes = shuffled(strokes, 3);
        let paths = paths(&strokes);
        let visits = order(&paths);
        let steps: Vec<f64> = visits
            .windows(2)
            .map(|w| {
                let [a, b] = [ends(&paths, &w[0])[1], ends(&paths, &w[1])[0]];
                math::hypot(f64::from(b.x - a.x), f64::from(b.y - a.y))
            })
            .collect();
        assert!(steps.iter().all(|&s| s <= 1000.0), "{steps:?}");
        assert!(visits.iter().all(|v| v.start == 0));
    }

    #[test]
    fn closed_stroke_starts_at_the_vertex_nearest_the_beam() {
        // A ring of 200 corners whose nearest to the field's centre is not one of the outermost.
        let corner = |i: i32| {
            let turn = f64::from(i % 200) / 200.0 * std::f64::consts::TAU;
            FieldPoint::new(9_000_000 + (2e6 * math::cos(turn)) as i32, 4_000_000 + (2e6 * math::sin(turn)) as i32)
        };
        let ring: Vec<FieldPoint> = (0..=200).map(corner).collect();
        let visits = order(&[Path { points: &ring, is_closed: true }]);
        let away = |p: FieldPoint| math::hypot(f64::from(p.x), f64::from(p.y));
        let nearest = ring.iter().map(|&p| away(p)).fold(f64::INFINITY, f64::min);
        assert_eq!(away(ring[visits[0].start as usize]), nearest);
        // As a piece of something longer it has two ends that happen to meet.
        let visits = order(&[Path { points: &ring, is_closed: false }]);
        assert_eq!(visits, [Visit { stroke: 0, start: 0, reversed: false }]);
    }

    #[test]
    fn two_outliers_do_not_lengthen_the_order_of_a_cluster() {
        let dash = |i: i32| line([i % 50 * 2000, i / 50 * 2000], [i % 50 * 2000 + 500, i / 50 * 2000]);
        let mut strokes = shuffled((0..2500).map(dash).collect(), 8);
        let alone = jumps(&paths(&strokes), &order(&paths(&strokes)));
        strokes.extend([line([-20_000_000; 2], [20_000_000; 2]), line([-20_000_000, 1], [1, -1])]);
        let both = jumps(&paths(&strokes), &order(&paths(&strokes)));
        // The outliers cost the way to and fro, and the crowd no more than before.
        assert!(both - alone < 80e6, "{alone} {both}");
    }

    #[test]
    fn dots_are_marked_once_in_a_short_order() {
        let dots: Vec<Vec<FieldPoint>> =
            shuffled((0..900).map(|i| vec![[i % 30 * 1000, i / 30 * 1000].into()]).collect(), 5);
        let paths = paths(&dots);
        let visits = order(&paths);
        let mut seen: Vec<u32> = visits.iter().map(|v| v.stroke).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..900).collect::<Vec<_>>());
        assert!(visits.iter().all(|v| v.start == 0 && !v.reversed));
        let each = jumps(&paths, &visits) / 900.0;
        assert!(each < 1100.0, "{each} nm for a pitch of 1000");
    }

    #[test]
    fn identical_strokes_are_all_kept() {
        let strokes = vec![line([5, 5], [5, 5]); 40];
        assert_eq!(order(&paths(&strokes)).len(), 40);
    }
}

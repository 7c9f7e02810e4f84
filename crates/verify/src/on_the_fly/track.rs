//! A mark along its stroke of the texture: where it begins, where it ends, how far it strays.
//!
//! Units: nm. Places on a stroke are lengths along it; on a closed one they run on over its seam.

use terrace_core::geom::P2;
use terrace_core::math;

/// A mark that is this much nearer to what lies behind it has turned back, nm.
const BEHIND: f64 = 50.0;
/// How much farther along its stroke than across it a hit point may have moved, nm.
const SPARE: f64 = 2_000.0;
/// Distances from a stroke that differ by no more are equal, nm: the vertices of two legs over one line are each
/// rounded to the grid, by up to half its diagonal.
const EQUAL: f64 = 2.0;

/// A stroke of the texture.
pub(super) struct Stroke {
    points: Vec<[f64; 2]>,
    along: Vec<f64>,
    closed: bool,
}

/// The place of a stroke that is nearest to a point, and how far from it.
#[derive(Clone, Copy)]
struct NearestPlace {
    along: f64,
    off: f64,
}

/// In which direction a mark runs along its stroke.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Forward,
    Backward,
}

impl Direction {
    fn between(from: f64, to: f64) -> Self {
        if to > from { Self::Forward } else { Self::Backward }
    }

    fn reversed(self) -> Self {
        match self {
            Self::Forward => Self::Backward,
            Self::Backward => Self::Forward,
        }
    }
}

/// The stretch of a stroke that a mark covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trace {
    /// The place where it begins.
    pub(super) from: f64,
    /// The place where it ends.
    pub(super) to: f64,
    /// The largest distance from the stroke.
    pub(super) worst: f64,
    /// Where that is.
    pub(super) at: [f64; 2],
    /// How far it runs back, all in all.
    pub(super) back: f64,
}

impl Stroke {
    pub(super) fn new(points: &[P2]) -> Self {
        let points: Vec<[f64; 2]> = points.iter().map(|p| [p.x as f64, p.y as f64]).collect();
        let mut along = Vec::with_capacity(points.len());
        let mut sum = 0.0;
        for (i, p) in points.iter().enumerate() {
            sum += if i == 0 { 0.0 } else { distance(points[i - 1], *p) };
            along.push(sum);
        }
        let closed = points.len() > 2 && points.first() == points.last();
        Self { points, along, closed }
    }

    /// The length of the stroke.
    pub(super) fn len(&self) -> f64 {
        self.along.last().copied().unwrap_or(0.0)
    }

    /// Whether it ends where it begins.
    pub(super) fn is_closed(&self) -> bool {
        self.closed
    }

    /// The point at a place.
    pub(super) fn at(&self, place: f64) -> [f64; 2] {
        let place = place.clamp(0.0, self.len());
        let i = self.segment(place);
        let (a, b) = (self.points[i], self.points[i + 1]);
        let share = (place - self.along[i]) / (self.along[i + 1] - self.along[i]);
        [0, 1].map(|k| a[k] + share * (b[k] - a[k]))
    }

    /// The segments between two places, each with its ends.
    pub(super) fn between(&self, from: f64, to: f64) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
        let first = self.segment(from.max(0.0));
        let inside = (first..self.points.len() - 1).take_while(move |&i| self.along[i] < to);
        inside.map(move |i| (self.at(from.max(self.along[i])), self.at(to.min(self.along[i + 1]))))
    }

    fn segment(&self, place: f64) -> usize {
        self.along.partition_point(|&a| a <= place).saturating_sub(1).min(self.points.len() - 2)
    }

    /// The place of segment `i` nearest to `p`, between `lo` and `hi` along the stroke.
    fn nearest_on_segment(&self, i: usize, p: [f64; 2], lo: f64, hi: f64) -> NearestPlace {
        let (a, b) = (self.points[i], self.points[i + 1]);
        let length = self.along[i + 1] - self.along[i];
        let dir = [0, 1].map(|k| (b[k] - a[k]) / length);
        let along = (p[0] - a[0]) * dir[0] + (p[1] - a[1]) * dir[1];
        let along = along.clamp((lo - self.along[i]).max(0.0), (hi - self.along[i]).min(length));
        NearestPlace { along: self.along[i] + along, off: distance(p, [0, 1].map(|k| a[k] + along * dir[k])) }
    }

    /// The place nearest to `p` on the way from one place to another, forward or back; None where the stroke has none
    /// there. Of places that are equally near the first on the way: next to a turn, a stroke that runs back over itself
    /// is as near beyond the turn as before it.
    fn nearest(&self, p: [f64; 2], from: f64, to: f64) -> Option<NearestPlace> {
        let (lo, hi, forward) = (from.min(to), from.max(to), from <= to);
        let ordered = |first: i64, end: i64| (first..end).map(move |i| if forward { i } else { first + end - 1 - i });
        let length = self.len();
        let turn = |place: f64| if self.closed { (place / length).floor() as i64 } else { 0 };
        let mut best: Option<NearestPlace> = None;
        for turn in ordered(turn(lo), turn(hi) + 1) {
            let shift = turn as f64 * length;
            let (lo, hi) = ((lo - shift).max(0.0), (hi - shift).min(length));
            if lo > hi {
                continue;
            }
            let end = self.along.partition_point(|&a| a <= hi).min(self.points.len() - 1);
            for i in ordered(self.segment(lo) as i64, end as i64) {
                let NearestPlace { along, off } = self.nearest_on_segment(i as usize, p, lo, hi);
                if best.is_none_or(|b| off < b.off - EQUAL) {
                    best = Some(NearestPlace { along: along + shift, off });
                }
            }
        }
        best
    }

    /// Follows the hit points of a mark; `limit` is how far it may stray, `loose` how far of this each hit point may
    /// lie from where it is on the welded part. A stroke that crosses or meets itself is tried from all its places near
    /// the first hit, both ways. The best first, then others that are within the limit: a stroke that runs back over
    /// itself has more than one place for a mark.
    pub(super) fn follow(&self, foot_points: &[[f64; 2]], limit: f64, loose: f64) -> Vec<Trace> {
        let Some(&first) = foot_points.first() else { return Vec::new() };
        let cost = |t: &Trace| t.worst.max(t.back);
        let mut traces: Vec<Trace> = Vec::new();
        for start in self.starts(first, limit, loose) {
            let trace = self.followed(foot_points, start, None, loose);
            let other_way = Direction::between(trace.from, trace.to).reversed();
            let other = self.followed(foot_points, start, Some(other_way), loose);
            traces.extend([trace, other]);
        }
        traces.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        let mut seen = 0;
        traces.retain(|t| {
            seen += 1;
            seen == 1 || cost(t) <= limit
        });
        traces
    }

    /// The places within `limit` of the first hit point from which a mark is followed: those next to each other are
    /// one, the nearest of them. A mark that lies nowhere on the stroke is followed from the nearest place, so that the
    /// fault can be reported with its distance.
    fn starts(&self, first: [f64; 2], limit: f64, loose: f64) -> Vec<NearestPlace> {
        let mut starts: Vec<NearestPlace> = Vec::new();
        let mut nearest: Option<NearestPlace> = None;
        for i in 0..self.points.len() - 1 {
            let place = self.nearest_on_segment(i, first, 0.0, f64::INFINITY);
            if nearest.is_none_or(|n| place.off < n.off) {
                nearest = Some(place);
            }
            let is_near = place.off <= limit; // never of a NaN
            if !is_near {
                continue;
            }
            match starts.last_mut() {
                Some(last) if place.along - last.along <= SPARE + 2.0 * loose => {
                    if place.off < last.off {
                        *last = place;
                    }
                }
                _ => starts.push(place),
            }
        }
        if starts.is_empty() {
            starts.extend(nearest);
        }
        starts
    }

    /// Follows a mark from a place of its first hit point on, in a direction or in the one that is nearer.
    fn followed(
        &self,
        foot_points: &[[f64; 2]],
        start: NearestPlace,
        mut direction: Option<Direction>,
        loose: f64,
    ) -> Trace {
        let mut trace = Trace { from: start.along, to: start.along, worst: start.off, at: foot_points[0], back: 0.0 };
        for pair in foot_points.windows(2) {
            let (before, hit) = (pair[0], pair[1]);
            let reach = 1.5 * distance(before, hit) + SPARE + 2.0 * loose;
            let here = trace.to;
            let ahead = self.nearest(hit, here, here + reach);
            let behind = self.nearest(hit, here, here - reach);
            let off = |place: Option<NearestPlace>| place.map_or(f64::INFINITY, |place| place.off);
            // The mark keeps its way: it has turned back only where what lies behind is nearer by more than rounding.
            let is_ahead = match direction {
                Some(Direction::Forward) => off(ahead) <= off(behind) + BEHIND,
                Some(Direction::Backward) => off(ahead) + BEHIND < off(behind),
                None => off(ahead) <= off(behind),
            };
            let next = if is_ahead { ahead.or(behind) } else { behind.or(ahead) };
            let Some(NearestPlace { along: to, off }) = next else { continue };
            if direction.is_none() && (to - trace.from).abs() > 10.0 * BEHIND {
                direction = Some(Direction::between(trace.from, to));
            }
            // Against its way: that is marked twice.
            let is_back = match direction {
                Some(Direction::Forward) => to < here,
                Some(Direction::Backward) => to >= here,
                None => false,
            };
            if is_back {
                trace.back += (to - here).abs();
            }
            let mut stray = |off: f64, place: [f64; 2]| {
                if off > trace.worst {
                    (trace.worst, trace.at) = (off, place);
                }
            };
            stray(off, hit);
            self.corners(here, to, |corner| stray(beside(corner, before, hit), corner));
            trace.to = to;
        }
        trace
    }

    /// The vertices between two places.
    fn corners(&self, a: f64, b: f64, mut visit: impl FnMut([f64; 2])) {
        let (lo, hi) = (a.min(b), a.max(b));
        let length = self.len();
        let turns = if self.closed { (lo / length).floor() as i64..=(hi / length).floor() as i64 } else { 0..=0 };
        for turn in turns {
            let shift = turn as f64 * length;
            let first = self.along.partition_point(|&a| a + shift <= lo);
            for i in (first..self.points.len()).take_while(|&i| self.along[i] + shift < hi) {
                visit(self.points[i]);
            }
        }
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::hypot(a[0] - b[0], a[1] - b[1])
}

/// Distance of a point from the stretch between two others.
fn beside(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let way = [b[0] - a[0], b[1] - a[1]];
    let length2 = way[0] * way[0] + way[1] * way[1];
    let along = if length2 > 0.0 { ((p[0] - a[0]) * way[0] + (p[1] - a[1]) * way[1]) / length2 } else { 0.0 };
    let along = along.clamp(0.0, 1.0);
    distance(p, [a[0] + along * way[0], a[1] + along * way[1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stroke(points: &[[i64; 2]]) -> Stroke {
        Stroke::new(&points.iter().map(|p| P2::new(p[0] * 1000, p[1] * 1000)).collect::<Vec<_>>())
    }

    fn foot_points(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        points.iter().map(|p| p.map(|v| v * 1000.0)).collect()
    }

    #[test]
    fn a_mark_is_followed_over_corners_crossings_and_the_seam() {
        // A loop that crosses itself at (100, 100).
        let s = stroke(&[[0, 100], [200, 100], [200, 200], [100, 200], [100, 0]]);
        let along = foot_points(&[[100.0, 150.0], [100.0, 100.0], [100.0, 50.0]]);
        let t = s.follow(&along, 1000.0, 0.0)[0];
        assert_eq!((t.from, t.to, t.worst, t.back), (450_000.0, 550_000.0, 0.0, 0.0));
        let t = s.follow(&foot_points(&[[100.0, 100.0], [0.0, 100.2]]), 1000.0, 0.0)[0];
        assert_eq!((t.from, t.to), (100_000.0, 0.0));
        assert!((t.worst - 200.0).abs() < 1e-9);
        // A cut corner is seen, though both ends lie on the stroke.
        let t = s.follow(&foot_points(&[[195.0, 100.0], [200.0, 105.0]]), 1000.0, 0.0)[0];
        assert!((t.worst - 5000.0 / 2f64.sqrt()).abs() < 1.0, "{t:?}");
        let square = stroke(&[[0, 0], [100, 0], [100, 100], [0, 100], [0, 0]]);
        let round = foot_points(&[[0.0, 50.0], [0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 50.0]]);
        let t = square.follow(&round, 1000.0, 0.0)[0];
        assert!(((t.to - t.from).abs() - 400_000.0).abs() < 1.0 && t.worst < 1.0, "{t:?}");
    }

    #[test]
    fn a_stroke_that_runs_back_over_itself_has_two_places_for_a_mark() {
        let s = stroke(&[[0, 0], [1000, 0], [0, 0]]);
        let places = |foot_points: &[[f64; 2]]| {
            let mut found: Vec<[f64; 2]> = s.follow(foot_points, 1000.0, 0.0).iter().map(|t| [t.from, t.to]).collect();
            found.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            found
        };
        let middle = places(&foot_points(&[[300.0, 0.0], [350.0, 0.0], [400.0, 0.0]]));
        assert_eq!(middle, [[300_000.0, 400_000.0], [1_700_000.0, 1_600_000.0]]);
        // To where it turns, with no more than a long move before the last.
        let last = places(&foot_points(&[[800.0, 0.0], [900.0, 0.0], [990.0, 0.0], [1000.0, 0.0]]));
        assert_eq!(last, [[800_000.0, 1_000_000.0], [1_200_000.0, 1_000_000.0]]);
        // From where it turns, one way or the other.
        let turn = places(&foot_points(&[[1000.0, 0.0], [900.0, 0.0]]));
        assert_eq!(turn, [[1_000_000.0, 900_000.0], [1_000_000.0, 1_100_000.0]]);
    }

    #[test]
    fn a_stroke_there_and_back_is_closed_and_may_begin_where_it_turns() {
        let s = stroke(&[[0, 0], [1000, 0], [0, 0]]);
        let t = s.follow(
            &foot_points(&[[1000.0, 0.0], [500.0, 0.0], [0.0, 0.0], [500.0, 0.0], [1000.0, 0.0]]),
            1000.0,
            0.0,
        )[0];
        assert!(((t.to - t.from).abs() - 2_000_000.0).abs() < 1.0 && t.back == 0.0, "{t:?}");
    }

    #[test]
    fn a_mark_that_turns_back_is_seen() {
        let s = stroke(&[[0, 0], [1000, 0]]);
        let t = s.follow(&foot_points(&[[100.0, 0.0], [300.0, 0.0], [250.0, 0.0], [400.0, 0.0]]), 1000.0, 0.0)[0];
        assert!((t.back - 50_000.0).abs() < 1.0 && (t.to - 400_000.0).abs() < 1.0, "{t:?}");
    }
}

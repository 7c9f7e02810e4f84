//! Fewer points that look the same. Points are in units of the drawing; None is a gap.

use crate::report::outline;
use terrace_core::math;

/// A line as runs without gaps. In each column one unit wide the lowest and the highest point stay, in the
/// order in which they come; a line that only goes to the right has so at most two points for each unit of
/// width. A gap inside a column is not seen.
pub fn columns(points: impl Iterator<Item = Option<[f64; 2]>>) -> Vec<Vec<[f64; 2]>> {
    let mut runs: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut open: Option<Column> = None;
    let mut is_gap = true;
    for point in points {
        let Some(p) = point else {
            is_gap = true;
            continue;
        };
        match &mut open {
            Some(column) if column.at == p[0].floor() => column.add(p),
            _ => {
                if let Some(column) = open.take() {
                    column.close(&mut runs);
                }
                open = Some(Column { at: p[0].floor(), starts: is_gap, low: p, high: p, is_falling: false });
            }
        }
        is_gap = false;
    }
    if let Some(column) = open {
        column.close(&mut runs);
    }
    runs
}

/// The points of a line in one column.
struct Column {
    at: f64,
    /// Whether a run begins here.
    starts: bool,
    low: [f64; 2],
    high: [f64; 2],
    /// Whether the highest point comes first.
    is_falling: bool,
}

impl Column {
    fn add(&mut self, p: [f64; 2]) {
        if p[1] < self.low[1] {
            (self.low, self.is_falling) = (p, true);
        } else if p[1] > self.high[1] {
            (self.high, self.is_falling) = (p, false);
        }
    }

    fn close(self, runs: &mut Vec<Vec<[f64; 2]>>) {
        if self.starts {
            runs.push(Vec::new());
        }
        let run = runs.last_mut().expect("the first column starts a run");
        let [first, second] = if self.is_falling { [self.high, self.low] } else { [self.low, self.high] };
        run.push(first);
        if second != first {
            run.push(second);
        }
    }
}

/// How far a thinned path may lie from the given one.
const TOLERANCE: f64 = 0.3;
/// Points of a chart of paths; where they would be more, the tolerance grows.
pub const MOST: usize = 50_000;
/// Points that are thinned at once, which bounds the time of long paths.
const CHUNK: usize = 2048;

/// Paths as runs without gaps, thinned together.
pub fn paths(all: &[Vec<Option<[f64; 2]>>]) -> Vec<Vec<Vec<[f64; 2]>>> {
    let mut tolerance = TOLERANCE;
    loop {
        let thinned: Vec<Vec<Vec<[f64; 2]>>> = all.iter().map(|points| path(points, tolerance)).collect();
        if thinned.iter().flatten().map(Vec::len).sum::<usize>() <= MOST || tolerance > super::WIDTH {
            return thinned;
        }
        tolerance *= 2.0;
    }
}

fn path(points: &[Option<[f64; 2]>], tolerance: f64) -> Vec<Vec<[f64; 2]>> {
    let mut runs = Vec::new();
    let mut keep = Vec::new();
    let mut spans = Vec::new();
    for run in points.split(Option::is_none) {
        // Most points of a fine path go here, at no cost: a third of the tolerance.
        let mut coarse: Vec<[f64; 2]> = Vec::new();
        for (k, p) in run.iter().flatten().enumerate() {
            let near = |q: &[f64; 2]| math::hypot(p[0] - q[0], p[1] - q[1]) < tolerance / 3.0;
            if !coarse.last().is_some_and(near) {
                coarse.push(*p);
            } else if k + 1 == run.len() && coarse.len() > 1 {
                coarse.pop();
                coarse.push(*p);
            }
        }
        let mut out: Vec<[f64; 2]> = Vec::new();
        let mut from = 0;
        while from < coarse.len() {
            let to = (from + CHUNK).min(coarse.len());
            let chunk = &coarse[from..to];
            outline::thin(chunk, tolerance * 2.0 / 3.0, &mut keep, &mut spans);
            out.extend(chunk.iter().zip(&keep).filter(|&(_, &k)| k).map(|(&p, _)| p));
            if to == coarse.len() {
                break;
            }
            out.pop();
            from = to - 1;
        }
        if !out.is_empty() {
            runs.push(out);
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_keeps_its_extremes_and_two_points_a_column() {
        let n = 40_000;
        let at = |k: usize| [k as f64 * 800.0 / n as f64, 100.0 + 40.0 * math::sin(k as f64 * 0.37)];
        let points: Vec<[f64; 2]> = (0..n)
            .map(|k| {
                if k == 17_777 {
                    [at(k)[0], 3.0]
                } else if k == 5 {
                    [at(k)[0], 444.0]
                } else {
                    at(k)
                }
            })
            .collect();
        let runs = columns(points.iter().copied().map(Some));
        assert_eq!(runs.len(), 1);
        for column in 0..800 {
            let inside = |p: &&[f64; 2]| p[0].floor() == f64::from(column);
            let all: Vec<f64> = points.iter().filter(inside).map(|p| p[1]).collect();
            let kept: Vec<f64> = runs[0].iter().filter(inside).map(|p| p[1]).collect();
            assert!((1..=2).contains(&kept.len()));
            for fold in [f64::min, f64::max] {
                let of = |v: &[f64]| v.iter().copied().reduce(fold);
                assert_eq!(of(&all), of(&kept), "column {column}");
            }
        }
        assert!(runs[0].iter().all(|p| points.contains(p)), "no point is made up");
        assert!(runs[0].is_sorted_by(|a, b| a[0] <= b[0]));
    }

    #[test]
    fn line_is_broken_at_gaps_wider_than_a_pixel() {
        let p = |x: f64, y: f64| Some([x, y]);
        let runs = columns([p(0.0, 1.0), p(5.0, 2.0), None, p(6.0, 1.0), p(9.2, 3.0), None, p(9.7, 1.0)].into_iter());
        assert_eq!(runs, [vec![[0.0, 1.0], [5.0, 2.0]], vec![[6.0, 1.0], [9.2, 3.0], [9.7, 1.0]]]);
        assert!(columns([None, None].into_iter()).is_empty());
    }

    /// Distance of a point from a path.
    fn distance(p: [f64; 2], path: &[[f64; 2]]) -> f64 {
        let to = |ab: &[[f64; 2]]| {
            let (a, d) = (ab[0], [ab[1][0] - ab[0][0], ab[1][1] - ab[0][1]]);
            let len2 = d[0] * d[0] + d[1] * d[1];
            let t =
                if len2 > 0.0 { (((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / len2).clamp(0.0, 1.0) } else { 0.0 };
            math::hypot(p[0] - a[0] - t * d[0], p[1] - a[1] - t * d[1])
        };
        path.windows(2).map(to).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_thinned_path_stays_near_and_keeps_its_ends() {
        let spiral: Vec<[f64; 2]> = (0..20_000)
            .map(|k| f64::from(k) / 20_000.0)
            .map(|t| [300.0 + 280.0 * t * math::cos(60.0 * t), 300.0 + 280.0 * t * math::sin(60.0 * t)])
            .collect();
        let given: Vec<_> = spiral.iter().copied().map(Some).collect();
        let thinned = &paths(&[given])[0];
        assert_eq!(thinned.len(), 1);
        let path = &thinned[0];
        assert!(path.len() < 1000, "{}", path.len());
        assert_eq!((path.first(), path.last()), (spiral.first(), spiral.last()));
        for &p in spiral.iter().step_by(7) {
            assert!(distance(p, path) <= TOLERANCE, "{p:?}");
        }
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn number_of_drawn_points_of_a_path_is_bounded() {
        let mut numbers = terrace_core::random::Random::new(1);
        let mut random = || numbers.unit() * 800.0;
        let wild: Vec<_> = (0..60_000).map(|_| Some([random(), random()])).collect();
        let count: usize = paths(&[wild]).iter().flatten().map(Vec::len).sum();
        assert!((1..=MOST).contains(&count), "{count}");
    }
}

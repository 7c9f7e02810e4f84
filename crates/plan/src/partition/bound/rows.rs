//! Points in rows: level lines a little more than the depth of a stop apart, so that no box holds points
//! of two rows, and along every row points just too far from each other for one window.
//!
//! An open line is divided from one end to the other. On a closed line of, say, 8.6 windows that leaves
//! 8 points; points set out in several laps, each with a part of the weight, come near 8.6.

use super::super::box_index::Item;
use super::Certificate;
use super::packing_weights::PackingWeights;
use crate::projection::Rows;

/// Weight of a point that stands alone; also the number of laps around a closed line.
const WHOLE: u32 = 8;
/// Rows that could be chosen in the depth of a stop.
const CLASSES: i32 = 8;
/// Of these, how many are tried.
const TRIED: i32 = 2;
/// Directions in which a line is divided, and from whose first points one walks along it.
const WAYS: [[i64; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];

/// Heights from `lo` to `hi` (nm, from the common origin) at which points are worth most for stops of
/// that depth range.
pub fn row_heights(depth: i32, lo: i32, hi: i32) -> impl Iterator<Item = i32> {
    rows(depth).heights(lo, hi)
}

/// The rows of heights at which points are worth most, for whoever collects points of marks.
pub fn rows(depth: i32) -> Rows {
    Rows { pitch: pitch_of(depth), group: CLASSES, used: TRIED }
}

/// Distance of rows: eight rows further up is just out of reach.
fn pitch_of(depth: i32) -> i32 {
    depth / CLASSES + 2
}

/// The best of a few choices of rows.
pub(super) fn certify(points: &[[i32; 3]], size: [i32; 3]) -> Certificate {
    let fine = pitch_of(size[2]);
    // Where points lie at any height, rows need some thickness.
    let coarse = fine + size[2] / 100;
    let (a, b) = (divide(points, size, fine, 0), divide(points, size, coarse, 0));
    let pitch = if a.sum() >= b.sum() { fine } else { coarse };
    let first = if a.sum() >= b.sum() { a } else { b };
    let others = (1..TRIED).map(|class| divide(points, size, pitch, class));
    let mut best = others.fold(first, |best, w| if w.sum() > best.sum() { w } else { best });
    fill(&mut best, points, size, pitch);
    best.certificate()
}

/// Adds points that lie at no row, column by column, wherever there is room for a whole: flat places cross
/// no row.
fn fill(weights: &mut PackingWeights, points: &[[i32; 3]], size: [i32; 3], pitch: i32) {
    let tolerance = tolerance(size, pitch);
    let off_rows = |p: &[i32; 3]| ((p[2] + pitch / 2).rem_euclid(pitch) - pitch / 2).abs() > tolerance;
    let mut others: Vec<[i32; 3]> = points.iter().copied().filter(off_rows).collect();
    others.sort_unstable();
    for (n, p) in (points.len() as u32..).zip(others) {
        let piece = Item { lo: p, hi: p };
        let mut is_free = true;
        weights.fitting(&piece, |_| {
            is_free = false;
            false
        });
        if is_free {
            weights.add(&piece, n, WHOLE);
        }
    }
}

/// How far a point may lie from its row: eight rows less both tolerances are more than a stop holds.
fn tolerance(size: [i32; 3], pitch: i32) -> i32 {
    (CLASSES * pitch - size[2] - 1) / 2
}

/// Sets points in every eighth row of `pitch`, from row `class` on.
fn divide(points: &[[i32; 3]], size: [i32; 3], pitch: i32, class: i32) -> PackingWeights {
    let tolerance = tolerance(size, pitch);
    let row = |p: &[i32; 3]| (p[2] + pitch / 2).div_euclid(pitch);
    let mut chosen: Vec<(i32, Item)> = points
        .iter()
        .filter(|p| (row(p) - class).rem_euclid(CLASSES) == 0 && (row(p) * pitch - p[2]).abs() <= tolerance)
        .map(|p| (row(p), Item { lo: *p, hi: *p }))
        .collect();
    chosen.sort_unstable();
    chosen.dedup();
    // Whatever is added later lies in the same box.
    let end = |k: usize, pick: fn(i32, i32) -> i32| points.iter().map(|p| p[k]).reduce(pick).unwrap_or(0);
    let mut weights =
        PackingWeights::new([0, 1].map(|k| end(k, i32::min)), [0, 1].map(|k| end(k, i32::max)), size, WHOLE);
    let mut number = 0;
    for row in chosen.chunk_by(|a, b| a.0 == b.0) {
        for part in parts(row, size) {
            set(&mut weights, &part, number, size);
            number += part.len() as u32;
        }
    }
    weights
}

/// The points of a row by what hangs together, where gaps of half a window do not count.
fn parts(row: &[(i32, Item)], size: [i32; 3]) -> Vec<Vec<Item>> {
    let bin = |p: &Item| [1, 0].map(|k| p.lo[k].div_euclid((size[k] / 2).max(1)));
    let mut binned: Vec<([i32; 2], Item)> = row.iter().map(|(_, p)| (bin(p), *p)).collect();
    binned.sort_unstable();
    let bins: Vec<&[([i32; 2], Item)]> = binned.chunk_by(|a, b| a.0 == b.0).collect();
    let mut is_open = vec![true; bins.len()];
    let mut parts = Vec::new();
    for first in 0..bins.len() {
        let mut part: Vec<Item> = Vec::new();
        let mut stack = Vec::from_iter(std::mem::take(&mut is_open[first]).then_some(first));
        while let Some(n) = stack.pop() {
            part.extend(bins[n].iter().map(|b| b.1));
            let [y, x] = bins[n][0].0;
            for near in (0..9).map(|d| [y + d / 3 - 1, x + d % 3 - 1]) {
                if let Ok(n) = bins.binary_search_by_key(&near, |b| b[0].0)
                    && std::mem::take(&mut is_open[n])
                {
                    stack.push(n);
                }
            }
        }
        if !part.is_empty() {
            parts.push(part);
        }
    }
    parts
}

/// Points along a part by their index, each with its weight, and the weight that they add in all.
#[derive(Default)]
struct WeightedPoints {
    gain: u64,
    points: Vec<(u32, u32)>,
}

impl WeightedPoints {
    /// Sets the points of a sequence of indices and greatest weights, as far as there is room, and takes them back.
    fn tried(
        weights: &mut PackingWeights,
        part: &[Item],
        number: u32,
        sequence: impl Iterator<Item = (usize, u32)>,
    ) -> Self {
        let before = weights.sum();
        let mut points = Vec::new();
        for (n, most) in sequence {
            let weight = weights.room(&part[n]).min(most);
            if weight > 0 {
                weights.add(&part[n], number + n as u32, weight);
                points.push((n as u32, weight));
            }
        }
        let gain = weights.sum() - before;
        for &(n, weight) in &points {
            weights.remove(&part[n as usize], number + n, weight);
        }
        Self { gain, points }
    }

    fn or_heavier(self, other: Self) -> Self {
        if other.gain > self.gain { other } else { self }
    }
}

/// Adds the best of several ways to set points along one part; the first of its points has `number`.
fn set(weights: &mut PackingWeights, part: &[Item], number: u32, size: [i32; 3]) {
    // Each way is tried on the weights as they are; the heaviest is then added for good.
    let mut best = WeightedPoints::default();
    let line = PartLine::new(part, size);
    for way in WAYS {
        let order = line.sorted(way);
        let spaced = line.spaced(&order);
        let enough = 2 * spaced.len() + 2;
        let spaced = spaced.into_iter().map(|n| (n, WHOLE));
        best = best.or_heavier(WeightedPoints::tried(weights, part, number, spaced));
        let (points, is_closed) = line.walk(order[0], enough);
        // On a closed line one part in eight of the weight for every point of eight laps: a line of 8.6 windows
        // comes near 8.6, not 8.
        if is_closed {
            let laps = points.iter().map(|&n| (n, 1));
            best = best.or_heavier(WeightedPoints::tried(weights, part, number, laps));
        } else if let Some(&end) = points.last() {
            let back = line.walk(end, enough).0.into_iter().map(|n| (n, WHOLE));
            best = best.or_heavier(WeightedPoints::tried(weights, part, number, back));
        }
    }
    for &(n, weight) in &best.points {
        weights.add(&part[n as usize], number + n, weight);
    }
}

/// The points of a part, to be set along.
struct PartLine<'a> {
    points: &'a [Item],
    size: [i32; 3],
    /// The points by x and by y.
    by: [Vec<usize>; 2],
}

impl<'a> PartLine<'a> {
    fn new(points: &'a [Item], size: [i32; 3]) -> Self {
        let mut line = Self { points, size, by: [vec![], vec![]] };
        line.by = [line.sorted([1, 0]), line.sorted([0, 1])];
        line
    }

    /// The points in the order of a direction.
    fn sorted(&self, way: [i64; 2]) -> Vec<usize> {
        let key = |p: &Item| way[0] * i64::from(p.lo[0]) + way[1] * i64::from(p.lo[1]);
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        order.sort_unstable_by_key(|&n| (key(&self.points[n]), n));
        order
    }

    /// How far two points lie apart along axis k.
    fn along(&self, k: usize, a: usize, b: usize) -> i64 {
        i64::from((self.points[a].lo[k] - self.points[b].lo[k]).abs())
    }

    /// Do the two points fit one window?
    fn share(&self, a: usize, b: usize) -> bool {
        (0..2).all(|k| self.along(k, a, b) <= i64::from(self.size[k]))
    }

    /// Points of `order` of which no two share a window.
    fn spaced(&self, order: &[usize]) -> Vec<usize> {
        let mut chosen: Vec<usize> = Vec::new();
        for &n in order {
            // The last ones are the likeliest to be near.
            if !chosen.iter().rev().any(|&c| self.share(c, n)) {
                chosen.push(n);
            }
        }
        chosen
    }

    /// Walks from point `start`, each time to the nearest point that no window holds together with the
    /// last or the one before: to the end of the line, or several times around it (then the second
    /// answer is true). A lap has at most `enough` points.
    fn walk(&self, start: usize, enough: usize) -> (Vec<usize>, bool) {
        let mut walked = vec![start];
        let mut laps = 0;
        let mut is_away = false;
        while let Some(next) = self.next(&walked) {
            let is_back = self.share(start, next);
            laps += usize::from(is_back && is_away);
            is_away = !is_back;
            if laps == WHOLE as usize || walked.len() >= (laps + 1) * enough {
                break;
            }
            walked.push(next);
        }
        (walked, laps > 0)
    }

    /// The next point of a walk.
    fn next(&self, walked: &[usize]) -> Option<usize> {
        let at = walked[walked.len() - 1];
        let before = walked.len().checked_sub(2).map(|n| walked[n]);
        // Distances in windows, along x or y, whichever is more; one that is nearer than two is near.
        let windows = |k: usize, n: usize| self.along(k, at, n) as f64 / f64::from(self.size[k]);
        let mut best = (2.0, usize::MAX);
        for k in 0..2 {
            let here = self.points[at].lo[k];
            let place = |v: i32| self.by[k].partition_point(|&n| self.points[n].lo[k] < v);
            let (below, above) = (place(here - self.size[k]), place(here + self.size[k] + 1));
            let down = &mut self.by[k][..below].iter().rev();
            let up = &mut self.by[k][above..].iter();
            for side in [down as &mut dyn Iterator<Item = &usize>, up] {
                for &n in side {
                    if windows(k, n) > best.0 {
                        break;
                    }
                    let found = (windows(0, n).max(windows(1, n)), n);
                    if found < best && before.is_none_or(|b| !self.share(b, n)) {
                        best = found;
                    }
                }
            }
        }
        (best.1 < usize::MAX).then_some(best.1)
    }
}

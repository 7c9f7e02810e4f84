//! Borders of blocks from the map: crack following, then simplification.
//!
//! A crack is an edge between two cells of different blocks. [`trace`] follows the cracks round every
//! block with the block on the left: outer rings run counter-clockwise, holes clockwise, cells that
//! touch only at a corner are apart. Each ring's area in cells is exact.
//!
//! [`simplify`] turns a ring into few points. Corners of the drawing (two straight runs that meet) and
//! points where three blocks meet stay; between them the border runs through middles of cracks, where
//! the true border is within half a cell, and Douglas-Peucker takes out what deviates less than the
//! tolerance. Every stretch is simplified in one fixed direction, so two neighbours get
//! the same points and no gap opens between them.

use std::ops::Range;

use super::BlockMap;
use super::sheet::{Sheet, push_command};
use terrace_core::geom::{Nm, P2};

/// The map with a rim of empty cells, so that every cell has neighbours.
pub(super) struct PaddedMap {
    /// Cells in a row, rim included.
    pub width: usize,
    /// Rows, rim included.
    pub height: usize,
    /// Block index + 1, or 0.
    pub cells: Vec<u32>,
}

impl PaddedMap {
    pub(super) fn of(map: &BlockMap, blocks: usize) -> Self {
        let labels = map.labels();
        Self::padded(map.size().map(|n| n as usize), |i| if labels[i] as usize <= blocks { labels[i] } else { 0 })
    }

    /// The cells of a grid, each with its label.
    pub(super) fn padded([columns, rows]: [usize; 2], label: impl Fn(usize) -> u32) -> Self {
        let (width, height) = (columns + 2, rows + 2);
        let mut cells = vec![0; width * height];
        for row in 0..rows {
            let start = (row + 1) * width + 1;
            for (column, to) in cells[start..start + columns].iter_mut().enumerate() {
                *to = label(row * columns + column);
            }
        }
        Self { width, height, cells }
    }
}

/// A corner of cells on a ring: where the border turns or where three or more blocks meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// In cells, rim included.
    pub at: [i32; 2],
    /// Whether other borders end here.
    pub junction: bool,
}

/// One closed border.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    /// The block it belongs to.
    pub block: u32,
    /// The corners of the ring in [`Outlines::corners`].
    pub corners: Range<usize>,
}

/// All rings, by block, and the corners they are made of.
#[derive(Debug, Default)]
pub(super) struct Outlines {
    pub rings: Vec<Ring>,
    pub corners: Vec<Corner>,
}

impl Outlines {
    /// The corners of a ring.
    pub(super) fn corners_of(&self, ring: &Ring) -> &[Corner] {
        &self.corners[ring.corners.clone()]
    }
}

/// Traces all blocks; time and memory follow the cells and the borders.
pub(super) fn trace(grid: &PaddedMap) -> Outlines {
    let w = grid.width;
    let mut out = Outlines::default();
    let mut seen = vec![false; grid.cells.len()];
    for i in w..grid.cells.len() {
        let label = grid.cells[i];
        if label != 0 && grid.cells[i - w] != label && !seen[i] {
            let first = out.corners.len();
            follow(grid, i, &mut seen, &mut out.corners);
            out.rings.push(Ring { block: label - 1, corners: first..out.corners.len() });
        }
    }
    out.rings.sort_by_key(|r| r.block);
    out
}

/// Follows the ring that runs in +x under cell `start`. A vertex of the grid is named by the cell
/// up and right of it; `seen` marks the cells whose lower edge was walked.
fn follow(grid: &PaddedMap, start: usize, seen: &mut [bool], corners: &mut Vec<Corner>) {
    let w = grid.width;
    let c = &grid.cells;
    let label = c[start];
    let (mut n, mut heading) = (start, 0);
    loop {
        n = match heading {
            0 => {
                seen[n] = true;
                n + 1
            }
            1 => n + w,
            2 => n - 1,
            _ => n - w,
        };
        let (ne, nw, sw, se) = (n, n - 1, n - w - 1, n - w);
        let (left, right) = match heading {
            0 => (ne, se),
            1 => (nw, ne),
            2 => (sw, nw),
            _ => (se, sw),
        };
        let turn = match (c[left] == label, c[right] == label) {
            (false, _) => 1,
            (true, true) => 3,
            (true, false) => 0,
        };
        let changes = [(ne, nw), (nw, sw), (sw, se), (se, ne)].iter().filter(|&&(a, b)| c[a] != c[b]).count();
        if turn != 0 || changes > 2 {
            corners.push(Corner { at: [(n % w) as i32, (n / w) as i32], junction: changes > 2 });
        }
        heading = (heading + turn) % 4;
        if n == start && heading == 0 {
            break;
        }
    }
}

/// A point in half cells, rim included.
pub(super) type Half = [i32; 2];

/// Twice the signed area enclosed by a ring, in the square of the points' unit.
pub(super) fn area2(points: impl ExactSizeIterator<Item = [i32; 2]> + Clone) -> i64 {
    let next = points.clone().cycle().skip(1);
    points.zip(next).map(|(a, b)| i64::from(a[0]) * i64::from(b[1]) - i64::from(b[0]) * i64::from(a[1])).sum()
}

/// Two straight runs at least this long (cells) meet in a corner of the drawing; the stairs of a
/// slanted or curved border have steps of a single cell between their long runs.
const CORNER_RUN: i32 = 3;

/// The ring with few points, closed without repeating the first. `tolerance` is in cells. A ring that
/// would lose most of its area keeps its corners instead.
pub(super) fn simplify(ring: &[Corner], tolerance: f64, out: &mut Vec<Half>) {
    out.clear();
    let n = ring.len();
    let kept: Vec<usize> = (0..n).filter(|&i| ring[i].junction || is_corner(ring, i)).collect();
    let mut scratch = Scratch { limit: 2.0 * tolerance, ..Scratch::default() };
    match kept.as_slice() {
        [] => {
            let middles = closed_middles(ring);
            let far = farthest(&middles);
            scratch.points.extend(&middles[..=far]);
            scratch.flush(out);
            scratch.points.extend(middles[far..].iter().chain(&middles[..1]));
            scratch.flush(out);
        }
        [first, ..] => {
            for (k, &from) in kept.iter().enumerate() {
                let to = kept.get(k + 1).copied().unwrap_or(first + n);
                stretch(ring, from, to, &mut scratch.points);
                scratch.flush(out);
            }
        }
    }
    let exact = || ring.iter().map(|c| c.at.map(|v| 2 * v));
    let (before, after) = (area2(exact()), area2(out.iter().copied()));
    if out.len() < 3 || after.signum() != before.signum() || after.abs() * 4 < before.abs() {
        out.clear();
        out.extend(exact());
    }
}

/// Whether two long runs meet at corner `i`, at an angle.
fn is_corner(ring: &[Corner], i: usize) -> bool {
    run(ring, i + ring.len() - 1) >= CORNER_RUN && run(ring, i) >= CORNER_RUN && turns(ring, i)
}

/// Whether the border changes direction at corner `i`.
fn turns(ring: &[Corner], i: usize) -> bool {
    let n = ring.len();
    let (a, b, c) = (ring[(i + n - 1) % n].at, ring[i].at, ring[(i + 1) % n].at);
    (a[0] == b[0]) != (b[0] == c[0])
}

/// Length of the run that begins at corner `i`, in cells.
fn run(ring: &[Corner], i: usize) -> i32 {
    let (a, b) = (ring[i % ring.len()].at, ring[(i + 1) % ring.len()].at);
    (a[0] - b[0]).abs() + (a[1] - b[1]).abs()
}

/// Appends what the run that begins at corner `i` says about the border: its centre where it lies
/// between steps of one cell (then the centre is within half a cell of all its cracks' middles and
/// the nearest to the true border), else its first and last middle.
fn push_run(ring: &[Corner], i: usize, out: &mut Vec<Half>) {
    let n = ring.len();
    let (a, b) = (ring[i % n].at, ring[(i + 1) % n].at);
    if run(ring, i) == 1 || (run(ring, i + n - 1) == 1 && run(ring, i + 1) == 1) {
        out.push([a[0] + b[0], a[1] + b[1]]);
    } else {
        let step = [(b[0] - a[0]).signum(), (b[1] - a[1]).signum()];
        out.push([2 * a[0] + step[0], 2 * a[1] + step[1]]);
        out.push([2 * b[0] - step[0], 2 * b[1] - step[1]]);
    }
}

/// The stretch between two kept corners: the corners and the runs between them. The first and the
/// last run lead to a kept corner; where a step of one cell follows, they add nothing to it.
fn stretch(ring: &[Corner], from: usize, to: usize, out: &mut Vec<Half>) {
    let n = ring.len();
    let at = |i: usize| ring[i % n].at.map(|v| 2 * v);
    out.push(at(from));
    for i in from..to {
        let leaves = i == from;
        let arrives = i + 1 == to;
        let adds = match (leaves, arrives) {
            (true, true) => false,
            (true, false) => run(ring, i + 1) > 1,
            (false, true) => run(ring, i + n - 1) > 1,
            (false, false) => true,
        };
        if adds {
            push_run(ring, i, out);
        }
    }
    out.push(at(to));
}

/// A ring without kept corners, from its smallest point on, counter-clockwise or not.
fn closed_middles(ring: &[Corner]) -> Vec<Half> {
    let mut out = Vec::with_capacity(2 * ring.len());
    (0..ring.len()).for_each(|i| push_run(ring, i, &mut out));
    let smallest = (0..out.len()).min_by_key(|&i| out[i]).unwrap_or(0);
    out.rotate_left(smallest);
    out
}

/// Index of the point farthest from the first; among equals the largest point, whatever the direction.
fn farthest(points: &[Half]) -> usize {
    let distance2 = |p: Half| (0..2).map(|k| i64::from(p[k] - points[0][k]).pow(2)).sum::<i64>();
    (0..points.len()).max_by_key(|&i| (distance2(points[i]), points[i])).unwrap_or(0)
}

/// Appends a closed ring of cells of a size whose lower left corner lies at `lo`: its start, then relative steps.
pub(super) fn push_ring(d: &mut String, sheet: &Sheet, lo: P2, cell: Nm, points: &[Half]) {
    let step = |p: &Half| place(sheet, lo, cell, *p);
    let mut last = [0, 0];
    for (k, p) in points.iter().map(step).enumerate() {
        let [dx, dy] = [p[0] - last[0], p[1] - last[1]];
        match (k, dx, dy) {
            (0, ..) => push_command(d, 'M', &[dx, dy], sheet.decimals),
            (_, 0, 0) => {}
            (_, _, 0) => push_command(d, 'h', &[dx], sheet.decimals),
            (_, 0, _) => push_command(d, 'v', &[dy], sheet.decimals),
            _ => push_command(d, 'l', &[dx, dy], sheet.decimals),
        }
        last = p;
    }
    d.push('z');
}

/// A point of a ring in steps of the drawing's last place.
pub(super) fn place(sheet: &Sheet, lo: P2, cell: Nm, p: Half) -> [i64; 2] {
    // The grid has a rim of one cell, two halves.
    let at = |half: i32, origin: i64| origin as f64 + f64::from(half - 2) * cell.f64() / 2.0;
    [sheet.step(at(p[0], lo.x)), -sheet.step(at(p[1], lo.y))]
}

/// Douglas-Peucker on one stretch, without recursion.
#[derive(Default)]
struct Scratch {
    points: Vec<Half>,
    keep: Vec<bool>,
    spans: Vec<(usize, usize)>,
    limit: f64,
}

impl Scratch {
    /// Simplifies the collected points and appends all but the last, which the next stretch begins with.
    fn flush(&mut self, out: &mut Vec<Half>) {
        let points = &mut self.points;
        let backwards = points.iter().gt(points.iter().rev());
        if backwards {
            points.reverse();
        }
        thin(points, self.limit, &mut self.keep, &mut self.spans);
        let mut kept: Vec<Half> = points.iter().zip(&self.keep).filter(|&(_, &k)| k).map(|(&p, _)| p).collect();
        if backwards {
            kept.reverse();
        }
        kept.pop();
        out.extend(kept);
        points.clear();
    }
}

/// Which points of a line, ends included, are kept so that none of the others lies further than `limit` from
/// it (Douglas-Peucker without recursion). `spans` is room to work in.
pub(super) fn thin<T: Copy + Into<f64>>(
    points: &[[T; 2]],
    limit: f64,
    keep: &mut Vec<bool>,
    spans: &mut Vec<(usize, usize)>,
) {
    keep.clear();
    keep.resize(points.len(), false);
    spans.extend(points.len().checked_sub(1).map(|last| (0, last)));
    while let Some((lo, hi)) = spans.pop() {
        keep[lo] = true;
        keep[hi] = true;
        let mut worst = (limit * limit, 0);
        for i in lo + 1..hi {
            let d = distance2(points[i], points[lo], points[hi]);
            if d > worst.0 {
                worst = (d, i);
            }
        }
        if worst.1 > 0 {
            spans.push((lo, worst.1));
            spans.push((worst.1, hi));
        }
    }
}

/// Square of the distance from `p` to the segment from `a` to `b`.
fn distance2<T: Copy + Into<f64>>(p: [T; 2], a: [T; 2], b: [T; 2]) -> f64 {
    let [p, a, b] = [p, a, b].map(|p| p.map(Into::into));
    let d = |u: [f64; 2], v: [f64; 2]| [v[0] - u[0], v[1] - u[1]];
    let (ab, ap) = (d(a, b), d(a, p));
    let len2 = ab[0] * ab[0] + ab[1] * ab[1];
    let t = if len2 > 0.0 { ((ap[0] * ab[0] + ap[1] * ab[1]) / len2).clamp(0.0, 1.0) } else { 0.0 };
    let (x, y) = (ap[0] - t * ab[0], ap[1] - t * ab[1]);
    x * x + y * y
}

//! The part as a smooth height field, for axes that must follow it.
//!
//! Facets have edges, and an axis that followed them would jerk at every one. The height field is a bicubic
//! B-spline over heights sampled on a square grid: twice continuously differentiable. It smooths over about
//! two steps of the grid; how far it lies from the part under a mark is part of that mark's focal offset. Within
//! a distance that may be chosen its nodes are smoothed further: a normal that jumps by a thousandth of a radian
//! from facet to facet turns a nearly level tool about its axis by degrees. That smoothing leaves the shape of the
//! part alone: bends over more than a few millimetres are not made flatter. Units: mm.
//!
//! # Limits
//! Holes and the outside are filled by continuing the part, so that jumps across them have heights; a cliff
//! is smeared over four steps, and over a dozen where nodes are smoothed.

use crate::projection::Tracer;
use terrace_core::geom::{Box2, NM_PER_MM, Nm, P2, UnitVector};
use terrace_core::math;
use terrace_core::parallel;
use terrace_input::surface::Surface;

/// Height and slope at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Height {
    /// Height.
    pub z: f64,
    /// Slopes along x and y.
    pub slope: [f64; 2],
}

impl Height {
    /// The direction that looks away from the part.
    pub fn normal(&self) -> UnitVector {
        let [x, y] = self.slope;
        let length = (1.0 + x * x + y * y).sqrt();
        UnitVector([-x / length, -y / length, 1.0 / length])
    }
}

/// A smooth height field.
#[derive(Clone, Debug)]
pub struct HeightField {
    origin: [f64; 2],
    step: f64,
    count: [usize; 2],
    heights: Vec<f64>,
    /// Steepest slope that is reported.
    steepest: f64,
}

/// Steps of the grid along the longer side of the area.
const STEPS: f64 = 1024.0;
/// Rings of nodes around the area.
const RINGS: usize = 3;

/// Finest step of the grid for axes that follow a part, mm.
const FINEST: f64 = 0.05;
/// Share of the focal offset that smoothing may use for axes that follow a part.
const SHARE: f64 = 0.1;

impl HeightField {
    /// The height field for axes that follow a part over `area`, where marks may be `half_depth` mm out of focus; None where
    /// no node of the grid lies on the part.
    pub fn followed(surface: &Surface, area: Box2, half_depth: f64) -> Option<Self> {
        Self::over(surface, area, FINEST, SHARE * half_depth)
    }

    /// The height field of a part over `area`, no finer than `finest` mm, its nodes smoothed as far as they stay about
    /// `near` mm from the part; None where no node of the grid lies on the part.
    pub fn over(surface: &Surface, area: Box2, finest: f64, near: f64) -> Option<Self> {
        let size = area.size().map(Nm::mm);
        let step = (size[0].max(size[1]) / STEPS).max(finest);
        let origin = area.lo.mm().map(|v| v - RINGS as f64 * step);
        let count = size.map(|s| (s / step).ceil() as usize + 1 + 2 * RINGS);
        let mut heights = vec![f64::NAN; count[0] * count[1]];
        let mut tracer = Tracer::new(surface, f64::INFINITY);
        let nm = |v: f64| (v * NM_PER_MM).round() as i64;
        let (x0, x1) = (nm(origin[0]), nm(origin[0] + (count[0] - 1) as f64 * step));
        for (row, line) in heights.chunks_exact_mut(count[0]).enumerate() {
            let y = nm(origin[1] + row as f64 * step);
            let mut node = 0;
            tracer.segment(P2::new(x0, y), P2::new(x1, y), |p| {
                let last = (p.t1 * (count[0] - 1) as f64).floor() as usize;
                while node <= last {
                    if p.skip.is_none() {
                        line[node] = p.z(node as f64 / (count[0] - 1) as f64) / NM_PER_MM;
                    }
                    node += 1;
                }
            });
        }
        if !fill(&mut heights, count) {
            return None;
        }
        if near > 0.0 {
            smooth(&mut heights, count[0], near);
        }
        Some(Self { origin, step, count, heights, steepest: f64::INFINITY })
    }

    /// The height field with slopes of at most `steepest`: steeper ones are those of a smeared cliff, on which nothing
    /// is marked and no axis should lean.
    pub(crate) fn no_steeper_than(self, steepest: f64) -> Self {
        Self { steepest, ..self }
    }

    /// Largest angle between its normal and the vertical at a node of the grid, rad.
    pub(crate) fn steepest_lean(&self) -> f64 {
        let [columns, rows] = self.count;
        let node = |i: usize, j: usize| [self.origin[0] + i as f64 * self.step, self.origin[1] + j as f64 * self.step];
        let mut steepest = 0.0f64;
        for j in 0..rows {
            for i in 0..columns {
                let [x, y] = self.at(node(i, j)).slope;
                steepest = steepest.max(math::hypot(x, y));
            }
        }
        math::atan(steepest)
    }

    /// Distance of the grid's nodes.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Height and slope at a point; beyond the grid those of its border.
    pub fn at(&self, [x, y]: [f64; 2]) -> Height {
        let (i, u) = self.spline_cell(0, x);
        let (j, v) = self.spline_cell(1, y);
        let (wx, dx, wy, dy) = (weights(u), slopes(u), weights(v), slopes(v));
        let mut out = Height::default();
        for (row, (wy, dy)) in wy.into_iter().zip(dy).enumerate() {
            let line = &self.heights[(j + row) * self.count[0] + i..][..4];
            let dot = |w: &[f64; 4]| w.iter().zip(line).map(|(w, h)| w * h).sum::<f64>();
            let across = dot(&wx);
            out.z += wy * across;
            out.slope[0] += wy * dot(&dx) / self.step;
            out.slope[1] += dy * across / self.step;
        }
        let steep = math::hypot(out.slope[0], out.slope[1]);
        if steep > self.steepest {
            out.slope = out.slope.map(|s| s * (self.steepest / steep));
        }
        out
    }

    /// The first of the four nodes around a coordinate along an axis, and the part of a step beyond the second of them.
    fn spline_cell(&self, axis: usize, v: f64) -> (usize, f64) {
        let at = ((v - self.origin[axis]) / self.step).clamp(1.0, (self.count[axis] - 2) as f64);
        let first = (at.floor() as usize).min(self.count[axis] - 3) - 1;
        (first, at - (first + 1) as f64)
    }
}

/// Weights of the four nodes around a point, `t` of a step beyond the second: the uniform cubic B-spline.
fn weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s / 6.0, (4.0 + 3.0 * t * t * (t - 2.0)) / 6.0, (4.0 + 3.0 * s * s * (s - 2.0)) / 6.0, t * t * t / 6.0]
}

/// The derivatives of the four weights.
fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-s * s / 2.0, t * (3.0 * t - 4.0) / 2.0, -s * (3.0 * s - 4.0) / 2.0, t * t / 2.0]
}

/// Rounds of blurring: each adds the square of a step of the grid to the variance of the kernel.
const ROUNDS: usize = 64;
/// Rounds at the end without bounds, which take away what these have bent.
const LAST: usize = 4;

/// Smooths nodes and holds them within `near` of where they were; beside sharp edges the last rounds go farther.
///
/// A blur S lowers a hilltop by half its variance times the bend: on a hill of 4.7 mm and a standard deviation of 9 mm
/// by 10 um, and what follows it sees all marks there that much too high. S + S (1 - S) (twicing; Tukey, Exploratory
/// Data Analysis, 1977) keeps polynomials of degree three as they are, and takes ripples away nearly as well. What it
/// moves farther than `near`, at edges, is brought back by a correction that is itself blurred within bounds.
fn smooth(heights: &mut [f64], columns: usize, near: f64) {
    let unbound = |_: usize, z: f64| z;
    let mut trend = heights.to_vec();
    blur(&mut trend, columns, ROUNDS, unbound);
    let mut rest: Vec<f64> = heights.iter().zip(&trend).map(|(z, t)| z - t).collect();
    blur(&mut rest, columns, ROUNDS, unbound);
    // How far each node was moved, and the correction of that.
    let moved: Vec<f64> = heights.iter().zip(trend.iter().zip(&rest)).map(|(z, (t, r))| z - (t + r)).collect();
    let mut back = vec![0.0; moved.len()];
    if moved.iter().any(|d| d.abs() > near) {
        blur(&mut back, columns, ROUNDS, |i, z| z.clamp(moved[i] - near, moved[i] + near));
        blur(&mut back, columns, LAST, unbound);
    }
    heights.iter_mut().zip(moved.iter().zip(&back)).for_each(|(z, (d, b))| *z += b - d);
}

/// Blurs nodes again and again along both axes, each kept to its `bound` after every round.
fn blur(heights: &mut [f64], columns: usize, rounds: usize, bound: impl Fn(usize, f64) -> f64 + Sync) {
    let mut across = heights.to_vec();
    let rows = heights.len() / columns;
    for _ in 0..rounds {
        parallel::map_items(across.chunks_exact_mut(columns).collect(), |row, to: &mut [f64]| {
            let from = &heights[row * columns..][..columns];
            to.iter_mut().enumerate().for_each(|(i, z)| *z = blurred(i, columns, |i| from[i]));
        });
        parallel::map_items(heights.chunks_exact_mut(columns).collect(), |row, to: &mut [f64]| {
            for (i, z) in to.iter_mut().enumerate() {
                *z = bound(row * columns + i, blurred(row, rows, |r| across[r * columns + i]));
            }
        });
    }
}

/// The binomial mean of five neighbours in a line; beyond its ends the line continues as if turned about them.
#[inline]
fn blurred(i: usize, count: usize, line: impl Fn(usize) -> f64) -> f64 {
    let last = count - 1;
    if (2..count.saturating_sub(2)).contains(&i) {
        return (line(i - 2) + line(i + 2) + 4.0 * (line(i - 1) + line(i + 1)) + 6.0 * line(i)) / 16.0;
    }
    let neighbour = |by: isize| match i.wrapping_add_signed(by) {
        k if k <= last => line(k),
        k if k > isize::MAX as usize => 2.0 * line(0) - line(k.wrapping_neg().min(last)),
        k => 2.0 * line(last) - line((2 * last).saturating_sub(k)),
    };
    (neighbour(-2) + neighbour(2) + 4.0 * (neighbour(-1) + neighbour(1)) + 6.0 * neighbour(0)) / 16.0
}

/// The directions to the eight neighbours of a node.
const AROUND: [[i64; 2]; 8] = [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]];

/// The node so many steps from another in a direction; None beyond the grid of so many columns and rows.
fn node_from(node: usize, [dx, dy]: [i64; 2], steps: i64, count: [usize; 2]) -> Option<usize> {
    let [columns, rows] = count.map(|c| c as i64);
    let (x, y) = (node as i64 % columns + dx * steps, node as i64 / columns + dy * steps);
    ((0..columns).contains(&x) && (0..rows).contains(&y)).then_some((y * columns + x) as usize)
}

/// Fills unknown nodes ring by ring from known ones; false where none is known.
fn fill(heights: &mut [f64], count: [usize; 2]) -> bool {
    let neighbours = |node: usize| AROUND.iter().filter_map(move |&d| node_from(node, d, 1, count));
    let mut ring: Vec<usize> = (0..heights.len())
        .filter(|&i| heights[i].is_nan())
        .filter(|&i| neighbours(i).any(|n| heights[n].is_finite()))
        .collect();
    // Invariant: `ring` are the unknown nodes next to known ones. The part continues as it ends for a few rings;
    // farther out only its height does.
    for number in 0.. {
        if ring.is_empty() {
            break;
        }
        let keeps_slope = number <= RINGS;
        // All of a ring from what was known before it, so that its order does not matter.
        let filled: Vec<f64> = ring.iter().map(|&i| continued(heights, count, i, keeps_slope)).collect();
        ring.iter().zip(filled).for_each(|(&i, z)| heights[i] = z);
        let mut next: Vec<usize> = ring.iter().flat_map(|&i| neighbours(i)).filter(|&n| heights[n].is_nan()).collect();
        next.sort_unstable();
        next.dedup();
        ring = next;
    }
    heights.first().is_some_and(|z| z.is_finite())
}

/// The height of a node from its known neighbours: the mean of the lines through pairs of them if it keeps the slope
/// and there are any, else of their heights.
fn continued(heights: &[f64], count: [usize; 2], node: usize, keeps_slope: bool) -> f64 {
    let (mut level, mut sloped) = (Mean::default(), Mean::default());
    for d in AROUND {
        let known = |steps| node_from(node, d, steps, count).map(|n| heights[n]).filter(|z| z.is_finite());
        let Some(near) = known(1) else { continue };
        level.add(near);
        if let Some(far) = known(2).filter(|_| keeps_slope) {
            sloped.add_line(near, far);
        }
    }
    if sloped.count > 0.0 { sloped.sum / sloped.count } else { level.sum / level.count }
}

/// A mean of heights.
#[derive(Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, z: f64) {
        self.sum += z;
        self.count += 1.0;
    }

    /// Adds what the line through two nodes has one step before the nearer one.
    fn add_line(&mut self, near: f64, far: f64) {
        self.sum = self.sum + 2.0 * near - far;
        self.count += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(side: usize, size: f64, z: impl Fn(f64, f64) -> f64) -> Surface {
        let at = |i: usize| i as f64 * size / side as f64;
        let corner = |i: usize, j: usize| [at(i), at(j), z(at(i), at(j))];
        let facets = (0..side).flat_map(|j| (0..side).map(move |i| (i, j))).flat_map(|(i, j)| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        Surface::from_facets(facets.collect::<Vec<_>>(), &mut Vec::new()).expect("facets")
    }

    fn area(lo: f64, hi: f64) -> Box2 {
        let p = |v| P2::from_mm(v, v).expect("in range");
        Box2 { lo: p(lo), hi: p(hi) }
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn height_field_of_a_plane_is_exact_to_its_rim_and_beyond() {
        let height_field =
            HeightField::over(&surface(20, 20.0, |x, y| 0.2 * x - 0.1 * y), area(0.0, 20.0), 0.0, 1e-3).expect("part");
        for p in [[0.0, 0.0], [20.0, 20.0], [20.0, 0.02], [15.3, 11.7], [0.0, 13.0]] {
            let h = height_field.at(p);
            assert!((h.z - 0.2 * p[0] + 0.1 * p[1]).abs() < 1e-6, "{p:?}: {h:?}");
            assert!((h.slope[0] - 0.2).abs() < 1e-5 && (h.slope[1] + 0.1).abs() < 1e-5, "{p:?}: {h:?}");
        }
    }

    #[test]
    fn a_dome_is_smooth_across_facets_and_its_slopes_are_those_of_the_heights() {
        let z = |x: f64, y: f64| 10.0 - ((x - 25.0).powi(2) + (y - 25.0).powi(2)) / 100.0;
        let height_field = HeightField::over(&surface(200, 50.0, z), area(0.0, 50.0), 0.1, 0.0).expect("part");
        let mut before = height_field.at([10.0, 20.03]);
        let h = 0.01;
        for i in 1..2000 {
            let x = 10.0 + f64::from(i) * h;
            let here = height_field.at([x, 20.03]);
            assert!((here.z - z(x, 20.03)).abs() < 2e-3, "{x}: {here:?}");
            let mean = (here.slope[0] + before.slope[0]) / 2.0;
            assert!(((here.z - before.z) / h - mean).abs() < 1e-4, "{x}");
            assert!((here.slope[0] - before.slope[0]).abs() < 1e-3, "{x}: the slope jumps");
            before = here;
        }
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn smoothing_removes_facet_edges_within_tolerance() {
        // Facets of a millimetre on a sphere of 5 m.
        let z = |x: f64, y: f64| -((x - 25.0).powi(2) + (y - 25.0).powi(2)) / 10_000.0;
        let part = surface(50, 50.0, z);
        let rough = |near: f64| {
            let height_field = HeightField::over(&part, area(0.0, 50.0), 0.1, near).expect("part");
            let slope = |i: i32| height_field.at([15.0 + 0.05 * f64::from(i), 20.03]).slope[0];
            let off =
                (0..400).map(|i| (height_field.at([15.0 + 0.05 * f64::from(i), 20.03]).z, 15.0 + 0.05 * f64::from(i)));
            let off = off.map(|(h, x)| (h - z(x, 20.03)).abs()).fold(0.0, f64::max);
            // The slope of the sphere falls by the same everywhere.
            let steps = (0..399).map(|i| ((slope(i + 1) - slope(i)) + 0.05 / 5000.0).abs());
            (steps.fold(0.0, f64::max), off)
        };
        let ((facets, near), (smooth, far)) = (rough(0.0), rough(2e-3));
        assert!(smooth < 0.1 * facets, "{smooth} of {facets}");
        assert!(near < 1e-3 && far < 2.5e-3, "{near} {far}");
        // Held to nothing, nothing moves but by the last rounds.
        assert!(rough(1e-9).0 < facets && rough(1e-9).1 < 1e-3);
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn smoothing_leaves_the_height_of_a_hill_alone() {
        // The highest hill of the seven-axis part in facets of a quarter of a millimetre, smoothed within 10 um.
        let z = |x: f64, y: f64| 4.7 * math::exp(-((x - 10.0).powi(2) + (y - 10.0).powi(2)) / 162.0);
        let height_field = HeightField::over(&surface(80, 20.0, z), area(0.0, 20.0), 0.05, 0.01).expect("part");
        // The facets themselves lie up to 0.9 um below the hill: h² z'' / 8 of their diagonal.
        for p in [[10.0, 10.0], [10.1, 9.9], [12.0, 10.0], [5.0, 14.0], [10.0, 16.0]] {
            let off = height_field.at(p).z - z(p[0], p[1]);
            assert!((-1.2e-3..0.6e-3).contains(&off), "{p:?}: {off}");
        }
    }

    #[test]
    fn holes_are_bridged() {
        let mut facets = Vec::new();
        for (i, j) in (0..50).flat_map(|j| (0..50).map(move |i| (f64::from(i), f64::from(j)))) {
            if math::hypot(i - 25.0, j - 25.0) > 8.0 {
                let c = |x: f64, y: f64| [x, y, 3.0];
                facets.push([c(i, j), c(i + 1.0, j), c(i + 1.0, j + 1.0)]);
                facets.push([c(i, j), c(i + 1.0, j + 1.0), c(i, j + 1.0)]);
            }
        }
        let surface = Surface::from_facets(facets, &mut Vec::new()).expect("facets");
        let height_field = HeightField::over(&surface, area(0.0, 50.0), 0.1, 0.0).expect("part");
        assert!((height_field.at([25.0, 25.0]).z - 3.0).abs() < 1e-9);
    }
}

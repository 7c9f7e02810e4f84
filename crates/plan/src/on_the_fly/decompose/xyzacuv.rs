//! Seven axes: paths on a part within limits of focus, angle and field.

use std::f64::consts::PI;
use terrace_core::math;

use super::corridor::{least_from, within};
use crate::on_the_fly::axes::kinematics::{Axes, Deviation, Pivot, Pose, TurnedAbout, nearest_half_turn, turned};
use crate::on_the_fly::banded_qp::Row;
use terrace_core::geom::{P3Mm, UnitVector};
use terrace_core::parallel;

/// How far a mark may lie from what its tool would like best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Out of focus along the beam, mm.
    pub half_depth: f64,
    /// Angle of the beam to the normal, rad.
    pub angle: f64,
    /// Across the beam, mm.
    pub field: f64,
}

impl Limits {
    /// A share of each.
    pub fn scaled(self, share: f64) -> Self {
        Self { half_depth: share * self.half_depth, angle: share * self.angle, field: share * self.field }
    }

    /// No part of a deviation is larger than its limit.
    pub fn hold(&self, d: Deviation) -> bool {
        d.defocus <= self.half_depth && d.angle <= self.angle && d.lateral <= self.field
    }
}

/// Poses on a surface, given as z, ∂z/∂x and ∂z/∂y of x and y, over a path in plan.
pub fn on_surface<F>(plan: &[[f64; 2]], surface: impl Fn(f64, f64) -> (f64, f64, f64)) -> Vec<Pose<F>> {
    plan.iter().map(|&at| Pose::on_surface(at, &surface)).collect()
}

/// Share of the angle that C may use up; what is left is A's.
const FOR_C: f64 = 0.7;
/// Sides of the polygon that stands for the round field.
const SIDES: usize = 16;
/// Share of the limits that is used: rounding must not pass them.
const INSIDE: f64 = 1.0 - 1e-9;

/// Stage axes of least acceleration that keep all limits at every mark.
///
/// One after the other, each the least of its summed squared second differences while the others are as they are:
/// - C. A tilt of the normal by t lets C be off by asin(sin β / sin t) for a limit β of the angle, and by anything
///   where t ≤ β. C and C + π serve alike (A then counts the other way), so a path that crosses the pole goes straight
///   on and A passes through 0.
/// - A, in the interval that the angle leaves it at that C.
/// - X, Y, Z. In the turned frame the marks are points Q, the scanner's U, V and the focus are Q - (X, Y, Z), and so X
///   and Y have a disc (a polygon of 16 sides within it) and Z an interval.
///
/// Every limit is kept exactly; the least of all axes together it need not be. Cost goes with the number of marks.
/// Normals must point up. `steps` are the lengths of path from mark to mark, none where they are even. The machine must
/// let A pass through 0 to both sides.
pub fn seven_axes(marks: &[Pose<Pivot>], steps: &[f64], limits: Limits) -> Vec<Axes> {
    let angle = limits.angle * INSIDE;
    let c = turntable(marks, steps, angle);
    let a = swivel(marks, steps, &c, angle);
    let turned: Vec<P3Mm<TurnedAbout<Pivot>>> =
        marks.iter().zip(&a).zip(&c).map(|((mark, &a), &c)| turned(a, c, mark.p)).collect();
    let (plan, z) = parallel::both(
        || in_field(&turned, steps, limits.field * INSIDE),
        || in_focus(&turned, steps, limits.half_depth * INSIDE),
    );
    (0..marks.len()).map(|i| Axes { xyz: P3Mm::new([plan[2 * i], plan[2 * i + 1], z[i]]), a: a[i], c: c[i] }).collect()
}

/// C along the path.
fn turntable(marks: &[Pose<Pivot>], steps: &[f64], angle: f64) -> Vec<f64> {
    let reach = FOR_C * math::sin(angle);
    // The C of each mark that needs one, with how far it may be off, and between them straight lines.
    let mut start = vec![0.0; marks.len()];
    let mut ends = vec![[f64::NEG_INFINITY, f64::INFINITY]; marks.len()];
    // Invariant: up to `last`, the last mark that needs a C, `start` is known.
    let mut last: Option<usize> = None;
    for (i, mark) in marks.iter().enumerate() {
        let UnitVector([x, y, _]) = mark.n;
        let tilt = math::hypot(x, y);
        if tilt <= reach {
            continue;
        }
        // Of C and C + π the nearer to the last.
        let own = math::atan2(-x, y);
        start[i] = last.map_or(own, |l| nearest_half_turn(own, start[l]));
        let off = math::asin(reach / tilt);
        ends[i] = [start[i] - off, start[i] + off];
        let (from, begin) = last.map_or((0, start[i]), |l| (l, start[l]));
        for j in from..i {
            let share = (j - from) as f64 / (i - from) as f64;
            start[j] = begin + share * (start[i] - begin);
        }
        last = Some(i);
    }
    if let Some(l) = last {
        let at = start[l];
        start[l..].fill(at);
    }
    within(start, steps, &ends)
}

/// A along the path, for its C.
fn swivel(marks: &[Pose<Pivot>], steps: &[f64], c: &[f64], angle: f64) -> Vec<f64> {
    let (start, ends) = marks
        .iter()
        .zip(c)
        .map(|(mark, c)| {
            // The normal's part in the plane in which A turns the tool, and its angle there.
            let UnitVector([i, j, k]) = mark.n;
            let across = j * math::cos(*c) - i * math::sin(*c);
            let (own, part) = (math::atan2(across, k), math::hypot(across, k));
            // cos of the beam's angle to the normal is part × cos(A - own).
            let off = math::acos((math::cos(angle) / part).min(1.0));
            (own, [own - off, own + off])
        })
        .unzip::<_, _, Vec<_>, Vec<_>>();
    within(start, steps, &ends)
}

/// Z along the path, within `half_depth` of the marks in the turned frame.
fn in_focus(marks: &[P3Mm<TurnedAbout<Pivot>>], steps: &[f64], half_depth: f64) -> Vec<f64> {
    let heights: Vec<f64> = marks.iter().map(|q| q[2]).collect();
    let ends: Vec<[f64; 2]> = heights.iter().map(|z| [z - half_depth, z + half_depth]).collect();
    within(heights, steps, &ends)
}

/// X and Y along the path, one after the other, within `field` of the marks in the turned frame.
fn in_field(marks: &[P3Mm<TurnedAbout<Pivot>>], steps: &[f64], field: f64) -> Vec<f64> {
    let start: Vec<f64> = marks.iter().flat_map(|q| q.xy()).collect();
    // The polygon within the disc: its sides are `inner` from the middle, its corners on the circle.
    let inner = field * math::cos(PI / SIDES as f64);
    if inner <= 0.0 {
        return start;
    }
    let rows: Vec<Row<2>> = (0..marks.len())
        .flat_map(|i| {
            (0..SIDES / 2).map(move |s| {
                let (sin, cos) = math::sin_cos(2.0 * PI * s as f64 / SIDES as f64);
                Row { at: 2 * i, a: [cos, sin], lo: -inner, hi: inner }
            })
        })
        .collect();
    let moved = least_from::<2, 2>(&start, steps, rows, inner);
    start.iter().zip(moved).map(|(x, d)| x + d).collect()
}

//! Part of `summary`: how far marks lie from the optical axis, as `off_axis_mm` says.
//!
//! The length of a line within a circle is that of a chord; so much of the marks must lie within the stated distance,
//! and less within the next smaller one that could have been stated.

use crate::read::manifest::OffAxis;
use terrace_core::geom::{FieldPoint, NM_PER_MM};
use terrace_core::math;
use terrace_core::program::Program;

/// Distances and shares agree to this, as docs/explanation/verify.md states.
const NEAR: f64 = 1e-9;

/// Distances are stated in steps of this share of the largest one, as docs/explanation/verify.md states.
const STEP: f64 = 1.0 / 512.0;

/// The share of the marked length that `p95` speaks of.
const SHARE: f64 = 0.95;

/// The fault of the stated distances.
pub(super) fn fault(stated: &OffAxis, program: &Program) -> Option<String> {
    let radius = |p: &FieldPoint| math::hypot(f64::from(p.x), f64::from(p.y)) / NM_PER_MM;
    let largest = program.points.iter().map(radius).fold(0.0, f64::max);
    let OffAxis { largest: stated_largest, p95 } = *stated;
    let is_near = (stated_largest - largest).abs() <= NEAR * largest.max(1.0); // never of a NaN
    if !is_near {
        return Some(format!("off_axis_mm.largest is given as {stated_largest}, but is {largest}"));
    }
    if largest == 0.0 {
        return (p95 != 0.0).then(|| format!("off_axis_mm.p95 is given as {p95}, but all marks lie on the axis"));
    }
    // Many dots may lie at one distance, and that at the end of a step: there a rounding of f64 decides over all of
    // them.
    let near = NEAR * largest;
    let shares = [p95 + near, p95 - largest * STEP - near].map(|r| share_within(program, r));
    let is_near =
        p95.is_finite() && shares[0] >= SHARE - NEAR && shares[1] < SHARE + NEAR && p95 <= largest * (1.0 + NEAR);
    (!is_near).then(|| {
        let percent = shares.map(|s| (s * 1e4).round() / 1e2);
        format!(
            "off_axis_mm.p95 is given as {p95}, within which {} % of the marks lie ({} % a step below)",
            percent[0], percent[1]
        )
    })
}

/// The share of the marked length that lies within a distance from the axis, mm; of the dots where nothing has a
/// length.
fn share_within(program: &Program, radius: f64) -> f64 {
    let (mut inside, mut all) = (0.0, 0.0);
    let (mut dots_inside, mut dots) = (0u64, 0u64);
    let place = |p: FieldPoint| [f64::from(p.x), f64::from(p.y)].map(|v| v / NM_PER_MM);
    for points in program.strokes.iter().map(|s| program.points_of(s)) {
        if let [dot] = points {
            let [x, y] = place(*dot);
            dots += 1;
            dots_inside += u64::from(math::hypot(x, y) <= radius);
        }
        for w in points.windows(2) {
            let (a, b) = (place(w[0]), place(w[1]));
            let d = [b[0] - a[0], b[1] - a[1]];
            let length = math::hypot(d[0], d[1]);
            all += length;
            // |a + t d| = radius, for t between 0 and 1.
            let (square, half, rest) =
                (length * length, a[0] * d[0] + a[1] * d[1], a[0] * a[0] + a[1] * a[1] - radius * radius);
            let root = half * half - square * rest;
            if radius > 0.0 && square > 0.0 && root > 0.0 {
                let ends = [-root.sqrt(), root.sqrt()].map(|s| ((s - half) / square).clamp(0.0, 1.0));
                inside += (ends[1] - ends[0]) * length;
            }
        }
    }
    if all > 0.0 { inside / all } else { dots_inside as f64 / dots.max(1) as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::program::sample;

    #[test]
    fn dots_at_one_distance_may_lie_at_the_end_of_a_step() {
        let (mut program, _) = sample::program();
        let stroke = program.strokes[0];
        program.blocks.truncate(1);
        for far in [1, 2, 3, 7, 512, 1024, 40_000_000] {
            for share in [256, 512] {
                let at = (i64::from(far) * share / 512) as i32;
                let places = (0..20).map(|i| if i == 0 { [far, 0] } else { [0, at] });
                program.points = places.map(|[x, y]| FieldPoint::new(x, y)).collect();
                program.strokes =
                    (0..20).map(|first| terrace_core::program::Stroke { first, len: 1, ..stroke }).collect();
                program.blocks[0].strokes = 0..20;
                let terrace_core::program::OffAxis { largest, p95 } = terrace_core::program::OffAxis::of(&program);
                assert_eq!(fault(&OffAxis { largest, p95 }, &program), None, "{far} {share}");
            }
        }
    }

    #[test]
    fn other_distances_than_those_of_the_marks_are_faults() {
        let (program, _) = sample::program();
        let sound = terrace_core::program::OffAxis::of(&program);
        let stated = |largest: f64, p95: f64| fault(&OffAxis { largest, p95 }, &program);
        assert_eq!(stated(sound.largest, sound.p95), None);
        let step = sound.largest / 512.0;
        for (largest, p95) in [
            (sound.largest * 1.000_001, sound.p95),
            (sound.largest, sound.p95 + 1.01 * step),
            (sound.largest, sound.p95 - 1.01 * step),
            (sound.largest, sound.largest + step),
            (f64::NAN, sound.p95),
            (sound.largest, f64::NAN),
        ] {
            assert!(stated(largest, p95).is_some(), "{largest} {p95}");
        }
    }
}

//! The convex hull of points of a plane, and how wide it is.

use terrace_core::math;

/// The least distance of two parallel lines that have all points between them, mm: one lies along a side of the hull.
pub(crate) fn least_width(points: Vec<[f64; 2]>) -> f64 {
    let hull = hull(points);
    let n = hull.len();
    let across = |i: usize| {
        let (a, b) = (hull[i], hull[(i + 1) % n]);
        let length = math::hypot(b[0] - a[0], b[1] - a[1]).max(f64::MIN_POSITIVE);
        hull.iter().map(|&p| turns(a, b, p) / length).fold(0.0, f64::max)
    };
    if n < 3 { 0.0 } else { (0..n).map(across).fold(f64::INFINITY, f64::min) }
}

/// The corners of the convex hull, counterclockwise (Andrew, Information Processing Letters 9, 1979).
fn hull(mut sorted: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let half = |along: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in along {
            while let [.., a, b] = chain[..] {
                if turns(a, b, p) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        // Its last point is the first of the other half.
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// Twice the area of a triangle, positive where it turns to the left.
fn turns(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

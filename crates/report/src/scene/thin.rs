//! Lines with fewer points (Douglas and Peucker 1973), in space.

/// Which points of a line are kept so that no other lies farther than `limit` from it; ends always. `spans` is room to
/// work in.
pub(super) fn thin(points: &[[f64; 3]], limit: f64, keep: &mut Vec<bool>, spans: &mut Vec<(usize, usize)>) {
    keep.clear();
    keep.resize(points.len(), points.len() < 3);
    let Some(last) = points.len().checked_sub(1).filter(|_| points.len() > 2) else { return };
    spans.push((0, last));
    while let Some((lo, hi)) = spans.pop() {
        (keep[lo], keep[hi]) = (true, true);
        let mut worst = (limit * limit, 0);
        for i in lo + 1..hi {
            let d = distance2(points[i], points[lo], points[hi]);
            if d > worst.0 {
                worst = (d, i);
            }
        }
        if worst.1 > 0 {
            spans.extend([(lo, worst.1), (worst.1, hi)]);
        }
    }
}

/// Square of the distance from `p` to the segment from `a` to `b`.
fn distance2(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let minus = |u: [f64; 3], v: [f64; 3]| [u[0] - v[0], u[1] - v[1], u[2] - v[2]];
    let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let (ab, ap) = (minus(b, a), minus(p, a));
    let len2 = dot(ab, ab);
    let t = if len2 > 0.0 { (dot(ap, ab) / len2).clamp(0.0, 1.0) } else { 0.0 };
    let off = minus(ap, ab.map(|v| v * t));
    dot(off, off)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_runs_lose_their_inner_points_and_corners_stay() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.001, 0.0], [3.0, 0.0, 0.0], [3.0, 2.0, 0.0], [3.0, 2.0, 1.0]];
        let mut keep = Vec::new();
        let mut spans = Vec::new();
        thin(&points, 0.01, &mut keep, &mut spans);
        assert_eq!(keep, [true, false, false, true, true, true]);
        thin(&points, 0.0005, &mut keep, &mut spans);
        assert_eq!(keep, [true, false, true, true, true, true]);
        thin(&points[..2], 0.01, &mut keep, &mut spans);
        assert_eq!(keep, [true, true]);
        // There and back: the far end stays though it lies on the line between the ends' neighbours.
        thin(&[[0.0; 3], [5.0, 0.0, 0.0], [0.0; 3]], 0.01, &mut keep, &mut spans);
        assert_eq!(keep, [true; 3]);
    }
}

//! B-splines as Bézier curves: rational or not, clamped or not, from control points or through fit points.

use super::space::{SpaceMap, add, length, sub, times, unit};
use terrace_core::geom::SpacePoint;

/// Highest degree that is read; drawing programs write 3, rarely up to 11.
const MAX_DEGREE: usize = 25;

/// A curve by control points, knots and weights, or by points on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Spline {
    pub(super) degree: usize,
    pub(super) knots: Vec<f64>,
    pub(super) control: Vec<SpacePoint>,
    /// Of the control points; empty where all are 1.
    pub(super) weights: Vec<f64>,
    pub(super) fit: Vec<SpacePoint>,
    /// Whether it is said to be closed, but has fit points alone that do not close: how it continues is not known.
    pub(super) is_open_loop: bool,
    /// Directions at both ends of a curve through fit points.
    pub(super) tangents: Option<[SpacePoint; 2]>,
}

impl Spline {
    /// The curve as Bézier curves, one for each span of knots that has a length; None where the description is faulty.
    ///
    /// What is drawn lies between knot number `degree` (from 0) and the one as far from the end: all of a clamped
    /// curve, and what repeated control points close of a periodic one.
    pub(super) fn pieces(&self) -> Option<Vec<Bezier>> {
        if self.is_open_loop {
            return None;
        }
        if self.control.is_empty() {
            return through(&self.fit, self.tangents);
        }
        let p = self.degree;
        let n = self.control.len();
        let is_sound = (1..=MAX_DEGREE).contains(&p)
            && n > p
            && (self.knots.is_empty() || self.knots.len() == n + p + 1)
            && (self.weights.is_empty() || self.weights.len() == n)
            && self.knots.windows(2).all(|k| k[0] <= k[1])
            && self.weights.iter().all(|&w| w > 0.0);
        if !is_sound {
            return None;
        }
        // Without knots: clamped and even.
        let even = || (0..=n + p).map(|i| i.saturating_sub(p).min(n - p) as f64).collect();
        let knots: Vec<f64> = if self.knots.is_empty() { even() } else { self.knots.clone() };
        let weight = |i: usize| self.weights.get(i).copied().unwrap_or(1.0);
        let control: Vec<[f64; 4]> = (0..n)
            .map(|i| {
                let w = weight(i);
                let [x, y, z] = self.control[i];
                [w * x, w * y, w * z, w]
            })
            .collect();
        // Spans that are noise beside the whole would only divide by it.
        let least = (knots[n] - knots[p]) * 1e-12;
        let spans = (p..n).filter(|&k| knots[k + 1] - knots[k] > least);
        let pieces: Vec<Bezier> = spans.map(|k| Bezier(span(&knots, &control, p, k))).collect();
        let is_finite = pieces.iter().flat_map(|b| &b.0).flatten().all(|v| v.is_finite());
        (is_finite && !pieces.is_empty()).then_some(pieces)
    }
}

/// The Bézier points of the span from knot k to the next: blossoms of both ends (Ramshaw 1989), each by the
/// recursion of de Boor with one parameter for each step.
fn span(knots: &[f64], control: &[[f64; 4]], p: usize, k: usize) -> Vec<[f64; 4]> {
    (0..=p)
        .map(|j| {
            let mut d = control[k - p..=k].to_vec();
            for r in 1..=p {
                // j of the p parameters are the upper end.
                let t = if r <= j { knots[k + 1] } else { knots[k] };
                for i in (r..=p).rev() {
                    let lo = knots[k + i - p];
                    let hi = knots[k + 1 + i - r];
                    let s = (t - lo) / (hi - lo);
                    d[i] = between(d[i - 1], d[i], s);
                }
            }
            d[p]
        })
        .collect()
}

/// The cubic curve through points, parametrised by the lengths of their chords: with these directions at its ends, or
/// without curvature there. ezdxf's `fit_points_to_cad_cv` is the same curve.
fn through(points: &[SpacePoint], tangents: Option<[SpacePoint; 2]>) -> Option<Vec<Bezier>> {
    let mut q: Vec<SpacePoint> = points.to_vec();
    q.dedup();
    let n = q.len().checked_sub(1).filter(|&n| n > 0)?;
    let h: Vec<f64> = q.windows(2).map(|w| length(sub(w[1], w[0]))).collect();
    let slope: Vec<SpacePoint> = (0..n).map(|i| times(sub(q[i + 1], q[i]), 1.0 / h[i])).collect();
    // First derivatives m at the points: curvature is continuous, a tridiagonal system.
    let ends = tangents.and_then(|[a, b]| Some([unit(a)?, unit(b)?]));
    let mut lower = vec![0.0; n + 1];
    let mut diagonal = vec![1.0; n + 1];
    let mut upper = vec![0.0; n + 1];
    let mut m = vec![[0.0; 3]; n + 1];
    match ends {
        Some([a, b]) => {
            m[0] = a;
            m[n] = b;
        }
        // No second derivative at an end: 2 m0 + m1 = 3 times the first slope.
        None => {
            diagonal[0] = 2.0;
            upper[0] = 1.0;
            m[0] = times(slope[0], 3.0);
            diagonal[n] = 2.0;
            lower[n] = 1.0;
            m[n] = times(slope[n - 1], 3.0);
        }
    }
    // The second derivatives of the cubics before and after a point are one.
    for i in 1..n {
        lower[i] = h[i];
        diagonal[i] = 2.0 * (h[i - 1] + h[i]);
        upper[i] = h[i - 1];
        m[i] = times(add(times(slope[i - 1], h[i]), times(slope[i], h[i - 1])), 3.0);
    }
    // Elimination without pivots: the diagonal dominates.
    for i in 1..=n {
        let f = lower[i] / diagonal[i - 1];
        diagonal[i] -= f * upper[i - 1];
        m[i] = sub(m[i], times(m[i - 1], f));
    }
    m[n] = times(m[n], 1.0 / diagonal[n]);
    for i in (0..n).rev() {
        m[i] = times(sub(m[i], times(m[i + 1], upper[i])), 1.0 / diagonal[i]);
    }
    let pieces: Vec<Bezier> = (0..n).map(|i| Bezier::hermite([q[i], q[i + 1]], [m[i], m[i + 1]], h[i])).collect();
    pieces.iter().flat_map(|b| &b.0).flatten().all(|v| v.is_finite()).then_some(pieces)
}

/// Control points of a Bézier curve, times their weight, and the weight.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bezier(Vec<[f64; 4]>);

impl Bezier {
    /// The cubic between two points with these derivatives at them by a parameter that runs over `h`.
    fn hermite(ends: [SpacePoint; 2], derivatives: [SpacePoint; 2], h: f64) -> Self {
        let third = h / 3.0;
        let a = add(ends[0], times(derivatives[0], third));
        let b = sub(ends[1], times(derivatives[1], third));
        Self([ends[0], a, b, ends[1]].map(|[x, y, z]| [x, y, z, 1.0]).to_vec())
    }

    pub(super) fn mapped(&self, map: SpaceMap) -> Self {
        let image = |&[x, y, z, w]: &[f64; 4]| {
            let [x, y, z] = map.at([x / w, y / w, z / w]);
            [w * x, w * y, w * z, w]
        };
        Self(self.0.iter().map(image).collect())
    }

    pub(super) fn start(&self) -> SpacePoint {
        point(self.0[0])
    }

    pub(super) fn end(&self) -> SpacePoint {
        point(self.0[self.0.len() - 1])
    }

    /// Whether all control points, and so the whole curve, lie this near to the chord.
    pub(super) fn is_flat(&self, tolerance: f64) -> bool {
        let a = self.start();
        let b = self.end();
        let d = sub(b, a);
        let square = super::space::dot(d, d);
        self.0.iter().all(|&p| {
            let v = sub(point(p), a);
            let t = if square > 0.0 { (super::space::dot(v, d) / square).clamp(0.0, 1.0) } else { 0.0 };
            length(sub(v, times(d, t))) <= tolerance
        })
    }

    /// The two halves (de Casteljau).
    pub(super) fn halves(&self) -> [Self; 2] {
        let mut row = self.0.clone();
        let mut first = vec![row[0]];
        let mut second = vec![row[row.len() - 1]];
        while row.len() > 1 {
            row = row.windows(2).map(|w| between(w[0], w[1], 0.5)).collect();
            first.push(row[0]);
            second.push(row[row.len() - 1]);
        }
        second.reverse();
        [Self(first), Self(second)]
    }
}

fn between(a: [f64; 4], b: [f64; 4], s: f64) -> [f64; 4] {
    let r = 1.0 - s;
    [r * a[0] + s * b[0], r * a[1] + s * b[1], r * a[2] + s * b[2], r * a[3] + s * b[3]]
}

fn point([x, y, z, w]: [f64; 4]) -> SpacePoint {
    [x / w, y / w, z / w]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of the curve by the definition of its basis functions (Cox and de Boor).
    fn by_definition(s: &Spline, t: f64) -> SpacePoint {
        fn basis(knots: &[f64], i: usize, p: usize, t: f64) -> f64 {
            if p == 0 {
                return f64::from(u8::from(knots[i] <= t && t < knots[i + 1]));
            }
            let part = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
            part(t - knots[i], knots[i + p] - knots[i]) * basis(knots, i, p - 1, t)
                + part(knots[i + p + 1] - t, knots[i + p + 1] - knots[i + 1]) * basis(knots, i + 1, p - 1, t)
        }
        let (mut sum, mut weight) = ([0.0; 3], 0.0);
        for (i, &c) in s.control.iter().enumerate() {
            let w = basis(&s.knots, i, s.degree, t) * s.weights.get(i).copied().unwrap_or(1.0);
            sum = add(sum, times(c, w));
            weight += w;
        }
        times(sum, 1.0 / weight)
    }

    fn at(b: &Bezier, t: f64) -> SpacePoint {
        let mut row = b.0.clone();
        while row.len() > 1 {
            row = row.windows(2).map(|w| [0, 1, 2, 3].map(|c| (1.0 - t) * w[0][c] + t * w[1][c])).collect();
        }
        point(row[0])
    }

    #[test]
    fn pieces_are_the_curve_of_the_definition() {
        let control: Vec<SpacePoint> = [[0.0, 0.0], [1.0, 2.0], [3.0, -1.0], [4.0, 4.0], [6.0, 0.0], [7.0, 1.0]]
            .map(|[x, y]| [x, y, x * y])
            .to_vec();
        let weights = vec![1.0, 0.5, 3.0, 1.0, 2.0, 1.0];
        for (degree, knots) in [
            (3, vec![0.0, 0.0, 0.0, 0.0, 0.3, 0.6, 1.0, 1.0, 1.0, 1.0]),
            (2, vec![-2.0, -1.0, 0.0, 1.0, 2.0, 2.0, 4.0, 5.0, 7.0]),
            (5, vec![0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
            (1, vec![0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0]),
        ] {
            for weights in [Vec::new(), weights.clone()] {
                let s = Spline { degree, knots: knots.clone(), control: control.clone(), weights, ..Spline::default() };
                let pieces = s.pieces().expect("sound");
                let spans: Vec<[f64; 2]> =
                    (degree..control.len()).map(|k| [knots[k], knots[k + 1]]).filter(|[a, b]| a < b).collect();
                assert_eq!(pieces.len(), spans.len());
                for (piece, [a, b]) in pieces.iter().zip(spans) {
                    for t in [0.0, 0.25, 0.7, 0.999] {
                        let miss = length(sub(at(piece, t), by_definition(&s, a + t * (b - a))));
                        assert!(miss < 1e-12, "degree {degree} at {t} of {a} to {b}: {miss}");
                    }
                }
            }
        }
    }

    #[test]
    fn fit_curve_passes_its_points_smoothly_with_the_given_ends() {
        let points = [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [4.0, 2.5, 1.0], [4.0, 2.5, 1.0], [5.0, 0.0, 0.0]];
        for tangents in [None, Some([[0.0, 3.0, 0.0], [2.0, 0.0, 0.0]])] {
            let s = Spline { fit: points.to_vec(), tangents, ..Spline::default() };
            let pieces = s.pieces().expect("sound");
            assert_eq!(pieces.len(), 3, "the doubled point counts once");
            assert_eq!((pieces[0].start(), pieces[2].end()), (points[0], points[4]));
            // Second derivatives with respect to the length of the chords.
            let bends = |b: &Bezier| {
                let p: Vec<SpacePoint> = b.0.iter().map(|&p| point(p)).collect();
                let h = length(sub(p[3], p[0]));
                let bend = |i: usize| times(add(sub(p[i], times(p[i + 1], 2.0)), p[i + 2]), 6.0 / (h * h));
                [bend(0), bend(1)]
            };
            for w in pieces.windows(2) {
                assert!(length(sub(bends(&w[0])[1], bends(&w[1])[0])) < 1e-12, "curvature is continuous");
            }
            match tangents {
                None => assert!(length(bends(&pieces[0])[0]) < 1e-12 && length(bends(&pieces[2])[1]) < 1e-12),
                Some(_) => {
                    let first = sub(point(pieces[0].0[1]), points[0]);
                    assert!(first[0].abs() < 1e-12 && (3.0 * first[1] - 5f64.sqrt()).abs() < 1e-12, "{first:?}");
                }
            }
        }
    }

    #[test]
    fn faulty_descriptions_are_refused() {
        type Spoil = fn(&mut Spline);
        let sound = Spline {
            degree: 1,
            knots: vec![0.0, 0.0, 1.0, 1.0],
            control: vec![[0.0; 3], [1.0; 3]],
            ..Spline::default()
        };
        assert!(sound.pieces().is_some());
        let faults: [(&str, Spoil); 7] = [
            ("one knot too few", |s| s.knots.truncate(3)),
            ("knots that fall", |s| s.knots[2] = -1.0),
            ("no length", |s| s.knots = vec![0.0; 4]),
            ("degree 0", |s| s.degree = 0),
            ("degree too high for the points", |s| s.degree = 2),
            ("a weight of zero", |s| s.weights = vec![1.0, 0.0]),
            ("no points", |s| s.control.clear()),
        ];
        for (what, spoil) in faults {
            let mut s = sound.clone();
            spoil(&mut s);
            assert_eq!(s.pieces(), None, "{what}");
        }
    }
}

//! Runs whose axes are all linear in s: one rest-to-rest move in closed form.

use super::{Limit, Path, Ratio, Report, Solved};

/// Share of a limit that a bend may use up in a run that still counts as straight.
const STRAIGHT: f64 = 1e-4;

/// A symmetric S-curve from rest to rest along s.
#[derive(Clone, Copy, Debug)]
struct Curve {
    length: f64,
    /// Jerk; infinite without limit.
    jerk: f64,
    /// Time of each even-jerk part of a ramp; 0 without jerk limit.
    bent: f64,
    /// Time of even acceleration on a ramp, and that acceleration.
    even: f64,
    acceleration: f64,
    peak: f64,
    /// Time at the peak.
    cruise: f64,
}

impl Curve {
    /// The same cases as `motion::rest_to_rest`.
    fn new(length: f64, v: f64, a: f64, jerk: Option<f64>) -> Self {
        let bend = jerk.map_or(0.0, |j| a / j);
        // Time of a ramp up to `peak`; the mean speed on it is half of that.
        let ramp = |peak: f64| match jerk {
            Some(j) if peak * j < a * a => 2.0 * (peak / j).sqrt(),
            _ => peak / a + bend,
        };
        let mut peak = v;
        if v * ramp(v) > length {
            // peak (peak / a + bend) = length, or where acceleration is never reached 2 peak^(3/2) / √j = length.
            peak = 0.5 * a * ((bend * bend + 4.0 * length / a).sqrt() - bend);
            if let Some(j) = jerk.filter(|j| peak * j < a * a) {
                peak = (0.25 * length * length * j).cbrt();
            }
        }
        let whole = ramp(peak);
        let bent = if jerk.is_some_and(|j| peak * j < a * a) { 0.5 * whole } else { bend };
        let even = (whole - 2.0 * bent).max(0.0);
        let cruise = (length - peak * whole).max(0.0) / peak;
        Self {
            length,
            jerk: jerk.unwrap_or(f64::INFINITY),
            bent,
            even,
            acceleration: peak / (bent + even),
            peak,
            cruise,
        }
    }

    fn ramp(&self) -> f64 {
        2.0 * self.bent + self.even
    }

    fn total(&self) -> f64 {
        2.0 * self.ramp() + self.cruise
    }

    /// Way and speed at `t` of the first ramp or the cruise.
    fn rising(&self, t: f64) -> [f64; 2] {
        let (j, a) = (self.jerk, self.acceleration);
        if t < self.bent {
            return [j * t * t * t / 6.0, 0.5 * j * t * t];
        }
        if t <= self.bent + self.even {
            let u = t - self.bent;
            // What the first part covered.
            let (x, v) = (a * self.bent * self.bent / 6.0, 0.5 * a * self.bent);
            return [x + u * (v + 0.5 * a * u), v + a * u];
        }
        let ramp = self.ramp();
        let left = ramp - t;
        let x = 0.5 * self.peak * ramp;
        if left <= 0.0 {
            return [x - self.peak * left, self.peak];
        }
        [x - left * (self.peak - j * left * left / 6.0), self.peak - 0.5 * j * left * left]
    }

    fn at(&self, t: f64) -> [f64; 2] {
        if 2.0 * t <= self.total() {
            return self.rising(t);
        }
        let [x, v] = self.rising(self.total() - t);
        [self.length - x, v]
    }

    /// Times where the jerk changes.
    fn corners(&self) -> [f64; 6] {
        let [p, q, r] = [self.bent, self.bent + self.even, self.ramp()];
        [p, q, r].into_iter().chain([r, q, p].map(|t| self.total() - t)).collect::<Vec<_>>().try_into().expect("six")
    }

    /// When `x` is reached.
    fn when(&self, x: f64) -> f64 {
        let (mut lo, mut hi) = (0.0, self.total());
        for _ in 0..60 {
            let mid = 0.5 * (lo + hi);
            if self.at(mid)[0] < x { lo = mid } else { hi = mid }
        }
        0.5 * (lo + hi)
    }
}

/// The run `first..=last` in closed form, where it has one.
pub(super) fn solve(path: &Path, limits: &[Limit], first: usize, last: usize, bends: &[f64]) -> Option<Solved> {
    let k = limits.len();
    let length = path.s[last] - path.s[first];
    let mut along = Limit { speed: f64::INFINITY, acceleration: f64::INFINITY, jerk: None };
    for (a, l) in limits.iter().enumerate() {
        let slope = ((path.positions[last * k + a] - path.positions[first * k + a]) / length).abs();
        along.speed = along.speed.min(l.speed / slope);
        along.acceleration = along.acceleration.min(l.acceleration / slope);
        let jerk = l.jerk.map_or(f64::INFINITY, |j| j / slope).min(along.jerk.unwrap_or(f64::INFINITY));
        along.jerk = Some(jerk).filter(|j| j.is_finite());
    }
    if !along.acceleration.is_finite() {
        return None;
    }
    let v = along.speed.min(path.caps[first]);
    let one_cap = path.caps[first..last].iter().all(|c| along.speed.min(*c) == v);
    if !(one_cap && is_straight(path, limits, first, last, bends, v)) {
        return None;
    }
    let curve = Curve::new(length, v, along.acceleration, along.jerk);
    let mut solved = lay(path, &curve, first, last);
    // Where it has an even jerk at all, that is the limit.
    let jerk = if curve.jerk.is_finite() { 1.0 } else { 0.0 };
    solved.report.ratio = Ratio { speed: curve.peak / v, acceleration: curve.acceleration / along.acceleration, jerk };
    Some(solved)
}

/// Whether no axis is bent so much that it would show at speed `v`.
fn is_straight(path: &Path, limits: &[Limit], first: usize, last: usize, bends: &[f64], v: f64) -> bool {
    let k = limits.len();
    (first..last).all(|node| {
        let width = path.s[node + 1] - path.s[node];
        limits.iter().enumerate().all(|(a, l)| {
            let from = (node - first) * k + a;
            let bend = bends[from].abs() + bends.get(from + k).map_or(0.0, |b| b.abs());
            bend * v * v <= STRAIGHT * l.acceleration && l.jerk.is_none_or(|j| bend / width * v * v * v <= STRAIGHT * j)
        })
    })
}

/// Borders at the nodes and wherever the jerk changes.
fn lay(path: &Path, curve: &Curve, first: usize, last: usize) -> Solved {
    let mut out =
        Solved { x: Vec::new(), rate: Vec::new(), time: Vec::new(), segment: Vec::new(), report: Report::default() };
    let corners = curve.corners();
    let mut next = 0;
    let length = curve.length;
    for node in first..last {
        let from = path.s[node] - path.s[first];
        let to = path.s[node + 1] - path.s[first];
        let (t0, t1) = (if node == first { 0.0 } else { curve.when(from) }, curve.when(to));
        out.x.push(from);
        out.time.push(t0);
        out.rate.push(if node == first { 0.0 } else { curve.at(t0)[1] });
        out.segment.push(node as u32);
        while next < 6 && (corners[next] < t1 || node + 1 == last) {
            let t = corners[next];
            let [x, v] = curve.at(t);
            next += 1;
            // Corners that fall together with others, or with nodes, leave no cell behind.
            let apart = 1e-12 * length;
            if x > out.x[out.x.len() - 1] + apart && x < to - apart && t > out.time[out.time.len() - 1] {
                out.x.push(x);
                out.time.push(t);
                out.rate.push(v);
                out.segment.push(node as u32);
            }
        }
    }
    out.x.push(length);
    out.time.push(curve.total());
    out.rate.push(0.0);
    out.segment.push(last as u32 - 1);
    out.report = Report {
        total_s: curve.total(),
        without_jerk_s: curve.total(),
        runs: 1,
        straight: 1,
        cells: out.x.len() - 1,
        stretch: 1.0,
        ..Report::default()
    };
    out
}

//! Runs whose axes are all linear in s: one rest-to-rest move in closed form.

use super::{Limit, Path, Ratio, Report, TimedRun};
use terrace_core::motion::RestToRest;

/// Share of a limit that a bend may use up in a run that still counts as straight.
const STRAIGHT: f64 = 1e-4;

/// The run `first..=last` in closed form, where it has one.
pub(super) fn solve(path: &Path, limits: &[Limit], first: usize, last: usize, bends: &[f64]) -> Option<TimedRun> {
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
    let curve = RestToRest::new(length, v, along.acceleration, along.jerk);
    let mut solved = lay(path, &curve, first, last);
    // Where it has an even jerk at all, that is the limit.
    let jerk = if along.jerk.is_some() { 1.0 } else { 0.0 };
    let acceleration = curve.acceleration() / along.acceleration;
    solved.report.ratio = Ratio { speed: curve.peak() / v, acceleration, jerk };
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
fn lay(path: &Path, curve: &RestToRest, first: usize, last: usize) -> TimedRun {
    let mut out =
        TimedRun { x: Vec::new(), rate: Vec::new(), time: Vec::new(), segment: Vec::new(), report: Report::default() };
    let corners = curve.corners();
    let mut next = 0;
    let length = path.s[last] - path.s[first];
    for node in first..last {
        let from = path.s[node] - path.s[first];
        let to = path.s[node + 1] - path.s[first];
        let (t0, t1) = (if node == first { 0.0 } else { curve.time_at(from) }, curve.time_at(to));
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
    out.time.push(curve.total_s());
    out.rate.push(0.0);
    out.segment.push(last as u32 - 1);
    out.report = Report {
        total_s: curve.total_s(),
        without_jerk_s: curve.total_s(),
        runs: 1,
        straight: 1,
        cells: out.x.len() - 1,
        stretch: 1.0,
        ..Report::default()
    };
    out
}

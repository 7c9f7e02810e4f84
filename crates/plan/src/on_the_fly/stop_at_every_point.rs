//! The time of a path on which every axis stops at every point.
//!
//! Consumes positions and limits of axes; promises the time when each segment takes as long as its slowest axis, from
//! rest to rest. Units: mm or rad, s; the limits of an axis in the units of its positions.

use crate::on_the_fly::topp::Limit;
use terrace_core::motion::rest_to_rest;

/// How long a path takes, and because of which axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopTimes<const N: usize> {
    /// All segments.
    pub total_s: f64,
    /// How many segments each axis was the slowest of, the first of equals; a segment in which nothing moves has none.
    pub slowest: [usize; N],
}

/// The time with a stop at every point, every segment as slow as its slowest axis.
pub fn stop_at_every_point<const N: usize>(positions: &[[f64; N]], limits: &[Limit; N]) -> StopTimes<N> {
    let mut out = StopTimes { total_s: 0.0, slowest: [0; N] };
    for pair in positions.windows(2) {
        let mut longest = 0.0;
        let mut by = None;
        for k in 0..N {
            let l = &limits[k];
            let time = rest_to_rest((pair[1][k] - pair[0][k]).abs(), l.speed, l.acceleration, l.jerk);
            if time > longest {
                (longest, by) = (time, Some(k));
            }
        }
        out.total_s += longest;
        if let Some(k) = by {
            out.slowest[k] += 1;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_the_fly::axes::kinematics::{Branch, Branches, follow};
    use crate::on_the_fly::decompose::{Method, sample, stage};

    #[test]
    fn the_slowest_axis_sets_the_time_of_a_segment() {
        let limits = [1.0, 2.0].map(|a| Limit { speed: 10.0, acceleration: a, jerk: None });
        let path = [[0.0, 0.0], [4.0, 4.0], [4.0, 4.5], [4.0, 4.5]];
        let got = stop_at_every_point(&path, &limits);
        assert!((got.total_s - (4.0 + 1.0)).abs() < 1e-12, "{got:?}");
        assert_eq!(got.slowest, [1, 1]);
        assert_eq!(stop_at_every_point(&path[..1], &limits).total_s, 0.0);
    }

    #[test]
    fn stop_and_go_times_match_the_reference_of_the_seven_axis_part() {
        let (part, times) = (sample::Part::stored(), sample::stored("axis_times.json"));
        let plan = part.hilbert();
        let sigma = part.json["sigma_points"].as_f64().expect("sigma");
        let marks = part.poses(&plan);
        let tools = part.poses(&stage(&plan, Method::Gaussian { sigma }));
        let five: Vec<[f64; 5]> = follow(&marks, Branches::Only(Branch::Positive))
            .iter()
            .map(|x| [x.xyz[0], x.xyz[1], x.xyz[2], x.a, x.c])
            .collect();
        let seven: Vec<[f64; 7]> = follow(&tools, Branches::Only(Branch::Positive))
            .iter()
            .zip(&marks)
            .map(|(x, m)| {
                let [u, v] = x.seen(m.p).uv;
                [x.xyz[0], x.xyz[1], x.xyz[2], x.a, x.c, u, v]
            })
            .collect();
        // Speed, acceleration and jerk as printed: X, Y, Z, A, C, U, V in mm and rad.
        let printed: [[f64; 3]; 7] = [
            [35.0, 100.0, 10.0],
            [35.0, 100.0, 10.0],
            [24.0, 83.0, 8.0],
            [0.36, 1.99, 0.20],
            [3.00, 3.74, 0.37],
            [3000.0, 20_000.0, 1000.0],
            [3000.0, 20_000.0, 1000.0],
        ];
        for (name, factor) in [("jerk as printed", Some(1.0)), ("jerk x 1000", Some(1000.0)), ("no jerk", None)] {
            let limit = |k: usize| {
                let [speed, acceleration, jerk] = printed[k];
                Limit { speed, acceleration, jerk: factor.map(|f| f * jerk) }
            };
            let stored = &times[name];
            let near = |seconds: f64, key: &str| {
                let want = stored[key].as_f64().expect("minutes");
                let got = seconds / 60.0;
                assert!((got - want).abs() < 1e-6 * want, "{name} {key}: {got} for {want}");
            };
            let all = stop_at_every_point(&five, &std::array::from_fn(limit));
            near(all.total_s, "five_axis_min");
            let xyz: Vec<[f64; 3]> = five.iter().map(|x| [x[0], x[1], x[2]]).collect();
            near(stop_at_every_point(&xyz, &std::array::from_fn(limit)).total_s, "five_XYZ_only_min");
            let uv: Vec<[f64; 2]> = seven.iter().map(|x| [x[5], x[6]]).collect();
            near(stop_at_every_point(&uv, &std::array::from_fn(|k| limit(5 + k))).total_s, "galvo_only_min");
            near(stop_at_every_point(&seven, &std::array::from_fn(limit)).total_s, "seven_all_R2R_min");
            let count: usize = all.slowest.iter().sum();
            for (k, share) in stored["limiting_axis_share"].as_array().expect("shares").iter().enumerate() {
                let got = all.slowest[k] as f64 / count as f64;
                assert!((got - share.as_f64().expect("share")).abs() < 1e-3, "{name} axis {k}: {got}");
            }
        }
    }
}

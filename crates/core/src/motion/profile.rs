//! The time of one axis from rest to rest under limits of speed, acceleration and jerk.

use crate::math;
/// Time in s of a move from rest to rest: that of [`RestToRest`].
pub fn rest_to_rest(length: f64, speed: f64, acceleration: f64, jerk: Option<f64>) -> f64 {
    RestToRest::new(length, speed, acceleration, jerk).total_s()
}

/// A motion from rest to rest: up to a peak speed, on at it, and down to rest as it came up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RestToRest {
    /// mm.
    length: f64,
    /// Peak speed, mm/s.
    peak: f64,
    /// Peak acceleration on the ramps, mm/s².
    acceleration: f64,
    /// mm/s³; infinite without a limit.
    jerk: f64,
    /// How long the acceleration rises to its peak, s; 0 without a limit of jerk.
    rise_s: f64,
    /// Time of each ramp, s.
    ramp_s: f64,
}

impl RestToRest {
    /// The motion over `length` mm at most `speed` mm/s, `acceleration` mm/s² and `jerk` mm/s³; without a jerk limit
    /// the acceleration steps.
    ///
    /// The profile is the symmetric S-curve that is fastest under its limits. Which of them bind:
    /// - neither speed nor acceleration: T = (32 L / j)^(1/3);
    /// - acceleration only: T = a/j + sqrt((a/j)² + 4 L / a);
    /// - speed, after the acceleration was reached: T = L/v + v/a + a/j;
    /// - speed, but never the acceleration: T = L/v + 2 sqrt(v/j).
    ///
    /// T is continuous in L and grows with it.
    pub fn new(length: f64, speed: f64, acceleration: f64, jerk: Option<f64>) -> Self {
        let (length, a) = (length.abs(), acceleration);
        let Some(j) = jerk else {
            let peak = speed.min((length * a).sqrt());
            return Self { length, peak, acceleration: a, jerk: f64::INFINITY, rise_s: 0.0, ramp_s: peak / a };
        };
        // Without a limit of speed nothing is marked at the peak p: length = p * ramp_s, which is p (p/a + a/j) where
        // the ramps reach the acceleration and 2 p sqrt(p/j) where they do not. Solved for p:
        let full_rise_s = a / j;
        let peak_with_acceleration = a / 2.0 * ((full_rise_s * full_rise_s + 4.0 * length / a).sqrt() - full_rise_s);
        // The lowest peak at which the ramps reach the acceleration.
        let knee = a * full_rise_s;
        let by_length =
            if peak_with_acceleration >= knee { peak_with_acceleration } else { math::cbrt(length * length * j / 4.0) };
        let peak = speed.min(by_length);
        if peak >= knee {
            Self { length, peak, acceleration: a, jerk: j, rise_s: full_rise_s, ramp_s: peak / a + full_rise_s }
        } else {
            let rise_s = (peak / j).sqrt();
            Self { length, peak, acceleration: j * rise_s, jerk: j, rise_s, ramp_s: 2.0 * rise_s }
        }
    }

    /// Time of the whole, s.
    pub fn total_s(&self) -> f64 {
        if self.length == 0.0 { 0.0 } else { self.length / self.peak + self.ramp_s }
    }

    /// The highest speed that it reaches, mm/s.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Way on each ramp, mm.
    pub(crate) fn ramp_mm(&self) -> f64 {
        0.5 * self.peak * self.ramp_s
    }

    /// Peak acceleration on its ramps, mm/s².
    pub fn acceleration(&self) -> f64 {
        self.acceleration
    }

    /// Way and speed at a time after the start, mm and mm/s.
    pub fn at(&self, time: f64) -> [f64; 2] {
        let total = self.total_s();
        if 2.0 * time <= total {
            return self.rising(time.max(0.0));
        }
        let [way, speed] = self.rising((total - time).max(0.0));
        [self.length - way, speed]
    }

    /// Way at a time after the start, mm.
    pub fn way_at(&self, time: f64) -> f64 {
        self.at(time)[0]
    }

    /// Way and speed at a time of the first half.
    fn rising(&self, t: f64) -> [f64; 2] {
        let (j, a, rise) = (self.jerk, self.acceleration, self.rise_s);
        if t < rise {
            return [j * t * t * t / 6.0, 0.5 * j * t * t];
        }
        let left = self.ramp_s - t;
        if left >= rise {
            let u = t - rise;
            let (way, speed) = (a * rise * rise / 6.0, 0.5 * a * rise);
            return [way + u * (speed + 0.5 * a * u), speed + a * u];
        }
        let way = 0.5 * self.peak * self.ramp_s;
        if left <= 0.0 {
            return [way - self.peak * left, self.peak];
        }
        [way - left * (self.peak - j * left * left / 6.0), self.peak - 0.5 * j * left * left]
    }

    /// Times at which its jerk changes, s, without its start and its end.
    pub fn corners(&self) -> [f64; 6] {
        let (total, [p, q, r]) = (self.total_s(), [self.rise_s, self.ramp_s - self.rise_s, self.ramp_s]);
        [p, q, r, total - r, total - q, total - p]
    }

    /// The time after the start at which it has come so far, s.
    pub fn time_at(&self, way: f64) -> f64 {
        let (way, total) = (way.clamp(0.0, self.length), self.total_s());
        let near = way.min(self.length - way);
        let ramp = self.peak * self.ramp_s / 2.0;
        let time = if near >= ramp && self.peak > 0.0 {
            self.ramp_s + (near - ramp) / self.peak
        } else {
            // The way grows with the time: bisection to the last bits that matter.
            let [mut lo, mut hi] = [0.0, self.ramp_s];
            for _ in 0..54 {
                let middle = f64::midpoint(lo, hi);
                *(if self.rising(middle)[0] < near { &mut lo } else { &mut hi }) = middle;
            }
            hi
        };
        if way <= self.length / 2.0 { time } else { total - time }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Limits under which acceleration binds before speed, and under which it never does.
    const LIMITS: [(f64, f64, Option<f64>); 4] = [
        (200.0, 1000.0, Some(20_000.0)),
        (50.0, 5000.0, Some(10_000.0)),
        (35.0, 100.0, Some(10_000.0)),
        (200.0, 1000.0, None),
    ];

    #[test]
    fn time_grows_with_length_without_steps() {
        for (v, a, j) in LIMITS {
            let mut last = 0.0;
            let mut length = 1e-6;
            while length < 2000.0 {
                let t = rest_to_rest(length, v, a, j);
                assert!(t > last, "{v} {a} {j:?} at {length}");
                let next = rest_to_rest(length * (1.0 + 1e-9), v, a, j);
                assert!((next - t).abs() < 1e-8 * t, "step at {length}: {t} {next}");
                last = t;
                length *= 1.001;
            }
        }
    }

    #[test]
    fn the_time_is_what_the_profile_needs_for_the_length() {
        for (v, a, j) in LIMITS {
            let Some(j) = j else { continue };
            for length in [1e-4, 0.07, 1.0, 3.9, 10.0, 40.0, 450.0] {
                let t = rest_to_rest(length, v, a, Some(j));
                let covered = covered_length(t, v, a, j);
                assert!((covered - length).abs() < 1e-6 * length, "{v} {a} {j}: {covered} of {length}");
            }
        }
    }

    /// Length covered in `t` by the fastest symmetric profile, by bisection on its peak speed.
    fn covered_length(t: f64, v: f64, a: f64, j: f64) -> f64 {
        let ramp = |peak: f64| if peak * j >= a * a { peak / a + a / j } else { 2.0 * (peak / j).sqrt() };
        let (mut lo, mut hi) = (0.0, v);
        for _ in 0..200 {
            let mid = 0.5 * (lo + hi);
            if 2.0 * ramp(mid) <= t { lo = mid } else { hi = mid }
        }
        // The mean speed on a symmetric ramp is half of the peak.
        lo * ramp(lo) + lo * (t - 2.0 * ramp(lo))
    }

    #[test]
    fn a_move_that_only_jerk_limits_peaks_at_a_sixteenth_of_jerk_times_time_squared() {
        let (length, j) = (8.0, 134e6);
        let t = rest_to_rest(length, 1e9, 1e12, Some(j));
        assert!((j * t * t / 16.0 * t / 2.0 - length).abs() < 1e-9, "the mean speed is half of the peak");
    }

    #[test]
    fn motion_keeps_its_limits_and_ends_when_the_time_says() {
        for (v, a, j) in LIMITS {
            for length in [1e-4, 0.07, 0.15686, 1.0, 3.9, 10.0, 40.0, 450.0] {
                let motion = RestToRest::new(length, v, a, j);
                let total = motion.total_s();
                let step = total / 4000.0;
                let ways: Vec<f64> = (0..=4000).map(|k| motion.way_at(f64::from(k) * step)).collect();
                assert!(ways[0] == 0.0 && (ways[4000] - length).abs() < 1e-12 * length);
                let d = |list: &[f64]| -> Vec<f64> { list.windows(2).map(|w| (w[1] - w[0]) / step).collect() };
                let most = |list: &[f64]| list.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                let speeds = d(&ways);
                let [acceleration, jerk] = [d(&speeds), d(&d(&speeds))].map(|list| most(&list));
                assert!(
                    motion.peak() <= v && motion.at(total / 2.0)[1] > 0.999_999 * motion.peak(),
                    "{v} {a} {length}"
                );
                assert!(most(&speeds) <= v * (1.0 + 1e-9) && acceleration <= a * (1.0 + 1e-6), "{v} {a} {length}");
                assert!(j.is_none_or(|j| jerk <= j * 1.001), "{jerk} of {j:?} at {length}");
                for (k, way) in ways.iter().enumerate().step_by(37) {
                    assert!((motion.way_at(motion.time_at(*way)) - way).abs() < 1e-12 * length);
                    let time = k as f64 * step;
                    let mean = (motion.way_at(time + step / 2.0) - motion.way_at(time - step / 2.0)) / step;
                    let is_inside = k > 0 && k < 4000;
                    assert!(!is_inside || (mean - motion.at(time)[1]).abs() < 2e-3 * motion.peak(), "{length} {k}");
                }
            }
        }
        assert_eq!(RestToRest::new(0.0, 1.0, 1.0, Some(1.0)).total_s(), 0.0);
    }
}

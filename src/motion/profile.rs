//! The time of one axis from rest to rest under limits of speed, acceleration and jerk.

/// Time in s of a move of `length` mm from rest to rest at most `speed` mm/s, `acceleration` mm/s² and
/// `jerk` mm/s³; without a jerk limit the acceleration steps.
///
/// The profile is the symmetric S-curve that is fastest under its limits. Which of them bind:
/// - neither speed nor acceleration: T = (32 L / j)^(1/3);
/// - acceleration only: T = a/j + sqrt((a/j)² + 4 L / a);
/// - speed, after the acceleration was reached: T = L/v + v/a + a/j;
/// - speed, but never the acceleration: T = L/v + 2 sqrt(v/j).
///
/// T is continuous in L and grows with it.
pub fn rest_to_rest(length: f64, speed: f64, acceleration: f64, jerk: Option<f64>) -> f64 {
    let (l, v, a) = (length.abs(), speed, acceleration);
    if l == 0.0 {
        return 0.0;
    }
    let Some(j) = jerk else {
        return if l * a >= v * v { l / v + v / a } else { 2.0 * (l / a).sqrt() };
    };
    // Time of the ramp up to full speed; the move covers v * ramp on the two ramps alone.
    let reaches_acceleration = v * j >= a * a;
    let ramp = if reaches_acceleration { v / a + a / j } else { 2.0 * (v / j).sqrt() };
    if l >= v * ramp {
        l / v + ramp
    } else if reaches_acceleration && l * j * j >= 2.0 * a.powi(3) {
        a / j + ((a / j).powi(2) + 4.0 * l / a).sqrt()
    } else {
        (32.0 * l / j).cbrt()
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
}

//! The time of seven axes with the stage in step with the spot, as the article has it: a model, not a motion.
//!
//! Consumes the scanner's time from rest to rest and where the stage stands at each of these; promises the time when
//! every stretch takes what the scanner needs, or the stage at its speeds, stretched until the stage's accelerations
//! hold by differences from stretch to stretch. Jerks of the stage are not looked at. Units: mm or rad, s.

use crate::on_the_fly::axes::motion::STAGE;
use crate::on_the_fly::topp::Limit;

/// How much a stretch is slowed down in a round at most.
const MOST: f64 = 1.1;
/// How many rounds there are at most.
const ROUNDS: usize = 400;
/// Share of an acceleration that rounding may add.
const ROUNDED: f64 = 1e-9;

/// The whole time, s, for the scanner's times between positions of the stage; None where the accelerations do not hold
/// after so many rounds.
pub fn in_step_s(scanner_s: &[f64], positions: &[[f64; STAGE]], limits: &[Limit; STAGE]) -> Option<f64> {
    let ways: Vec<[f64; STAGE]> = positions.windows(2).map(|w| std::array::from_fn(|k| w[1][k] - w[0][k])).collect();
    let mut times: Vec<f64> = scanner_s.iter().zip(&ways).map(|(t, way)| t.max(time_at_speed(way, limits))).collect();
    let mut slower = vec![1.0f64; times.len()];
    for _ in 0..ROUNDS {
        slower.fill(1.0);
        for i in 1..times.len() {
            let excess = acceleration_share(&ways[i - 1..=i], &times[i - 1..=i], limits);
            if excess > 1.0 + ROUNDED {
                // Slowed down by k, an acceleration falls by k².
                let by = excess.sqrt().min(MOST);
                slower[i - 1] = slower[i - 1].max(by);
                slower[i] = slower[i].max(by);
            }
        }
        if slower.iter().all(|by| *by == 1.0) {
            return Some(times.iter().sum());
        }
        times.iter_mut().zip(&slower).for_each(|(t, by)| *t *= by);
    }
    None
}

/// The least time in which all axes go their way at their largest speeds, s.
fn time_at_speed(way: &[f64; STAGE], limits: &[Limit; STAGE]) -> f64 {
    (0..STAGE).map(|k| way[k].abs() / limits[k].speed).fold(0.0, f64::max)
}

/// The largest acceleration of an axis from one of two stretches to the next, as a share of its limit: the change of
/// their mean speeds over the time between their middles.
fn acceleration_share(ways: &[[f64; STAGE]], times: &[f64], limits: &[Limit; STAGE]) -> f64 {
    let between_middles = 0.5 * (times[0] + times[1]);
    let share = |k: usize| {
        let change = ways[1][k] / times[1] - ways[0][k] / times[0];
        change.abs() / between_middles / limits[k].acceleration
    };
    (0..STAGE).map(share).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn acceleration_is_the_change_of_mean_speeds_between_the_middles_of_stretches() {
        let limits = [Limit { speed: 10.0, acceleration: 4.0, jerk: None }; STAGE];
        let along = |x: f64| [x, 0.0, 0.0, 0.0, 0.0];
        // From 1 mm/s to 3 mm/s within 1 s.
        assert_eq!(acceleration_share(&[along(1.0), along(3.0)], &[1.0, 1.0], &limits), 0.5);
        assert_eq!(acceleration_share(&[along(1.0), along(2.0)], &[1.0, 2.0], &limits), 0.0);
    }

    #[test]
    fn stretches_are_slowed_until_speeds_and_accelerations_hold() {
        let limits = [Limit { speed: 10.0, acceleration: 50.0, jerk: None }; STAGE];
        let along = |list: &[f64]| -> Vec<[f64; STAGE]> { list.iter().map(|x| [*x, 0.0, 0.0, 0.0, 0.0]).collect() };
        // The scanner is slower; the stage at its speed is; a turn back that takes acceleration.
        assert_eq!(in_step_s(&[1.0, 1.0], &along(&[0.0, 1.0, 2.0]), &limits), Some(2.0));
        assert_eq!(in_step_s(&[1e-3, 1e-3], &along(&[0.0, 1.0, 2.0]), &limits), Some(0.2));
        let turned = in_step_s(&[0.1, 0.1], &along(&[0.0, 1.0, 0.0]), &limits).expect("a time");
        // 2 x 1 mm / T over T is 50 mm/s2 at T = 0.2 s; a round may overshoot by its tenth.
        assert!((0.4..0.4 * MOST).contains(&turned), "{turned}");
        // An acceleration of nothing is never kept.
        let still = [Limit { acceleration: 0.0, ..limits[0] }; STAGE];
        assert_eq!(in_step_s(&[0.1, 0.1], &along(&[0.0, 1.0, 0.0]), &still), None);
    }
}

//! Following errors of every axis over a motion.
//!
//! Consumes commands and following errors of X, Y, Z, A, C, U and V at even steps of time; promises the way of every
//! axis, the mean and the largest size of its following error over the whole motion, jumps included, and its course at
//! the start of the path. Units: mm, rad, s.

use terrace_plan::on_the_fly::axes::motion::AXES;

/// Following errors of every axis of a motion.
#[derive(Clone, Debug, Default)]
pub struct AxisErrors {
    /// Way of the commands.
    pub(super) way: [f64; AXES],
    /// Size of the error, summed over the samples.
    sum: [f64; AXES],
    /// Largest size of the error.
    pub(super) worst: [f64; AXES],
    /// Step between two samples, s.
    step_s: f64,
    samples: usize,
    last: Option<[f64; AXES]>,
    /// Time and errors with their signs, of the samples up to `until_s`.
    pub(super) first: Vec<(f64, [f64; AXES])>,
    until_s: f64,
}

impl AxisErrors {
    /// The errors of no samples yet, which will be `step_s` apart; their course is kept up to `until_s`.
    pub(super) fn new(step_s: f64, until_s: f64) -> Self {
        Self { step_s, until_s, ..Self::default() }
    }

    /// Adds a sample: what the axes are commanded, and how far each is behind that.
    pub(super) fn add(&mut self, commands: [f64; AXES], errors: [f64; AXES]) {
        let last = self.last.replace(commands).unwrap_or(commands);
        for k in 0..AXES {
            self.way[k] += (commands[k] - last[k]).abs();
            self.sum[k] += errors[k].abs();
            self.worst[k] = self.worst[k].max(errors[k].abs());
        }
        let time = self.samples as f64 * self.step_s;
        if time <= self.until_s {
            self.first.push((time, errors));
        }
        self.samples += 1;
    }

    /// Mean size of an axis's error.
    pub(super) fn mean(&self, axis: usize) -> f64 {
        self.sum[axis] / self.samples.max(1) as f64
    }

    /// Mean size of an axis's speed; 0 of a single sample.
    pub(super) fn speed(&self, axis: usize) -> f64 {
        let time = self.samples.saturating_sub(1) as f64 * self.step_s;
        if time > 0.0 { self.way[axis] / time } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_averaged_over_the_samples_and_ways_are_summed() {
        let mut errors = AxisErrors::new(0.5, 1.0);
        errors.add([0.0; AXES], [0.0; AXES]);
        assert_eq!(errors.speed(0), 0.0, "of one sample");
        errors = AxisErrors::new(0.5, 1.0);
        for (i, at) in [0.0, 2.0, 1.0, 1.0].into_iter().enumerate() {
            let mut command = [0.0; AXES];
            let mut error = [0.0; AXES];
            (command[0], error[0], error[4]) = (at, if i % 2 == 0 { 0.1 } else { -0.3 }, 0.01);
            errors.add(command, error);
        }
        assert!((errors.mean(0) - 0.2).abs() < 1e-15 && errors.worst[0] == 0.3 && errors.way[0] == 3.0);
        assert!((errors.speed(0) - 2.0).abs() < 1e-15, "3 mm in 1.5 s");
        assert!((errors.mean(4) - 0.01).abs() < 1e-15 && errors.way[4] == 0.0);
        let times: Vec<f64> = errors.first.iter().map(|(t, _)| *t).collect();
        assert_eq!(times, [0.0, 0.5, 1.0]);
    }
}

//! The moving average, and how many samples it should take.

use super::{at_or_end, peak, rest};

/// Mean over `samples` around each sample, ends repeated.
pub(super) fn moving_average<const N: usize>(path: &[[f64; N]], samples: usize) -> Vec<[f64; N]> {
    let half = samples / 2;
    let (Some(&first), Some(&last)) = (path.first(), path.last()) else { return Vec::new() };
    let ends = |end, by| std::iter::repeat_n(end, by);
    let held: Vec<[f64; N]> = ends(first, half).chain(path.iter().copied()).chain(ends(last, half + 1)).collect();
    // Invariant: before sample i the sums are those of the samples i - half to i + half.
    let window = 2 * half + 1;
    let mut sums = [Sum::default(); N];
    for x in &held[..window] {
        (0..N).for_each(|k| sums[k].add(x[k]));
    }
    let mut out = Vec::with_capacity(path.len());
    for (goes, comes) in held.iter().zip(&held[window..]) {
        out.push(std::array::from_fn(|k| sums[k].value() / window as f64));
        for k in 0..N {
            sums[k].add(comes[k]);
            sums[k].add(-goes[k]);
        }
    }
    out
}

/// A running sum that keeps what rounding takes away: second differences of means are small, and an error
/// that grew along the path would show in them.
#[derive(Clone, Copy, Default)]
struct Sum {
    high: f64,
    low: f64,
}

impl Sum {
    #[inline]
    fn add(&mut self, x: f64) {
        // Two-sum (Knuth): `low` takes exactly what the rounding of `high` loses.
        let sum = self.high + x;
        let part = sum - self.high;
        self.low += (self.high - (sum - part)) + (x - part);
        self.high = sum;
    }

    fn value(self) -> f64 {
        self.high + self.low
    }
}

/// The fewest samples, odd, that turn a jump of velocity into at most the acceleration `most`: the stage
/// then accelerates by `jump` / (samples × `step_s`), and the scanner goes out by
/// `jump` (samples² - 1) `step_s` / (8 samples). True while no second corner is as near as that.
pub fn samples_for_jump(jump: f64, step_s: f64, most: f64) -> usize {
    let fewest = (jump.abs() / (step_s * most)).ceil().max(1.0) as usize;
    fewest | 1
}

/// A moving average that meets its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Average<const N: usize> {
    /// Samples it takes.
    pub samples: usize,
    /// Largest acceleration of the stage along one axis.
    pub acceleration: f64,
    /// How far the scanner goes to each side, per axis.
    pub reach: [f64; N],
}

/// Why no moving average will do: the acceleration asks for more samples than the scanner's field allows. (Any
/// acceleration can be met: over twice the path the mean moves evenly.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Infeasible<const N: usize> {
    /// The average that the acceleration asks for.
    pub average: Average<N>,
    /// The axis that leaves the field by most.
    pub axis: usize,
    /// How far the field reaches there; the average's `reach` tells what it would have to.
    pub half_field: f64,
    /// The share of the speed at which a lone corner would fit: at a corner acceleration times reach is constant,
    /// the squared jump of velocity / 8.
    pub speed_share: f64,
}

/// The moving average of fewest samples whose stage stays at or below the acceleration `most` along each axis;
/// then the scanner must stay in `half_field`. Steps of `step_s`.
///
/// The scanner's reach does not always grow with the samples, but a larger average than needed is not
/// looked for: fewest samples leave the scanner least to do at corners (the article's criterion).
///
/// # Errors
/// The field that this average leaves, by how much, and what speed would do.
pub fn choose_average<const N: usize>(
    path: &[[f64; N]],
    step_s: f64,
    most: f64,
    half_field: [f64; N],
) -> Result<Average<N>, Infeasible<N>> {
    let mut samples = 1;
    // Where one average fails the next one often fails too: that sample is looked at first.
    let mut last_failure = None;
    let acceleration = loop {
        // Over twice the path the mean moves evenly: there is nothing longer to try.
        let is_longest = samples as isize > 2 * path.len() as isize;
        let fails_again = |i: usize| acceleration_of_mean(path, samples, step_s, i) > most;
        if is_longest || !last_failure.is_some_and(fails_again) {
            let largest = largest_acceleration(path, samples, step_s);
            if largest.acceleration <= most || is_longest {
                break largest.acceleration;
            }
            last_failure = Some(largest.sample);
        }
        samples += 2;
    };
    let reach = peak(&rest(path, &moving_average(path, samples)));
    let average = Average { samples, acceleration, reach };
    let share_of_field = |k: usize| reach[k] / half_field[k];
    let axis = (0..N).fold(0, |most, k| if share_of_field(k) > share_of_field(most) { k } else { most });
    if N > 0 && reach[axis] > half_field[axis] {
        // At a corner the reach is as the square of the jump of velocity.
        let speed_share = (half_field[axis] / reach[axis]).sqrt();
        return Err(Infeasible { average, axis, half_field: half_field[axis], speed_share });
    }
    Ok(average)
}

/// The largest acceleration of a mean, and the sample at which it is.
struct LargestAcceleration {
    acceleration: f64,
    sample: usize,
}

/// The largest acceleration of the mean over `samples` at any sample but the ends, along one axis.
fn largest_acceleration<const N: usize>(path: &[[f64; N]], samples: usize, step_s: f64) -> LargestAcceleration {
    let mut largest = LargestAcceleration { acceleration: 0.0, sample: 0 };
    for i in 1..path.len().saturating_sub(1) {
        let acceleration = acceleration_of_mean(path, samples, step_s, i);
        if acceleration > largest.acceleration {
            largest = LargestAcceleration { acceleration, sample: i };
        }
    }
    largest
}

/// The largest acceleration along one axis that the mean over `samples` has at sample `i`.
fn acceleration_of_mean<const N: usize>(path: &[[f64; N]], samples: usize, step_s: f64, i: usize) -> f64 {
    // The second difference of a mean telescopes: only the differences at both ends of its window are left.
    let (i, half) = (i as isize, (samples / 2) as isize);
    let x = [i + half + 1, i + half, i - half, i - half - 1].map(|j| at_or_end(path, j));
    let change = (0..N).map(|k| ((x[0][k] - x[1][k]) - (x[2][k] - x[3][k])).abs()).fold(0.0, f64::max);
    change / (samples as f64 * step_s * step_s)
}

//! The low-pass filter in waves.

use std::sync::Arc;

use rustfft::algorithm::{BluesteinsAlgorithm, Radix4};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection};

/// A Fourier transform of any length (Bluestein's). The planner of the library is quicker for many lengths, but holds
/// code for all of them; one filter of `compare` does not need that.
fn transform(len: usize, direction: FftDirection) -> BluesteinsAlgorithm<f64> {
    BluesteinsAlgorithm::new(len, Arc::new(Radix4::new((2 * len).next_power_of_two(), direction)))
}

/// Takes away all waves shorter than `wavelength` samples.
///
/// The line from the first sample to the last is set aside, and what is left is continued by itself turned about the
/// end: so nothing wraps round from one end to the other, and both ends stay where they are.
pub(super) fn low_pass<const N: usize>(path: &[[f64; N]], wavelength: f64) -> Vec<[f64; N]> {
    let last = path.len() - 1;
    let period = 2 * last;
    let [there, back] = [FftDirection::Forward, FftDirection::Inverse].map(|direction| transform(period, direction));
    let mut allowed = vec![Complex::default(); there.get_inplace_scratch_len().max(back.get_inplace_scratch_len())];
    let mut waves = vec![Complex::default(); period];
    let mut out = path.to_vec();
    for k in 0..N {
        let line = |i: usize| path[0][k] + (path[last][k] - path[0][k]) * (i as f64 / last as f64);
        waves[0] = Complex::default();
        waves[last] = Complex::default();
        // Odd about both ends: a series of sines, whose period is twice the path.
        for i in 1..last {
            let x = path[i][k] - line(i);
            waves[i] = Complex::new(x, 0.0);
            waves[period - i] = Complex::new(-x, 0.0);
        }
        there.process_with_scratch(&mut waves, &mut allowed);
        for (i, wave) in waves.iter_mut().enumerate() {
            let frequency = i.min(period - i) as f64;
            if frequency * wavelength > period as f64 {
                *wave = Complex::default();
            }
        }
        back.process_with_scratch(&mut waves, &mut allowed);
        for (i, x) in out.iter_mut().enumerate() {
            x[k] = line(i) + if i == 0 || i == last { 0.0 } else { waves[i].re / period as f64 };
        }
    }
    out
}

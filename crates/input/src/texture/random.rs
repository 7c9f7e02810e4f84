//! Numbers that follow from a seed alone.

use terrace_core::math;
/// SplitMix64 (Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014).
#[derive(Clone, Debug)]
pub(super) struct Random(u64);

impl Random {
    /// The random numbers of a seed and two numbers of a place.
    pub(super) fn at(seed: u64, a: u64, b: u64) -> Self {
        let mut random = Self(seed);
        let first = random.next() ^ a;
        random = Self(first);
        let second = random.next() ^ b;
        Self(second)
    }

    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// From 0 to 1, which is left out.
    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 * math::exp2(-53f64)
    }

    /// From 0 to `n`, which is left out; `n` is above 0.
    pub(super) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next()) * n as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spread_evenly_and_follow_from_seed_and_place() {
        for seed in 0..5 {
            let mut counts = [0u32; 10];
            let mut sum = 0.0;
            for a in 0..200 {
                for b in 0..50 {
                    let v = Random::at(seed, a, b).unit();
                    assert!((0.0..1.0).contains(&v));
                    assert_eq!(v, Random::at(seed, a, b).unit());
                    (counts[(v * 10.0) as usize], sum) = (counts[(v * 10.0) as usize] + 1, sum + v);
                }
            }
            assert!((sum / 1e4 - 0.5).abs() < 0.01, "{sum}");
            assert!(counts.iter().all(|&n| (900..1100).contains(&n)), "{counts:?}");
        }
        let mut random = Random::at(7, 0, 0);
        assert!((0..1000).map(|_| random.below(3)).all(|n| n < 3));
    }
}

//! Pairs that do not go together, and which of them is at fault.

use super::chi_squared;
use super::closed_form::{Pair, scatter};
use super::fit::refined;
use super::motion::Motion;

/// Sums of squares beyond this many sigmas are no chance.
const SIGMAS: f64 = 4.0;

/// What is wrong with pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairsFault {
    /// This one does not go with the others, which go together.
    Wrong(usize),
    /// They go together once the stage positions of these two are exchanged.
    Exchanged(usize, usize),
    /// They go together in a mirror alone.
    Mirrored,
    /// They do not go together; this one has the largest residual.
    Apart(usize),
}

/// What is wrong with pairs of known noise; None where they go together, or are too few to tell.
pub fn fault(pairs: &[Pair]) -> Option<PairsFault> {
    if pairs.len() < 3 || goes_together(pairs) {
        return None;
    }
    let suspects = suspects(pairs);
    let exchanges =
        (0..suspects.len()).flat_map(|n| (0..n).map(move |m| (m, n))).map(|(m, n)| (suspects[m], suspects[n]));
    let mut exchanged = exchanges.filter(|&(i, k)| {
        let mut tried = pairs.to_vec();
        (tried[i].stage, tried[k].stage) = (pairs[k].stage, pairs[i].stage);
        goes_together(&tried)
    });
    if let Some((i, k)) = exchanged.next() {
        // Where several exchanges mend it, none of them is known to be the fault.
        return Some(if exchanged.next().is_none() { PairsFault::Exchanged(i, k) } else { apart(pairs) });
    }
    if pairs.len() > 3 {
        let mut wrong = suspects.iter().copied().filter(|&i| {
            let mut others = pairs.to_vec();
            others.remove(i);
            goes_together(&others)
        });
        if let Some(i) = wrong.next() {
            return Some(if wrong.next().is_none() { PairsFault::Wrong(i) } else { apart(pairs) });
        }
        let mirrored: Vec<Pair> =
            pairs.iter().map(|p| Pair { part: [-p.part[0], p.part[1], p.part[2]], ..*p }).collect();
        if goes_together(&mirrored) {
            return Some(PairsFault::Mirrored);
        }
    }
    Some(apart(pairs))
}

/// Pairs that may be at fault, at most.
const SUSPECTS: usize = 24;

/// The pairs of the largest residuals, in their order.
fn suspects(pairs: &[Pair]) -> Vec<usize> {
    let motion = refined(pairs);
    let mut all: Vec<usize> = (0..pairs.len()).collect();
    all.sort_by(|&i, &k| weighted2(&pairs[k], &motion).total_cmp(&weighted2(&pairs[i], &motion)));
    all.truncate(SUSPECTS);
    all.sort_unstable();
    all
}

/// The pair of the largest residual.
fn apart(pairs: &[Pair]) -> PairsFault {
    let motion = refined(pairs);
    let size = |p: &Pair| weighted2(p, &motion);
    let worst = (0..pairs.len()).max_by(|&i, &k| size(&pairs[i]).total_cmp(&size(&pairs[k])));
    PairsFault::Apart(worst.unwrap_or(0))
}

/// Whether the residuals are as large as the noise allows.
fn goes_together(pairs: &[Pair]) -> bool {
    let motion = refined(pairs);
    let sum: f64 = pairs.iter().map(|p| weighted2(p, &motion)).sum();
    // Points on a line leave a turn free: one degree of freedom more.
    let dof = 3 * pairs.len() - if is_collinear(pairs) { 5 } else { 6 };
    sum <= chi_squared::quantile(dof, SIGMAS)
}

/// Square of a residual over its noise.
fn weighted2(pair: &Pair, motion: &Motion) -> f64 {
    let found = motion.apply(pair.part);
    (0..3).map(|k| ((pair.stage[k] - found[k]) / pair.sigma[k]).powi(2)).sum()
}

/// Whether the part points lie on one line, to a thousandth of their length.
fn is_collinear(pairs: &[Pair]) -> bool {
    let scatter = scatter(pairs.iter().map(|p| (p.part, p.part)));
    let mut values: Vec<f64> = scatter.symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    values[1] <= 1e-6 * values[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::tests::{gauss, random_motion};
    use terrace_core::random::Random;

    fn pairs(seed: u64, count: usize, sigma: f64) -> Vec<Pair> {
        let mut random = Random::case(seed);
        let motion = random_motion(&mut random, 3.0, 500.0);
        let point = |random: &mut Random| {
            let xy = [0; 2].map(|_| random.range(-150.0, 150.0));
            let part = [xy[0], xy[1], random.range(-20.0, 20.0)];
            let stage = motion.apply(part).map(|v| v + sigma * gauss(random));
            Pair { part, stage, sigma: [sigma; 3] }
        };
        (0..count).map(|_| point(&mut random)).collect()
    }

    #[test]
    fn one_that_is_off_two_that_are_exchanged_and_a_mirror_are_named() {
        let named = |spoil: &dyn Fn(&mut Vec<Pair>, u64), wanted: PairsFault| {
            (0..100)
                .filter(|&seed| {
                    let mut pairs = pairs(seed, 6, 0.01);
                    assert_eq!(fault(&pairs), None, "seed {seed}");
                    spoil(&mut pairs, seed);
                    fault(&pairs) == Some(wanted)
                })
                .count()
        };
        let wrong = named(&|pairs, seed| pairs[4].stage[seed as usize % 3] += 0.3, PairsFault::Wrong(4));
        let exchanged = named(
            &|pairs, _| (pairs[1].stage, pairs[3].stage) = (pairs[3].stage, pairs[1].stage),
            PairsFault::Exchanged(1, 3),
        );
        let mirrored = named(&|pairs, _| pairs.iter_mut().for_each(|p| p.part[1] = -p.part[1]), PairsFault::Mirrored);
        assert!(wrong >= 98 && exchanged >= 98 && mirrored >= 98, "{wrong} {exchanged} {mirrored}");
    }

    #[test]
    fn three_pairs_tell_that_they_do_not_go_together() {
        let mut three = pairs(7, 3, 0.01);
        assert_eq!(fault(&three), None);
        three[2].stage[0] += 5.0;
        assert!(matches!(fault(&three), Some(PairsFault::Apart(_))), "{:?}", fault(&three));
    }
}

//! Pieces no two of which fit one box: as many as can be found by swaps.
//!
//! A piece that fits with none of the chosen is chosen; one that fits with a single one takes its place,
//! which changes nothing but may make room elsewhere. After Andrade, Resende and Werneck (2012), without
//! their lists of neighbours: pieces are tried by chance.

use super::super::box_index::Item;
use super::Certificate;
use super::packing_weights::PackingWeights;

/// Trials for every piece.
const TRIALS: usize = 50;

pub(super) fn certify(mut pieces: Vec<Item>, size: [i32; 3]) -> Certificate {
    pieces.sort_unstable_by_key(|p| (p.lo[2], *p));
    pieces.dedup();
    let end = |k: usize, pick: fn(i32, i32) -> i32| pieces.iter().map(|p| p.lo[k]).reduce(pick).unwrap_or(0);
    let mut weights = PackingWeights::new([0, 1].map(|k| end(k, i32::min)), [0, 1].map(|k| end(k, i32::max)), size, 1);
    let mut chance = 0x9E37_79B9_7F4A_7C15u64;
    let in_order = 0..pieces.len();
    let by_chance = (0..pieces.len() * TRIALS).map(|_| {
        chance ^= chance << 13;
        chance ^= chance >> 7;
        chance ^= chance << 17;
        ((u128::from(chance) * pieces.len() as u128) >> 64) as usize
    });
    for n in in_order.chain(by_chance) {
        let piece = &pieces[n];
        let mut found = [0; 2];
        let mut count = 0;
        weights.fitting(piece, |number| {
            found[count] = number;
            count += 1;
            count < 2
        });
        // No two of the chosen fit one box. A piece that fits with two or more of them, or is chosen already,
        // changes nothing; one that fits with none joins them; one that fits with a single one takes its place ((1,
        // 1) swap), which keeps the number and moves the gaps.
        if count == 2 || (count == 1 && found[0] == n as u32) {
            continue;
        }
        if count == 1 {
            weights.remove(&pieces[found[0] as usize], found[0], 1);
        }
        weights.add(piece, n as u32, 1);
    }
    weights.certificate()
}

//! How much of a page its marks cover.

use super::cut::Cells;
use crate::texture::clip::Polylines;
use crate::texture::clip::distance;

/// Places of the page that are looked at: a share of a sixteenth is known to a fiftieth of it.
const PLACES: u32 = 40_000;

/// Most rows and columns of the index.
const MAX_CELLS: f64 = 200.0;

/// The share of a page that lies within half a spot of its lines. Places are those of the R2 sequence (Roberts, *The
/// unreasonable effectiveness of quasirandom sequences*, 2018), which has no period that a screened picture could meet.
/// Cost: the number of lines, and of places near them.
pub(super) fn covered_share(lines: &Polylines, size: [f64; 2], spot_mm: f64) -> f64 {
    // 1/g and 1/g² for the root g of g³ = g + 1.
    const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let place = |n: u32| [0, 1].map(|k| (0.5 + STEPS[k] * f64::from(n)).fract() * size[k]);
    let places: Vec<[[f64; 2]; 2]> = (0..PLACES).map(|n| [place(n); 2]).collect();
    let count = size.map(|side| (side / spot_mm).clamp(1.0, MAX_CELLS) as usize);
    let cells = Cells::new(&places, count, spot_mm / 2.0);
    let mut is_covered = vec![false; places.len()];
    for side in lines.iter().flat_map(|line| line.windows(2)).map(|w| [w[0], w[1]]) {
        cells.along(side, |cell| {
            for &i in cells.edges_of(cell) {
                let i = i as usize;
                is_covered[i] = is_covered[i] || distance(places[i][0], side) <= spot_mm / 2.0;
            }
        });
    }
    is_covered.iter().filter(|c| **c).count() as f64 / f64::from(PLACES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_covers_its_length_times_the_spot_and_round_ends() {
        for (spot, size) in [(0.5, [10.0, 4.0]), (0.02, [10.0, 4.0]), (3.0, [6.0, 6.0])] {
            let mut lines = Polylines::default();
            lines.push(&[[2.0, 2.0], [4.0, 2.0], [4.0, 2.5]]);
            let bent = 2.5 * spot + std::f64::consts::PI / 4.0 * spot * spot;
            // The corner is counted twice on its inner side, and not at all outside, but for a round join.
            let corner = spot * spot / 4.0 * (1.0 - std::f64::consts::FRAC_PI_4);
            let share = covered_share(&lines, size, spot) * size[0] * size[1];
            if spot < 1.0 {
                assert!((share - bent + corner).abs() < 0.02 * bent + 0.002, "{spot}: {share} instead of {bent}");
            } else {
                assert!(share > bent * 0.7 && share < bent, "{share}");
            }
        }
        assert_eq!(covered_share(&Polylines::default(), [1.0; 2], 0.1), 0.0);
    }
}

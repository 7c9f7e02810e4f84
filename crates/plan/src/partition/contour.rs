//! The article's way: level k is [z0 + k D, z0 + (k + 1) D) over the whole part; with hysteresis h the
//! levels lie D - 2 h apart and overlap.

use super::{Lattice, SectionLevel};
use crate::projection::HeightRange;
use terrace_core::geom::Nm;

/// The levels that the heights of one section need, upwards. A height that ends exactly where a level begins, from below,
/// does not need it.
pub(super) fn levels(heights: &[HeightRange], z0: Nm, lattice: &Lattice) -> Vec<SectionLevel> {
    let mut out: Vec<SectionLevel> = Vec::new();
    let apart = lattice.depth - lattice.hysteresis * 2;
    for &HeightRange { lo, hi } in heights {
        // From the highest level that begins at or below `lo` to the lowest that ends at or above `hi`.
        let first = ((lo - z0.f64()) / apart.f64()).floor() as i64;
        let last = (((hi - (z0 + lattice.depth).f64()) / apart.f64()).ceil() as i64).max(first);
        for k in first..=last {
            if out.last().is_none_or(|last| i64::from(last.number) < k) {
                out.push(SectionLevel { number: k as i32, z_lo: z0 + apart * k });
            }
        }
    }
    out
}

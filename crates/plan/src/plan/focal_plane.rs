//! The focal plane (LPFL) of a block.

use crate::partition::Lattice;
use terrace_core::geom::Nm;
use terrace_input::job::Level;

/// The focal plane (LPFL) of a block whose marks lie between `z` and have the mean height `mean`, and the
/// plane that the mean alone would give; both on the lattice.
pub(super) fn focal_plane(level: Level, lattice: &Lattice, z: [Nm; 2], mean: f64) -> (Nm, Nm) {
    let nearest = |at: f64| lattice.floor(at + lattice.step.f64() / 2.0);
    let mean = nearest(mean);
    if level == Level::Mean {
        return (mean, mean);
    }
    // The middle, moved where rounding it to the lattice would cost more than half the depth range.
    let mid = nearest((z[0] + z[1]).f64() / 2.0);
    let excess = |plane: Nm| ((z[1] - plane).max(plane - z[0]) - lattice.depth / 2).max(Nm(0));
    let beside = if z[1] - mid > mid - z[0] { mid + lattice.step } else { mid - lattice.step };
    (if excess(beside) < excess(mid) { beside } else { mid }, mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn focus_mid_keeps_both_ends_within_half_the_depth_range() {
        let lattice = Lattice { depth: Nm(70_000), step: Nm(1_000), offset: Nm(0), hysteresis: Nm(0) };
        for lo in (-3_000..3_000).step_by(130) {
            let z = [Nm(lo), Nm(lo + 70_000)];
            let (mid, mean) = focal_plane(Level::Mid, &lattice, z, lo as f64 + 10_000.0);
            // Marks that fill the whole range and do not begin on the lattice lose less than a step.
            let most = if lo % 1_000 == 0 { Nm(35_000) } else { Nm(35_999) };
            assert!((z[1] - mid).max(mid - z[0]) <= most, "{z:?}: {mid:?}");
            assert_eq!(mid % Nm(1_000), Nm(0));
            assert_eq!(focal_plane(Level::Mean, &lattice, z, lo as f64 + 10_000.0), (mean, mean));
        }
    }
}

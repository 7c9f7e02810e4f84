//! In each section the fewest levels: interval stabbing of the heights by one sweep upwards, each level
//! starting at the lowest height that is not covered yet. Optimal for a fixed grid of sections. Heights of
//! strokes that may be cut are covered by levels together, less the hysteresis; a figure that is to stay
//! whole is covered by one.

use super::{Lattice, SectionLevel};
use crate::projection::HeightRange;
use terrace_core::geom::Nm;

/// The levels, upwards. Both lists are sorted by their lower ends; a figure that no level can hold is taken as heights.
pub(super) fn levels(heights: &[HeightRange], figures: &[HeightRange], lattice: &Lattice) -> Vec<SectionLevel> {
    let mut out = Vec::new();
    let mut h = 0;
    let mut f = 0;
    let mut waiting: Vec<HeightRange> = Vec::new();
    let mut end = Nm::MIN;
    loop {
        // What the last level holds is done with.
        while heights.get(h).is_some_and(|range| range.hi <= end.f64()) {
            h += 1;
        }
        waiting.retain(|figure| figure.hi > end.f64());
        while let Some(&figure) = figures.get(f).filter(|figure| figure.lo < end.f64()) {
            if figure.hi > end.f64() {
                waiting.push(figure);
            }
            f += 1;
        }
        // A height that reaches over the last level continues in the next one, which must overlap it by twice the
        // hysteresis; one that begins above it needs a level from its own begin.
        let height = heights
            .get(h)
            .map(|range| if range.lo > end.f64() { range.lo } else { (end - lattice.hysteresis * 2).f64() });
        let whole = waiting.first().or_else(|| figures.get(f)).map(|figure| figure.lo);
        let Some(lowest) = [height, whole].into_iter().flatten().min_by(f64::total_cmp) else { return out };
        // The next level begins where it must, but never before a height that has a level already.
        let floor = lattice.floor(lowest);
        let start = if whole == Some(lowest) { floor } else { floor.max(end.saturating_sub(lattice.hysteresis * 2)) };
        out.push(SectionLevel { number: out.len() as i32, z_lo: start });
        end = start + lattice.depth;
    }
}

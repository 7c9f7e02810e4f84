//! In each section the fewest levels: interval stabbing of the heights by one sweep upwards, each level
//! starting at the lowest height that is not covered yet. Optimal for a fixed grid of sections. Heights of
//! strokes that may be cut are covered by levels together, less the hysteresis; a figure that is to stay
//! whole is covered by one.

use super::Lattice;
use terrace_core::geom::Nm;

/// Number and lower end of every level, upwards. Both lists are sorted by their lower ends; a figure that
/// no level can hold is taken as heights.
pub(super) fn levels(heights: &[(f64, f64)], figures: &[(f64, f64)], lattice: &Lattice) -> Vec<(i32, Nm)> {
    let mut out: Vec<(i32, Nm)> = Vec::new();
    let mut h = 0;
    let mut f = 0;
    let mut waiting: Vec<(f64, f64)> = Vec::new();
    let mut end = Nm::MIN;
    loop {
        // What the last level holds is done with.
        while heights.get(h).is_some_and(|&(_, hi)| hi <= end.f64()) {
            h += 1;
        }
        waiting.retain(|&(_, hi)| hi > end.f64());
        while let Some(&figure) = figures.get(f).filter(|&&(lo, _)| lo < end.f64()) {
            if figure.1 > end.f64() {
                waiting.push(figure);
            }
            f += 1;
        }
        // A height that reaches over the last level continues in the next one, which must overlap it by twice the
        // hysteresis; one that begins above it needs a level from its own begin.
        let height =
            heights.get(h).map(|&(lo, _)| if lo > end.f64() { lo } else { (end - lattice.hysteresis * 2).f64() });
        let whole = waiting.first().or_else(|| figures.get(f)).map(|&(lo, _)| lo);
        let Some(lowest) = [height, whole].into_iter().flatten().min_by(f64::total_cmp) else { return out };
        // The next level begins where it must, but never before a height that has a level already.
        let floor = lattice.floor(lowest);
        let start = if whole == Some(lowest) { floor } else { floor.max(end.saturating_sub(lattice.hysteresis * 2)) };
        out.push((out.len() as i32, start));
        end = start + lattice.depth;
    }
}

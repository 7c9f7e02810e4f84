//! The heights at which the texture touches the surface, section by section.

use std::cmp::Ordering;
use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use super::{GridTracer, Keep, Piece, Samples, segments};
use terrace_core::geom::{Box2, Nm, P2};

/// Heights of marks from the lowest to the highest, nm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightRange {
    /// Lowest.
    pub lo: f64,
    /// Highest.
    pub hi: f64,
}

impl HeightRange {
    /// By the lowest, then by the highest.
    pub(super) fn total_cmp(&self, other: &Self) -> Ordering {
        self.lo.total_cmp(&other.lo).then(self.hi.total_cmp(&other.hi))
    }

    /// The smallest range that holds both.
    fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }
}

/// Sorts ranges upwards, and joins those that touch.
pub fn join_ranges(ranges: &mut Vec<HeightRange>) {
    ranges.sort_unstable_by(|a, b| a.lo.total_cmp(&b.lo));
    ranges.dedup_by(|next, last| {
        let touches = next.lo <= last.hi;
        if touches {
            last.hi = last.hi.max(next.hi);
        }
        touches
    });
}

/// Disjoint, sorted ranges of height.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heights {
    list: Vec<HeightRange>,
    /// Not joined yet: joined in one go, so that many separate ranges cost no more than sorting.
    new: Vec<HeightRange>,
}

/// Intervals that are put aside before a join, beyond as many as are joined already: sorting is shared by as many
/// additions.
const SPARE: usize = 16;

impl Heights {
    /// Adds the heights between `a` and `b`, nm, in either order.
    pub fn add(&mut self, a: f64, b: f64) {
        let new = HeightRange { lo: a.min(b), hi: a.max(b) };
        let i = self.list.partition_point(|range| range.hi < new.lo);
        // Only the first interval that ends at or above `lo` can hold [lo, hi]: nearly every piece ends here. A
        // single interval has no neighbour that it could grow into, so it may grow in place.
        let alone = self.new.is_empty() && self.list.len() == 1;
        match self.list.get_mut(i) {
            Some(old) if old.lo <= new.lo && new.hi <= old.hi => return,
            Some(old) if alone && old.lo <= new.hi => return *old = old.union(new),
            _ => self.new.push(new),
        }
        if self.new.len() > self.list.len() + SPARE {
            self.join();
        }
    }

    /// Adds all intervals of another list.
    pub(super) fn append(&mut self, other: &mut Self) {
        other.join();
        self.new.append(&mut other.list);
    }

    /// Joins what was added, where it touches.
    pub fn join(&mut self) {
        if self.new.is_empty() {
            return;
        }
        self.list.append(&mut self.new);
        join_ranges(&mut self.list);
    }

    /// The intervals, upwards; joined.
    pub(crate) fn intervals(&self) -> &[HeightRange] {
        debug_assert!(self.new.is_empty());
        &self.list
    }
}

/// What lies in one section.
#[derive(Clone, Debug, Default)]
struct InSection {
    heights: Heights,
    /// That of every stroke that is to stay whole, with what is kept free around it.
    figures: Vec<HeightRange>,
    /// The most that is kept free above and below a mark that may be cut, nm.
    reserve: f64,
}

/// How rough the surface is under the strokes: heights that rise and fall again by little.
#[derive(Clone, Copy, Debug, Default)]
struct Ripple {
    /// Rises and falls below [`Ripple::SMALL`], and their sum, nm.
    count: u64,
    sum: u64,
    /// Sum of all rises and falls, nm.
    all: u64,
}

impl Ripple {
    /// Above this it is shape, not roughness, nm.
    const SMALL: f64 = 20_000.0;

    fn add(&mut self, change: f64) {
        let change = change.abs();
        self.all += change as u64;
        if change < Self::SMALL {
            self.count += 1;
            self.sum += change as u64;
        }
    }
}

/// Height that strokes climb or fall by slope along them: as cuts between levels are spread over slopes.
#[derive(Clone, Debug)]
struct SlopeSpan {
    /// By slope in steps of 1 / [`SlopeSpan::PER_UNIT`], the steepest together, nm.
    by_slope: [u64; Self::STEPS],
}

impl Default for SlopeSpan {
    fn default() -> Self {
        Self { by_slope: [0; Self::STEPS] }
    }
}

impl SlopeSpan {
    /// Steps up to a slope of 4 (76 deg), beyond which little is ever marked.
    const STEPS: usize = 256;
    /// Steps of a slope of 1: less than a degree each.
    const PER_UNIT: f64 = 64.0;

    /// Adds a stretch that is `length` nm long and climbs `height` nm.
    fn add(&mut self, height: f64, length: f64) {
        if length == 0.0 {
            return;
        }
        let height = height.abs();
        let step = (height / length * Self::PER_UNIT) as usize;
        self.by_slope[step.min(Self::STEPS - 1)] += height as u64;
    }

    /// The slope that `share` of all climbing does not exceed.
    fn slope(&self, share: f64) -> f64 {
        let all: u64 = self.by_slope.iter().sum();
        let mut sum = 0;
        let step = self.by_slope.iter().position(|climb| {
            sum += climb;
            sum as f64 >= share * all as f64
        });
        if all == 0 { 0.0 } else { step.map_or(0.0, |step| (step + 1) as f64 / Self::PER_UNIT) }
    }
}

/// Follows the height along one stroke from turn to turn.
#[derive(Default)]
struct HeightReversals {
    from: f64,
    at: f64,
    begun: bool,
}

impl HeightReversals {
    fn follow(&mut self, p: &Piece, ripple: &mut Ripple) {
        if !self.begun || p.z0 != self.at {
            self.end(ripple);
            *self = Self { from: p.z0, at: p.z0, begun: true };
        }
        // A change of sign is a turn: what rose or fell since the one before it counts as one.
        if (p.z1 - self.at) * (self.at - self.from) < 0.0 {
            ripple.add(self.at - self.from);
            self.from = self.at;
        }
        self.at = p.z1;
    }

    fn end(&mut self, ripple: &mut Ripple) {
        if self.begun && self.at != self.from {
            ripple.all += (self.at - self.from).abs() as u64;
        }
    }
}

/// Where the texture touches the surface: the heights of its marks in every section.
#[derive(Clone, Debug, Default)]
pub struct Footprint {
    /// By section; most sections of a large grid may hold nothing.
    sections: FxHashMap<u32, InSection>,
    ripple: Ripple,
    climb: SlopeSpan,
    /// Strokes to be kept whole that have a place where nothing is marked.
    broken: usize,
    /// Strokes to be kept whole that do not fit the window around the centre of one section.
    astride: usize,
}

/// The heights of one stroke, piece by piece: pieces of one section that follow each other make one interval each time
/// the section or the sheet changes.
struct SectionRuns<'a> {
    sections: &'a mut FxHashMap<u32, InSection>,
    ripple: &'a mut Ripple,
    /// Columns of the grid of sections.
    columns: i64,
    run: Option<SectionRun>,
    reversals: HeightReversals,
}

/// The heights of pieces that follow each other in one section, column and row of it.
struct SectionRun {
    cell: [i64; 2],
    lo: f64,
    hi: f64,
    reserve: f64,
}

impl SectionRuns<'_> {
    #[inline]
    fn add(&mut self, p: &Piece, cell: [i64; 2]) {
        self.reversals.follow(p, self.ripple);
        match &mut self.run {
            // A piece extends the run where it begins within its heights; at a step between sheets it does not,
            // and the heights between the sheets stay out: no stop is spent on them.
            Some(run) if run.cell == cell && p.z0 <= run.hi && p.z0 >= run.lo => {
                run.lo = run.lo.min(p.z1);
                run.hi = run.hi.max(p.z1);
                run.reserve = run.reserve.max(p.reserve);
            }
            _ => {
                self.close();
                self.run = Some(SectionRun { cell, lo: p.z0.min(p.z1), hi: p.z0.max(p.z1), reserve: p.reserve });
            }
        }
    }

    /// Gives the heights of the run to its section.
    fn close(&mut self) {
        if let Some(SectionRun { cell: [column, row], lo, hi, reserve }) = self.run.take() {
            let section = self.sections.entry((row * self.columns + column) as u32).or_default();
            section.heights.add(lo, hi);
            section.reserve = section.reserve.max(reserve);
        }
    }

    fn end(mut self) {
        self.close();
        self.reversals.end(self.ripple);
    }
}

impl Footprint {
    /// Adds one stroke, traced over the grid of sections. One that `keep` would have whole is added as a figure where
    /// all of it is marked and lies within `half` of its section's centre along x and y; any other piece by piece.
    /// `marks` takes points and figures of it for the lower bound.
    pub fn add(
        &mut self,
        points: &[P2],
        tracer: &mut GridTracer<'_>,
        keep: Keep,
        half: [Nm; 2],
        mut marks: Option<&mut Samples>,
    ) {
        let bounds = keep.bounds(points);
        if let Some(bounds) = &bounds
            && self.add_figure(points, bounds, tracer, half, marks.as_deref_mut())
        {
            return;
        }
        let Self { sections, ripple, climb, .. } = self;
        let columns = i64::from(tracer.grid.count[0]);
        let mut runs = SectionRuns { sections, ripple, columns, run: None, reversals: HeightReversals::default() };
        if bounds.is_some() {
            // `add_figure` has traced it, to see whether it stays whole, and has given its pieces to `marks`.
            tracer.replay(|p, cell| runs.add(&p, cell));
        } else {
            for (a, b) in segments(points) {
                let length = a.distance(b);
                tracer.segment(a, b, |p, cell| {
                    climb.add(p.z1 - p.z0, (p.t1 - p.t0) * length);
                    marks.iter_mut().for_each(|m| m.add(&p, a, b));
                    runs.add(&p, cell);
                });
            }
        }
        runs.end();
    }

    /// Traces a stroke that is to stay whole, and adds it to the section of its middle if it can; `bounds` is its box.
    fn add_figure(
        &mut self,
        points: &[P2],
        bounds: &Box2,
        tracer: &mut GridTracer<'_>,
        half: [Nm; 2],
        mut marks: Option<&mut Samples>,
    ) -> bool {
        let (z, is_marked) = tracer.small_stroke(points, |p, a, b| {
            marks.iter_mut().for_each(|m| m.add(p, a, b));
        });
        // A whole figure belongs to the section of its middle, which the window of a stop reaches beyond.
        let middle = [(0, bounds.lo.x + bounds.hi.x), (1, bounds.lo.y + bounds.hi.y)];
        let [column, row] = middle.map(|(axis, sum)| tracer.grid.along(axis, sum / 2, 0));
        let section = row * i64::from(tracer.grid.count[0]) + column;
        let window = Box2::around(tracer.grid.centre(section as usize), half);
        let is_whole = is_marked && window.holds(bounds.lo) && window.holds(bounds.hi);
        if is_whole {
            self.sections.entry(section as u32).or_default().figures.push(HeightRange { lo: z[0], hi: z[1] });
            marks.iter_mut().for_each(|m| m.figure(bounds, z));
        } else {
            self.astride += usize::from(is_marked);
            // A stroke without any mark is not broken.
            self.broken += usize::from(!is_marked && z[0] <= z[1]);
        }
        is_whole
    }

    /// Adds the footprint of other strokes. Which strokes come together, and in which order, is chance: all here are sums of
    /// integers, or lists that [`Footprint::joined`] sorts.
    pub fn merge(&mut self, other: Self) {
        for (section, mut theirs) in other.sections {
            match self.sections.entry(section) {
                Entry::Vacant(mine) => _ = mine.insert(theirs),
                Entry::Occupied(mine) => {
                    let mine = mine.into_mut();
                    mine.heights.append(&mut theirs.heights);
                    mine.figures.append(&mut theirs.figures);
                    mine.reserve = mine.reserve.max(theirs.reserve);
                }
            }
        }
        self.ripple.count += other.ripple.count;
        self.ripple.sum += other.ripple.sum;
        self.ripple.all += other.ripple.all;
        self.climb.by_slope.iter_mut().zip(other.climb.by_slope).for_each(|(mine, theirs)| *mine += theirs);
        self.broken += other.broken;
        self.astride += other.astride;
    }

    /// The footprint with all intervals joined and sorted, as the next functions need it.
    #[must_use]
    pub fn joined(mut self) -> Self {
        for s in self.sections.values_mut() {
            s.heights.join();
            s.figures.sort_unstable_by(HeightRange::total_cmp);
        }
        self
    }

    /// The footprint with every interval reaching `by` nm further up and down.
    #[must_use]
    pub fn widened(mut self, by: f64) -> Self {
        for s in self.sections.values_mut() {
            s.heights.new = std::mem::take(&mut s.heights.list);
            s.heights.new.iter_mut().for_each(|range| *range = HeightRange { lo: range.lo - by, hi: range.hi + by });
            s.heights.join();
        }
        self
    }

    /// The footprint with the lowest interval of every section reaching `by` nm further down, so that levels begin
    /// there.
    #[must_use]
    pub(crate) fn deepened(mut self, by: f64) -> Self {
        for lowest in self.sections.values_mut().filter_map(|s| s.heights.list.first_mut()) {
            lowest.lo -= by;
        }
        self
    }

    /// The intervals of a section, upwards; strokes that are to stay whole are not among them.
    pub(crate) fn of_section(&self, section: usize) -> &[HeightRange] {
        self.sections.get(&(section as u32)).map_or(&[], |s| s.heights.intervals())
    }

    /// The heights of the strokes that are to stay whole in a section, by the lowest mark.
    pub(crate) fn figures_of(&self, section: usize) -> &[HeightRange] {
        self.sections.get(&(section as u32)).map_or(&[], |s| &s.figures)
    }

    /// The most that is kept free above and below the marks of a section that may be cut, nm.
    pub(crate) fn reserve_of(&self, section: usize) -> f64 {
        self.sections.get(&(section as u32)).map_or(0.0, |s| s.reserve)
    }

    /// The most that is kept free above and below any mark that may be cut, nm, and the first section with that; None
    /// where nothing is.
    pub fn most_reserve(&self) -> Option<(f64, usize)> {
        let kept = self.sections.iter().map(|(&section, s)| (s.reserve, section as usize));
        kept.filter(|(kept, _)| *kept > 0.0).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
    }

    /// Whether anything is marked in a section.
    pub fn is_used(&self, section: usize) -> bool {
        self.sections.contains_key(&(section as u32))
    }

    /// Strokes that were to stay whole: those that a rim or a steep place breaks, those that lie across a
    /// border of sections.
    pub(crate) fn not_whole(&self) -> [usize; 2] {
        [self.broken, self.astride]
    }

    /// From the lowest to the highest mark; None where nothing is marked.
    pub fn range(&self) -> Option<HeightRange> {
        let all = self.sections.values().flat_map(|s| s.heights.intervals().iter().chain(&s.figures));
        all.copied().reduce(HeightRange::union)
    }

    /// The slope along strokes, as a tangent, that 99 of 100 cuts between levels do not exceed, wherever levels
    /// begin. Strokes that are to stay whole do not count.
    pub fn slope(&self) -> f64 {
        self.climb.slope(0.99)
    }

    /// The hysteresis that keeps the surface's roughness from shredding strokes, nm: nine tenths of the mean
    /// of the small rises and falls, where these are a quarter of all or more (fewer cut strokes by less
    /// than a third, and stops cost more); else 0. White noise of deviation s gives 1.6 s.
    pub(crate) fn roughness(&self) -> f64 {
        let Ripple { count, sum, all } = self.ripple;
        if count == 0 || sum * 4 < all { 0.0 } else { 0.9 * sum as f64 / count as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_of_height_are_joined_only_where_they_touch() {
        let pairs =
            |heights: &Heights| heights.intervals().iter().map(|range| [range.lo, range.hi]).collect::<Vec<_>>();
        let mut h = Heights::default();
        for (a, b) in [(5.0, 6.0), (1.0, 2.0), (9.0, 8.0), (2.0, 3.0)] {
            h.add(a, b);
        }
        h.join();
        assert_eq!(pairs(&h), [[1.0, 3.0], [5.0, 6.0], [8.0, 9.0]]);
        h.add(2.5, 8.5);
        h.join();
        assert_eq!(pairs(&h), [[1.0, 9.0]]);
    }
}

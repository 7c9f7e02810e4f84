//! Fragments given to other stops: where two stops become one, their fragments go there as they are, and those that
//! touch become one. Nothing has to be traced again for that.
//!
//! Cut anew is a stroke of which a sliver was left out in or next to a stop that changes, which may admit it now; and a
//! closed one, or one that was to stay whole, of which fragments would be joined.
//!
//! Consumes the fragments of a run of strokes; promises the same marks, none in more fragments than before.

use std::ops::Range;

use super::{Fragment, Fragments, Measure, Splitter};
use crate::geom::{FieldPoint, P2};
use crate::partition::Stops;
use crate::program::{PenId, StopId, StrokeId};
use crate::projection::Keep;

/// Stops that took the place of others.
pub struct Regroup<'a> {
    /// Those that the fragments were cut for, upright.
    pub old: &'a Stops,
    /// Those that they go to.
    pub new: &'a Stops,
    /// By old stop, the new one that admits all of its marks.
    pub ids: &'a [StopId],
    /// By new stop, whether it stands elsewhere than the old one or marks more.
    pub is_changed: &'a [bool],
    /// Whether strokes may be cut anew. Where not, fragments of closed strokes and of those that were to stay whole are
    /// not joined.
    pub may_cut: bool,
}

/// A stroke of the texture: fills its points, and answers with its pen and how often that marks it.
type Strokes<'a> = &'a mut dyn FnMut(StrokeId, &mut Vec<P2>) -> (PenId, u32);

/// The fragments and slivers of one stroke.
struct Group {
    source: StrokeId,
    list: Range<usize>,
    slivers: Range<usize>,
    is_cut_again: bool,
    /// Whether its fragments stay as many as they are.
    is_kept: bool,
}

impl Regroup<'_> {
    /// Gives fragments to their new stops. `splitter`, without strokes yet, cuts between the new stops, and `keep`
    /// wants whole what it wants whole.
    pub fn apply(&self, old: Fragments, mut splitter: Splitter<'_>, keep: Keep, strokes: Strokes<'_>) -> Fragments {
        let mut points = Vec::new();
        let mut groups = groups(&old);
        let (mut closed, mut not_kept) = (0, 0);
        for group in &mut groups {
            let admits_slivers = self.may_cut && self.admits_slivers(&old, group);
            if !admits_slivers && !self.joins(&old, group) {
                continue;
            }
            let (pen, passes) = strokes(group.source, &mut points);
            let is_closed = points.len() > 1 && points.first() == points.last();
            let is_kept = keep.bounds(&points).is_some();
            group.is_kept = !self.may_cut && (is_closed || is_kept);
            group.is_cut_again = self.may_cut && (admits_slivers || is_closed || is_kept);
            if group.is_cut_again {
                closed += usize::from(is_closed);
                not_kept += usize::from(is_kept && group.list.len() > 1);
                splitter.stroke(group.source, pen, passes, &points);
            }
        }
        let again = splitter.finish().next().unwrap_or_default();
        let mut new = Fragments {
            list: Vec::with_capacity(old.list.len()),
            measures: Vec::with_capacity(old.list.len()),
            points: Vec::with_capacity(old.points.len()),
            slivers: Vec::with_capacity(old.slivers.len()),
            strokes_cut: old.strokes_cut + again.strokes_cut,
            figures_whole: old.figures_whole + again.figures_whole,
            figures_cut: old.figures_cut + again.figures_cut - closed,
            not_kept: old.not_kept + again.not_kept - not_kept,
            ..Fragments::default()
        };
        let (mut next, mut next_sliver) = (0, 0);
        let mut small = old.skipped.small;
        for group in &groups {
            let first = new.list.len();
            if group.is_cut_again {
                let of = |source: StrokeId| source == group.source;
                let end = next + again.list[next..].iter().take_while(|f| of(f.source)).count();
                (next..end).for_each(|i| new.push(again.list[i], again.measures[i], again.points_of(i)));
                let slivers = again.slivers[next_sliver..].iter().take_while(|s| of(s.source));
                for sliver in slivers {
                    let after = first + (sliver.after as usize - next);
                    new.slivers.push(super::Sliver { after: after as u32, ..*sliver });
                    small += sliver.length_mm;
                    next_sliver += 1;
                }
                next = end;
                small -= old.slivers[group.slivers.clone()].iter().map(|s| s.length_mm).sum::<f64>();
            } else {
                self.give(&old, group, &mut new, &mut points, strokes);
            }
            let count = new.list.len() - first;
            let was_cut = usize::from(group.list.len() > 1);
            new.strokes_cut -= if group.is_cut_again { was_cut } else { was_cut - usize::from(count > 1) };
        }
        let skipped = super::Skipped { small: small.max(0.0), ..old.skipped };
        Fragments {
            texture_mm: old.texture_mm,
            mark_mm: old.mark_mm + (old.skipped.small - skipped.small),
            overlap_mm: old.overlap_mm,
            skipped,
            dots: old.dots,
            cuts: old.cuts,
            short: old.short,
            steep_at: old.steep_at,
            worst_slope2: old.worst_slope2,
            ..new
        }
    }

    fn id(&self, old: StopId) -> StopId {
        self.ids[old.index()]
    }

    fn is_changed(&self, old: StopId) -> bool {
        self.is_changed[self.id(old).index()]
    }

    /// Whether fragments of a stroke become one.
    fn joins(&self, old: &Fragments, group: &Group) -> bool {
        let list = &old.list[group.list.clone()];
        list.windows(2).any(|w| w[1].goes_on && self.id(w[0].stop) == self.id(w[1].stop))
    }

    /// Whether what was left out of a stroke may be admitted by a stop that changes.
    fn admits_slivers(&self, old: &Fragments, group: &Group) -> bool {
        old.slivers[group.slivers.clone()].iter().any(|s| old.stops_at(s).any(|stop| self.is_changed(stop)))
    }

    /// Gives the fragments of a stroke to their new stops.
    fn give(&self, old: &Fragments, group: &Group, new: &mut Fragments, points: &mut Vec<P2>, strokes: Strokes<'_>) {
        let slivers = &old.slivers[group.slivers.clone()];
        let mut left_out = slivers.iter().peekable();
        let mut is_read = false;
        for i in group.list.clone() {
            while let Some(sliver) = left_out.next_if(|s| s.after as usize <= i) {
                new.leave_out(sliver, self.id(sliver.stop));
            }
            let (f, measure) = (old.list[i], old.measures[i]);
            let (from, to) = (&self.old.stops[f.stop.index()].stop, self.id(f.stop));
            let at = &self.new.stops[to.index()].stop;
            let by = [from.centre.x - at.centre.x, from.centre.y - at.centre.y].map(|v| v as i32);
            let measure = measure.over(from.z_lo - at.z_lo);
            let moved = |p: &FieldPoint| FieldPoint::new(p.x + by[0], p.y + by[1]);
            let follows = i > group.list.start && f.goes_on && self.id(old.list[i - 1].stop) == to;
            let is_joined = follows && !group.is_kept;
            if !is_joined {
                new.push(Fragment { stop: to, ..f }, measure, old.points_of(i).iter().map(moved));
                continue;
            }
            if !std::mem::replace(&mut is_read, true) {
                strokes(group.source, points);
            }
            let [cut, ref follows @ ..] = *old.points_of(i) else { continue };
            // A cut at a vertex of the stroke is a corner of the mark.
            let is_vertex = points[f.segment as usize]
                == P2::new(from.centre.x + i64::from(cut.x), from.centre.y + i64::from(cut.y));
            if !is_vertex {
                new.points.pop();
            }
            new.points.extend(follows.iter().map(moved));
            let (Some(last), Some(sum)) = (new.list.last_mut(), new.measures.last_mut()) else { continue };
            last.len = new.points.len() as u32 - last.first;
            *sum = sum.joined(measure);
        }
        left_out.for_each(|sliver| new.leave_out(sliver, self.id(sliver.stop)));
    }
}

impl Fragments {
    /// The stop that a sliver was left out in, and those of the fragments beside it on its stroke.
    pub fn stops_at<'a>(&'a self, sliver: &'a super::Sliver) -> impl Iterator<Item = StopId> + 'a {
        let after = sliver.after as usize;
        let beside = &self.list[after.saturating_sub(1)..(after + 1).min(self.list.len())];
        beside.iter().filter(|f| f.source == sliver.source).map(|f| f.stop).chain([sliver.stop])
    }

    fn points_of(&self, i: usize) -> &[FieldPoint] {
        let f = &self.list[i];
        &self.points[f.first as usize..(f.first + f.len) as usize]
    }

    fn push<P: std::borrow::Borrow<FieldPoint>>(
        &mut self,
        fragment: Fragment,
        measure: Measure,
        points: impl IntoIterator<Item = P>,
    ) {
        let first = self.points.len() as u32;
        self.points.extend(points.into_iter().map(|p| *p.borrow()));
        self.list.push(Fragment { first, ..fragment });
        self.measures.push(measure);
    }

    fn leave_out(&mut self, sliver: &super::Sliver, stop: StopId) {
        let after = self.list.len() as u32;
        self.slivers.push(super::Sliver { stop, after, ..*sliver });
    }
}

/// The strokes that have fragments or slivers, in the order of the texture.
fn groups(of: &Fragments) -> Vec<Group> {
    let (mut groups, mut at, mut sliver) = (Vec::new(), 0, 0);
    loop {
        let next = [of.list.get(at).map(|f| f.source), of.slivers.get(sliver).map(|s| s.source)];
        let Some(source) = next.into_iter().flatten().min() else { return groups };
        let list = at..at + of.list[at..].iter().take_while(|f| f.source == source).count();
        let slivers = sliver..sliver + of.slivers[sliver..].iter().take_while(|s| s.source == source).count();
        (at, sliver) = (list.end, slivers.end);
        groups.push(Group { source, list, slivers, is_cut_again: false, is_kept: false });
    }
}

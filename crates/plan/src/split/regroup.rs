//! Fragments given to other stops: where two stops become one, their fragments go there as they are, and those that
//! touch become one. Nothing has to be traced again for that.
//!
//! Cut anew is a stroke of which a sliver was left out in or next to a stop that changes, which may admit it now; and a
//! closed one, or one that was to stay whole, of which fragments would be joined.
//!
//! Consumes the fragments of a run of strokes; promises the same marks, none in more fragments than before.

use std::ops::Range;

use super::{Fragment, Fragments, Measure, Splitter};
use crate::partition::Stops;
use crate::projection::Keep;
use terrace_core::geom::{FieldPoint, P2};
use terrace_core::program::{PenId, StopId, StrokeId, stroke_mm};

/// Stops that took the place of others.
pub struct Regroup<'a> {
    /// The stops that the fragments were cut for, upright.
    pub old: &'a Stops,
    /// The stops that they go to.
    pub new: &'a Stops,
    /// By old stop, the new one that admits all of its marks.
    pub ids: &'a [StopId],
    /// By new stop, whether it stands elsewhere than the old one or marks more.
    pub is_changed: &'a [bool],
    /// Whether strokes may be cut anew. Where not, fragments of closed strokes and of those that were to stay whole are
    /// not joined.
    pub may_cut: bool,
}

/// A stroke of the texture: fills its points, and returns its pen and how often that marks it.
type ReadStroke<'a> = &'a mut dyn FnMut(StrokeId, &mut Vec<P2>) -> (PenId, u32);

/// The fragments and slivers of one stroke.
struct StrokeGroup {
    source: StrokeId,
    list: Range<usize>,
    slivers: Range<usize>,
    is_cut_again: bool,
    /// Whether its fragments stay as many as they are.
    is_kept: bool,
}

/// What was counted of the strokes that are cut again.
struct Replaced {
    /// Length of the marks of all other strokes, mm.
    others_mark_mm: f64,
    /// Closed strokes. Each was counted as cut, since it had more than one fragment or a sliver.
    closed: usize,
    /// Strokes that were to stay whole and were cut.
    not_kept: usize,
}

/// Fragments of strokes that are read stroke by stroke, in the order of the texture.
struct StrokeByStroke<'a> {
    fragments: &'a Fragments,
    next: usize,
    next_sliver: usize,
}

impl StrokeByStroke<'_> {
    /// Appends the fragments and the slivers of the next stroke, which is `source`, to `new`.
    fn append(&mut self, source: StrokeId, new: &mut Fragments) {
        let first = new.list.len();
        let Self { fragments, next, next_sliver } = self;
        let end = *next + fragments.list[*next..].iter().take_while(|f| f.source == source).count();
        (*next..end).for_each(|i| new.push(fragments.list[i], fragments.measures[i], fragments.points_of(i)));
        for sliver in fragments.slivers[*next_sliver..].iter().take_while(|s| s.source == source) {
            let after = first + (sliver.after as usize - *next);
            new.slivers.push(super::Sliver { after: after as u32, ..*sliver });
            new.skipped.small += sliver.length_mm;
            *next_sliver += 1;
        }
        *next = end;
    }
}

impl Regroup<'_> {
    /// Gives fragments to their new stops; `measures` are what they lie on. `splitter`, without strokes yet, cuts
    /// between the new stops, and `keep` wants whole what it wants whole.
    pub fn apply(
        &self,
        old: &Fragments,
        measures: &[Measure],
        mut splitter: Splitter<'_>,
        keep: Keep,
        strokes: ReadStroke<'_>,
    ) -> Fragments {
        let mut points = Vec::new();
        let mut groups = groups(old);
        let replaced = self.cut_again(old, &mut groups, &mut splitter, keep, strokes, &mut points);
        let again = splitter.finish().next().unwrap_or_default();
        let mut new = Fragments {
            list: Vec::with_capacity(old.list.len()),
            measures: Vec::with_capacity(old.list.len()),
            points: Vec::with_capacity(old.points.len()),
            slivers: Vec::with_capacity(old.slivers.len()),
            strokes_cut: old.strokes_cut + again.strokes_cut,
            figures_whole: old.figures_whole + again.figures_whole,
            figures_cut: old.figures_cut + again.figures_cut - replaced.closed,
            not_kept: old.not_kept + again.not_kept - replaced.not_kept,
            texture_mm: old.texture_mm,
            mark_mm: replaced.others_mark_mm + again.mark_mm,
            overlap_mm: old.overlap_mm,
            skipped: old.skipped,
            dots: old.dots,
            cuts: old.cuts,
            short: old.short,
            steep_at: old.steep_at,
            worst_slope2: old.worst_slope2,
        };
        let mut cut_again = StrokeByStroke { fragments: &again, next: 0, next_sliver: 0 };
        for group in &groups {
            let first = new.list.len();
            if group.is_cut_again {
                cut_again.append(group.source, &mut new);
                let old_slivers = &old.slivers[group.slivers.clone()];
                new.skipped.small -= old_slivers.iter().map(|s| s.length_mm).sum::<f64>();
            } else {
                new.mark_mm += self.give(old, measures, group, &mut new, &mut points, strokes);
            }
            let count = new.list.len() - first;
            let was_cut = usize::from(group.list.len() > 1);
            // Takes out what was counted of the stroke in `old`: `again` counts strokes that are cut again; others are
            // no longer cut where their fragments became one.
            new.strokes_cut -= if group.is_cut_again { was_cut } else { was_cut - usize::from(count > 1) };
        }
        // A difference of sums may fall below nothing by rounding.
        new.skipped.small = new.skipped.small.max(0.0);
        new
    }

    /// Decides of every stroke whether it is cut again, and cuts those that are.
    fn cut_again(
        &self,
        old: &Fragments,
        groups: &mut [StrokeGroup],
        splitter: &mut Splitter<'_>,
        keep: Keep,
        strokes: ReadStroke<'_>,
        points: &mut Vec<P2>,
    ) -> Replaced {
        let mut replaced = Replaced { others_mark_mm: old.mark_mm, closed: 0, not_kept: 0 };
        for group in groups {
            let admits_slivers = self.may_cut && self.admits_slivers(old, group);
            if !admits_slivers && !self.joins(old, group) {
                continue;
            }
            let (pen, passes) = strokes(group.source, points);
            let is_closed = points.len() > 1 && points.first() == points.last();
            let is_kept = keep.bounds(points).is_some();
            group.is_kept = !self.may_cut && (is_closed || is_kept);
            group.is_cut_again = self.may_cut && (admits_slivers || is_closed || is_kept);
            if group.is_cut_again {
                let length: f64 = group.list.clone().map(|i| stroke_mm(old.points_of(i))).sum();
                replaced.others_mark_mm -= f64::from(passes) * length;
                replaced.closed += usize::from(is_closed);
                replaced.not_kept += usize::from(is_kept && group.list.len() > 1);
                splitter.stroke(group.source, pen, passes, points);
            }
        }
        replaced
    }

    fn id(&self, old: StopId) -> StopId {
        self.ids[old.index()]
    }

    fn is_changed(&self, old: StopId) -> bool {
        self.is_changed[self.id(old).index()]
    }

    /// Whether fragments of a stroke become one.
    fn joins(&self, old: &Fragments, group: &StrokeGroup) -> bool {
        let list = &old.list[group.list.clone()];
        list.windows(2).any(|w| w[1].goes_on && self.id(w[0].stop) == self.id(w[1].stop))
    }

    /// Whether what was left out of a stroke may be admitted by a stop that changes.
    fn admits_slivers(&self, old: &Fragments, group: &StrokeGroup) -> bool {
        old.slivers[group.slivers.clone()].iter().any(|s| old.stops_at(s).any(|stop| self.is_changed(stop)))
    }

    /// Gives the fragments of a stroke to their new stops. Returns by how much longer its marks become, mm: a cut that
    /// was rounded to the grid lay off the line.
    fn give(
        &self,
        old: &Fragments,
        measures: &[Measure],
        group: &StrokeGroup,
        new: &mut Fragments,
        points: &mut Vec<P2>,
        strokes: ReadStroke<'_>,
    ) -> f64 {
        let mut slivers = old.slivers[group.slivers.clone()].iter().peekable();
        // The stroke is read once, when the first of its fragments are joined.
        let mut passes_of_stroke = None;
        let mut longer = 0.0;
        for i in group.list.clone() {
            // Invariant: slivers and fragments go to `new` in their order on the stroke.
            while let Some(sliver) = slivers.next_if(|s| s.after as usize <= i) {
                new.leave_out(sliver, self.id(sliver.stop));
            }
            let f = old.list[i];
            let old_stop = &self.old.stops[f.stop.index()].stop;
            let new_id = self.id(f.stop);
            let new_stop = &self.new.stops[new_id.index()].stop;
            let by = [old_stop.centre.x - new_stop.centre.x, old_stop.centre.y - new_stop.centre.y].map(|v| v as i32);
            let measure = measures[i].over(old_stop.z_lo - new_stop.z_lo);
            let moved = |p: &FieldPoint| FieldPoint::new(p.x + by[0], p.y + by[1]);
            let continues = i > group.list.start && f.goes_on && self.id(old.list[i - 1].stop) == new_id;
            let is_joined = continues && !group.is_kept;
            if !is_joined {
                new.push(Fragment { stop: new_id, ..f }, measure, old.points_of(i).iter().map(moved));
                continue;
            }
            let passes = *passes_of_stroke.get_or_insert_with(|| strokes(group.source, points).1);
            let [cut, ref rest @ ..] = *old.points_of(i) else { continue };
            // A cut at a vertex of the stroke is a corner of the mark.
            let is_vertex = points[f.segment as usize]
                == P2::new(old_stop.centre.x + i64::from(cut.x), old_stop.centre.y + i64::from(cut.y));
            if let (false, [.., before, end], Some(after)) = (is_vertex, &new.points[..], rest.first().map(moved)) {
                longer += f64::from(passes) * (stroke_mm(&[*before, after]) - stroke_mm(&[*before, *end, after]));
                new.points.pop();
            }
            new.points.extend(rest.iter().map(moved));
            let (Some(last), Some(sum)) = (new.list.last_mut(), new.measures.last_mut()) else { continue };
            last.len = new.points.len() as u32 - last.first;
            *sum = sum.joined(measure);
        }
        slivers.for_each(|sliver| new.leave_out(sliver, self.id(sliver.stop)));
        longer
    }
}

impl Fragments {
    /// The stop that a sliver was left out in, and those of the fragments beside it on its stroke.
    pub(crate) fn stops_at<'a>(&'a self, sliver: &'a super::Sliver) -> impl Iterator<Item = StopId> + 'a {
        self.stops_beside(sliver).chain([sliver.stop])
    }

    /// The stops of the fragments before and after a sliver on its stroke.
    pub(crate) fn stops_beside<'a>(&'a self, sliver: &super::Sliver) -> impl Iterator<Item = StopId> + use<'a> {
        let after = sliver.after as usize;
        let source = sliver.source;
        let beside = &self.list[after.saturating_sub(1)..(after + 1).min(self.list.len())];
        beside.iter().filter(move |f| f.source == source).map(|f| f.stop)
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
fn groups(fragments: &Fragments) -> Vec<StrokeGroup> {
    let Fragments { list: all, slivers: all_slivers, .. } = fragments;
    let mut groups = Vec::new();
    let mut next = 0;
    let mut next_sliver = 0;
    loop {
        // Invariant: fragments before `next` and slivers before `next_sliver` are in a group. Both lists are in the
        // order of the texture, and a stroke may be in one of them only.
        let sources = [all.get(next).map(|f| f.source), all_slivers.get(next_sliver).map(|s| s.source)];
        let Some(source) = sources.into_iter().flatten().min() else { return groups };
        let list = next..next + all[next..].iter().take_while(|f| f.source == source).count();
        let sliver_count = all_slivers[next_sliver..].iter().take_while(|s| s.source == source).count();
        let slivers = next_sliver..next_sliver + sliver_count;
        (next, next_sliver) = (list.end, slivers.end);
        groups.push(StrokeGroup { source, list, slivers, is_cut_again: false, is_kept: false });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::projection::Tracer;
    use crate::projection::tests::{MM, slope};
    use crate::split::{Least, Seam};
    use terrace_core::geom::Nm;
    use terrace_core::machine::TiltAngles;
    use terrace_core::program::{SectionId, Stop};
    use terrace_core::random::Random;

    const WINDOW: [Nm; 2] = [Nm(8 * MM), Nm(4 * MM)];
    const DEPTH: Nm = Nm(800_000);
    const LEAST: Least = Least { mark: 0.0, sliver: 100_000.0 };

    fn stop(y: i64, z_lo: i64) -> Stop {
        let (z_lo, z_hi) = (Nm(z_lo), Nm(z_lo) + DEPTH);
        let section = SectionId([0; 2]);
        Stop { section, level: 0, tilt: TiltAngles::default(), centre: P2::new(4 * MM, y), lpfl: z_lo, z_lo, z_hi }
    }

    fn cut(stops: &Stops, strokes: &[Vec<P2>]) -> Fragments {
        let surface = slope();
        let mut splitter = Splitter::new(Tracer::new(&surface, 1.0), &[stops], LEAST, Keep(Nm(0)), Seam::default());
        for (i, points) in strokes.iter().enumerate() {
            splitter.stroke(StrokeId(i as u32), PenId(0), 2, points);
        }
        splitter.finish().next().expect("one candidate")
    }

    fn regrouped(regroup: &Regroup<'_>, old: &Fragments, strokes: &[Vec<P2>]) -> Fragments {
        let surface = slope();
        let splitter = Splitter::new(Tracer::new(&surface, 1.0), &[regroup.new], LEAST, Keep(Nm(0)), Seam::default());
        regroup.apply(old, &old.measures, splitter, Keep(Nm(0)), &mut |source, points| {
            points.clone_from(&strokes[source.0 as usize]);
            (PenId(0), 2)
        })
    }

    /// Polylines of up to five points on the slope, some closed, some with vertices on the border of two stops and some
    /// with ends so near to it that a sliver is left out.
    fn strokes(random: &mut Random, count: usize) -> Vec<Vec<P2>> {
        (0..count)
            .map(|_| {
                let mut points: Vec<P2> = (0..random.between(2, 5))
                    .map(|_| {
                        let x = match random.between(0, 3) {
                            0 => 4 * MM,
                            1 => 4 * MM + random.between(-90_000, 90_000),
                            _ => random.between(MM, 7 * MM),
                        };
                        P2::new(x, random.between(MM, 7 * MM))
                    })
                    .collect();
                points.dedup();
                if random.between(0, 3) == 0 {
                    points.push(points[0]);
                }
                points.dedup();
                points
            })
            .filter(|points| points.len() > 1)
            .collect()
    }

    /// Two levels over one place, that meet where the slope is 0.4 mm high, and a stop beside them.
    fn two_levels() -> Stops {
        Stops::new(vec![stop(2 * MM, -400_000), stop(2 * MM, 400_000), stop(6 * MM, 0)], WINDOW, DEPTH)
    }

    #[test]
    fn fragments_of_two_stops_that_become_one_are_those_cut_for_that_stop() {
        let old = two_levels();
        // One level holds the marks of both.
        let new = Stops::new(vec![stop(2 * MM, 0), stop(6 * MM, 0)], WINDOW, DEPTH);
        let ids = [StopId(0), StopId(0), StopId(1)];
        let regroup = Regroup { old: &old, new: &new, ids: &ids, is_changed: &[true, false], may_cut: true };
        let strokes = strokes(&mut Random::new(11), 3000);
        let before = cut(&old, &strokes);
        assert!(before.slivers.len() > 50 && before.figures_cut > 50, "{}", before.slivers.len());
        let (found, wanted) = (regrouped(&regroup, &before, &strokes), cut(&new, &strokes));
        assert!(found.list.len() + 1000 < before.list.len());
        let shapes = |all: &Fragments| -> Vec<(Fragment, Vec<FieldPoint>)> {
            let shape = |i: usize| (Fragment { first: 0, goes_on: false, ..all.list[i] }, all.points_of(i).to_vec());
            (0..all.list.len()).map(shape).collect()
        };
        assert_eq!(shapes(&found), shapes(&wanted));
        for (a, b) in found.measures.iter().zip(&wanted.measures) {
            assert!((0..2).all(|k| (a.z[k] - b.z[k]).abs() <= 1) && (a.mean_z - b.mean_z).abs() < 1.0, "{a:?} {b:?}");
            assert!((a.length - b.length).abs() < 2.0 && (a.versine - b.versine).abs() < 1e-9, "{a:?} {b:?}");
        }
        let counts = |f: &Fragments| (f.strokes_cut, f.figures_whole, f.figures_cut, f.not_kept, f.slivers.len());
        assert_eq!(counts(&found), counts(&wanted));
        for (a, b) in [
            (found.mark_mm, wanted.mark_mm),
            (found.skipped.small, wanted.skipped.small),
            (found.texture_mm, wanted.texture_mm),
        ] {
            assert!((a - b).abs() < 1e-9 * b, "{a} {b}");
        }
    }

    #[test]
    fn stops_that_stay_keep_their_fragments() {
        let old = two_levels();
        let ids = [StopId(0), StopId(1), StopId(2)];
        let regroup = Regroup { old: &old, new: &old, ids: &ids, is_changed: &[false; 3], may_cut: true };
        let strokes = strokes(&mut Random::new(12), 500);
        let before = cut(&old, &strokes);
        let after = regrouped(&regroup, &before, &strokes);
        assert_eq!((&after.list, &after.points, &after.measures), (&before.list, &before.points, &before.measures));
        assert_eq!(after.slivers.len(), before.slivers.len());
        assert!((after.mark_mm - before.mark_mm).abs() < 1e-9);
    }

    #[test]
    fn where_nothing_may_be_cut_anew_figures_stay_in_their_fragments() {
        let old = two_levels();
        let new = Stops::new(vec![stop(2 * MM, 0), stop(2 * MM, 400_000), stop(6 * MM, 0)], WINDOW, DEPTH);
        let ids = [StopId(0), StopId(0), StopId(2)];
        let regroup = Regroup { old: &old, new: &new, ids: &ids, is_changed: &[true, false, false], may_cut: false };
        let strokes = strokes(&mut Random::new(13), 500);
        let before = cut(&old, &strokes);
        let after = regrouped(&regroup, &before, &strokes);
        assert!(after.list.len() < before.list.len() && after.list.iter().all(|f| f.stop != StopId(1)));
        let of_figures = |all: &Fragments| {
            let is_closed = |f: &&Fragment| {
                let points = &strokes[f.source.0 as usize];
                points.first() == points.last()
            };
            all.list.iter().filter(is_closed).count()
        };
        assert_eq!(of_figures(&after), of_figures(&before));
        assert_eq!(after.slivers.len(), before.slivers.len());
        assert!((after.mark_mm - before.mark_mm).abs() < 1e-9);
    }
}

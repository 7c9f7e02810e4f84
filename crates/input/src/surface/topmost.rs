//! Spans under one segment, and the topmost of several sheets.

use std::cmp::Ordering;

use super::mesh::NONE;

/// A place on a segment: its parameter, and a height there, nm.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProfilePoint {
    pub(super) t: f64,
    pub(super) z: f64,
}

/// A stretch of a segment on one facet, or on none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Parameter where it begins, 0 to 1.
    pub t0: f64,
    /// Parameter where it ends.
    pub t1: f64,
    /// Height at its start, nm.
    pub z0: f64,
    /// Height at its end, nm.
    pub z1: f64,
    pub(super) facet: u32,
}

impl Span {
    /// The facet under the stretch; None where the part is absent.
    pub fn facet(&self) -> Option<u32> {
        (self.facet != NONE).then_some(self.facet)
    }
    /// Height at `t`, never beyond those of its ends.
    pub(super) fn z(&self, t: f64) -> f64 {
        height_between(t, ProfilePoint { t: self.t0, z: self.z0 }, ProfilePoint { t: self.t1, z: self.z1 })
    }
    /// The part of it between two parameters.
    pub(super) fn cut(&self, t0: f64, t1: f64) -> Self {
        Self { t0, t1, z0: self.z(t0), z1: self.z(t1), facet: self.facet }
    }
    /// Whether two spans of one stretch have the same heights.
    fn ties(&self, other: &Self) -> bool {
        (self.z0 - other.z0).abs() <= TIE && (self.z1 - other.z1).abs() <= TIE
    }
    pub(super) fn gap(t0: f64, t1: f64) -> Self {
        Self { t0, t1, z0: f64::NAN, z1: f64::NAN, facet: NONE }
    }
}

/// On which side of the segment a facet lies that is cut with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
    /// The segment crosses it.
    Both,
}

impl Side {
    /// The side of a facet whose corners lie on these sides of the segment: positive on the left, zero on it.
    pub(super) fn of_facet(corners: [f64; 3]) -> Self {
        match (corners.iter().any(|s| *s > 0.0), corners.iter().any(|s| *s < 0.0)) {
            (true, false) => Self::Left,
            (false, true) => Self::Right,
            _ => Self::Both,
        }
    }

    /// Whether a facet of this side lies, at least in part, on `side`.
    fn reaches(self, side: Self) -> bool {
        self == side || self == Self::Both
    }
}

/// A stretch of the segment on a closed facet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) span: Span,
    pub(super) side: Side,
}

/// Facets cut with one segment, and scratch space to take the topmost of them.
#[derive(Debug, Default)]
pub(super) struct Sheets {
    pub(super) hits: Vec<Hit>,
    ends: Vec<f64>,
    active: Vec<Hit>,
    /// What is topmost on the left and on the right of the segment.
    beside: [Vec<Span>; 2],
}

/// How a facet lies to a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Incline {
    /// How steeply it rises to the left of the segment, per length of the segment.
    pub(super) rise_left: f64,
    /// Square of its slope.
    pub(super) slope2: f64,
}

/// What decides between facets that the segment runs along.
pub(super) struct FacetChoice<I> {
    /// Half a nanometre as parameter.
    pub(super) half_nm: f64,
    /// Square of the steepest slope that is marked.
    pub(super) limit2: f64,
    /// The side that is taken where nothing else decides.
    pub(super) tie_side: Side,
    /// How a facet of this number lies to the segment.
    pub(super) incline: I,
}

/// Heights that differ by less, nm, are one: corners are rounded in the plane, and edges may be divided differently.
const TIE: f64 = 1.0;

/// Height at `t` of the straight line between two points, never beyond theirs.
#[inline]
pub(super) fn height_between(t: f64, from: ProfilePoint, to: ProfilePoint) -> f64 {
    if t <= from.t || to.t <= from.t {
        from.z
    } else if t >= to.t {
        to.z
    } else {
        from.z + (to.z - from.z) * ((t - from.t) / (to.t - from.t))
    }
}

/// Appends a span on a facet. One that begins within half a nanometre of the last continues it: the grid of the program
/// cannot hold what lies between.
pub(super) fn push_span(out: &mut Vec<Span>, span: Span, half_nm: f64) {
    let t0 = match out.last() {
        Some(last) if (span.t0 - last.t1).abs() <= half_nm => last.t1,
        _ => span.t0,
    };
    if span.t1 > t0 {
        out.push(Span { t0, ..span });
    }
}

/// Appends a gap: it lengthens one at the end of the list, and is dropped where it is no longer than half a nanometre.
pub(super) fn push_gap(out: &mut Vec<Span>, t0: f64, t1: f64, half_nm: f64) {
    match out.last_mut() {
        Some(last) if last.facet == NONE => last.t1 = last.t1.max(t1),
        _ if t1 - t0 > half_nm => out.push(Span::gap(out.last().map_or(0.0, |l| l.t1), t1)),
        _ => {}
    }
}

/// Makes the spans tile [0, 1].
pub(super) fn seal(out: &mut Vec<Span>) {
    if let Some(first) = out.first_mut() {
        first.t0 = 0.0;
    }
    for i in 1..out.len() {
        let end = out[i - 1].t1;
        out[i].t0 = end;
    }
    match out.last_mut() {
        Some(last) => last.t1 = 1.0,
        None => out.push(Span::gap(0.0, 1.0)),
    }
}

impl Sheets {
    /// The topmost facets between two parameters, of the hits in any order.
    ///
    /// Where the segment crosses facets, that is their upper envelope. Where it runs along an edge, what counts is what
    /// is topmost beside it, on either side: of these the one that may be marked, else the higher one. A facet that is
    /// topmost on neither side, as the underside of a solid at the foot of its wall, is never taken.
    pub(super) fn take(
        &mut self,
        t_from: f64,
        t_to: f64,
        choice: &FacetChoice<impl Fn(u32) -> Incline>,
        out: &mut Vec<Span>,
    ) {
        self.hits.sort_by(|p, q| p.span.t0.total_cmp(&q.span.t0).then(p.span.facet.cmp(&q.span.facet)));
        if self.is_one_sheet(choice.half_nm) {
            self.take_in_turn(t_from, t_to, choice.half_nm, out);
        } else {
            self.sweep(t_from, t_to, choice, out);
        }
    }

    /// Whether the facets follow each other and nothing is above anything, as nearly everywhere.
    fn is_one_sheet(&self, half_nm: f64) -> bool {
        self.hits.windows(2).all(|w| w[1].span.t0 >= w[0].span.t1 - half_nm * 1e-3)
    }

    /// Takes the hits of one sheet, sorted by where they begin.
    fn take_in_turn(&self, t_from: f64, t_to: f64, half_nm: f64, out: &mut Vec<Span>) {
        let mut t = t_from;
        for Hit { span, .. } in &self.hits {
            push_gap(out, t, span.t0, half_nm);
            push_span(out, *span, half_nm);
            t = t.max(span.t1);
        }
        push_gap(out, t, t_to, half_nm);
    }

    /// Sweeps over the ends of all hits, sorted by where they begin, and takes the topmost between two that follow each
    /// other: there the same hits lie under the segment, and each is straight.
    fn sweep(&mut self, t_from: f64, t_to: f64, choice: &FacetChoice<impl Fn(u32) -> Incline>, out: &mut Vec<Span>) {
        let Self { hits, ends, active, beside } = self;
        let half_nm = choice.half_nm;
        ends.clear();
        ends.extend(hits.iter().flat_map(|h| [h.span.t0, h.span.t1]));
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        active.clear();
        let mut next = 0;
        // Spans and gaps are written up to t.
        let mut t = t_from;
        for stretch in ends.windows(2) {
            let &[start, end] = stretch else { continue };
            while next < hits.len() && hits[next].span.t0 <= start {
                active.push(hits[next]);
                next += 1;
            }
            active.retain(|h| h.span.t1 > start);
            if active.is_empty() {
                continue;
            }
            push_gap(out, t, start, half_nm);
            if active.iter().all(|h| h.side == Side::Both) {
                let spans = || active.iter().map(|h| &h.span);
                envelope(spans, start, end, None::<fn(u32) -> f64>, |span| push_span(out, span, half_nm));
            } else {
                for (side_spans, side) in beside.iter_mut().zip([Side::Left, Side::Right]) {
                    side_spans.clear();
                    let spans = || active.iter().filter(move |h| h.side.reaches(side)).map(|h| &h.span);
                    let sign = if side == Side::Left { 1.0 } else { -1.0 };
                    let rise = |facet| sign * (choice.incline)(facet).rise_left;
                    envelope(spans, start, end, Some(rise), |span| side_spans.push(span));
                }
                choice.take_sides(beside, start, end, out);
            }
            t = end;
        }
        push_gap(out, t, t_to, half_nm);
    }
}

impl<I: Fn(u32) -> Incline> FacetChoice<I> {
    /// Takes between two parameters the better of what is topmost on either side, which on a side is nothing or tiles
    /// all of the stretch.
    fn take_sides(&self, [left, right]: &[Vec<Span>; 2], t_from: f64, t_to: f64, out: &mut Vec<Span>) {
        // Spans are taken up to t; those of number l on the left and r on the right begin at it or before.
        let [mut l, mut r] = [0, 0];
        let mut t = t_from;
        while t < t_to {
            let end = [left.get(l), right.get(r)].into_iter().flatten().fold(t_to, |end, s| end.min(s.t1));
            let sides = [left.get(l).map(|s| s.cut(t, end)), right.get(r).map(|s| s.cut(t, end))];
            if let Some(span) = self.better(sides) {
                push_span(out, span, self.half_nm);
            }
            l += usize::from(left.get(l).is_some_and(|s| s.t1 <= end));
            r += usize::from(right.get(r).is_some_and(|s| s.t1 <= end));
            t = end;
        }
    }

    /// The better of what is topmost on the left and on the right of a stretch.
    fn better(&self, sides: [Option<Span>; 2]) -> Option<Span> {
        let [Some(left), Some(right)] = sides else { return sides[0].or(sides[1]) };
        let is_markable = |s: &Span| (self.incline)(s.facet).slope2 <= self.limit2;
        let takes_left = match (is_markable(&left), is_markable(&right)) {
            (true, false) => true,
            (false, true) => false,
            // Each may have lost to what ties with it on its own side: no more is lost here.
            _ if left.ties(&right) => {
                let facet = if self.tie_side == Side::Left { left.facet } else { right.facet };
                return Some(Span { facet, z0: left.z0.max(right.z0), z1: left.z1.max(right.z1), ..left });
            }
            _ => left.z0 + left.z1 > right.z0 + right.z1,
        };
        Some(if takes_left { left } else { right })
    }
}

/// The upper envelope between two parameters of spans that all reach over the stretch between them. Of several that
/// tie, the one with the greatest `rise` is topmost; without a rise they are compared by height alone.
fn envelope<'a, I: Iterator<Item = &'a Span>>(
    spans: impl Fn() -> I,
    t_from: f64,
    t_to: f64,
    rise: Option<impl Fn(u32) -> f64>,
    mut sink: impl FnMut(Span),
) {
    let Some(highest) = spans().max_by(|p, q| by_height(p, q, t_from, t_to)) else { return };
    let topmost = |top: &'a Span, t: f64| match &rise {
        Some(rise) => steepest_tied(top, spans(), t, t_to, rise),
        None => top,
    };
    let mut t = t_from;
    let mut top = topmost(highest, t_from);
    loop {
        let crossing = first_above(top, spans(), t, t_to, rise.is_none());
        let end = crossing.map_or(t_to, |(t_crossing, _)| t_crossing);
        sink(top.cut(t, end));
        let Some((t_crossing, above)) = crossing else { return };
        t = t_crossing;
        top = topmost(above, t);
    }
}

/// Orders spans by their height at `t`; of those that are equal there the one that is higher at `t_to` is greater, then
/// that of the lower facet number.
fn by_height(p: &Span, q: &Span, t: f64, t_to: f64) -> Ordering {
    p.z(t).total_cmp(&q.z(t)).then(p.z(t_to).total_cmp(&q.z(t_to))).then(q.facet.cmp(&p.facet))
}

/// The facet that rises most of the spans that tie with `top` from `t` to `t_to`, which are `top` and others.
fn steepest_tied<'a>(
    top: &'a Span,
    spans: impl Iterator<Item = &'a Span>,
    t: f64,
    t_to: f64,
    rise: impl Fn(u32) -> f64,
) -> &'a Span {
    let tied = spans.filter(|h| top.cut(t, t_to).ties(&h.cut(t, t_to)));
    tied.max_by(|p, q| rise(p.facet).total_cmp(&rise(q.facet)).then(q.facet.cmp(&p.facet))).unwrap_or(top)
}

/// The first of the spans that rises above `top` between `t` and `t_to`, and where; of several that rise there, the one
/// that is highest at `t_to`. Spans that tie with `top` over the whole stretch count only if `counts_ties`.
fn first_above<'a>(
    top: &Span,
    spans: impl Iterator<Item = &'a Span>,
    t: f64,
    t_to: f64,
    counts_ties: bool,
) -> Option<(f64, &'a Span)> {
    let top_start = top.z(t);
    let top_end = top.z(t_to);
    let mut first: Option<(f64, &'a Span)> = None;
    for span in spans {
        let (start, end) = (span.z(t), span.z(t_to));
        // Straight lines cross once: one that is no higher at t and higher at t_to rises above `top` at s.
        if end > top_end && start <= top_start && (counts_ties || !span.cut(t, t_to).ties(&top.cut(t, t_to))) {
            let s = t + (t_to - t) * ((top_start - start) / ((top_start - start) + (end - top_end)));
            if s < t_to && first.is_none_or(|(best, other)| s < best || s == best && end > other.z(t_to)) {
                first = Some((s, span));
            }
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(z0: f64, z1: f64, facet: u32) -> Span {
        Span { t0: 0.0, t1: 1.0, z0, z1, facet }
    }

    #[test]
    fn envelope_changes_where_spans_cross() {
        let spans = [span(0.0, 40.0, 0), span(30.0, 10.0, 1), span(5.0, 5.0, 2)];
        let mut out = Vec::new();
        envelope(|| spans.iter(), 0.0, 1.0, None::<fn(u32) -> f64>, |s| out.push(s));
        assert_eq!(
            out,
            [
                Span { t0: 0.0, t1: 0.5, z0: 30.0, z1: 20.0, facet: 1 },
                Span { t0: 0.5, t1: 1.0, z0: 20.0, z1: 40.0, facet: 0 },
            ]
        );
    }

    #[test]
    fn envelope_takes_the_steepest_of_spans_that_tie() {
        let spans = [span(10.0, 10.0, 0), span(10.5, 10.5, 1), span(10.2, 10.2, 2)];
        let mut out = Vec::new();
        envelope(|| spans.iter(), 0.0, 1.0, Some(|facet: u32| [1.0, 0.0, 2.0][facet as usize]), |s| out.push(s.facet));
        assert_eq!(out, [2]);
    }
}

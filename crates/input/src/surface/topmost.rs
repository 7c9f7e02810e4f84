//! Spans under one segment, and the topmost of several sheets.

use super::mesh::NONE;

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
    fn z(&self, t: f64) -> f64 {
        interpolate(t, self.t0, self.z0, self.t1, self.z1)
    }
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
    fn is(self, one: Self) -> bool {
        self == one || self == Self::Both
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
    beside: [Vec<Span>; 2],
}

/// What decides between facets that the segment runs along.
pub(super) struct Choice<L> {
    /// Half a nanometre as parameter.
    pub(super) half_nm: f64,
    /// Square of the steepest slope that is marked.
    pub(super) limit2: f64,
    /// The side that is taken where nothing else decides.
    pub(super) first: Side,
    /// How steeply a facet rises to the left of the segment, and the square of its slope.
    pub(super) look: L,
}

/// Heights that differ by less, nm, are one: corners are rounded in the plane, and edges may be divided differently.
const TIE: f64 = 1.0;

/// Height at `t` of the line through (t0, z0) and (t1, z1), never beyond the two.
#[inline]
pub(super) fn interpolate(t: f64, t0: f64, z0: f64, t1: f64, z1: f64) -> f64 {
    if t <= t0 || t1 <= t0 {
        z0
    } else if t >= t1 {
        z1
    } else {
        z0 + (z1 - z0) * ((t - t0) / (t1 - t0))
    }
}

pub(super) fn push_on(out: &mut Vec<Span>, t0: f64, z0: f64, t1: f64, z1: f64, facet: u32, half_nm: f64) {
    let t0 = match out.last() {
        Some(last) if (t0 - last.t1).abs() <= half_nm => last.t1,
        _ => t0,
    };
    if t1 > t0 {
        out.push(Span { t0, t1, z0, z1, facet });
    }
}

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
        choice: &Choice<impl Fn(u32) -> (f64, f64)>,
        out: &mut Vec<Span>,
    ) {
        let Self { hits, ends, active, beside } = self;
        let half_nm = choice.half_nm;
        hits.sort_by(|p, q| p.span.t0.total_cmp(&q.span.t0).then(p.span.facet.cmp(&q.span.facet)));
        // One sheet, as nearly everywhere: facets follow each other, and nothing is above anything.
        let apart = hits.windows(2).all(|w| w[1].span.t0 >= w[0].span.t1 - half_nm * 1e-3);
        let mut t = t_from;
        if apart {
            for Hit { span: h, .. } in hits.iter() {
                push_gap(out, t, h.t0, half_nm);
                push_on(out, h.t0, h.z0, h.t1, h.z1, h.facet, half_nm);
                t = t.max(h.t1);
            }
            push_gap(out, t, t_to, half_nm);
            return;
        }
        ends.clear();
        ends.extend(hits.iter().flat_map(|h| [h.span.t0, h.span.t1]));
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        active.clear();
        let mut next = 0;
        // A sweep over all ends: between two of them that follow each other the same hits lie under the segment,
        // and each is straight.
        for w in ends.windows(2) {
            let (u, v) = (w[0], w[1]);
            while next < hits.len() && hits[next].span.t0 <= u {
                active.push(hits[next]);
                next += 1;
            }
            active.retain(|h| h.span.t1 > u);
            if active.is_empty() {
                continue;
            }
            push_gap(out, t, u, half_nm);
            if active.iter().all(|h| h.side == Side::Both) {
                let all = || active.iter().map(|h| &h.span);
                envelope(all, u, v, None::<fn(u32) -> f64>, |s| push_on(out, s.t0, s.z0, s.t1, s.z1, s.facet, half_nm));
            } else {
                for (spans, side) in beside.iter_mut().zip([Side::Left, Side::Right]) {
                    spans.clear();
                    let all = || active.iter().filter(move |h| h.side.is(side)).map(|h| &h.span);
                    let away = if side == Side::Left { 1.0 } else { -1.0 };
                    envelope(all, u, v, Some(|f| away * (choice.look)(f).0), |s| spans.push(s));
                }
                choice.of_sides(beside, u, v, out);
            }
            t = v;
        }
        push_gap(out, t, t_to, half_nm);
    }
}

impl<L: Fn(u32) -> (f64, f64)> Choice<L> {
    /// Takes between u and v what is topmost on either side, which is nothing on a side or all of the stretch.
    fn of_sides(&self, [left, right]: &[Vec<Span>; 2], u: f64, v: f64, out: &mut Vec<Span>) {
        let (mut l, mut r, mut t) = (0, 0, u);
        while t < v {
            let end = [left.get(l), right.get(r)].into_iter().flatten().fold(v, |end, s| end.min(s.t1));
            let part = |s: &Span| Span { t0: t, t1: end, z0: s.z(t), z1: s.z(end), ..*s };
            let sides = [left.get(l).map(part), right.get(r).map(part)];
            if let Some(s) = self.better(sides) {
                push_on(out, s.t0, s.z0, s.t1, s.z1, s.facet, self.half_nm);
            }
            l += usize::from(left.get(l).is_some_and(|s| s.t1 <= end));
            r += usize::from(right.get(r).is_some_and(|s| s.t1 <= end));
            t = end;
        }
    }

    /// The better of what is topmost on the left and on the right of a stretch.
    fn better(&self, sides: [Option<Span>; 2]) -> Option<Span> {
        let [Some(left), Some(right)] = sides else { return sides[0].or(sides[1]) };
        let is_markable = |s: &Span| (self.look)(s.facet).1 <= self.limit2;
        let takes_left = match (is_markable(&left), is_markable(&right)) {
            (true, false) => true,
            (false, true) => false,
            // Each may have lost to what ties with it on its own side: no more is lost here.
            _ if left.ties(&right) => {
                let facet = if self.first == Side::Left { left.facet } else { right.facet };
                return Some(Span { facet, z0: left.z0.max(right.z0), z1: left.z1.max(right.z1), ..left });
            }
            _ => left.z0 + left.z1 > right.z0 + right.z1,
        };
        Some(if takes_left { left } else { right })
    }
}

/// The upper envelope between u and v of hits that all span them. Of several that tie, the one that rises most to the
/// side that `rise` looks to is topmost there.
fn envelope<'a, I: Iterator<Item = &'a Span>>(
    all: impl Fn() -> I,
    u: f64,
    v: f64,
    rise: Option<impl Fn(u32) -> f64>,
    mut sink: impl FnMut(Span),
) {
    // Equal here: the one that is higher later; then the lower facet number.
    let by =
        |p: &&Span, q: &&Span| p.z(u).total_cmp(&q.z(u)).then(p.z(v).total_cmp(&q.z(v))).then(q.facet.cmp(&p.facet));
    let steepest = |top: &'a Span, from: f64| match &rise {
        Some(rise) => {
            let tied = all().filter(|h| top.cut(from, v).ties(&h.cut(from, v)));
            let by = |p: &&Span, q: &&Span| rise(p.facet).total_cmp(&rise(q.facet)).then(q.facet.cmp(&p.facet));
            tied.max_by(by).unwrap_or(top)
        }
        None => top,
    };
    let mut t = u;
    let Some(mut top) = all().max_by(by).map(|top| steepest(top, u)) else { return };
    loop {
        // The first other hit that rises above `top` before v.
        let (zt, zv) = (top.z(t), top.z(v));
        let mut cut: Option<(f64, &'a Span)> = None;
        for h in all() {
            let (ht, hv) = (h.z(t), h.z(v));
            // Straight lines cross once: one that is no higher now and higher at v rises above `top` at s.
            if hv > zv && ht <= zt && (rise.is_none() || !h.cut(t, v).ties(&top.cut(t, v))) {
                let s = t + (v - t) * ((zt - ht) / ((zt - ht) + (hv - zv)));
                if s < v && cut.is_none_or(|(c, b)| s < c || s == c && hv > b.z(v)) {
                    cut = Some((s, h));
                }
            }
        }
        let end = cut.map_or(v, |(s, _)| s);
        sink(Span { t0: t, z0: zt, t1: end, z1: top.z(end), facet: top.facet });
        match cut {
            Some((s, h)) => (t, top) = (s, steepest(h, s)),
            None => return,
        }
    }
}

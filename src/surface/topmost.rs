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
    pub(super) fn gap(t0: f64, t1: f64) -> Self {
        Self { t0, t1, z0: f64::NAN, z1: f64::NAN, facet: NONE }
    }
}

/// Facets cut with one segment, and scratch space to take the topmost of them.
#[derive(Debug, Default)]
pub(super) struct Sheets {
    /// Stretches of the segment on each facet, sorted by begin and facet before [`Sheets::topmost`].
    pub(super) hits: Vec<Span>,
    ends: Vec<f64>,
    active: Vec<Span>,
}

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
    /// The upper envelope of the hits between two parameters.
    pub(super) fn topmost(&mut self, t_from: f64, t_to: f64, half_nm: f64, out: &mut Vec<Span>) {
        let Self { hits, ends, active } = self;
        // One sheet, as nearly everywhere: facets follow each other, and nothing is above anything.
        let apart = hits.windows(2).all(|w| w[1].t0 >= w[0].t1 - half_nm * 1e-3);
        let mut t = t_from;
        if apart {
            for h in hits.iter() {
                push_gap(out, t, h.t0, half_nm);
                push_on(out, h.t0, h.z0, h.t1, h.z1, h.facet, half_nm);
                t = t.max(h.t1);
            }
            push_gap(out, t, t_to, half_nm);
            return;
        }
        ends.clear();
        ends.extend(hits.iter().flat_map(|h| [h.t0, h.t1]));
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        active.clear();
        let mut next = 0;
        // A sweep over all ends: between two of them that follow each other the same hits lie under the segment,
        // and each is straight.
        for w in ends.windows(2) {
            let (u, v) = (w[0], w[1]);
            while next < hits.len() && hits[next].t0 <= u {
                active.push(hits[next]);
                next += 1;
            }
            active.retain(|h| h.t1 > u);
            if active.is_empty() {
                continue;
            }
            push_gap(out, t, u, half_nm);
            envelope(active, u, v, half_nm, out);
            t = v;
        }
        push_gap(out, t, t_to, half_nm);
    }
}

/// The upper envelope between u and v of hits that all span them.
fn envelope(active: &[Span], u: f64, v: f64, half_nm: f64, out: &mut Vec<Span>) {
    let z = |h: &Span, t: f64| interpolate(t, h.t0, h.z0, h.t1, h.z1);
    let highest = |t: f64| {
        // Equal here: the one that is higher later; then the lower facet number.
        let by = |p: &&Span, q: &&Span| {
            z(p, t).total_cmp(&z(q, t)).then(z(p, v).total_cmp(&z(q, v))).then(q.facet.cmp(&p.facet))
        };
        active.iter().max_by(by)
    };
    let mut t = u;
    let Some(mut top) = highest(u) else { return };
    loop {
        // The first other hit that rises above `top` before v.
        let (zt, zv) = (z(top, t), z(top, v));
        let mut cut: Option<(f64, &Span)> = None;
        for h in active {
            let (ht, hv) = (z(h, t), z(h, v));
            // Straight lines cross once: one that is no higher now and higher at v rises above `top` at s.
            if hv > zv && ht <= zt {
                let s = t + (v - t) * ((zt - ht) / ((zt - ht) + (hv - zv)));
                if s < v && cut.is_none_or(|(c, b)| s < c || s == c && hv > z(b, v)) {
                    cut = Some((s, h));
                }
            }
        }
        let end = cut.map_or(v, |(s, _)| s);
        push_on(out, t, zt, end, z(top, end), top.facet, half_nm);
        match cut {
            Some((s, h)) => (t, top) = (s, h),
            None => return,
        }
    }
}

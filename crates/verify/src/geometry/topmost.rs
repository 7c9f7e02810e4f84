//! From crossings to the topmost sheet: one sweep along the line.

use super::Crossing;

/// Neighbours whose common end differs by less than this, nm, meet: their ends were computed from the
/// same edge in two ways.
const MEET: f64 = 1e-3;

/// Calls `visit` for every piece in order: its stretch, and the topmost crossing with its two heights,
/// or None off the part. The crossings are sorted in place.
pub(super) fn pieces(
    crossings: &mut [Crossing],
    active: &mut Vec<u32>,
    len: f64,
    mut visit: impl FnMut([f64; 2], Option<(&Crossing, [f64; 2])>),
) {
    sort(crossings);
    active.clear();
    let (mut at, mut next) = (0.0, 0);
    loop {
        // Invariant: pieces up to `at` are done, and `active` holds the crossings that span the place right after it.
        if active.is_empty() {
            let Some(c) = crossings.get(next) else { break };
            if c.d[0] > at + MEET {
                visit([at, c.d[0]], None);
                at = c.d[0];
            }
            next += 1;
            if c.d[1] <= at {
                continue;
            }
            // Nothing else begins before this one ends: it is the top as it stands. On most parts all pieces are such.
            if crossings.get(next).is_none_or(|n| n.d[0] >= c.d[1] - MEET) {
                visit([at, c.d[1]], Some((c, [c.z_at(at), c.z[1]])));
                at = c.d[1];
            } else {
                active.push((next - 1) as u32);
            }
            continue;
        }
        // Several sheets: up to where the next one begins or ends, all of them span the stretch.
        let end = active.iter().map(|&i| crossings[i as usize].d[1]).fold(f64::INFINITY, f64::min);
        let to = crossings.get(next).map_or(end, |c| c.d[0].min(end));
        if to > at {
            visit_upper_envelope(crossings, active, [at, to], &mut visit);
            at = to;
        }
        active.retain(|&i| crossings[i as usize].d[1] > at);
        while let Some(c) = crossings.get(next).filter(|c| c.d[0] <= at) {
            if c.d[1] > at {
                active.push(next as u32);
            }
            next += 1;
        }
    }
    // What is left behind the last crossing is off the part; so is a line that meets none.
    if len > at + MEET || (at == 0.0 && len > 0.0) {
        visit([at, len], None);
    }
}

/// Nearly sorted already, since cells come in order; long lists of many sheets are not.
fn sort(crossings: &mut [Crossing]) {
    /// Up to about so many, insertion is quicker than a sort that does not know that they are nearly in order.
    const SHORT: usize = 24;
    if crossings.len() > SHORT {
        crossings.sort_unstable_by(|a, b| a.d[0].total_cmp(&b.d[0]).then(a.facet.cmp(&b.facet)));
        return;
    }
    for i in 1..crossings.len() {
        let mut k = i;
        while k > 0 && crossings[k - 1].d[0] > crossings[k].d[0] {
            crossings.swap(k - 1, k);
            k -= 1;
        }
    }
}

/// Visits the pieces of the upper envelope of the active crossings between two places of the line, nm: where a piece
/// begins and ends, its crossing, and the heights there. All active crossings span that stretch.
fn visit_upper_envelope(
    crossings: &[Crossing],
    active: &[u32],
    [from, to]: [f64; 2],
    visit: &mut impl FnMut([f64; 2], Option<(&Crossing, [f64; 2])>),
) {
    let spanning = || active.iter().map(|&i| &crossings[i as usize]);
    // Of equally high ones the steeper is on top right after `from`.
    let height_then_rise = |c: &Crossing| (c.z_at(from), c.rise());
    let higher = |a: (f64, f64), b: (f64, f64)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).is_ge();
    let Some(mut top) = spanning().reduce(|a, b| if higher(height_then_rise(a), height_then_rise(b)) { a } else { b })
    else {
        return;
    };
    let mut at = from;
    while at < to {
        // The envelope is convex, so `top` only ever gets steeper along the line.
        // Only a steeper one can overtake; where several do so at one place, the steepest continues.
        let mut overtaken: Option<(f64, &Crossing)> = None;
        for c in spanning().filter(|c| c.rise() > top.rise()) {
            // By rounding `c` may lie above `top` already: then it overtakes here.
            let d = at + (top.z_at(at) - c.z_at(at)).max(0.0) / (c.rise() - top.rise());
            if overtaken.is_none_or(|(nearest, by)| d < nearest || (d == nearest && c.rise() > by.rise())) {
                overtaken = Some((d, c));
            }
        }
        let end = overtaken.map_or(to, |(d, _)| d.min(to));
        if end > at {
            visit([at, end], Some((top, [top.z_at(at), top.z_at(end)])));
        }
        at = end;
        match overtaken {
            Some((d, c)) if d < to => top = c,
            _ => return,
        }
    }
}

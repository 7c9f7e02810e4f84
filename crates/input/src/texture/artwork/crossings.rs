//! How often contours cross each other, before a boolean operation takes time and memory for each crossing.

use terrace_core::geom::{BoxMm, PlanePoint};

/// Most crossings that an operation computes.
const MAX_CROSSINGS: usize = 400_000;

/// Most pairs of edges that are tried to find that out.
const MAX_TRIED: usize = 60_000_000;

/// Fewer edges cannot cross too often.
const FEW: usize = 800;

/// More crossings of contours than an area may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::texture) struct TooMany;

/// The edges of a contour.
pub(in crate::texture) fn edges(contour: &[PlanePoint]) -> impl Iterator<Item = [PlanePoint; 2]> {
    contour.iter().zip(contour.iter().cycle().skip(1)).map(|(&a, &b)| [a, b])
}

/// Whether the contours cross, themselves and each other, at most [`MAX_CROSSINGS`] times.
///
/// Edges are put into the cells of a grid with about as many cells as edges; pairs of edges that share a cell are
/// tried.
pub(super) fn are_few<'a>(contours: impl Iterator<Item = &'a Vec<PlanePoint>>) -> Result<(), TooMany> {
    let edges: Vec<[PlanePoint; 2]> = contours.flat_map(|c| edges(c)).collect();
    if edges.len() < FEW {
        return Ok(());
    }
    let bounds = BoxMm::of(edges.iter().flatten().copied());
    let cells = (edges.len() as f64).sqrt().ceil().min(1000.0);
    let step = bounds.size().map(|s| (s / cells).max(f64::MIN_POSITIVE));
    let cell =
        |p: PlanePoint| [0, 1].map(|k| (((p[k] - bounds.lo[k]) / step[k]).floor().clamp(0.0, cells - 1.0)) as u32);
    let mut entries: Vec<(u32, u32)> = Vec::new();
    for (i, e) in edges.iter().enumerate() {
        let [left, bottom] = cell([e[0][0].min(e[1][0]), e[0][1].min(e[1][1])]);
        let [right, top] = cell([e[0][0].max(e[1][0]), e[0][1].max(e[1][1])]);
        for y in bottom..=top {
            // The cells of this row that the edge meets.
            let band = [0.0, 1.0].map(|f| bounds.lo[1] + (f64::from(y) + f) * step[1]);
            let columns = across(*e, band).map(|x| x.map(|x| cell([x, 0.0])[0].clamp(left, right)));
            let [from, to] = columns.unwrap_or([left, right]);
            entries.extend((from..=to).map(|x| (y * cells as u32 + x, i as u32)));
        }
        if entries.len() > MAX_TRIED / 4 {
            return Err(TooMany);
        }
    }
    entries.sort_unstable();
    let mut crossings = 0;
    let mut tried = 0;
    for cell in entries.chunk_by(|a, b| a.0 == b.0) {
        for (i, &(_, e)) in cell.iter().enumerate() {
            tried += cell.len() - i - 1;
            crossings += cell[i + 1..].iter().filter(|&&(_, f)| cross(edges[e as usize], edges[f as usize])).count();
            if crossings > MAX_CROSSINGS || tried > MAX_TRIED {
                return Err(TooMany);
            }
        }
    }
    Ok(())
}

/// Where an edge lies between two heights, from left to right; None where it is level.
fn across([p, q]: [PlanePoint; 2], [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    if p[1] == q[1] {
        return None;
    }
    let at = |y: f64| p[0] + (y.clamp(p[1].min(q[1]), p[1].max(q[1])) - p[1]) / (q[1] - p[1]) * (q[0] - p[0]);
    let a = at(low);
    let b = at(high);
    Some([a.min(b), a.max(b)])
}

/// Whether two edges cross within both.
fn cross([a, b]: [PlanePoint; 2], [c, d]: [PlanePoint; 2]) -> bool {
    let side =
        |p: PlanePoint, q: PlanePoint, r: PlanePoint| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::math;
    use terrace_core::random::Random;

    #[test]
    fn a_tangle_is_told_from_a_fine_outline() {
        let mut noise = Random::case(1);
        let tangle: Vec<PlanePoint> = (0..4000).map(|_| [0; 2].map(|_| noise.range(0.0, 100.0))).collect();
        assert_eq!(are_few([&tangle].into_iter()), Err(TooMany));
        let circle: Vec<PlanePoint> =
            (0..400_000).map(|i| math::sin_cos(f64::from(i) * std::f64::consts::TAU / 4e5).into()).collect();
        assert_eq!(are_few([&circle].into_iter()), Ok(()));
    }
}

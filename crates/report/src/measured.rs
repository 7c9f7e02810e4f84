//! What a measured part shows place by place: the correction of its height, the depth that marks keep free, and what is
//! left of its points. Units: um; places in mm beside the placement.

use terrace_core::geom::{Box2, BoxMm, NM_PER_MM, P2};
use terrace_plan::measured::{MeasuredPart, PointResidual, Residual};

/// Cells along the longer side of a map.
const CELLS: usize = 220;

/// The area of a map, and its cells.
pub(crate) struct Area {
    lo: [f64; 2],
    size: [f64; 2],
}

impl Area {
    /// Around some places, mm, and a rim.
    pub(crate) fn around(places: impl Iterator<Item = [f64; 2]>) -> Self {
        let mut around = BoxMm::EMPTY;
        places.for_each(|at| around.add(at));
        let size = around.size().map(|side| side.max(1e-3));
        let rim = 0.02 * size[0].max(size[1]);
        Self { lo: around.lo.map(|v| v - rim), size: size.map(|v| v + 2.0 * rim) }
    }

    /// Around the points of a part and the box of its texture.
    pub(crate) fn of(part: &MeasuredPart, texture: Box2) -> Self {
        let corners = if texture.is_empty() { vec![] } else { vec![texture.lo.mm(), texture.hi.mm()] };
        Self::around(part.lying.points.iter().map(|point| beside(part, point)).chain(corners))
    }

    /// Its lowest corner, mm.
    pub(crate) fn lo(&self) -> [f64; 2] {
        self.lo
    }

    /// Its size, mm.
    pub(crate) fn size(&self) -> [f64; 2] {
        self.size
    }

    /// The root of its size, mm.
    pub(crate) fn extent(&self) -> f64 {
        (self.size[0] * self.size[1]).sqrt()
    }

    /// How many cells lie along x and y.
    pub(crate) fn cells(&self) -> [usize; 2] {
        let longest = self.size[0].max(self.size[1]);
        self.size.map(|side| ((side / longest * CELLS as f64).round() as usize).max(1))
    }

    /// Places of cells from the upper left, row by row.
    pub(crate) fn places(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let [columns, rows] = self.cells();
        (0..rows * columns).map(move |i| {
            let [column, row] = [i % columns, rows - 1 - i / columns];
            [
                self.lo[0] + self.size[0] * (column as f64 + 0.5) / columns as f64,
                self.lo[1] + self.size[1] * (row as f64 + 0.5) / rows as f64,
            ]
        })
    }
}

/// Where a point lies beside the placement, mm.
pub(crate) fn beside(part: &MeasuredPart, point: &PointResidual) -> [f64; 2] {
    let origin = part.lying.origin.mm();
    [0, 1].map(|k| point.at[k] - origin[k])
}

/// What the warp adds to the height of a part; None where no correction reaches.
pub(crate) fn correction(part: &MeasuredPart, at: [f64; 2]) -> Option<f64> {
    let at = at.map(|v| v * NM_PER_MM);
    let [height, deviation, ..] = part.correction.as_ref()?.linear(at).map(|l| l.of(at));
    deviation.is_finite().then_some(height / 1e3)
}

/// What is kept free above and below marks; None where nothing can be marked, infinite where less is kept free than the
/// uncertainty asks for.
pub(crate) fn kept(part: &MeasuredPart, [x, y]: [f64; 2]) -> Option<f64> {
    let p = P2::from_mm(x, y)?;
    let kept = part.reserve.kept(Box2 { lo: p, hi: p }) / 1e3;
    let kept = if part.reserve.is_short(Box2 { lo: p, hi: p }) { f64::INFINITY } else { kept };
    (kept > 0.0).then_some(kept)
}

/// What the rigid fit leaves of a point along z, or along the normal; None where it does not count.
pub(crate) fn left_by_fit(point: &PointResidual) -> Option<f64> {
    match point.residual {
        Residual::Place([_, _, z]) => Some(z * 1e3),
        Residual::Above(distance, true) => Some(distance * 1e3),
        Residual::Above(_, false) => None,
    }
}

/// What the correction leaves of it; of a rigid part what the fit does.
pub(crate) fn left(part: &MeasuredPart, point: &PointResidual) -> Option<f64> {
    match part.correction {
        Some(_) => point.left.map(|mm| mm * 1e3),
        None => left_by_fit(point),
    }
}

/// The largest of some values, of both signs; infinite ones do not count.
pub(crate) fn most(values: &[Option<f64>]) -> f64 {
    values.iter().flatten().filter(|v| v.is_finite()).fold(0.0, |most: f64, v| most.max(v.abs()))
}

/// The largest of corrections and of what the rigid fit leaves of points.
pub(crate) fn most_signed(part: &MeasuredPart, corrections: &[Option<f64>]) -> f64 {
    let of_points: Vec<Option<f64>> = part.lying.points.iter().map(left_by_fit).collect();
    most(corrections).max(most(&of_points))
}

/// Least and largest of amounts; 0 to 1 where all are infinite.
pub(crate) fn range(amounts: &[Option<f64>]) -> [f64; 2] {
    let least = amounts.iter().flatten().fold(f64::INFINITY, |least: f64, v| least.min(*v));
    if least.is_finite() { [least, most(amounts)] } else { [0.0, 1.0] }
}

//! A measured part as the page draws it: what its warp adds to its height and what marks keep free, as maps, and the
//! points.

use serde::Serialize;

use super::pack::Data;
use crate::measured::{self, Area};
use terrace_core::geom::{Box2, SpacePoint};
use terrace_plan::measured::{MeasuredPart, PointResidual};

/// Bytes of a cell: no value, the least and the most, and where less is kept free than the uncertainty asks for.
const NONE: u8 = 0;
const VALUES: [u8; 2] = [1, 254];
const SHORT: u8 = 255;

/// A measured part in the head of the page. Its element holds the bytes of the kept depth and then, of a warped part,
/// those of the correction: cells by rows from the lowest corner.
#[derive(Serialize)]
pub(super) struct MeasuredHead<'a> {
    name: &'static str,
    origin: [f64; 2],
    size: [f64; 2],
    columns: usize,
    rows: usize,
    kept_um: [f64; 2],
    /// The largest of what is added to the height and of what the fit leaves of points, um.
    most_um: f64,
    is_warped: bool,
    points: Vec<PointHead<'a>>,
}

/// A measured point, part frame; what the rigid fit leaves of it, and what the correction does, um.
#[derive(Serialize)]
struct PointHead<'a> {
    name: &'a str,
    at: SpacePoint,
    before_um: Option<f64>,
    after_um: Option<f64>,
}

impl<'a> PointHead<'a> {
    fn new(part: &MeasuredPart, point: &'a PointResidual) -> Self {
        let origin = part.lying.origin.mm();
        Self {
            name: &point.name,
            at: [0, 1, 2].map(|k| point.at[k] - origin[k]),
            before_um: measured::left_by_fit(point),
            after_um: measured::left(part, point),
        }
    }
}

/// The head of the part, and its maps; `texture` is the box of the texture.
pub(super) fn packed(part: &MeasuredPart, texture: Box2) -> (MeasuredHead<'_>, String) {
    let area = Area::of(part, texture);
    let [columns, rows] = area.cells();
    let mut data = Data::default();
    let kept: Vec<Option<f64>> = area.places().map(|at| measured::kept(part, at)).collect();
    let kept_um = measured::range(&kept);
    data.u8(bytes(&kept, kept_um, columns));
    let corrections: Vec<Option<f64>> = area.places().map(|at| measured::correction(part, at)).collect();
    let most_um = measured::most_signed(part, &corrections);
    if part.correction.is_some() {
        data.u8(bytes(&corrections, [-most_um, most_um], columns));
    }
    let head = MeasuredHead {
        name: "measured",
        origin: area.lo(),
        size: area.size(),
        columns,
        rows,
        kept_um,
        most_um,
        is_warped: part.correction.is_some(),
        points: part.lying.points.iter().map(|point| PointHead::new(part, point)).collect(),
    };
    let element = data.element(head.name);
    (head, element)
}

/// Values, from the upper left, as bytes from the lower left. A cell without a value that touches one with a value has
/// the largest of those, for means of neighbours.
fn bytes(values: &[Option<f64>], [lo, hi]: [f64; 2], columns: usize) -> Vec<u8> {
    let span = if hi > lo { hi - lo } else { 1.0 };
    let steps = f64::from(VALUES[1] - VALUES[0]);
    let byte = |v: f64| match v.is_finite() {
        true => VALUES[0] + ((v - lo) / span * steps).round().clamp(0.0, steps) as u8,
        false => SHORT,
    };
    let rows: Vec<&[Option<f64>]> = values.chunks(columns.max(1)).rev().collect();
    let own: Vec<Vec<u8>> = rows.iter().map(|row| row.iter().map(|v| v.map_or(NONE, byte)).collect()).collect();
    let near = |i: usize, last: usize| i.saturating_sub(1)..=(i + 1).min(last);
    let filled = |r: usize, c: usize| match own[r][c] {
        NONE => {
            near(r, own.len() - 1).flat_map(|r| near(c, columns - 1).map(move |c| (r, c))).map(|(r, c)| own[r][c]).max()
        }
        byte => Some(byte),
    };
    (0..own.len()).flat_map(|r| (0..columns).map(move |c| (r, c))).map(|(r, c)| filled(r, c).unwrap_or(NONE)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_hold_values_from_the_lower_left_and_say_what_is_missing() {
        let values =
            [None, None, None, None, Some(f64::INFINITY), Some(3.0), None, None, Some(1.0), Some(2.0), None, None];
        let found = bytes(&values, [1.0, 3.0], 4);
        // Lowest row first; beside a value the largest that it touches, farther away nothing.
        assert_eq!(found, [1, 128, 254, NONE, SHORT, 254, 254, NONE, SHORT, SHORT, 254, NONE]);
        assert_eq!(bytes(&[Some(5.0)], [5.0, 5.0], 1), [1]);
    }
}

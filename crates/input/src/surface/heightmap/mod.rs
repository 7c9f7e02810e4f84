//! Height maps: samples on a square grid, from images and from grids of elevations.
//!
//! A reader ([`png_image`], [`tiff_image`] or [`esri_grid`]) gives the values of the file; here they get
//! their heights, from `[surface.heightmap]` or from the file's own scale, and their limits. Samples are nodes of the
//! grid. Holes are samples of a stated value or NaN. Values stay as the file has them (2, 4 or 8 bytes each).

pub(super) mod esri_grid;
pub(super) mod png_image;
pub(super) mod tiff_image;

use super::facets::PartExtent;
use super::{Content, Heightmap, Scale};
use terrace_core::diag::{Diag, Place};
use terrace_core::geom::BoxMm;

/// Most samples along one side.
const MAX_SIDE: u64 = 20_000;
/// Most samples in all: 400 MB of 16 bits. Interlaced images have half of it, being held twice.
const MAX_SAMPLES: u64 = 200_000_000;

/// The values of a height map, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Of 8 or 16 bits without a sign; one value, if any, means a hole.
    Whole(Vec<u16>, Option<u16>),
    /// Of 16 bits with a sign, and floats of 32 bits or less; NaN is a hole.
    Single(Vec<f32>),
    /// Of 32 bits, and decimal text; NaN is a hole.
    Double(Vec<f64>),
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Whole(v, _) => v.len(),
            Self::Single(v) => v.len(),
            Self::Double(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sample `i`; None for a hole.
    #[inline]
    pub fn value(&self, i: usize) -> Option<f64> {
        let v = match self {
            Self::Whole(v, hole) => return (Some(v[i]) != *hole).then(|| f64::from(v[i])),
            Self::Single(v) => f64::from(v[i]),
            Self::Double(v) => v[i],
        };
        (!v.is_nan()).then_some(v)
    }

    /// The lowest and the highest value; None where all are holes.
    pub fn range(&self) -> Option<[f64; 2]> {
        (0..self.len()).filter_map(|i| self.value(i)).fold(None, |range, v| {
            let [lo, hi] = range.unwrap_or([v, v]);
            Some([v.min(lo), v.max(hi)])
        })
    }

    /// Turns the order of the rows.
    fn flip(&mut self, columns: usize) {
        fn rows<T>(v: &mut [T], columns: usize) {
            let rows = v.len() / columns;
            for row in 0..rows / 2 {
                let (top, rest) = v.split_at_mut((rows - 1 - row) * columns);
                top[row * columns..][..columns].swap_with_slice(&mut rest[..columns]);
            }
        }
        match self {
            Self::Whole(v, _) => rows(v, columns),
            Self::Single(v) => rows(v, columns),
            Self::Double(v) => rows(v, columns),
        }
    }

    /// Makes samples of this value holes, beside those that are holes. The value occurs in the file's type.
    fn add_hole(&mut self, value: f64) {
        match self {
            Self::Whole(v, hole) => {
                let value = value as u16;
                if let Some(old) = hole.filter(|&old| old != value) {
                    v.iter_mut().filter(|v| **v == old).for_each(|v| *v = value);
                }
                *hole = Some(value);
            }
            // A value in decimal text is that of the nearest float.
            Self::Single(v) => v.iter_mut().filter(|v| **v == value as f32).for_each(|v| *v = f32::NAN),
            Self::Double(v) => v.iter_mut().filter(|v| **v == value).for_each(|v| *v = f64::NAN),
        }
    }
}

/// What a file holds, the lowest row first.
struct Grid {
    columns: usize,
    rows: usize,
    samples: Samples,
    /// The least and the greatest value of the file's type, where it has whole numbers.
    full: Option<[f64; 2]>,
    is_8_bit: bool,
}

impl Grid {
    /// Gives the samples the heights that `[surface.heightmap]` states.
    fn scaled(mut self, scale: &Scale, notes: &mut Vec<Diag>, place: &Place) -> Result<Content, Diag> {
        let z_mm = check_scale(scale, self.full)?;
        if let Some(v) = scale.nodata {
            self.samples.add_hole(v);
        }
        let remedy = "check pixel, z, values, nodata and origin in [surface.heightmap]";
        self.placed(scale.pixel_mm, scale.origin_mm, z_mm, remedy, notes, place)
    }

    /// Checks the box of the samples. z of value v is `z_mm[0] + v * z_mm[1]`.
    fn placed(
        self,
        pixel_mm: f64,
        origin_mm: [f64; 2],
        z_mm: [f64; 2],
        remedy: &str,
        notes: &mut Vec<Diag>,
        place: &Place,
    ) -> Result<Content, Diag> {
        let Some(range) = self.samples.range() else {
            let hint = "check nodata in [surface.heightmap]";
            return Err(Diag::input("heightmap-empty", "every sample is nodata").hint(hint));
        };
        let z = range.map(|v| z_mm[0] + v * z_mm[1]);
        let far = |k: usize, n: usize| origin_mm[k] + (n - 1) as f64 * pixel_mm;
        let mut extent = BoxMm::EMPTY;
        extent.add([origin_mm[0], origin_mm[1], z[0]]);
        extent.add([far(0, self.columns), far(1, self.rows), z[1]]);
        if !extent.fits_part() {
            return Err(extent.beyond(Place::Nowhere, remedy));
        }
        notes.extend(extent.tiny(place.clone(), remedy));
        if z[0] == z[1] {
            let text = format!("the height map is flat: every height is {} mm", z[0]);
            notes.push(Diag::warning("heightmap-flat", text).at(place.clone()).hint("check that it is the right file"));
        } else if self.is_8_bit {
            let text = format!("the image has 8 bits: one step of its values is {:.1} um in z", z_mm[1].abs() * 1e3);
            let hint = "use 16 bits where that is coarse against the depth of focus";
            notes.push(Diag::warning("heightmap-8-bit", text).at(place.clone()).hint(hint));
        }
        let Self { columns, rows, samples, .. } = self;
        Ok(Content::Heightmap(Heightmap { columns, rows, samples, origin_mm, pixel_mm, z_mm }))
    }
}

/// Refuses grids that are too small or too large.
fn check_size(columns: u64, rows: u64, most: u64) -> Result<(), Diag> {
    if columns < 2 || rows < 2 {
        let text = format!("a height map has at least 2 x 2 samples; this one is {columns} x {rows}");
        return Err(Diag::input("heightmap-size", text).hint("export the height map again"));
    }
    if columns > MAX_SIDE || rows > MAX_SIDE || columns * rows > most {
        let text = format!(
            "the height map is {columns} x {rows}; at most {MAX_SIDE} samples a side and {most} in all are read"
        );
        return Err(Diag::input("heightmap-size", text).hint("export it coarser or in parts"));
    }
    Ok(())
}

/// Refuses cells that a file says are not square; `what` names what says so.
fn check_square([x, y]: [f64; 2], what: &str, remedy: &str) -> Result<(), Diag> {
    let is_stated = [x, y].iter().all(|v| v.is_finite() && *v > 0.0);
    if !is_stated || (x - y).abs() <= 1e-6 * x {
        return Ok(());
    }
    let text = format!("by {what} its cells are {:.4} times as wide as high; a height map has square ones", x / y);
    Err(Diag::input("heightmap-cells", text).hint(remedy))
}

/// The line from values to heights: z of value 0, and the step of one value.
fn check_scale(scale: &Scale, full: Option<[f64; 2]>) -> Result<[f64; 2], Diag> {
    let numbers = [scale.pixel_mm, scale.z_mm[0], scale.z_mm[1], scale.origin_mm[0], scale.origin_mm[1]];
    if scale.pixel_mm <= 0.0 || numbers.iter().chain(scale.values.iter().flatten()).any(|v| !v.is_finite()) {
        return Err(bad_scale(
            "the scale of the height map is invalid: pixel must be positive, and z, values and origin finite".into(),
            "pixel, z, values or origin",
        ));
    }
    let Some([from, to]) = scale.values.or(full) else {
        let text = "the samples of this file are floats or elevations, whose range is not known beforehand";
        return Err(bad_scale(text.into(), "values: state the two values that z belongs to"));
    };
    if from == to {
        return Err(bad_scale(format!("values are both {from}: two heights need two values"), "values"));
    }
    if let Some([lo, hi]) = full {
        let is_beyond = |v: f64| v < lo || v > hi;
        let absence = format!("does not occur in this file: its samples go from {lo} to {hi}");
        if let Some(v) = [from, to].into_iter().find(|v| is_beyond(*v)) {
            return Err(bad_scale(format!("value {v} {absence}"), "values"));
        }
        // Heights may be given for values between two samples; a sample that is a hole is a whole number.
        if let Some(v) = scale.nodata.filter(|v| is_beyond(*v) || v.fract() != 0.0) {
            return Err(bad_scale(format!("nodata {v} {absence}"), "nodata"));
        }
    }
    let step = (scale.z_mm[1] - scale.z_mm[0]) / (to - from);
    Ok([scale.z_mm[0] - from * step, step])
}

/// The fault of a scale that cannot be used.
fn bad_scale(text: String, key: &str) -> Diag {
    Diag::input("heightmap-scale", text).hint(format!("correct {key} in [surface.heightmap]"))
}

/// What a reader makes of a file of this name and these bytes, and what it says of it.
#[cfg(test)]
fn read_bytes(
    name: &str,
    read: fn(&std::path::Path, &Scale, &mut Vec<Diag>) -> Result<Content, terrace_core::diag::Error>,
    bytes: &[u8],
    scale: &Scale,
) -> (Result<Heightmap, terrace_core::diag::Error>, Vec<Diag>) {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).expect("written");
    let mut notes = vec![];
    let map = read(&path, scale, &mut notes).map(|c| match c {
        Content::Heightmap(map) => map,
        _ => panic!("a height map"),
    });
    (map, notes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_add_up_and_rows_turn() {
        let mut whole = Samples::Whole(vec![1, 2, 3, 4, 5, 6], Some(6));
        whole.add_hole(2.0);
        assert_eq!(
            (0..6).map(|i| whole.value(i)).collect::<Vec<_>>(),
            [1, 0, 3, 4, 5, 0].map(|v| (v > 0).then_some(f64::from(v)))
        );
        whole.flip(2);
        assert_eq!(whole, Samples::Whole(vec![5, 2, 3, 4, 1, 2], Some(2)));
        let mut single = Samples::Single(vec![f32::NAN, 0.1, -3.402_823_5e38, 7.0]);
        single.add_hole(-3.402_823_466_385_288_6e38);
        single.add_hole(0.1);
        assert_eq!((single.range(), single.value(2), single.value(1)), (Some([7.0, 7.0]), None, None));
        let mut double = Samples::Double(vec![-9999.0, 0.25, -1.0]);
        double.add_hole(-9999.0);
        double.flip(1);
        assert_eq!((double.range(), double.value(0), double.value(2)), (Some([-1.0, 0.25]), Some(-1.0), None));
        double.add_hole(0.25);
        double.add_hole(-1.0);
        assert_eq!(double.range(), None);
    }
}

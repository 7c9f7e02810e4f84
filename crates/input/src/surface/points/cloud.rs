//! The points of a file, and those that cannot be used.

use std::path::Path;
use terrace_core::math;

use super::super::facets::{PartExtent, Unit, check_unit, fits};
use super::{Point, no_surface};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{BoxMm, P2, Pose};

/// From so many rows `0 0 0` on, these are places where nothing was measured, wherever the others lie.
const MANY_ZEROS: usize = 10;

/// Rows of one height that may mean that nothing was measured; kept until all others are known.
struct SuspectRows {
    z: f64,
    rows: Vec<[f64; 3]>,
    first: Place,
}

/// Whether scanners and maps write this height, in whatever unit, where they measured nothing: -999 and more nines,
/// with up to three decimals, and the least number of 16 bits.
fn may_be_no_data(z: f64) -> bool {
    z == -32768.0 || (-1e6..=-999.0).contains(&z) && (0..=3).any(|decimals| is_all_nines(-z, decimals))
}

/// Whether a number is written as nines alone, with so many decimals: one more of its last digit is a power of ten.
fn is_all_nines(v: f64, decimals: i32) -> bool {
    let whole = v * 10f64.powi(decimals);
    let digits = math::log10(whole + 1.0);
    (whole - whole.round()).abs() < 1e-6 * 10f64.powi(decimals) && (digits - digits.round()).abs() < 1e-12
}

/// The points so far, and those that cannot be used.
pub(super) struct Cloud {
    unit: Unit,
    pose: Option<Pose>,
    points: Vec<Point>,
    extent: BoxMm<3>,
    first_beyond: Option<Place>,
    dropped: usize,
    first_dropped: Option<Place>,
    zeros: usize,
    first_zero: Option<Place>,
    suspect: Vec<SuspectRows>,
    /// Least and largest height of all other rows, in file units.
    heights: [f64; 2],
}

impl Cloud {
    pub(super) fn new(unit: Unit, pose: Option<Pose>) -> Self {
        Self {
            unit,
            pose,
            points: Vec::new(),
            extent: BoxMm::EMPTY,
            first_beyond: None,
            dropped: 0,
            first_dropped: None,
            zeros: 0,
            first_zero: None,
            suspect: Vec::new(),
            heights: [f64::INFINITY, f64::NEG_INFINITY],
        }
    }

    /// Where a row lies in the part, mm.
    fn place(&self, row: [f64; 3]) -> [f64; 3] {
        let p = self.unit.place(row);
        self.pose.map_or(p, |pose| pose.apply(p))
    }

    /// How many points there are.
    pub(super) fn len(&self) -> usize {
        self.points.len() + self.suspect.iter().map(|suspect| suspect.rows.len()).sum::<usize>()
    }

    /// Adds a row in file units.
    pub(super) fn add(&mut self, row: [f64; 3], place: impl Fn() -> Place) {
        if !row.iter().all(|v| v.is_finite()) {
            self.dropped += 1;
            self.first_dropped.get_or_insert_with(place);
            return;
        }
        if may_be_no_data(row[2]) {
            match self.suspect.iter_mut().find(|suspect| suspect.z == row[2]) {
                Some(suspect) => suspect.rows.push(row),
                None => self.suspect.push(SuspectRows { z: row[2], rows: vec![row], first: place() }),
            }
            return;
        }
        self.heights = [self.heights[0].min(row[2]), self.heights[1].max(row[2])];
        self.put(row, place);
    }

    /// Adds a row that is a point.
    fn put(&mut self, row: [f64; 3], place: impl Fn() -> Place) {
        let p = self.place(row);
        self.extent.add(p);
        match P2::from_mm(p[0], p[1]) {
            // Beyond 4 m the box of the rest is still wanted, for the message.
            Some(at) if fits(p[2]) => {
                if self.first_beyond.is_none() {
                    self.points.push(Point { at, z: p[2] });
                }
            }
            _ => {
                self.first_beyond.get_or_insert_with(place);
            }
        }
    }

    /// Adds a row `0 0 0`: a point, or what cameras and scanners write where they measured nothing.
    pub(super) fn zero(&mut self, place: impl FnOnce() -> Place) {
        self.zeros += 1;
        self.first_zero.get_or_insert_with(place);
    }

    /// Decides what rows of such heights are: no points where they lie farther below all others than these
    /// lie apart.
    fn end_suspect(&mut self, notes: &mut Vec<Diag>) {
        let [low, high] = self.heights;
        for suspect in std::mem::take(&mut self.suspect) {
            let z = suspect.z;
            if low.is_finite() && low - z > high - low {
                let text = format!(
                    "{} rows have the height {z}, far below the others, {low} to {high}, as where nothing was measured; left \
                     out",
                    suspect.rows.len()
                );
                let d = Diag::warning("points-no-data", text).at(suspect.first);
                notes.push(d.hint("export the cloud without them; where they were, neighbours are joined"));
            } else {
                suspect.rows.into_iter().for_each(|row| self.put(row, || suspect.first.clone()));
            }
        }
    }

    /// Decides what the rows `0 0 0` are: two or more are not points where the others lie elsewhere, and so are many.
    fn end_zeros(&mut self, are_none: bool, notes: &mut Vec<Diag>) {
        let Some(place) = self.first_zero.clone() else { return };
        let origin = self.place([0.0; 3]);
        let box3 = self.extent;
        let is_outside = (0..3).any(|k| origin[k] < box3.lo[k] || origin[k] > box3.hi[k]);
        let zeros = self.zeros;
        if are_none || zeros >= MANY_ZEROS || zeros > 1 && is_outside {
            let text = format!("{zeros} rows are 0 0 0, as where a camera or scanner measured nothing; left out");
            let d = Diag::warning("points-no-data", text).at(place);
            notes.push(d.hint("export the cloud without them; where they were, neighbours are joined"));
            return;
        }
        (0..zeros).for_each(|_| self.put([0.0; 3], || place.clone()));
    }

    /// The points; rows `0 0 0` are left out where `zeros_are_none`.
    pub(super) fn finish(
        mut self,
        path: &Path,
        zeros_are_none: bool,
        notes: &mut Vec<Diag>,
    ) -> Result<Vec<Point>, Error> {
        self.end_suspect(notes);
        self.end_zeros(zeros_are_none, notes);
        if let Some(place) = self.first_beyond {
            return Err(self.extent.beyond_in(place, self.unit, &check_unit(self.unit)).into());
        }
        if let Some(place) = self.first_dropped {
            let text = format!("{} points are not finite and were left out", self.dropped);
            let d = Diag::warning("points-not-finite", text).at(place);
            notes.push(d.hint("remove them from the file; where they were, neighbours are joined"));
        }
        if self.points.is_empty() {
            let text = "the file holds no points".into();
            return Err(no_surface(path, text, "export the cloud as rows of x y z").into());
        }
        Ok(self.points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_of_nines_may_mean_that_nothing_was_measured() {
        for (z, may_be) in [
            (-999.0, true),
            (-9999.0, true),
            (-9999.99, true),
            (-999.999, true),
            (-32768.0, true),
            (-998.0, false),
            (-99.0, false),
            (999.0, false),
            (-9990.0, false),
        ] {
            assert_eq!(may_be_no_data(z), may_be, "{z}");
        }
    }
}

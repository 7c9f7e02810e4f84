//! The points of a file, and those that cannot be used.

use std::path::Path;

use super::super::facets::{Unit, check_unit, fits};
use super::{Point, no_surface};
use crate::diag::{Diag, Error, Place};
use crate::geom::{BoxMm, P2, Pose};

/// From so many rows `0 0 0` on, these are places where nothing was measured, wherever the others lie.
const MANY_ZEROS: usize = 10;

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
        }
    }

    /// Where a row lies in the part, mm.
    fn place(&self, row: [f64; 3]) -> [f64; 3] {
        let p = self.unit.place(row);
        self.pose.map_or(p, |pose| pose.apply(p))
    }

    /// How many points there are.
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// Adds a row in file units.
    pub(super) fn add(&mut self, row: [f64; 3], place: impl Fn() -> Place) {
        if !row.iter().all(|v| v.is_finite()) {
            self.dropped += 1;
            self.first_dropped.get_or_insert_with(place);
            return;
        }
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

    /// Decides what the rows `0 0 0` are: two or more are no points where the others lie elsewhere, and so are many.
    fn end_zeros(&mut self, are_none: bool, notes: &mut Vec<Diag>) {
        let Some(place) = self.first_zero.clone() else { return };
        let (origin, box3) = (self.place([0.0; 3]), self.extent);
        let is_outside = (0..3).any(|k| origin[k] < box3.lo[k] || origin[k] > box3.hi[k]);
        let zeros = self.zeros;
        if are_none || zeros >= MANY_ZEROS || zeros > 1 && is_outside {
            let text = format!("{zeros} rows are 0 0 0, as where a camera or scanner measured nothing; left out");
            let d = Diag::warning("points-no-data", text).at(place);
            notes.push(d.hint("export the cloud without them; where they were, neighbours are joined"));
            return;
        }
        (0..zeros).for_each(|_| self.add([0.0; 3], || place.clone()));
    }

    /// The points; rows `0 0 0` are none where `zeros_are_none`.
    pub(super) fn finish(
        mut self,
        path: &Path,
        zeros_are_none: bool,
        notes: &mut Vec<Diag>,
    ) -> Result<Vec<Point>, Error> {
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

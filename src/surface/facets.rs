//! What every reader asks of coordinates: the unit, the reach of the whole file, facets handed on.
//!
//! Consumes corners in file units, hands them on in mm. Promises the sink finite coordinates within
//! 4 m of the origin: at the first facet beyond, it hands on nothing more, but reads to the end so
//! that the message can name the whole box (a wrong unit shows there).

use std::path::Path;

use super::Content;
use super::lines::place;
use crate::diag::{Diag, Error, Place};
use crate::geom::{BoxMm, MAX_NM};

impl BoxMm<3> {
    /// Whether all of it lies within 4 m of the origin.
    pub(crate) fn fits_part(&self) -> bool {
        self.lo.iter().chain(&self.hi).all(|v| v.abs() <= MAX_NM.mm())
    }

    /// The diagnostic for a box that reaches beyond 4 m.
    pub(crate) fn beyond(&self, place: Place, remedy: &str) -> Diag {
        let text = format!(
            "the surface reaches from ({}) to ({}) mm, more than 4000 mm from the origin",
            mm(self.lo),
            mm(self.hi)
        );
        Diag::input("surface-size", text).at(place).hint(remedy)
    }

    /// A warning where the whole surface is smaller than 1 mm.
    pub(crate) fn tiny(&self, place: Place, remedy: &str) -> Option<Diag> {
        let size = self.size();
        size.iter().all(|&s| s < 1.0).then(|| {
            let text = format!("the whole surface is smaller than 1 mm: its size is ({}) mm", mm(size));
            Diag::warning("surface-tiny", text).at(place).hint(remedy)
        })
    }
}

/// Whether a length in mm is one that a part can have.
#[inline]
pub(crate) fn fits(v: f64) -> bool {
    v.abs() <= MAX_NM.mm()
}

/// Coordinates as a message shows them.
fn mm(v: [f64; 3]) -> String {
    let one = |v: f64| {
        if v == 0.0 || (1e-3..1e6).contains(&v.abs()) {
            // At most micrometres, without the zeros behind.
            format!("{}", (v * 1e3).round() / 1e3)
        } else {
            format!("{v:.3e}")
        }
    };
    format!("{}, {}, {}", one(v[0]), one(v[1]), one(v[2]))
}

/// The remedy for a surface of the wrong size whose file carries no unit.
pub(crate) fn check_unit(unit_mm: f64) -> String {
    format!("check unit in [surface]: one unit of the file is taken as {unit_mm} mm; parts lie near their origin")
}

/// Hands facets on in mm.
pub(crate) struct Facets<'a> {
    path: &'a Path,
    unit_mm: f64,
    sink: &'a mut dyn FnMut([[f64; 3]; 3]),
    extent: BoxMm<3>,
    count: usize,
    first_beyond: Option<usize>,
}

impl<'a> Facets<'a> {
    /// Nothing handed on yet.
    pub(crate) fn new(path: &'a Path, unit_mm: f64, sink: &'a mut dyn FnMut([[f64; 3]; 3])) -> Self {
        Self { path, unit_mm, sink, extent: BoxMm::EMPTY, count: 0, first_beyond: None }
    }

    /// Facets so far.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Hands on a facet given in file units; its corners are finite.
    #[inline]
    pub(crate) fn push(&mut self, corners: [[f64; 3]; 3]) {
        let corners = corners.map(|p| p.map(|v| v * self.unit_mm));
        for &p in &corners {
            self.extent.add(p);
        }
        if self.first_beyond.is_none() {
            if corners.iter().flatten().all(|&v| fits(v)) {
                (self.sink)(corners);
            } else {
                self.first_beyond = Some(self.count);
            }
        }
        self.count += 1;
    }

    /// Ends the file: it must hold facets, all within 4 m.
    pub(crate) fn finish(self, notes: &mut Vec<Diag>) -> Result<Content, Error> {
        if self.count == 0 {
            let d = Diag::input("surface-empty", "the file holds no facets").at(place(self.path));
            return Err(d.hint("export the surface as triangles").into());
        }
        if let Some(facet) = self.first_beyond {
            let place = Place::Facet { path: self.path.display().to_string(), facet };
            return Err(self.extent.beyond(place, &check_unit(self.unit_mm)).into());
        }
        notes.extend(self.extent.tiny(place(self.path), &check_unit(self.unit_mm)));
        Ok(Content::Facets(self.count))
    }
}

//! What every reader asks of coordinates: the unit, the reach of the whole file, facets handed on.
//!
//! Consumes corners in file units, hands them on in mm. Promises the sink finite coordinates within
//! 4 m of the origin: at the first facet beyond, it hands on nothing more, but reads to the end so
//! that the message can name the whole box (a wrong unit shows there).

use std::path::Path;

use super::Content;
use super::lines::place;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{BoxMm, MAX_NM};

/// How the numbers of a file become mm of the part frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    /// mm of the part in one unit of the file.
    pub mm: f64,
    /// The factor of the job on all coordinates, such as that of a map; it is in `mm`.
    pub scale: f64,
    /// Where the part's origin lies in the file, in its unit.
    pub datum: [f64; 3],
}

impl Unit {
    /// A unit of this many mm, the origin where the file has it.
    pub(crate) fn mm(mm: f64) -> Self {
        Self { mm, scale: 1.0, datum: [0.0; 3] }
    }

    /// mm in one unit of the file, without the factor of the job.
    pub(crate) fn file_mm(self) -> f64 {
        self.mm / self.scale
    }

    /// A place of the part, mm. The difference is taken first: digits that large numbers share cost none of the others.
    #[inline]
    pub(crate) fn place(self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (p[k] - self.datum[k]) * self.mm)
    }

    /// The keys that bring a surface of this extent to the origin, and to the size of a part; None where it is larger
    /// than any land.
    fn keys(self, extent: &BoxMm<3>) -> Option<String> {
        const LARGEST_MM: f64 = 1e10;
        const WANTED_MM: f64 = 1000.0;
        let longest = extent.size().into_iter().fold(0.0, f64::max);
        if !(longest <= LARGEST_MM && extent.lo.iter().all(|v| v.abs() < 1e13)) {
            return None;
        }
        let datum = [0, 1, 2].map(|k| (extent.lo[k] / self.mm + self.datum[k]).floor());
        let text = format!("surface.datum = [{}, {}, {}]", datum[0], datum[1], datum[2]);
        if longest <= MAX_NM.mm() {
            return Some(format!("{text} puts its lower corner at the origin"));
        }
        let mut ratios = (0..10).flat_map(|k| [1.0, 2.0, 2.5, 5.0].map(|v| v * 10f64.powi(k)));
        let ratio = ratios.find(|ratio| longest / ratio <= WANTED_MM)?;
        Some(format!(
            "{text} puts its lower corner at the origin, and surface.scale = {:e} (1 : {ratio}) makes it {} mm large",
            1.0 / ratio,
            mm(extent.size().map(|v| v / ratio))
        ))
    }
}

/// What is said of a surface by its box.
pub(crate) trait PartExtent {
    /// Whether all of it lies within 4 m of the origin.
    fn fits_part(&self) -> bool;
    /// The diagnostic for a box that reaches beyond 4 m. Where it is only its place that is far, the remedy says how far
    /// it is to be moved.
    fn beyond(&self, place: Place, remedy: &str) -> Diag;
    /// The fault of a box that reaches beyond 4 m, without its remedy.
    fn too_far(&self, place: Place) -> Diag;
    /// The diagnostic for a box that reaches beyond 4 m, of a file whose coordinates the job can move and scale; the
    /// remedy has the keys.
    fn beyond_in(&self, place: Place, unit: Unit, remedy: &str) -> Diag;
    /// A warning where the whole surface is smaller than 1 mm.
    fn tiny(&self, place: Place, remedy: &str) -> Option<Diag>;
}

impl PartExtent for BoxMm<3> {
    fn fits_part(&self) -> bool {
        self.lo.iter().chain(&self.hi).all(|v| v.abs() <= MAX_NM.mm())
    }

    fn beyond(&self, place: Place, remedy: &str) -> Diag {
        let fits_by_size = self.size().into_iter().all(|side| side <= MAX_NM.mm());
        let shift = format!(
            "its size fits: subtract ({}) mm from all coordinates, so that it lies at its origin",
            mm(self.lo.map(f64::floor))
        );
        self.too_far(place).hint(if fits_by_size { shift.as_str() } else { remedy })
    }

    fn too_far(&self, place: Place) -> Diag {
        let text = format!(
            "the surface reaches from ({}) to ({}) mm, more than 4000 mm from the origin",
            mm(self.lo),
            mm(self.hi)
        );
        Diag::input("surface-size", text).at(place)
    }

    fn beyond_in(&self, place: Place, unit: Unit, remedy: &str) -> Diag {
        let is_large = self.size().into_iter().any(|size| size > MAX_NM.mm());
        let remedy = match unit.keys(self) {
            Some(keys) if is_large => format!("{remedy}; of a map of land {keys}"),
            Some(keys) => keys,
            None => remedy.to_owned(),
        };
        self.too_far(place).hint(remedy)
    }

    fn tiny(&self, place: Place, remedy: &str) -> Option<Diag> {
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
    let [x, y, z] = v.map(coordinate);
    format!("{x}, {y}, {z}")
}

/// One coordinate as a message shows it.
fn coordinate(v: f64) -> String {
    if v == 0.0 || (1e-3..1e9).contains(&v.abs()) {
        // At most micrometres, without the zeros behind.
        format!("{}", (v * 1e3).round() / 1e3)
    } else {
        format!("{v:.3e}")
    }
}

/// The remedy for a surface of the wrong size whose file carries no unit.
pub(crate) fn check_unit(unit: Unit) -> String {
    format!("check unit in [surface]: one unit of the file is taken as {} mm", unit.mm)
}

/// Hands facets on in mm.
pub(crate) struct Facets<'a> {
    path: &'a Path,
    unit: Unit,
    /// What to do about a wrong size.
    remedy: String,
    sink: &'a mut dyn FnMut([[f64; 3]; 3]),
    extent: BoxMm<3>,
    count: usize,
    first_beyond: Option<usize>,
    /// Facets beyond, and the box of all others.
    beyond: usize,
    near: BoxMm<3>,
}

impl<'a> Facets<'a> {
    /// Nothing handed on yet, of a file whose unit the job states.
    pub(crate) fn new(path: &'a Path, unit: Unit, sink: &'a mut dyn FnMut([[f64; 3]; 3])) -> Self {
        Self::with_remedy(path, unit, check_unit(unit), sink)
    }

    /// Nothing handed on yet, of a file for whose wrong size there is another remedy than its unit.
    pub(crate) fn with_remedy(
        path: &'a Path,
        unit: Unit,
        remedy: String,
        sink: &'a mut dyn FnMut([[f64; 3]; 3]),
    ) -> Self {
        Self {
            path,
            unit,
            remedy,
            sink,
            extent: BoxMm::EMPTY,
            count: 0,
            first_beyond: None,
            beyond: 0,
            near: BoxMm::EMPTY,
        }
    }

    /// Facets so far.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Hands on a facet given in file units; its corners are finite.
    #[inline]
    pub(crate) fn push(&mut self, corners: [[f64; 3]; 3]) {
        let corners = corners.map(|p| self.unit.place(p));
        for &p in &corners {
            self.extent.add(p);
        }
        if corners.iter().flatten().all(|&v| fits(v)) {
            corners.iter().for_each(|&p| self.near.add(p));
            if self.first_beyond.is_none() {
                (self.sink)(corners);
            }
        } else {
            self.first_beyond.get_or_insert(self.count);
            self.beyond += 1;
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
            let mut d = self.extent.beyond_in(place, self.unit, &self.remedy);
            // Few facets far away from all others are not the part.
            if self.beyond * 100 <= self.count {
                d = d.hint(format!(
                    "{} of {} facets reach so far, the others from ({}) to ({}) mm: remove them if they are strays",
                    self.beyond,
                    self.count,
                    mm(self.near.lo),
                    mm(self.near.hi)
                ));
            }
            return Err(d.into());
        }
        notes.extend(self.extent.tiny(place(self.path), &self.remedy));
        Ok(Content::Facets(self.count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_shown_to_the_micrometre_or_with_an_exponent() {
        for (v, text) in [(0.0, "0"), (-12.34567, "-12.346"), (40.0, "40"), (1e-4, "1.000e-4"), (2.5e9, "2.500e9")] {
            assert_eq!(coordinate(v), text);
        }
    }
}

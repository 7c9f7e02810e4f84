//! Space curves: polylines of x, y and z in the part frame, which lie on the surface.
//!
//! Consumes CSV and DXF files. Promises curves of which each has two places at least as seen from the lens, in the
//! turned part frame: x and y on the nanometre grid, z in nm as f64, each with a name for messages. Curves stay where
//! the file has them: in the frame of the surface file, not moved to the middle of the part and not scaled. As strokes
//! of the texture they are what the lens sees of them; whether they lie on the surface is for the plan to find.

mod csv;

use std::collections::BTreeSet;
use std::path::Path;

use super::artwork::{Artwork, Class, Marking, classes};
use super::dxf;
use super::place::{Site, far, is_near, push};
use super::{Figure, Kind, Request, Slip};
use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::geom::{Box2, NM_PER_MM, P2};
use terrace_core::program::PenId;

/// Largest file of curves.
const MAX_FILE: u64 = 256 << 20;

/// What is done with curves that lie farther from the surface than allowed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OnDistance {
    /// The job is refused.
    #[default]
    Error,
    /// They are marked where the lens sees them, with a warning.
    Warn,
}

/// A point of a curve: x and y on the grid, z in nm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpacePoint {
    /// The place of the point as the lens sees it.
    pub at: P2,
    /// Height, nm.
    pub z: f64,
}

/// The space curves of one request.
#[derive(Debug)]
pub struct Curves {
    points: Vec<SpacePoint>,
    /// Per curve, the end of its points.
    ends: Vec<usize>,
    names: Vec<String>,
    name_of: Vec<u32>,
    pen_of: Vec<Option<PenId>>,
    bounds: Box2,
}

impl Curves {
    /// Reads and places the curves of a request of that kind; answers also with what is odd of their size.
    ///
    /// # Errors
    /// `file-…`, `curve-…`, `dxf-…`, `texture-pens`, `texture-empty`, `texture-far`.
    pub(super) fn load(request: &Request, site: &Site, notes: &mut Vec<Diag>) -> Result<(Self, Option<Slip>), Error> {
        let Kind::Curves { path, unit_mm, marking, pose, .. } = &request.kind else {
            unreachable!("curves were asked for")
        };
        let file = Place::file(path.display().to_string());
        let art = read(path, *unit_mm, site, marking, notes)?;
        let slip = Slip::of(&art, &request.kind, site);
        let classes = classes(&art, marking, None).map_err(|d| Error::from(d.at(file.clone())))?;
        let mut curves = Self {
            points: Vec::with_capacity(art.lines.points.len()),
            ends: Vec::new(),
            names: Vec::new(),
            name_of: Vec::new(),
            pen_of: Vec::new(),
            bounds: Box2::EMPTY,
        };
        for (shape, class) in art.shapes.iter().zip(classes) {
            let pen = match class {
                // Curves have no page that they could be painted like.
                Class::Skip | Class::Page => continue,
                Class::Pen(pen) => pen,
            };
            for i in shape.lines.clone() {
                let points = art.lines.get(i).iter().zip(art.lines.heights(i)).map(|(&[x, y], &z)| [x, y, z]);
                let points = points.map(|p| pose.map_or(p, |pose| pose.apply(p)));
                curves.push(points, site).map_err(|_| {
                    let element = art.names[shape.name as usize].clone();
                    let e = far().at(Place::Element { path: path.display().to_string(), element }).into();
                    slip.as_ref().map_or(Error::clone(&e), |slip| slip.explain(&e))
                })?;
                curves.name_of.push(shape.name);
                curves.pen_of.push(pen);
            }
        }
        if curves.ends.is_empty() {
            return Err(Diag::input("texture-empty", "the file holds no space curve that is marked")
                .at(file)
                .hint("check the file, and only and except of the texture")
                .into());
        }
        curves.names = art.names;
        Ok((curves, slip))
    }

    /// Appends a curve, part frame, mm; the readers have seen that it has an extent.
    fn push(&mut self, points: impl Iterator<Item = [f64; 3]>, site: &Site) -> Result<(), BeyondLimit> {
        for [x, y, z] in points {
            let p = [x, y];
            if !is_near(site.turn.turned(p)) || !is_near([z, 0.0]) {
                return Err(BeyondLimit);
            }
            let at = site.turn.nm(p);
            self.bounds.add(at);
            self.points.push(SpacePoint { at, z: z * NM_PER_MM });
        }
        self.ends.push(self.points.len());
        Ok(())
    }

    /// How many curves there are, at least one.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    /// The points of curve `i`: neighbours may lie above each other.
    pub fn points(&self, i: usize) -> &[SpacePoint] {
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.points[start..self.ends[i]]
    }

    /// What curve `i` is called in messages.
    pub fn name(&self, i: usize) -> &str {
        &self.names[self.name_of[i] as usize]
    }
}

/// A point lies beyond 4 m.
struct BeyondLimit;

/// Reads a file by its extension.
pub(super) fn read(
    path: &Path,
    unit_mm: Option<f64>,
    site: &Site,
    marking: &Marking,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Error> {
    let file = || Place::file(path.display().to_string());
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "dxf" => {
            let bytes = diag::read_file(path, MAX_FILE)?;
            let widest_line = marking.widest_line_mm(site.spot_mm);
            let options = dxf::DxfOptions { path, unit_mm, tolerance: site.tolerance, widest_line, marking };
            dxf::curves(&bytes, &options, notes)
        }
        "csv" | "txt" | "xyz" => {
            let Some(unit_mm) = unit_mm else {
                let d = Diag::input("curve-unit", "a file of numbers does not say what its unit is").at(file());
                return Err(d.hint("add unit = \"mm\" (or \"in\") to the texture").into());
            };
            let bytes = diag::read_file(path, MAX_FILE)?;
            csv::read(&bytes, path, unit_mm, notes).map_err(|d| Error::from(*d))
        }
        _ => {
            let d = Diag::input("curve-format", "space curves are read from CSV and DXF files").at(file());
            Err(d.hint("name the file .csv (rows of x, y, z) or .dxf; give a drawing by file").into())
        }
    }
}

impl Figure for Curves {
    fn len(&self) -> u64 {
        self.ends.len() as u64
    }

    fn points(&self) -> u64 {
        self.points.len() as u64
    }

    fn bounds(&self) -> Box2 {
        self.bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        self.points(i as usize).iter().for_each(|p| push(out, p.at));
    }

    fn element(&self, i: u64) -> String {
        self.name(i as usize).to_owned()
    }

    fn dot_pens(&self, own: PenId) -> BTreeSet<PenId> {
        let is_dot = |&i: &usize| self.points(i).len() == 1;
        (0..self.count()).filter(is_dot).map(|i| self.pen_of[i].unwrap_or(own)).collect()
    }

    fn pen(&self, i: u64) -> Option<PenId> {
        self.pen_of[i as usize]
    }
}

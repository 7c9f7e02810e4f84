//! What the file of a texture holds, before a job says how it is marked: figures, and the names that choose shapes.

use std::path::Path;

use super::artwork::{self, Artwork, selectors};
use super::bitmap::Image;
use super::place::{Site, Turn, far_in, is_near};
use super::source::{Source, Sources};
use super::{Area, FillMode, Kind, Marking, Masks, Position, Request, Selector, Size, StrokeMode, curves};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::BoxMm;
use terrace_core::program::PenId;

/// Largest distance between a curve and its polyline, mm.
const TOLERANCE_MM: f64 = 1e-3;

/// What a file that is marked as a drawing holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Contents {
    /// Lines and areas.
    Drawing(Shapes),
    /// Pixels.
    Bitmap(Pixels),
}

/// What a drawing holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Shapes {
    /// The file says how large it is; else the page measures 100 mm x 100 mm.
    pub is_sized: bool,
    /// The lines and the contours of the areas, as far as they are seen.
    pub outlines: Outlines,
    /// What `pens`, `only` and `except` can name, with the number of shapes that each name chooses.
    pub selectors: Vec<(Selector, usize)>,
    /// Why a job is refused unless it asks for warnings; what is named here is counted nowhere.
    pub refused: Vec<Diag>,
}

/// Lines, mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outlines {
    /// How many there are.
    pub count: usize,
    /// How many of them end where they begin.
    pub closed: usize,
    /// How many points they have together.
    pub points: usize,
    /// Their length together.
    pub length_mm: f64,
    /// Their box in the coordinates of the drawing, or from the lower left corner of the page; None without lines.
    pub bounds: Option<BoxMm<2>>,
}

/// What a bitmap holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// Pixels along x.
    pub columns: usize,
    /// Pixels along y.
    pub rows: usize,
    /// Pixels in a mm along x and y, as the file states them.
    pub per_mm: Option<[f64; 2]>,
    /// The darkest grey, 0 black to 1 white.
    pub darkest: f64,
    /// The lightest grey.
    pub lightest: f64,
    /// The mean grey.
    pub mean: f64,
}

/// What a file holds as curves in space, in mm or, where nobody states it, in its own unit.
#[derive(Clone, Debug, PartialEq)]
pub struct InSpace {
    /// How many curves there are.
    pub count: usize,
    /// How many points they have together.
    pub points: usize,
    /// Their length together.
    pub length: f64,
    /// Least x, y and z.
    pub lo: [f64; 3],
    /// Greatest x, y and z.
    pub hi: [f64; 3],
    /// The selectors and how many curves each selects, as in [`Shapes::selectors`].
    pub selectors: Vec<(Selector, usize)>,
}

impl Contents {
    /// Reads a file as the drawing of a texture; `unit_mm` is what a unit measures in a DXF that does not state it.
    /// Warnings go to `notes`.
    ///
    /// # Errors
    /// Faults of the file; what a job could leave out is not a fault.
    pub fn read(path: &Path, unit_mm: Option<f64>, notes: &mut Vec<Diag>) -> Result<Self, Error> {
        let mut sources = Sources::default();
        if let Source::Bitmap(image) = sources.read(path)? {
            notes.extend(image.notes.iter().map(|d| d.clone().at(Place::file(path.display().to_string()))));
            return Ok(Self::Bitmap(Pixels::of(image)));
        }
        let before = notes.len();
        let strict = Shapes::read(&mut sources, path, unit_mm, false, notes);
        let Err(e) = strict else { return strict.map(Self::Drawing) };
        let warned = notes.split_off(before);
        match Shapes::read(&mut sources, path, unit_mm, true, notes) {
            Ok(shapes) => {
                // What is left out was given as the reason of the refusal.
                notes.truncate(before);
                notes.extend(warned);
                Ok(Self::Drawing(Shapes { refused: e.diags().to_vec(), ..shapes }))
            }
            Err(other) => {
                let is_new = |d: &&Diag| e.diags().iter().all(|known| known.code != d.code);
                Err(Error::many(e.diags().iter().chain(other.diags().iter().filter(is_new)).cloned().collect()))
            }
        }
    }
}

impl Shapes {
    fn read(
        sources: &mut Sources,
        path: &Path,
        unit_mm: Option<f64>,
        is_lenient: bool,
        notes: &mut Vec<Diag>,
    ) -> Result<Self, Error> {
        let before = notes.len();
        let (art, is_sized) = match sources.artwork(&request(path, Size::File, unit_mm, is_lenient), &anywhere(), notes)
        {
            Ok(art) => (art, true),
            Err(e) if e.diags().iter().any(|d| d.code == "svg-size") => {
                // A job must give such a drawing a size. Here any does, so no warning says that it is stretched.
                notes.truncate(before);
                let sized = request(path, Size::Mm([100.0; 2]), unit_mm, is_lenient);
                let art = sources.artwork(&sized, &anywhere(), notes)?;
                notes.retain(|w| w.code != "svg-stretched");
                (art, false)
            }
            Err(e) => return Err(e),
        };
        let file = Place::file(path.display().to_string());
        let outlines = Outlines::of(&art).map_err(|d| Error::from(d.at(file)))?;
        Ok(Self { is_sized, outlines, selectors: selectors(&art), refused: Vec::new() })
    }
}

/// A request that marks all that a drawing shows by its outlines, wherever it lies.
fn request(path: &Path, size: Size, unit_mm: Option<f64>, is_lenient: bool) -> Request {
    let kind = Kind::Drawing {
        path: path.to_owned(),
        size,
        unit_mm,
        position: Position::Usual,
        turn_rad: 0.0,
        tile: false,
        marking: Box::new(Marking { is_lenient, ..outlines() }),
    };
    Request { kind, area: Area::Unlimited, tolerance_mm: TOLERANCE_MM, pen: PenId(0), masks: Masks::default() }
}

impl Outlines {
    fn of(art: &Artwork) -> Result<Self, Box<Diag>> {
        let page = artwork::marks(art, &outlines(), 0.0, 0.0, &mut Vec::new())?;
        let corner = art.corner.unwrap_or_default();
        let points = || page.lines.points.iter().map(|p| [p[0] + corner[0], p[1] + corner[1]]);
        Ok(Self {
            count: page.lines.len(),
            closed: page.lines.iter().filter(|line| line.len() > 2 && line.first() == line.last()).count(),
            points: page.lines.points.len(),
            length_mm: page.lines.iter().flat_map(|line| line.windows(2)).map(|s| distance(s[0], s[1])).sum(),
            bounds: (page.lines.len() > 0).then(|| BoxMm::of(points())),
        })
    }
}

impl Pixels {
    fn of(image: &Image) -> Self {
        let white = f64::from(u16::MAX);
        let grey = |sample: Option<&u16>| sample.map_or(0.0, |&s| f64::from(s) / white);
        let sum: u64 = image.samples.iter().map(|&s| u64::from(s)).sum();
        Self {
            columns: image.columns,
            rows: image.rows,
            per_mm: image.resolution,
            darkest: grey(image.samples.iter().min()),
            lightest: grey(image.samples.iter().max()),
            mean: sum as f64 / image.samples.len() as f64 / white,
        }
    }
}

impl InSpace {
    /// Reads a CSV or DXF file as space curves; a unit of a file that does not state it measures `unit_mm`.
    ///
    /// # Errors
    /// Faults of the file; `texture-far`.
    pub fn read(path: &Path, unit_mm: Option<f64>, notes: &mut Vec<Diag>) -> Result<Self, Error> {
        let art = curves::read(path, unit_mm, &anywhere(), &outlines(), notes)?;
        let heights = (0..art.lines.len()).flat_map(|i| art.lines.heights(i));
        if !(art.lines.points.iter().all(|&p| is_near(p)) && heights.into_iter().all(|&z| is_near([z, 0.0]))) {
            return Err(far_in(&path.display().to_string()).into());
        }
        let mut curves = Self {
            count: art.lines.len(),
            points: art.lines.points.len(),
            length: 0.0,
            lo: [f64::INFINITY; 3],
            hi: [f64::NEG_INFINITY; 3],
            selectors: selectors(&art),
        };
        for i in 0..art.lines.len() {
            let heights = art.lines.heights(i).iter();
            let mut last: Option<[f64; 3]> = None;
            for p in art.lines.get(i).iter().zip(heights).map(|(&[x, y], &z)| [x, y, z]) {
                curves.length += last.map_or(0.0, |last| distance(last, p));
                last = Some(p);
                curves.lo = [0, 1, 2].map(|k| curves.lo[k].min(p[k]));
                curves.hi = [0, 1, 2].map(|k| curves.hi[k].max(p[k]));
            }
        }
        Ok(curves)
    }
}

/// All lines of a drawing and the contours of its areas: what does not depend on a machine.
fn outlines() -> Marking {
    Marking { stroke: StrokeMode::Centre, fill: FillMode::Outline, lists_labels: true, ..Marking::default() }
}

/// A part of no extent: where a drawing lies on it does not matter.
fn anywhere() -> Site {
    let none = BoxMm::of([[0.0; 2]]);
    Site { area: none, part_box: none, tolerance: TOLERANCE_MM, turn: Turn::new(0.0), spot_mm: 0.0 }
}

fn distance<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

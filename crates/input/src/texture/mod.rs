//! What is to be marked: strokes on the nanometre grid of the turned part frame.
//!
//! Consumes the requests of a job (patterns, drawings, bitmaps and space curves, lengths in mm, angles in rad) and the
//! part's box. Promises an indexed stream of polylines and dots: every stroke has at least two points, or is a dot and
//! has one; neighbours differ, closed figures end on the point they start with, nothing is NaN or beyond 4 m,
//! and stroke `i` is the same whenever and wherever it is asked for. Strokes of patterns and of tiles
//! that lie wholly inside their area are computed from their index, so a texture of 10^8 points takes
//! no memory. An area that is to be filled along contours ([`Contour`]) has a box and no strokes until
//! [`Texture::fill`] is given the direction of its lines, cell by cell.
//!
//! All geometry is f64 in mm until one rounding per point: a pattern or a drawing is placed in the part
//! frame, turned with the part about the frame's origin, and then rounded to the nanometre. Quarter
//! turns are exact. Points beyond `tolerance` of the true curve do not arise, but for that rounding
//! (0.7 nm).
//!
//! Limits: 2^31 strokes, 2·10^9 points (20 million in one drawing), coordinates up to 4 m.

mod artwork;
mod bitmap;
mod clip;
pub mod contents;
mod contour_areas;
mod curves;
mod cut_figure;
mod cut_texture;
pub mod direction;
mod draped;
mod drawing;
mod dxf;
mod foreign;
mod hpgl;
pub mod kind;
pub mod marked;
mod mask;
mod page;
pub mod pattern;
mod place;
mod random;
mod scale;
mod source;
mod svg;
mod xml;

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use artwork::Artwork;
pub(crate) use artwork::lightness;
pub use artwork::{ContourPass, FillMode, Marking, Mirror, Paper, Resolution, Screen, Selector, StrokeMode, Tone};
pub use bitmap::{Image, decode as decode_bitmap};
pub use contour_areas::ContourAreas;
pub use curves::{Curves, OnDistance, SpacePoint};
pub use draped::{Draped, Draping, Lost, LostMarks};
use drawing::Drawing;
pub use kind::Kind;
use mask::{Border, Masked};
pub use mask::{Mask, Masks};
pub use page::{Align, Fit, Position, Size};
pub use pattern::{Contour, Directions};
use place::Turn;
pub use scale::Slip;
pub use source::{DrawingFormat, read_drawing};
use terrace_core::diag::{Diag, Error, Place, memory};
use terrace_core::geom::{Box2, BoxMm, Nm, P2};
use terrace_core::program::PenId;

/// Most strokes of one job.
const MAX_STROKES: u64 = 1 << 31;

/// Most points of one job.
const MAX_POINTS: u64 = 2_000_000_000;

/// Where a texture lies, part frame, mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Area {
    /// The part's box seen from the lens.
    Part,
    /// This box, mm, part frame.
    Rectangle(BoxMm<2>),
    /// No limit; patterns fill the part's box.
    Unlimited,
}

/// What is said of a drawing whose name shows that it is not read, such as `panel.dxf`.
pub(crate) fn foreign_drawing(path: &std::path::Path) -> Option<Diag> {
    foreign::name(path)
}

/// One `[[texture]]` of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// The pattern, drawing or curves.
    pub kind: Kind,
    /// The area in which it lies.
    pub area: Area,
    /// Largest distance between a curve and its polyline, mm.
    pub tolerance_mm: f64,
    /// Index of its pen.
    pub pen: PenId,
    /// Where it is marked in its area.
    pub masks: Masks,
}

impl Request {
    /// Whether the job says where it lies, so that what of it lies off the part may be a mistake. Patterns over the
    /// part's box, and drawings that are repeated over it, lie where the part does.
    pub fn is_placed(&self) -> bool {
        match self.kind {
            Kind::Drawing { tile, .. } => !tile || self.masks.inside.is_some() || self.area != Area::Part,
            _ => matches!(self.area, Area::Rectangle(_)) || self.masks.inside.is_some(),
        }
    }
}

/// Strokes that are asked for by their index.
pub trait Figure: std::fmt::Debug + Send + Sync {
    /// How many strokes there are.
    fn len(&self) -> u64;
    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// How many points they have together, at most.
    fn points(&self) -> u64;
    /// How many points its longest stroke has, about: all where it has one stroke, four times the mean of several.
    fn longest(&self) -> u64 {
        let strokes = self.len().max(1);
        if strokes == 1 { self.points() } else { self.points().min(4 * self.points().div_ceil(strokes)) }
    }
    /// The box of all strokes, turned part frame.
    fn bounds(&self) -> Box2;
    /// Appends the points of stroke `i`.
    fn stroke(&self, i: u64, out: &mut Vec<P2>);
    /// What stroke `i` comes from, for messages.
    fn element(&self, i: u64) -> String;
    /// The pens that its dots are marked with, where `own` is the pen of the texture.
    fn dot_pens(&self, _own: PenId) -> BTreeSet<PenId> {
        BTreeSet::new()
    }
    /// The pen of stroke `i`; None for that of the texture.
    fn pen(&self, _: u64) -> Option<PenId> {
        None
    }
}

/// The drawing or curves of a request, placed.
struct PlacedFile {
    strokes: PlacedStrokes,
    /// The drawing, where another pass may hatch it anew.
    artwork: Option<Arc<Artwork>>,
    /// Where its size does not go with the part.
    slip: Option<Slip>,
}

/// What a request takes from files.
struct RequestFiles {
    /// None where it is a pattern.
    file: Option<PlacedFile>,
    /// The border at which its strokes are cut.
    border: Option<Arc<Border>>,
}

/// Returns what the request of an index takes from files, at its site.
type FilesOf<'a> = dyn FnMut(usize, &Request, &place::Site) -> Result<RequestFiles, Error> + 'a;

/// The strokes of one request, placed on the part.
#[derive(Clone, Debug)]
enum PlacedStrokes {
    /// Those of a pattern or a drawing, which are known once it is placed.
    Figure(Arc<dyn Figure>),
    /// Space curves.
    Curves(Arc<Curves>),
    /// Lines along the level lines of the part; none before their directions are known.
    Contour(Contour),
    /// A drawing with areas that such lines fill.
    Areas(Box<ContourAreas>),
}

impl PlacedStrokes {
    fn figure(&self) -> &dyn Figure {
        match self {
            Self::Figure(figure) => figure.as_ref(),
            Self::Curves(curves) => curves.as_ref(),
            Self::Contour(contour) => contour,
            Self::Areas(areas) => areas.as_ref(),
        }
    }
}

/// The part of a texture that one request asks for.
#[derive(Clone, Debug)]
struct Part {
    placed: PlacedStrokes,
    /// The drawing, where another pass may hatch it anew.
    artwork: Option<Arc<Artwork>>,
    /// The border at which its strokes are cut.
    border: Option<Arc<Border>>,
    /// What the border leaves of its strokes, once they are known.
    masked: Option<Arc<Masked>>,
    /// Where its size does not go with the part.
    slip: Option<Slip>,
    pen: PenId,
    /// Index of its first stroke in the whole texture.
    start: u64,
}

impl Part {
    /// What its strokes are cut from.
    fn base(&self) -> Arc<dyn Figure> {
        match (&self.masked, &self.placed) {
            (Some(masked), _) => Arc::clone(masked) as Arc<dyn Figure>,
            (None, PlacedStrokes::Figure(figure)) => Arc::clone(figure),
            (None, PlacedStrokes::Curves(curves)) => Arc::clone(curves) as Arc<dyn Figure>,
            (None, PlacedStrokes::Contour(contour)) => Arc::new(contour.clone()),
            (None, PlacedStrokes::Areas(areas)) => Arc::new(areas.as_ref().clone()),
        }
    }

    /// The strokes of a request, cut at its border as far as they are known.
    fn new(request: &Request, files: RequestFiles, site: &place::Site) -> Result<Self, Error> {
        let RequestFiles { file, border } = files;
        let PlacedFile { strokes, artwork, slip } = match file {
            Some(file) => file,
            None => PlacedFile { strokes: pattern::place(&request.kind, site)?, artwork: None, slip: None },
        };
        // A border does not apply to space curves. Lines along level lines are cut when they are made, by
        // `Texture::fill`.
        let base = if let PlacedStrokes::Figure(figure) = &strokes { Some(Arc::clone(figure)) } else { None };
        let mut part = Self { placed: strokes, artwork, border, masked: None, slip, pen: request.pen, start: 0 };
        if let Some(base) = base {
            part.mask(base)?;
        }
        Ok(part)
    }

    /// The strokes of the part.
    fn figure(&self) -> &dyn Figure {
        match &self.masked {
            Some(masked) => masked.as_ref(),
            None => self.placed.figure(),
        }
    }

    /// Cuts strokes that are known at the border.
    fn mask(&mut self, base: Arc<dyn Figure>) -> Result<(), Error> {
        if let Some(border) = &self.border {
            self.masked = Some(Arc::new(Masked::new(base, Arc::clone(border))?.0));
        }
        Ok(())
    }
}

/// Mean distances between neighbouring marks, nm; infinite where there are none of the kind.
#[derive(Clone, Copy, Debug)]
pub struct Spacing {
    /// Area over length.
    pub lines: f64,
    /// Root of the area for one dot.
    pub dots: f64,
}

/// All strokes of a job, computed on request: nothing is stored that can be computed. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Texture {
    parts: Vec<Part>,
    len: u64,
    points: u64,
    bounds: Box2,
    /// The directions that areas were filled by.
    directions: Option<Directions>,
    spot_mm: f64,
}

impl Texture {
    /// Places the requested textures on a part whose box (part frame) is `part_box_mm` and that is
    /// turned by `turn_rad` about the z axis of its frame. The spot tells lines of drawings from areas, and areas are
    /// filled by lines half a spot apart unless the request says otherwise. Warnings go to `notes`.
    ///
    /// # Errors
    /// Faults of drawings (`svg-…`, `dxf-…`, `bitmap-…`) and curves (`curve-…`), `texture-key`, `texture-empty`,
    /// `texture-far` (beyond 4 m), `texture-large`, `texture-area`, `texture-pitch`, `texture-cell`, `texture-order`,
    /// `texture-tile`.
    pub fn load(
        requests: &[Request],
        part_box_mm: BoxMm<2>,
        turn_rad: f64,
        spot_mm: f64,
        notes: &mut Vec<Diag>,
    ) -> Result<Self, Error> {
        let mut sources = source::Sources::default();
        Self::place(requests, part_box_mm, turn_rad, spot_mm, &mut |_, request, site| {
            let border = request.masks.border(site, &mut sources, notes)?;
            let file = match &request.kind {
                Kind::Drawing { .. } => {
                    let art = sources.artwork(request, site, notes)?;
                    let slip = Slip::of(&art, &request.kind, site);
                    let figure = Self::drawing(&art, request, site, notes);
                    let strokes = figure.map_err(|e| slip.as_ref().map_or(e.clone(), |slip| slip.explain(&e)))?;
                    Some(PlacedFile { strokes, artwork: art.has_areas().then(|| Arc::new(art)), slip })
                }
                Kind::Curves { .. } => {
                    let (curves, slip) = Curves::load(request, site, notes)?;
                    Some(PlacedFile { strokes: PlacedStrokes::Curves(Arc::new(curves)), artwork: None, slip })
                }
                _ => None,
            };
            Ok(RequestFiles { file, border })
        })
    }

    /// Marks and places a drawing.
    fn drawing(
        art: &Artwork,
        request: &Request,
        site: &place::Site,
        notes: &mut Vec<Diag>,
    ) -> Result<PlacedStrokes, Error> {
        let Kind::Drawing { path, turn_rad, marking, .. } = &request.kind else { unreachable!("it is a drawing") };
        let file = Place::file(path.display().to_string());
        let mut file_notes = Vec::new();
        let page = artwork::marks(art, marking, site.spot_mm, *turn_rad, &mut file_notes)
            .map_err(|d| Error::from(d.at(file.clone())))?;
        notes.extend(file_notes.into_iter().map(|d| d.at(file.clone())));
        if page.lines.len() == 0 && page.unfilled.is_empty() {
            return Err(nothing_marked(art, marking).at(file).into());
        }
        Drawing::place(page, request, site)
    }

    /// The texture of another pass of the same job: its patterns are placed anew, its drawings and curves are shared,
    /// and no file is read again.
    ///
    /// # Errors
    /// Those of patterns that [`Texture::load`] has.
    pub fn of_pass(&self, requests: &[Request], part_box_mm: BoxMm<2>, turn_rad: f64) -> Result<Self, Error> {
        Self::place(requests, part_box_mm, turn_rad, self.spot_mm, &mut |k, request, site| {
            let part = &self.parts[k];
            let file = match (&request.kind, &part.placed, &part.artwork) {
                (Kind::Drawing { .. }, _, Some(art)) => {
                    // Its warnings were given by the first pass.
                    let strokes = Self::drawing(art, request, site, &mut Vec::new())?;
                    Some(PlacedFile { strokes, artwork: Some(art.clone()), slip: None })
                }
                (Kind::Drawing { .. } | Kind::Curves { .. }, placed, None) => {
                    Some(PlacedFile { strokes: placed.clone(), artwork: None, slip: None })
                }
                _ => None,
            };
            Ok(RequestFiles { file, border: part.border.clone() })
        })
    }

    /// Places the requests; `files` returns what they take from files.
    fn place(
        requests: &[Request],
        part_box_mm: BoxMm<2>,
        turn_rad: f64,
        spot_mm: f64,
        files: &mut FilesOf<'_>,
    ) -> Result<Self, Error> {
        let turn = Turn::new(turn_rad);
        let mut texture = Self { parts: Vec::new(), len: 0, points: 0, bounds: Box2::EMPTY, directions: None, spot_mm };
        for (k, request) in requests.iter().enumerate() {
            let site = place::Site::new(request, part_box_mm, turn, spot_mm);
            let part = site.and_then(|site| Part::new(request, files(k, request, &site)?, &site));
            let part = part.map_err(|e| numbered(&e, k))?;
            texture.bounds = texture.bounds.union(part.figure().bounds());
            texture.parts.push(part);
            texture.count(k)?;
        }
        if texture.parts.is_empty() { Err(empty().into()) } else { Ok(texture) }
    }

    /// Fills areas with lines along the level lines of the part. The grid of `directions` covers [`Texture::bounds`].
    ///
    /// # Errors
    /// `texture-empty`, `texture-large`.
    pub fn fill(&mut self, directions: Directions) -> Result<(), Error> {
        for (k, part) in self.parts.iter_mut().enumerate() {
            let base: Arc<dyn Figure> = match &mut part.placed {
                PlacedStrokes::Contour(area) => {
                    area.fill(&directions).map_err(|e| numbered(&e, k))?;
                    Arc::new(area.clone())
                }
                PlacedStrokes::Areas(areas) => {
                    areas.fill(&directions).map_err(|e| numbered(&e, k))?;
                    Arc::new(ContourAreas::clone(areas))
                }
                PlacedStrokes::Figure(_) | PlacedStrokes::Curves(_) => continue,
            };
            part.mask(base).map_err(|e| numbered(&e, k))?;
        }
        self.directions = Some(directions);
        self.len = 0;
        self.points = 0;
        (0..self.parts.len()).try_for_each(|k| self.count(k))
    }

    /// Puts the strokes of part `k` after those of the parts before it.
    fn count(&mut self, k: usize) -> Result<(), Error> {
        self.count_any(k)?;
        let part = &self.parts[k];
        let is_unfilled =
            matches!(part.placed, PlacedStrokes::Contour(_) | PlacedStrokes::Areas(_)) && self.directions.is_none();
        if self.len == part.start && !is_unfilled {
            return Err(numbered(&empty().into(), k));
        }
        Ok(())
    }

    /// The same where a request may have no strokes.
    fn count_any(&mut self, k: usize) -> Result<(), Error> {
        let part = &mut self.parts[k];
        part.start = self.len;
        self.len += part.figure().len();
        self.points += part.figure().points();
        if self.len > MAX_STROKES || self.points > MAX_POINTS {
            return Err(too_large(self.len, self.points).into());
        }
        Ok(())
    }

    /// The boxes that are filled along contours, as they are before a border cuts their lines; and those in which areas
    /// of drawings are.
    pub fn contours(&self) -> impl Iterator<Item = &Contour> {
        self.parts.iter().flat_map(|p| match &p.placed {
            PlacedStrokes::Contour(f) => std::slice::from_ref(f),
            PlacedStrokes::Areas(areas) => areas.lattices(),
            PlacedStrokes::Figure(_) | PlacedStrokes::Curves(_) => &[],
        })
    }

    /// The boxes that are filled along contours as wholes.
    pub fn whole_contours(&self) -> impl Iterator<Item = &Contour> {
        self.parts.iter().filter_map(|p| if let PlacedStrokes::Contour(f) = &p.placed { Some(f) } else { None })
    }

    /// The drawings with areas that are filled along contours, as they are before a border cuts their lines.
    pub fn contour_areas(&self) -> impl Iterator<Item = &ContourAreas> {
        self.parts.iter().filter_map(|p| match &p.placed {
            PlacedStrokes::Areas(areas) => Some(areas.as_ref()),
            _ => None,
        })
    }

    /// The space curves, each with the index of its request.
    pub fn curves(&self) -> impl Iterator<Item = (usize, &Curves)> {
        self.parts.iter().enumerate().filter_map(|(k, p)| match &p.placed {
            PlacedStrokes::Curves(curves) => Some((k, curves.as_ref())),
            _ => None,
        })
    }

    /// The drawings and curves whose size does not go with the part, each with the index of its request.
    pub fn slips(&self) -> impl Iterator<Item = (usize, &Slip)> {
        self.parts.iter().enumerate().filter_map(|(k, p)| Some((k, p.slip.as_ref()?)))
    }

    /// The box of the strokes of a request, turned part frame.
    pub fn bounds_of(&self, request: usize) -> Box2 {
        self.parts[request].figure().bounds()
    }

    /// The directions that areas were filled by; None where none was.
    pub fn directions(&self) -> Option<&Directions> {
        self.directions.as_ref()
    }

    /// How many strokes there are.
    pub fn len(&self) -> usize {
        usize::try_from(self.len).expect("at most 2^31 strokes")
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// How many points all strokes have together, but for neighbours that fall on one nanometre.
    pub fn points_estimate(&self) -> u64 {
        self.points
    }

    /// How far apart neighbouring marks are on average over the texture's box, estimated from some of the strokes.
    pub fn spacing_estimate(&self) -> Spacing {
        const SAMPLES: usize = 500;
        let step = self.len().div_ceil(SAMPLES).max(1);
        let mut points = Vec::new();
        let mut length = 0.0;
        let mut dots = 0.0;
        for i in (0..self.len()).step_by(step) {
            self.stroke(i, &mut points);
            length += points.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>();
            dots += f64::from(u8::from(points.len() == 1));
        }
        let [w, h] = self.bounds.size().map(Nm::f64);
        Spacing { lines: w * h / (length * step as f64), dots: (w * h / (dots * step as f64)).sqrt() }
    }

    /// Asks for the memory in which a stroke is traced: its points, and where it crosses the part.
    ///
    /// # Errors
    /// `memory`.
    pub fn ask_for_tracing(&self) -> Result<(), Diag> {
        const BYTES: u64 = 2 * size_of::<P2>() as u64;
        let longest = self.parts.iter().map(|part| part.placed.figure().longest()).max().unwrap_or(0);
        memory::ask("the longest stroke of the texture", BYTES.saturating_mul(longest))
    }

    /// The box of all strokes, turned part frame.
    pub fn bounds(&self) -> Box2 {
        self.bounds
    }

    /// The pens that dots are marked with, each with the number of a texture, from 1, that has such dots.
    pub fn dot_pens(&self) -> Vec<(PenId, usize)> {
        let parts = self.parts.iter().enumerate();
        parts.flat_map(|(k, p)| p.placed.figure().dot_pens(p.pen).into_iter().map(move |pen| (pen, k + 1))).collect()
    }

    /// Writes the points of stroke `i` (at least two, neighbours differ; one of a dot) into `out`, which is cleared,
    /// and returns the index of its pen. A closed figure ends on the point it starts with.
    ///
    /// # Panics
    /// Where `i` is not below [`Texture::len`].
    pub fn stroke(&self, i: usize, out: &mut Vec<P2>) -> PenId {
        out.clear();
        let (k, i) = self.find(i);
        let part = &self.parts[k];
        let figure = part.figure();
        figure.stroke(i, out);
        figure.pen(i).unwrap_or(part.pen)
    }

    /// What stroke `i` comes from, for messages: texture number, element, tile.
    ///
    /// # Panics
    /// Where `i` is not below [`Texture::len`].
    pub fn element(&self, i: usize) -> String {
        let (k, i) = self.find(i);
        let what = self.parts[k].figure().element(i);
        format!("texture {}, {what}", k + 1)
    }

    /// The strokes of a request.
    pub fn strokes_of(&self, request: usize) -> Range<usize> {
        let part = &self.parts[request];
        part.start as usize..(part.start + part.figure().len()) as usize
    }

    /// The request that stroke `i` is of, by its index.
    pub fn part_of(&self, i: usize) -> usize {
        self.find(i).0
    }

    /// The strokes of a request before `inside` and `outside` cut them; None where neither does.
    pub fn uncut(&self, request: usize) -> Option<Uncut<'_>> {
        let part = &self.parts[request];
        part.masked.as_ref().map(|masked| Uncut { figure: part.placed.figure(), masked, start: part.start })
    }

    /// The part that holds stroke `i`, and the stroke's index in it.
    fn find(&self, i: usize) -> (usize, u64) {
        let i = i as u64;
        assert!(i < self.len, "stroke {i} of {}", self.len);
        let k = self.parts.partition_point(|p| p.start <= i) - 1;
        (k, i - self.parts[k].start)
    }
}

/// The strokes of a request before they were cut at a border.
#[derive(Clone, Copy, Debug)]
pub struct Uncut<'a> {
    figure: &'a dyn Figure,
    masked: &'a Masked,
    start: u64,
}

impl Uncut<'_> {
    /// How many there are.
    pub fn len(&self) -> u64 {
        self.figure.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes the points of one into `out`, which is cleared.
    pub fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        out.clear();
        self.figure.stroke(i, out);
    }

    /// The strokes of the texture that are left of it.
    pub fn pieces(&self, i: u64) -> Range<usize> {
        let Range { start, end } = self.masked.pieces_of(i);
        (self.start + start) as usize..(self.start + end) as usize
    }
}

/// An error in which what has no place says which texture it speaks of.
fn numbered(e: &Error, k: usize) -> Error {
    let mut diags = e.diags().to_vec();
    for d in diags.iter_mut().filter(|d| d.place == Place::Nowhere) {
        d.message = format!("texture {}: {}", k + 1, d.message);
    }
    Error::many(diags)
}

/// What is said of a drawing without marks.
fn nothing_marked(art: &Artwork, marking: &Marking) -> Diag {
    let is_line = |shape: &artwork::PaintedShape| shape.figure == artwork::ShapeFigure::Lines;
    let first_line = art.shapes.iter().position(is_line);
    let has_cover = first_line.is_some_and(|first| art.shapes[first..].iter().any(|shape| !is_line(shape)));
    let (why, hint) = if art.dark_share.is_some() {
        (": all dark areas of the picture are thinner than twice the inset", artwork::DIFFUSION_HINT)
    } else if marking.fill == FillMode::None && has_cover {
        (
            ": its areas, which fill = \"none\" leaves unmarked, hide the lines below them",
            "leave the areas out by except or only, or mark them with another fill",
        )
    } else {
        ("", "check fill, stroke, inset, only and except of the texture")
    };
    Diag::input("texture-empty", format!("nothing of the drawing is marked{why}")).hint(hint)
}

fn empty() -> Diag {
    Diag::input("texture-empty", "the texture holds nothing to mark")
        .hint("check that its area holds at least one line or cell, that a drawing lies in its area, and what inside and outside leave")
}

fn too_large(strokes: u64, points: u64) -> Diag {
    let text = format!(
        "the textures have {strokes} strokes and about {points} points, more than {MAX_STROKES} strokes or {MAX_POINTS} points"
    );
    Diag::limit("texture-large", text).hint("use a larger pitch, a larger tolerance or a smaller area")
}

//! What is to be marked: strokes on the nanometre grid of the turned part frame.
//!
//! Consumes the requests of a job (patterns and SVG drawings, lengths in mm, angles in rad) and the
//! part's box. Promises an indexed stream of polylines: every stroke has at least two points,
//! neighbours differ, closed figures end on the point they start with, nothing is NaN or beyond 4 m,
//! and stroke `i` is the same whenever and wherever it is asked for. Strokes of patterns and of tiles
//! that lie wholly inside their area are computed from their index, so a texture of 10^8 points takes
//! no memory. An area that is to be filled along contours ([`Contour`]) has a box and no strokes until
//! [`Texture::fill`] is told the direction of its lines, cell by cell.
//!
//! All geometry is f64 in mm until one rounding per point: a pattern or a drawing is placed in the part
//! frame, turned with the part about the frame's origin, and then rounded to the nanometre. Quarter
//! turns are exact. Points beyond `tolerance` of the true curve do not arise, but for that rounding
//! (0.7 nm).
//!
//! Limits: 2^31 strokes, 2·10^9 points (20 million in one drawing), coordinates up to 4 m.

mod clip;
mod drawing;
mod pattern;
mod place;
mod svg;

use std::ops::Range;
use std::path::PathBuf;

use crate::diag::{Diag, Error, Place};
use crate::geom::{Box2, P2};
use drawing::Drawing;
pub use pattern::{Contour, Directions};
use pattern::{Hatch, Hilbert, Loops};
use place::Turn;

/// Most strokes of one job.
const MAX_STROKES: u64 = 1 << 31;

/// Most points of one job.
const MAX_POINTS: u64 = 2_000_000_000;

/// Where a texture lies, part frame, mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Area {
    /// The part's box seen from the lens.
    Part,
    /// x0, y0, x1, y1.
    Rectangle([f64; 4]),
    /// No limit; patterns fill the part's box.
    Unlimited,
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Parallel lines.
    Hatch {
        /// Distance of lines.
        pitch_mm: f64,
        /// Direction of lines from +x, counter-clockwise.
        direction_rad: f64,
    },
    /// Parallel lines along the level lines of the part, their direction told later.
    Contour {
        /// Distance of lines.
        pitch_mm: f64,
        /// By which part of their distance all lines are moved, 0 to 1.
        phase: f64,
    },
    /// One Hilbert curve of 4^order points.
    Hilbert {
        /// 4^order points.
        order: u32,
    },
    /// Square loops of side `cell_mm`.
    Squares {
        /// Side.
        cell_mm: f64,
        /// Distance of centres.
        pitch_mm: f64,
    },
    /// Circles of diameter `cell_mm`.
    Circles {
        /// Diameter.
        cell_mm: f64,
        /// Distance of centres.
        pitch_mm: f64,
    },
    /// An SVG drawing.
    Drawing {
        /// The file.
        path: PathBuf,
        /// Width and height of the whole page; None for those that the file states.
        size_mm: Option<[f64; 2]>,
        /// Lower left corner of the page; None for that of the area.
        origin_mm: Option<[f64; 2]>,
        /// Turn of the page about its lower left corner, counter-clockwise.
        turn_rad: f64,
        /// Whether the page is repeated over the area.
        tile: bool,
    },
}

/// One `[[texture]]` of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// What.
    pub kind: Kind,
    /// Where.
    pub area: Area,
    /// Largest distance between a curve and its polyline, mm.
    pub tolerance_mm: f64,
    /// Index of its pen.
    pub pen: u16,
}

/// One placed request.
#[derive(Debug)]
enum Figures {
    Hatch(Hatch),
    Contour(Contour),
    Hilbert(Hilbert),
    Loops(Loops),
    Drawing(Box<Drawing>),
}

#[derive(Debug)]
struct Part {
    figures: Figures,
    pen: u16,
    /// Index of its first stroke in the whole texture.
    start: u64,
}

/// All strokes of a job, made anew on request: nothing is held that can be computed.
#[derive(Debug)]
pub struct Texture {
    parts: Vec<Part>,
    len: u64,
    points: u64,
    bounds: Box2,
    /// Those that areas were filled by.
    directions: Option<Directions>,
}

impl Texture {
    /// Places the requested textures on a part whose box (x0, y0, x1, y1 in mm, part frame) is
    /// `part_box_mm` and that is turned by `turn_rad` about the z axis of its frame. Warnings go to
    /// `notes`.
    ///
    /// # Errors
    /// Faults of drawings (`svg-…`), `texture-empty`, `texture-far` (beyond 4 m), `texture-large`,
    /// `texture-area`, `texture-pitch`, `texture-cell`, `texture-order`, `texture-tile`.
    pub fn load(
        requests: &[Request],
        part_box_mm: [f64; 4],
        turn_rad: f64,
        notes: &mut Vec<Diag>,
    ) -> Result<Self, Error> {
        let turn = Turn::new(turn_rad);
        let mut texture = Self { parts: Vec::new(), len: 0, points: 0, bounds: Box2::EMPTY, directions: None };
        for (k, request) in requests.iter().enumerate() {
            let figures = Figures::place(request, part_box_mm, turn, notes).map_err(|e| numbered(&e, k))?;
            texture.bounds = texture.bounds.union(figures.bounds());
            texture.parts.push(Part { figures, pen: request.pen, start: 0 });
            texture.count(k)?;
        }
        if texture.parts.is_empty() { Err(empty().into()) } else { Ok(texture) }
    }

    /// Fills the areas that wait for it with lines. The grid of `directions` covers [`Texture::bounds`].
    ///
    /// # Errors
    /// `texture-empty`, `texture-large`.
    pub fn fill(&mut self, directions: Directions) -> Result<(), Error> {
        for (k, part) in self.parts.iter_mut().enumerate() {
            if let Figures::Contour(area) = &mut part.figures {
                area.fill(&directions).map_err(|e| numbered(&e, k))?;
            }
        }
        self.directions = Some(directions);
        (self.len, self.points) = (0, 0);
        (0..self.parts.len()).try_for_each(|k| self.count(k))
    }

    /// Puts the strokes of part `k` after those of the parts before it.
    fn count(&mut self, k: usize) -> Result<(), Error> {
        let part = &mut self.parts[k];
        let waits = matches!(part.figures, Figures::Contour(_)) && self.directions.is_none();
        part.start = self.len;
        self.len += part.figures.len();
        self.points += part.figures.points();
        if self.len == part.start && !waits {
            return Err(numbered(&empty().into(), k));
        }
        if self.len > MAX_STROKES || self.points > MAX_POINTS {
            return Err(too_large(self.len, self.points).into());
        }
        Ok(())
    }

    /// The areas that are filled along contours, each with the indices of its strokes.
    pub fn contours(&self) -> impl Iterator<Item = (Range<usize>, &Contour)> {
        self.parts.iter().filter_map(|p| match &p.figures {
            Figures::Contour(f) => Some((p.start as usize..(p.start + f.len()) as usize, f)),
            _ => None,
        })
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

    /// The box of all strokes, turned part frame.
    pub fn bounds(&self) -> Box2 {
        self.bounds
    }

    /// Writes the points of stroke `i` (at least two, neighbours differ) into `out`, which is cleared,
    /// and answers with the index of its pen. A closed figure ends on the point it starts with.
    ///
    /// # Panics
    /// Where `i` is not below [`Texture::len`].
    pub fn stroke(&self, i: usize, out: &mut Vec<P2>) -> u16 {
        out.clear();
        let (k, i) = self.find(i);
        let part = &self.parts[k];
        match &part.figures {
            Figures::Hatch(f) => f.stroke(i, out),
            Figures::Contour(f) => f.stroke(i, out),
            Figures::Hilbert(f) => f.stroke(out),
            Figures::Loops(f) => f.stroke(i, out),
            Figures::Drawing(f) => f.stroke(i, out),
        }
        part.pen
    }

    /// What stroke `i` comes from, for messages: texture number, element, tile.
    ///
    /// # Panics
    /// Where `i` is not below [`Texture::len`].
    pub fn element(&self, i: usize) -> String {
        let (k, i) = self.find(i);
        let what = match &self.parts[k].figures {
            Figures::Hatch(f) => f.element(i),
            Figures::Contour(f) => f.element(i),
            Figures::Hilbert(_) => "hilbert curve".to_owned(),
            Figures::Loops(f) => f.element(i),
            Figures::Drawing(f) => f.element(i),
        };
        format!("texture {}, {what}", k + 1)
    }

    /// The part that holds stroke `i`, and the stroke's index in it.
    fn find(&self, i: usize) -> (usize, u64) {
        let i = i as u64;
        assert!(i < self.len, "stroke {i} of {}", self.len);
        let k = self.parts.partition_point(|p| p.start <= i) - 1;
        (k, i - self.parts[k].start)
    }
}

impl Figures {
    fn place(request: &Request, part_box: [f64; 4], turn: Turn, notes: &mut Vec<Diag>) -> Result<Self, Error> {
        let area = match request.area {
            Area::Part | Area::Unlimited => part_box,
            Area::Rectangle(r) => r,
        };
        if request.area != Area::Unlimited || !matches!(request.kind, Kind::Drawing { .. }) {
            place::check_area(area, turn)?;
        }
        let tolerance = request.tolerance_mm.max(place::NM);
        Ok(match &request.kind {
            Kind::Hatch { pitch_mm, direction_rad } => Self::Hatch(Hatch::new(area, *pitch_mm, *direction_rad, turn)?),
            Kind::Contour { pitch_mm, phase } => Self::Contour(Contour::new(area, *pitch_mm, *phase, turn)?),
            Kind::Hilbert { order } => Self::Hilbert(Hilbert::new(area, *order, turn)?),
            Kind::Squares { cell_mm, pitch_mm } => Self::Loops(Loops::squares(area, *cell_mm, *pitch_mm, turn)?),
            Kind::Circles { cell_mm, pitch_mm } => {
                Self::Loops(Loops::circles(area, *cell_mm, *pitch_mm, tolerance, turn)?)
            }
            Kind::Drawing { path, size_mm, origin_mm, turn_rad, tile } => {
                let page = svg::load(path, *size_mm, tolerance, notes)?;
                let limit = (request.area != Area::Unlimited).then_some(area);
                let placed = drawing::Placed::new(page.size, *origin_mm, *turn_rad, limit, part_box, turn);
                let file = path.display().to_string();
                Self::Drawing(Box::new(if *tile {
                    Drawing::tiled(page, &placed, limit, &file)?
                } else {
                    Drawing::single(page, &placed, limit, &file)?
                }))
            }
        })
    }

    fn len(&self) -> u64 {
        match self {
            Self::Hatch(f) => f.len(),
            Self::Contour(f) => f.len(),
            Self::Hilbert(_) => 1,
            Self::Loops(f) => f.len(),
            Self::Drawing(f) => f.len(),
        }
    }

    fn points(&self) -> u64 {
        match self {
            Self::Hatch(f) => 2 * f.len(),
            Self::Contour(f) => 2 * f.len(),
            Self::Hilbert(f) => f.points(),
            Self::Loops(f) => f.points(),
            Self::Drawing(f) => f.points(),
        }
    }

    fn bounds(&self) -> Box2 {
        match self {
            Self::Hatch(f) => f.bounds(),
            Self::Contour(f) => f.bounds(),
            Self::Hilbert(f) => f.bounds(),
            Self::Loops(f) => f.bounds(),
            Self::Drawing(f) => f.bounds(),
        }
    }
}

/// The same error; what has no place says which texture it speaks of.
fn numbered(e: &Error, k: usize) -> Error {
    let mut diags = e.diags().to_vec();
    for d in diags.iter_mut().filter(|d| d.place == Place::Nowhere) {
        d.message = format!("texture {}: {}", k + 1, d.message);
    }
    Error::many(diags)
}

fn empty() -> Diag {
    Diag::input("texture-empty", "the texture holds nothing to mark")
        .hint("check that its area holds at least one line or cell, and that a drawing lies in its area")
}

fn too_large(strokes: u64, points: u64) -> Diag {
    let text = format!(
        "the textures have {strokes} strokes and about {points} points, more than {MAX_STROKES} strokes or {MAX_POINTS} points"
    );
    Diag::limit("texture-large", text).hint("use a larger pitch, a larger tolerance or a smaller area")
}

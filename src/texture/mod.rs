//! What is to be marked: strokes on the nanometre grid of the turned part frame.

use std::path::PathBuf;

use crate::diag::{Diag, Error};
use crate::geom::{Box2, P2};

/// Where a texture lies, part frame, mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Area {
    /// The part's box seen from the lens.
    Part,
    /// x0, y0, x1, y1.
    Rectangle([f64; 4]),
    /// No limit.
    Unlimited,
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Parallel lines.
    Hatch { pitch_mm: f64, direction_rad: f64 },
    /// One Hilbert curve of 4^order points.
    Hilbert { order: u32 },
    /// Square loops of side `cell_mm`.
    Squares { cell_mm: f64, pitch_mm: f64 },
    /// Circles of diameter `cell_mm`.
    Circles { cell_mm: f64, pitch_mm: f64 },
    /// An SVG drawing.
    Drawing { path: PathBuf, size_mm: Option<[f64; 2]>, origin_mm: Option<[f64; 2]>, turn_rad: f64, tile: bool },
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

/// All strokes of a job, made anew on request: nothing is held that can be computed.
pub struct Texture {}

impl Texture {
    /// Places the requested textures on a part whose box (x0, y0, x1, y1 in mm, part frame) is
    /// `part_box_mm` and that is turned by `turn_rad` about the z axis of its frame.
    ///
    /// # Errors
    /// Faults of drawings, empty textures, textures beyond 4 m.
    pub fn load(
        requests: &[Request],
        part_box_mm: [f64; 4],
        turn_rad: f64,
        notes: &mut Vec<Diag>,
    ) -> Result<Self, Error> {
        let _ = (requests, part_box_mm, turn_rad, notes);
        todo!()
    }
    /// How many strokes there are.
    pub fn len(&self) -> usize {
        todo!()
    }
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The box of all strokes, turned part frame.
    pub fn bounds(&self) -> Box2 {
        todo!()
    }
    /// Writes the points of stroke `i` (at least two, neighbours differ) into `out`, which is cleared,
    /// and answers with the index of its pen. A closed figure ends on the point it starts with.
    pub fn stroke(&self, i: usize, out: &mut Vec<P2>) -> u16 {
        let _ = (i, out);
        todo!()
    }
    /// What stroke `i` comes from, for messages: texture number, element, tile.
    pub fn element(&self, i: usize) -> String {
        let _ = i;
        todo!()
    }
}

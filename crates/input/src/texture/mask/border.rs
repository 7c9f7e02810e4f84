//! The border of an area, and polylines cut at it.

use super::soft::{PieceId, Soft};
use crate::texture::artwork::{Cutter, Keep, PolygonArea};
use crate::texture::clip::Polylines;
use terrace_core::geom::{BoxMm, PlanePoint};

/// Fewest and most columns and rows of cells.
const CELLS: [f64; 2] = [64.0, 1024.0];

/// On which side of the border a cell or a point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BorderSide {
    /// The border passes.
    Both,
    /// The side on which strokes are marked.
    Kept,
    /// The side on which they are not.
    Lost,
}

/// The border of an area, turned part frame, mm.
#[derive(Debug)]
pub(in crate::texture) struct Border {
    cutter: Cutter,
    keep: Keep,
    /// The side of each cell of the cutter's index.
    sides: Vec<BorderSide>,
    soft: Option<Soft>,
}

impl Border {
    /// What lies inside is kept.
    pub(super) fn inside(area: &PolygonArea) -> Self {
        Self::new(area, Keep::Inside)
    }

    /// What lies outside is kept.
    pub(super) fn outside(area: &PolygonArea) -> Self {
        Self::new(area, Keep::Outside)
    }

    fn new(area: &PolygonArea, keep: Keep) -> Self {
        let contours: Vec<Vec<PlanePoint>> = area.contours().cloned().collect();
        let side = (4.0 * (area.edge_count() as f64).sqrt()).clamp(CELLS[0], CELLS[1]) as usize;
        let cutter = Cutter::with_cells(&contours, [side; 2]);
        let mut border = Self { cutter, keep, sides: Vec::new(), soft: None };
        let cells = border.cutter.cells();
        let mut sides = Vec::with_capacity(cells.count[0] * cells.count[1]);
        for cell in 0..cells.count[0] * cells.count[1] {
            let is_first = cell % cells.count[0] == 0;
            sides.push(match (cells.edges_of(cell), sides.last()) {
                ([_, ..], _) => BorderSide::Both,
                // No border passes between two cells that it does not meet.
                ([], Some(&before @ (BorderSide::Kept | BorderSide::Lost))) if !is_first => before,
                ([], _) => border.side(cells.centre(cell)),
            });
        }
        border.sides = sides;
        border
    }

    /// The same border, which marks reach less and less over a width; 0 for a sharp one.
    #[must_use]
    pub(super) fn softened(mut self, width: f64, seed: u64) -> Self {
        let BoxMm { lo, hi } = self.cutter.cells().bounds;
        let size = [hi[0] - lo[0], hi[1] - lo[1]];
        self.soft = (width > 0.0).then(|| Soft::new(self.cutter.edges(), size, width, seed));
        self
    }

    /// The side of a point that does not lie on the border.
    fn side(&self, p: PlanePoint) -> BorderSide {
        match self.cutter.holds(p) {
            None => BorderSide::Both,
            Some(inside) if inside == (self.keep == Keep::Inside) => BorderSide::Kept,
            Some(_) => BorderSide::Lost,
        }
    }

    /// Appends what is marked of stroke `stroke`, in its direction.
    pub(super) fn cut(&self, line: &[PlanePoint], stroke: u64, scratch: &mut Polylines, out: &mut Polylines) {
        let side = self.side_of(BoxMm::of(line.iter().copied()));
        let Some(soft) = &self.soft else {
            return match side {
                BorderSide::Kept => out.push(line),
                BorderSide::Lost => {}
                BorderSide::Both => self.cutter.cut(line, self.keep, out),
            };
        };
        scratch.clear();
        match side {
            BorderSide::Kept => scratch.push(line),
            BorderSide::Lost => return,
            BorderSide::Both => self.cutter.cut(line, self.keep, scratch),
        }
        for (k, piece) in scratch.iter().enumerate() {
            soft.fade(self.cutter.edges(), piece, PieceId { stroke, piece: k as u64 }, out);
        }
    }

    /// The side of all of a small box, as far as the cells say.
    fn side_of(&self, bounds: BoxMm<2>) -> BorderSide {
        let cells = self.cutter.cells();
        if cells.is_far(bounds.lo, bounds.hi) {
            return if self.keep == Keep::Inside { BorderSide::Lost } else { BorderSide::Kept };
        }
        let [columns, rows] = [0, 1].map(|k| cells.index(k, bounds.lo[k])..=cells.index(k, bounds.hi[k]));
        if columns.end() - columns.start() > 3 || rows.end() - rows.start() > 3 || !cells.holds_box(bounds) {
            return BorderSide::Both;
        }
        let mut sides =
            rows.flat_map(|row| columns.clone().map(move |column| self.sides[row * cells.count[0] + column]));
        let first = sides.next().unwrap_or(BorderSide::Both);
        if sides.all(|side| side == first) { first } else { BorderSide::Both }
    }
}

//! A drawing as its author sees it: lines and areas in the order of painting, each with its colour and labels.
//!
//! Readers (`svg`, `dxf`) make an [`Artwork`]; [`marks()`] turns it into the lines that are marked: what lies below
//! other areas is left out, areas are hatched or outlined, and colours and labels choose the pens. Everything is f64 in
//! mm on a page whose lower left corner is the origin, y up.

mod area;
mod choice;
mod coverage;
mod crossings;
mod cut;
mod dot_screen;
mod flatten;
mod hatch;
mod light;
mod marking;
mod marks;
mod paper;
mod screen;

use std::ops::Range;

pub(super) use area::{Polygon, PolygonArea};
pub(super) use choice::{Class, classes, selectors};
pub(super) use crossings::TooMany;
pub(super) use cut::{Cells, Cutter, Keep};
pub(super) use flatten::{MAX_MM, MAX_POINTS, Stop, arc_steps, counted, disc, steps};
pub(super) use hatch::{LevelHatch, LineSet, OWN_LINE_SHARES, extent_across};
pub(super) use marking::Weight;
pub use marking::{ContourPass, FillMode, Marking, Mirror, Resolution, Screen, Selector, StrokeMode, Tone};
pub(super) use marks::{DIFFUSION_HINT, Page, UnfilledAreas, marks};
pub use paper::Paper;
pub(crate) use paper::lightness;
pub(super) use screen::Grey;

use super::clip::Polylines;
use terrace_core::geom::BoxMm;

/// A drawing before it is said how it is marked.
#[derive(Debug, Default)]
pub(super) struct Artwork {
    /// Width and height of the page, mm.
    pub(super) size: [f64; 2],
    /// Where the page's lower left corner lies in the part frame unless the job says otherwise, mm; None where the
    /// drawing has no coordinates of its own.
    pub(super) corner: Option<[f64; 2]>,
    /// In the order of painting: later shapes lie over earlier ones.
    pub(super) shapes: Vec<PaintedShape>,
    /// The polylines that shapes refer to, page mm.
    pub(super) lines: Polylines,
    /// The areas that shapes are cut at, page mm.
    pub(super) clips: Vec<PolygonArea>,
    /// The pictures that shapes refer to; each fills the page.
    pub(super) greys: Vec<Grey>,
    /// The dark share of a picture of two tones whose dark areas the shapes are.
    pub(super) dark_share: Option<f64>,
    /// What elements are called in messages: their id, or tag and number.
    pub(super) names: Vec<String>,
    /// Sets of labels by which shapes can be chosen.
    pub(super) labels: Vec<Labels>,
}

/// The labels of an element, such as `layer:Grain`, `id:rim`, `class:fine`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Labels {
    /// Index of the set of the element that holds it.
    pub(super) parent: Option<u32>,
    /// The labels of the shape itself.
    pub(super) own: Vec<String>,
}

impl Artwork {
    /// Whether something may be hatched.
    pub(super) fn has_areas(&self) -> bool {
        self.shapes.iter().any(|s| s.figure != ShapeFigure::Lines)
    }

    /// Gives the page another size.
    pub(super) fn stretch(&mut self, size: [f64; 2]) {
        let factor = [0, 1].map(|k| if self.size[k] > 0.0 { size[k] / self.size[k] } else { 1.0 });
        self.lines.points.iter_mut().for_each(|p| *p = [p[0] * factor[0], p[1] * factor[1]]);
        self.corner = self.corner.map(|c| [c[0] * factor[0], c[1] * factor[1]]);
        self.size = size;
    }

    /// Makes the page the box of the lines, and moves them there from their own coordinates.
    pub(super) fn fit_page(&mut self) {
        if !self.lines.points.is_empty() {
            let all = BoxMm::of(self.lines.points.iter().copied());
            self.lines.points.iter_mut().for_each(|p| *p = [p[0] - all.lo[0], p[1] - all.lo[1]]);
            (self.size, self.corner) = (all.size(), Some(all.lo));
        }
    }

    /// Mirrors the page about its middle.
    pub(super) fn mirror(&mut self, mirror: Mirror) {
        let axis = if mirror == Mirror::X { 0 } else { 1 };
        let side = self.size[axis];
        self.lines.points.iter_mut().for_each(|p| p[axis] = side - p[axis]);
        self.clips.iter_mut().for_each(|clip| clip.mirror(axis, side));
        self.greys.iter_mut().for_each(|grey| grey.mirror(axis));
    }

    /// All labels of a set, from the element outwards.
    pub(super) fn labels(&self, set: u32) -> impl Iterator<Item = &String> + Clone {
        let outer = |l: &&Labels| l.parent.map(|p| &self.labels[p as usize]);
        std::iter::successors(self.labels.get(set as usize), outer).flat_map(|l| &l.own)
    }
}

/// One line or area of one colour.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PaintedShape {
    /// Index of its element's name.
    pub(super) name: u32,
    /// Index of its set of labels.
    pub(super) labels: u32,
    pub(super) colour: Colour,
    /// From 0, not seen, to 1, opaque.
    pub(super) opacity: f32,
    pub(super) figure: ShapeFigure,
    /// The polylines of the shape among those of the artwork.
    pub(super) lines: Range<usize>,
    /// Index of the area that it is cut at.
    pub(super) clip: Option<u32>,
}

/// Red, green, blue.
pub(super) type Colour = [u8; 3];

/// White, which is the page whatever [`Paper`] says: what is painted in a colour of the page hides what lies below, and
/// is not marked unless `pens` or `only` name its colour.
pub(super) const WHITE: Colour = [255; 3];

/// What the polylines of a shape mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShapeFigure {
    /// They are marked along themselves.
    Lines,
    /// They bound a filled area; open ones are closed by a straight line.
    Fill(WindingRule),
    /// They bound the area of a wide line.
    Stroke,
    /// The picture of this index, by lines; it has no polylines.
    Grey(u32),
}

/// Which points the contours of an area hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WindingRule {
    /// The places that the contours go round, one way more often than the other.
    NonZero,
    /// The places that the contours go round an odd number of times.
    EvenOdd,
}

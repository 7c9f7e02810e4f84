//! A drawing as its author sees it: lines and areas in the order of painting, each with its colour and labels.
//!
//! Readers (`svg`, `dxf`) make an [`Artwork`]; [`marks`] turns it into the lines that are marked: what lies below
//! other areas is left out, areas are hatched or outlined, and colours and labels choose the pens. Everything is f64 in
//! mm on a page whose lower left corner is the origin, y up.


use std::ops::Range;


use super::clip::Lines;

/// A drawing before it is said how it is marked.
#[derive(Debug, Default)]
pub(super) struct Artwork {
    /// Width and height of the page, mm.
    pub(super) size: [f64; 2],
    /// Where the page's lower left corner lies in the part frame unless the job says otherwise, mm; None where the
    /// drawing has no coordinates of its own.
    pub(super) corner: Option<[f64; 2]>,
    /// In the order of painting: later shapes lie over earlier ones.
    pub(super) shapes: Vec<Shape>,
    /// The polylines that shapes refer to, page mm.
    pub(super) lines: Lines,
    /// The areas that shapes are cut at, page mm.
    pub(super) clips: Vec<()>,
    /// What elements are called in messages: their id, or tag and number.
    pub(super) names: Vec<String>,
    /// Sets of labels by which shapes can be chosen, such as `layer:Grain`, `id:rim`, `class:fine`.
    pub(super) labels: Vec<Vec<String>>,
}

/// One line or area of one colour.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape {
    /// Index of its element's name.
    pub(super) name: u32,
    /// Index of its set of labels.
    pub(super) labels: u32,
    pub(super) colour: Colour,
    pub(super) figure: Figure,
    /// Its polylines among those of the artwork.
    pub(super) lines: Range<usize>,
    /// Index of the area that it is cut at.
    pub(super) clip: Option<u32>,
}

/// Red, green, blue.
pub(super) type Colour = [u8; 3];

/// The colour of the page: what is painted in it hides what lies below, and is not marked unless a pen is given to it.
pub(super) const WHITE: Colour = [255; 3];

/// What the polylines of a shape mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Figure {
    /// They are marked along themselves.
    Lines,
    /// They bound a filled area; open ones are closed by a straight line.
    Fill(Rule),
    /// They bound the area of a wide line.
    Stroke,
}

/// Which points the contours of an area hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// Those that the contours go round, one way more often than the other.
    NonZero,
    /// Those that the contours go round an odd number of times.
    EvenOdd,
}

//! `[[texture]]` as written.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::job::direction::Direction;
use crate::job::file_unit::FileUnit;
use crate::texture::kind::Lattice;
use crate::texture::pattern::Pattern;
use crate::texture::{Align, ContourPass, FillMode, Fit, Mirror, OnDistance, Screen, StrokeMode};
use terrace_core::units::{Angle, Length, Share, positive, positive_option};

/// Where a texture lies: over the whole part, or in a rectangle [x0, y0, x1, y1] of the part frame.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum AreaKeys {
    /// `"part"`.
    Named(AreaName),
    /// Lower left and upper right corner.
    Rectangle([Length; 4]),
}

/// Areas with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AreaName {
    /// The part's box seen from the lens.
    Part,
}

/// `[[texture]]`: a pattern, a drawing or space curves, where it lies, and its pen.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TextureKeys {
    /// A generated pattern, see below.
    #[schemars(example = &"hatch", extend("x-default" = "this, `file` or `curves`"))]
    #[serde(default)]
    pub pattern: Option<Pattern>,
    /// A drawing (`.svg`, `.svgz`, `.dxf`, `.plt`, `.hpgl`) or a [bitmap](#bitmaps): PNG, TIFF, BMP or JPEG.
    #[schemars(example = &"drawing.svg", extend("x-value" = "path", "x-default" = "see `pattern`"))]
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// [Space curves](#space-curves) on the surface, in the frame of its file: `.csv` (`.txt`, `.xyz`) or `.dxf`.
    #[schemars(example = &"curves.csv", extend("x-value" = "path", "x-default" = "see `pattern`"))]
    #[serde(default)]
    pub curves: Option<PathBuf>,
    /// Where the texture lies; "part" is the box of the surface file in plan. Drawings are cut at it.
    #[schemars(example = ["-30 mm", "-25 mm", "30 mm", "25 mm"], extend("x-value" = "\"part\" or [x0, y0, x1, y1] as lengths", "x-default" = "patterns: \"part\"; drawings: no limit"))]
    #[serde(default)]
    pub area: Option<AreaKeys>,
    /// Hatch, drawings: distance between lines. Cells, honeycomb: between centres. Riblets: between grooves.
    /// Concentric, spiral: between circles or turns. Dots: between sites. Poisson: least distance.
    #[schemars(example = &"0.5 mm", extend("x-default" = "required but for hilbert; drawings: half the spot"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub pitch: Option<Length>,
    /// Hatch, riblets: direction of the lines from +x, counter-clockwise. Drawings: direction of the lines that fill
    /// areas. Hatch, drawings: "contour" turns them along the level lines of every section.
    #[schemars(example = &"0 deg", extend("x-default" = "\"0 deg\""))]
    #[serde(default)]
    pub direction: Option<Direction>,
    /// Hilbert: a curve of 4^order points.
    #[schemars(example = 8, extend("x-value" = "1 to 13", "x-default" = "required for hilbert"))]
    #[serde(default)]
    pub order: Option<u32>,
    /// Squares: side. Circles, rings: (outer) diameter. Hexagons: width across flats. Crosses, jerusalem: width from
    /// tip to tip. Riblets: width of a groove.
    #[schemars(example = &"0.6 mm", extend("x-default" = "required where it applies"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub cell: Option<Length>,
    /// Cells, dots: how their centres lie.
    #[schemars(extend("x-default" = "hexagons: \"hex\"; other cells: \"square\""))]
    #[serde(default)]
    pub lattice: Option<Lattice>,
    /// Crosses, jerusalem: width of the arms, and of the bars.
    #[schemars(example = &"0.1 mm", extend("x-default" = "required for crosses, jerusalem"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub width: Option<Length>,
    /// Jerusalem: length of the bars across the ends of the arms.
    #[schemars(example = &"0.3 mm", extend("x-default" = "required for jerusalem"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub bar: Option<Length>,
    /// Rings: inner diameter.
    #[schemars(example = &"0.4 mm", extend("x-default" = "required for rings"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub inner: Option<Length>,
    /// Riblets: distance between the lines in a groove, at most `cell`.
    #[schemars(example = &"0.02 mm", extend("x-default" = "required for riblets"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub line: Option<Length>,
    /// Concentric, spiral: part-frame position of the centre, in the area or beside it.
    #[schemars(example = ["0 mm", "0 mm"], extend("x-default" = "middle of the area"))]
    #[serde(default)]
    pub centre: Option<[Length; 2]>,
    /// Dots: how far a dot may lie from its site, in percent of half a pitch.
    #[schemars(example = &"50 %", extend("x-value" = "0 % to 100 %", "x-default" = "\"0 %\""))]
    #[serde(default)]
    pub jitter: Option<Share>,
    /// Dots, poisson, bitmaps with `screen = "noise"`, and `soft`: seed of the random places.
    #[schemars(example = 1, extend("x-default" = "0"))]
    #[serde(default)]
    pub seed: Option<u64>,
    /// Drawings: width and height that the whole page gets. This, `fit` or, for bitmaps, `dpi` is required where the
    /// file has no physical size.
    #[schemars(example = ["50 mm", "50 mm"], extend("x-default" = "the drawing's own"))]
    #[serde(default)]
    pub size: Option<[Length; 2]>,
    /// Drawings: how many times as large as its file says the page is; not together with `size` or `fit`.
    #[schemars(example = 2.0, extend("x-value" = "number above 0", "x-default" = "1"))]
    #[serde(default)]
    pub scale: Option<f64>,
    /// Drawings: size of the page from that of `area`, or of the part's box, see below; not together with `size`,
    /// `scale`, `dpi` or `origin`.
    #[serde(default)]
    pub fit: Option<Fit>,
    /// Drawings: where in `area`, or in the part's box, the page lies; not together with `origin`.
    #[schemars(extend("x-default" = "with `fit`: \"centre\""))]
    #[serde(default)]
    pub align: Option<Align>,
    /// Only what lies inside an area of a drawing is marked: `"mask.svg#outline"`, placed by the keys of this texture,
    /// or a table with keys of its own; see below.
    #[schemars(example = &"mask.svg#outline", extend("x-value" = "\"FILE#NAME\", or a table", "x-default" = "everywhere"))]
    #[serde(default)]
    pub inside: Option<MaskKeys>,
    /// What lies inside an area of a drawing is not marked, as with `inside`.
    #[schemars(example = &"mask.svg#holes", extend("x-value" = "\"FILE#NAME\", or a table"))]
    #[serde(default)]
    pub outside: Option<MaskKeys>,
    /// Width over which marks fade at the border of `inside` and `outside`.
    #[schemars(example = &"2 mm", extend("x-default" = "a sharp border"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub soft: Option<Length>,
    /// DXF drawings, curves: a unit of the file. Required where it states none, as CSV.
    #[schemars(example = &"mm", extend("x-default" = "the file's own"))]
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Drawings: part-frame position of the page's lower left corner.
    #[schemars(example = ["0 mm", "0 mm"], extend("x-default" = "lower left of `area`; without an area the page is centred on the part's box"))]
    #[serde(default)]
    pub origin: Option<[Length; 2]>,
    /// Drawings: rotation of the page, counter-clockwise: about its lower left corner where that is placed, by `origin`
    /// or by default; with `align` the turned page is aligned.
    #[schemars(example = &"90 deg")]
    #[serde(default)]
    pub turn: Angle,
    /// Drawings: mirror the page about its middle, before it is turned; "x" exchanges left and right, "y" top and
    /// bottom.
    #[serde(default, deserialize_with = "mirror_axis")]
    pub mirror: Option<Mirror>,
    /// Drawings: repeat the page over `area`, which is then required. Tiles at its border are cut.
    #[serde(default)]
    pub tile: bool,
    /// Drawings: how strokes are marked, see below.
    #[schemars(extend("x-default" = "\"shown\""))]
    #[serde(default)]
    pub stroke: Option<StrokeMode>,
    /// Drawings: how filled areas are marked, see below.
    #[schemars(extend("x-default" = "\"hatch\""))]
    #[serde(default)]
    pub fill: Option<FillMode>,
    /// Drawings: a second set of lines at a right angle to the first in filled areas.
    #[serde(default)]
    pub cross: bool,
    /// Drawings: all lines of filled areas run along `direction`; else neighbours run in opposite directions.
    #[serde(default)]
    pub one_way: bool,
    /// Drawings: distance of the lines of filled areas from their border.
    #[schemars(example = &"0.01 mm", extend("x-default" = "half the spot"))]
    #[serde(default)]
    pub inset: Option<Length>,
    /// Drawings: whether the contour of a hatched area is marked too, `inset` inside, before or after its lines.
    #[schemars(extend("x-default" = "\"none\""))]
    #[serde(default)]
    pub contour: Option<ContourPass>,
    /// Drawings, curves: whether elements that cannot be reproduced refuse the job, or are left out with a warning.
    #[schemars(extend("x-default" = "\"error\""))]
    #[serde(default)]
    pub on_unsupported: Option<OnUnsupported>,
    /// Drawings, curves: pens by colour (`"#ff0000"`, `"red"`) or label (`"layer:Grain"`, `"id:rim"`, `"class:fine"`),
    /// see below. All else is marked with `pen`.
    #[schemars(example = BTreeMap::from([("#ff0000", "fill")]), extend("x-value" = "table of colours and labels with their pens"))]
    #[serde(default)]
    pub pens: BTreeMap<String, String>,
    /// Drawings, curves: only these colours and labels are read.
    #[schemars(example = ["layer:Grain"], extend("x-value" = "list of colours and labels", "x-default" = "all"))]
    #[serde(default)]
    pub only: Vec<String>,
    /// Drawings, curves: these colours and labels are left out.
    #[schemars(example = ["layer:Notes"], extend("x-value" = "list of colours and labels"))]
    #[serde(default)]
    pub except: Vec<String>,
    /// Drawings: which colours are the page, which hides what lies below it and is not marked: a colour and what lies
    /// between it and white, or a CIE lightness; see below.
    #[schemars(example = &"#fefefe", extend("x-value" = "a colour, or 50 to 100", "x-default" = "98"))]
    #[serde(default)]
    pub paper: Option<PaperKeys>,
    /// Bitmaps: pixels per inch; "file" takes what the file states.
    #[schemars(example = 300, extend("x-value" = "number, or \"file\"", "x-default" = "this or `size` for bitmaps"))]
    #[serde(default)]
    pub dpi: Option<DpiKeys>,
    /// Bitmaps: the density of a sample from 0 (black) to 1 (white) is 1 - sample^gamma.
    #[schemars(example = 2.2, extend("x-value" = "0.01 to 100", "x-default" = "1"))]
    #[serde(default)]
    pub gamma: Option<f64>,
    /// Bitmaps: mark what is light.
    #[serde(default)]
    pub invert: bool,
    /// Bitmaps: how grey becomes marks. Lines, dashes and dots lie at `pitch`, by default the spot, along `direction`.
    #[schemars(extend("x-default" = "\"threshold\""))]
    #[serde(default)]
    pub screen: Option<Screen>,
    /// Bitmaps with `screen = "threshold"`: density above which an area is marked.
    #[schemars(example = &"50 %", extend("x-value" = "percent below 100", "x-default" = "\"50 %\""))]
    #[serde(default)]
    pub threshold: Option<Share>,
    /// Bitmaps with `screen = "dashes"`: distance of the dashes on their line; with "halftone": side of the cells.
    #[schemars(example = &"0.2 mm", extend("x-default" = "ten pitches"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub period: Option<Length>,
    /// Curves: how far a curve may lie above or below the surface.
    #[schemars(example = &"0.1 mm", extend("x-default" = "half of `focus.pdof`"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub max_distance: Option<Length>,
    /// Curves: whether a curve farther from the surface refuses the job, or is marked where the lens sees it, with a
    /// warning.
    #[schemars(extend("x-default" = "\"error\""))]
    #[serde(default)]
    pub on_distance: Option<OnDistance>,
    /// Largest distance between a curve and the polyline that is marked.
    #[serde(default = "default_tolerance", deserialize_with = "positive")]
    pub tolerance: Length,
    /// The pen it is marked with.
    #[schemars(example = &"fill", extend("x-value" = "name", "x-default" = "the first pen"))]
    #[serde(default)]
    pub pen: Option<String>,
}

/// The area of a drawing: its file, with `#` and the id, layer, class or block that makes the area; or a table.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum MaskKeys {
    /// Placed as a drawing with the keys of the texture.
    Named(String),
    /// Placed by keys of its own.
    Placed(Box<PlacedMaskKeys>),
}

/// The area of a drawing, and where that lies; the keys are those of a drawing.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacedMaskKeys {
    /// The drawing, relative to the job file, with `#` and the id, layer, class or block that makes the area.
    pub file: String,
    /// Width and height that the whole page gets.
    #[serde(default)]
    pub size: Option<[Length; 2]>,
    /// How many times as large as its file states.
    #[serde(default)]
    pub scale: Option<f64>,
    /// How large its page becomes in the part's box.
    #[serde(default)]
    pub fit: Option<Fit>,
    /// Which side or corner of the part's box the page touches.
    #[serde(default)]
    pub align: Option<Align>,
    /// A drawing unit of a DXF file.
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Part-frame position of the page's lower left corner.
    #[serde(default)]
    pub origin: Option<[Length; 2]>,
    /// Turn of the page, counter-clockwise.
    #[serde(default)]
    pub turn: Angle,
    /// Mirror the page about its middle, before it is turned.
    #[serde(default, deserialize_with = "mirror_axis")]
    pub mirror: Option<Mirror>,
}

impl TextureKeys {
    /// Whether it lies in a rectangle of its own.
    pub fn has_rectangle(&self) -> bool {
        matches!(self.area, Some(AreaKeys::Rectangle(_)))
    }

    /// The files that it names.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let masks = [&self.inside, &self.outside].into_iter().flatten().map(|mask| PathBuf::from(mask.file().0));
        self.file.clone().into_iter().chain(self.curves.clone()).chain(masks)
    }
}

impl MaskKeys {
    /// File, and the name of what makes the area.
    pub fn file(&self) -> (&str, Option<&str>) {
        let text = match self {
            Self::Named(text) => text,
            Self::Placed(keys) => &keys.file,
        };
        // A name follows the last part of a path, and may hold # itself.
        let folder = text.rfind(['/', '\\']).map_or(0, |at| at + 1);
        match text[folder..].split_once('#') {
            Some((file, name)) => (&text[..folder + file.len()], Some(name)),
            None => (text, None),
        }
    }
}

/// Colours of the page.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged, expecting = "paper is a colour or a lightness; write \"#fefefe\", or a number from 50 to 100")]
pub enum PaperKeys {
    /// CIE L* from which on greys are the page.
    Lightness(f64),
    /// The darkest colour of the page.
    Colour(String),
}

/// Resolution of a bitmap: a number, or `"file"`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum DpiKeys {
    /// Pixels in an inch.
    Number(f64),
    /// From the file.
    Stated(DpiName),
}

/// Resolutions with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DpiName {
    /// What the file states.
    File,
}

/// What is done with elements of a drawing that cannot be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OnUnsupported {
    /// The job is refused.
    #[default]
    Error,
    /// They are left out, with a warning.
    Warn,
}

/// The axis of `mirror`; of `true` and `false`, which name none, it says what to write.
fn mirror_axis<'de, D: Deserializer<'de>>(d: D) -> Result<Option<Mirror>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Written {
        Switch(bool),
        Text(String),
    }
    const WRITE: &str = "write \"x\" (left and right are exchanged) or \"y\" (top and bottom)";
    match Written::deserialize(d).map_err(|_| D::Error::custom(format!("mirror is no axis; {WRITE}")))? {
        Written::Text(axis) if axis == "x" => Ok(Some(Mirror::X)),
        Written::Text(axis) if axis == "y" => Ok(Some(Mirror::Y)),
        Written::Text(other) => Err(D::Error::custom(format!("{other:?} is no axis to mirror along; {WRITE}"))),
        Written::Switch(true) => Err(D::Error::custom(format!("mirror = true does not say along which axis; {WRITE}"))),
        Written::Switch(false) => {
            Err(D::Error::custom(format!("mirror = false does not name an axis; leave it out, or {WRITE}")))
        }
    }
}

fn default_tolerance() -> Length {
    Length::um(1.0)
}

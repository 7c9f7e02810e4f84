//! `[[texture]]` as written.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::job::file_unit::FileUnit;
use crate::texture::direction::Direction;
use crate::texture::pattern::PatternKeys;
use crate::texture::{Align, ContourPass, FillMode, Fit, Mirror, OnDistance, Screen, StrokeMode};
use terrace_core::units::{Angle, Length, Share, positive, positive_option};

/// Where a texture lies: over the whole part, or in a rectangle [x0, y0, x1, y1] of the part frame.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "this is no area; write \"part\", or lengths [x0, y0, x1, y1] with their units, such as [\"0 mm\", \"0 mm\", \"50 mm\", \"40 mm\"]"
)]
pub(crate) enum AreaKeys {
    /// `"part"`.
    Named(AreaName),
    /// Lower left and upper right corner.
    Rectangle([Length; 4]),
}

/// Areas with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum AreaName {
    /// The part's box seen from the lens.
    Part,
}

// A file has all keys in one table; `by_source` sorts them.
/// `[[texture]]`: a pattern, a drawing or space curves, where it lies, and its pen.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TextureKeys {
    /// What is marked.
    #[schemars(flatten)]
    pub source: SourceKeys,
    /// Where, and with which pen.
    #[schemars(flatten)]
    pub common: CommonKeys,
}

/// What a texture is made from.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(untagged)]
pub(crate) enum SourceKeys {
    /// A generated pattern.
    Pattern(PatternKeys),
    /// A drawing or a bitmap.
    File(Box<DrawingKeys>),
    /// Space curves.
    Curves(CurvesKeys),
}

/// The keys that every texture takes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct CommonKeys {
    /// Where the texture lies; "part" is the box of the surface file in plan. Drawings are cut at it.
    #[schemars(example = ["-30 mm", "-25 mm", "30 mm", "25 mm"], extend("x-value" = "\"part\" or [x0, y0, x1, y1] as lengths", "x-default" = "patterns: \"part\"; drawings: no limit"))]
    #[serde(default)]
    pub area: Option<AreaKeys>,
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
    /// Seed of random places: those of dots, poisson, bitmaps with `screen = "noise"`, and of `soft`.
    #[schemars(example = 1, extend("x-default" = "0"))]
    #[serde(default)]
    pub seed: Option<u64>,
    /// Largest distance between a curve and the polyline that is marked.
    #[serde(default = "default_tolerance", deserialize_with = "positive")]
    pub tolerance: Length,
    /// The pen it is marked with.
    #[schemars(example = &"fill", extend("x-value" = "name", "x-default" = "the first pen"))]
    #[serde(default)]
    pub pen: Option<String>,
}

/// The keys of drawings and bitmaps.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[schemars(title = "drawings")]
pub(crate) struct DrawingKeys {
    /// A drawing (`.svg`, `.svgz`, `.dxf`, `.plt`, `.hpgl`) or a [bitmap](#bitmaps): PNG, TIFF, BMP or JPEG.
    #[schemars(example = &"drawing.svg", extend("x-value" = "path", "x-default" = "see `pattern`"))]
    pub file: PathBuf,
    /// Distance between the lines that fill areas.
    #[schemars(example = &"0.5 mm", extend("x-default" = "half the spot"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub pitch: Option<Length>,
    /// Direction of the lines that fill areas, from +x, counter-clockwise; "contour" turns them along the level lines
    /// of every section.
    #[serde(default)]
    pub direction: Direction,
    /// Width and height that the whole page gets. This, `fit` or, for bitmaps, `dpi` is required where the
    /// file has no physical size.
    #[schemars(example = ["50 mm", "50 mm"], extend("x-default" = "the drawing's own"))]
    #[serde(default)]
    pub size: Option<[Length; 2]>,
    /// How many times as large as its file says the page is; not together with `size` or `fit`.
    #[schemars(example = 2.0, extend("x-value" = "number above 0", "x-default" = "1"))]
    #[serde(default)]
    pub scale: Option<f64>,
    /// Size of the page from that of `area`, or of the part's box, see below; not together with `size`,
    /// `scale`, `dpi` or `origin`.
    #[serde(default)]
    pub fit: Option<Fit>,
    /// Where in `area`, or in the part's box, the page lies; not together with `origin`.
    #[schemars(extend("x-default" = "with `fit`: \"centre\""))]
    #[serde(default)]
    pub align: Option<Align>,
    /// A unit of a DXF file. Required where it states none.
    #[schemars(example = &"mm", extend("x-default" = "the file's own"))]
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Part-frame position of the page's lower left corner.
    #[schemars(example = ["0 mm", "0 mm"], extend("x-default" = "lower left of `area`; without an area the page is centred on the part's box"))]
    #[serde(default)]
    pub origin: Option<[Length; 2]>,
    /// Rotation of the page, counter-clockwise: about its lower left corner where that is placed, by `origin`
    /// or by default; with `align` the turned page is aligned.
    #[schemars(example = &"90 deg")]
    #[serde(default)]
    pub turn: Angle,
    /// Mirror the page about its middle, before it is turned; "x" exchanges left and right, "y" top and
    /// bottom.
    #[serde(default, deserialize_with = "mirror_axis")]
    pub mirror: Option<Mirror>,
    /// Repeat the page over `area`, which is then required. Tiles at its border are cut.
    #[serde(default)]
    pub tile: bool,
    /// How strokes are marked, see below.
    #[schemars(extend("x-default" = "\"shown\""))]
    #[serde(default)]
    pub stroke: Option<StrokeMode>,
    /// How filled areas are marked, see below.
    #[schemars(extend("x-default" = "\"hatch\""))]
    #[serde(default)]
    pub fill: Option<FillMode>,
    /// A second set of lines at a right angle to the first in filled areas.
    #[serde(default)]
    pub cross: bool,
    /// All lines of filled areas run along `direction`; else neighbours run in opposite directions.
    #[serde(default)]
    pub one_way: bool,
    /// Distance of the lines of filled areas from their border.
    #[schemars(example = &"0.01 mm", extend("x-default" = "half the spot"))]
    #[serde(default)]
    pub inset: Option<Length>,
    /// Whether the contour of a hatched area is marked too, `inset` inside, before or after its lines.
    #[schemars(extend("x-default" = "\"none\""))]
    #[serde(default)]
    pub contour: Option<ContourPass>,
    /// Whether elements that cannot be reproduced refuse the job, or are left out with a warning.
    #[schemars(extend("x-default" = "\"error\""))]
    #[serde(default)]
    pub on_unsupported: Option<OnUnsupported>,
    /// Pens by colour (`"#ff0000"`, `"red"`) or label (`"layer:Grain"`, `"id:rim"`, `"class:fine"`),
    /// see below. All else is marked with `pen`.
    #[schemars(example = BTreeMap::from([("#ff0000", "fill")]), extend("x-value" = "table of colours and labels with their pens"))]
    #[serde(default)]
    pub pens: BTreeMap<String, String>,
    /// Only these colours and labels are read.
    #[schemars(example = ["layer:Grain"], extend("x-value" = "list of colours and labels", "x-default" = "all"))]
    #[serde(default)]
    pub only: Vec<String>,
    /// These colours and labels are left out.
    #[schemars(example = ["layer:Notes"], extend("x-value" = "list of colours and labels"))]
    #[serde(default)]
    pub except: Vec<String>,
    /// Which colours are the page, which hides what lies below it and is not marked: a colour and what lies
    /// between it and white, or a CIE lightness; see below.
    #[schemars(example = &"#fefefe", extend("x-value" = "a colour, or 50 to 100", "x-default" = "98"))]
    #[serde(default)]
    pub paper: Option<PaperKeys>,
    /// Pixels per inch of a bitmap; "file" takes what the file states.
    #[schemars(example = 300, extend("x-value" = "number, or \"file\"", "x-default" = "this or `size` for bitmaps"))]
    #[serde(default)]
    pub dpi: Option<DpiKeys>,
    /// The density of a sample of a bitmap from 0 (black) to 1 (white) is 1 - sample^gamma.
    #[schemars(example = 2.2, extend("x-value" = "0.01 to 100", "x-default" = "1"))]
    #[serde(default)]
    pub gamma: Option<f64>,
    /// Mark what is light in a bitmap.
    #[serde(default)]
    pub invert: bool,
    /// How grey becomes marks. Lines, dashes and dots lie at `pitch`, by default the spot, along `direction`.
    #[schemars(extend("x-default" = "\"threshold\""))]
    #[serde(default)]
    pub screen: Option<Screen>,
    /// With `screen = "threshold"`: density above which an area is marked.
    #[schemars(example = &"50 %", extend("x-value" = "percent below 100", "x-default" = "\"50 %\""))]
    #[serde(default)]
    pub threshold: Option<Share>,
    /// With `screen = "dashes"`: distance of the dashes on their line; with "halftone": side of the cells.
    #[schemars(example = &"0.2 mm", extend("x-default" = "ten pitches"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub period: Option<Length>,
}

/// The keys of space curves.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[schemars(title = "curves")]
pub(crate) struct CurvesKeys {
    /// [Space curves](#space-curves) on the surface, in the frame of its file: `.csv` (`.txt`, `.xyz`) or `.dxf`.
    #[schemars(example = &"curves.csv", extend("x-value" = "path", "x-default" = "see `pattern`"))]
    pub curves: PathBuf,
    /// A unit of the file. Required where it states none, as CSV.
    #[schemars(example = &"mm", extend("x-default" = "the file's own"))]
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Whether elements that cannot be reproduced refuse the job, or are left out with a warning.
    #[schemars(extend("x-default" = "\"error\""))]
    #[serde(default)]
    pub on_unsupported: Option<OnUnsupported>,
    /// Pens by colour (`"#ff0000"`, `"red"`) or label (`"layer:Grain"`, `"id:rim"`, `"class:fine"`),
    /// see below. All else is marked with `pen`.
    #[schemars(example = BTreeMap::from([("#ff0000", "fill")]), extend("x-value" = "table of colours and labels with their pens"))]
    #[serde(default)]
    pub pens: BTreeMap<String, String>,
    /// Only these colours and labels are read.
    #[schemars(example = ["layer:Grain"], extend("x-value" = "list of colours and labels", "x-default" = "all"))]
    #[serde(default)]
    pub only: Vec<String>,
    /// These colours and labels are left out.
    #[schemars(example = ["layer:Notes"], extend("x-value" = "list of colours and labels"))]
    #[serde(default)]
    pub except: Vec<String>,
    /// How far a curve may lie above or below the surface.
    #[schemars(example = &"0.1 mm", extend("x-default" = "half of `focus.pdof`"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub max_distance: Option<Length>,
    /// Whether a curve farther from the surface refuses the job, or is marked where the lens sees it, with a
    /// warning.
    #[schemars(extend("x-default" = "\"error\""))]
    #[serde(default)]
    pub on_distance: Option<OnDistance>,
}

/// The area of a drawing: its file, with `#` and the id, layer, class or block that makes the area; or a table.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "this is no area of a drawing; write \"mask.svg#outline\", or a table with file and the keys of a drawing"
)]
pub(crate) enum MaskKeys {
    /// Placed as a drawing with the keys of the texture.
    Named(String),
    /// Placed by keys of its own.
    Placed(Box<PlacedMaskKeys>),
}

/// The area of a drawing, and where that lies; the keys are those of a drawing.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlacedMaskKeys {
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
    /// The files that it names.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let CommonKeys { inside, outside, .. } = &self.common;
        let masks = [inside, outside].into_iter().flatten().map(|mask| PathBuf::from(mask.file().0));
        let file = match &self.source {
            SourceKeys::Pattern(_) => None,
            SourceKeys::File(keys) => Some(keys.file.clone()),
            SourceKeys::Curves(keys) => Some(keys.curves.clone()),
        };
        file.into_iter().chain(masks)
    }

    /// The drawing that it is.
    pub fn drawing(&self) -> Option<&DrawingKeys> {
        if let SourceKeys::File(keys) = &self.source { Some(keys) } else { None }
    }

    /// Whether its lines run along contours.
    pub(crate) fn runs_along_contours(&self) -> bool {
        match &self.source {
            SourceKeys::Pattern(PatternKeys::Hatch(keys)) => keys.direction == Direction::Contour,
            SourceKeys::File(keys) => keys.direction == Direction::Contour,
            _ => false,
        }
    }

    /// The pens that it names for colours and labels.
    pub fn pens(&self) -> impl Iterator<Item = &String> {
        let pens = match &self.source {
            SourceKeys::Pattern(_) => None,
            SourceKeys::File(keys) => Some(&keys.pens),
            SourceKeys::Curves(keys) => Some(&keys.pens),
        };
        pens.into_iter().flat_map(BTreeMap::values)
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
pub(crate) enum PaperKeys {
    /// CIE L* from which on greys are the page.
    Lightness(f64),
    /// The darkest colour of the page.
    Colour(String),
}

/// Resolution of a bitmap: a number, or `"file"`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged, expecting = "this is no resolution; write a number of pixels in an inch, or \"file\"")]
pub(crate) enum DpiKeys {
    /// Pixels in an inch.
    Number(f64),
    /// From the file.
    Stated(DpiName),
}

/// Resolutions with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum DpiName {
    /// What the file states.
    File,
}

/// What is done with elements of a drawing that cannot be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum OnUnsupported {
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
    match Written::deserialize(d).map_err(|_| D::Error::custom(format!("mirror is not an axis; {WRITE}")))? {
        Written::Text(axis) if axis == "x" => Ok(Some(Mirror::X)),
        Written::Text(axis) if axis == "y" => Ok(Some(Mirror::Y)),
        Written::Text(other) => Err(D::Error::custom(format!("{other:?} is not an axis to mirror along; {WRITE}"))),
        Written::Switch(true) => Err(D::Error::custom(format!("mirror = true does not say along which axis; {WRITE}"))),
        Written::Switch(false) => {
            Err(D::Error::custom(format!("mirror = false does not name an axis; leave it out, or {WRITE}")))
        }
    }
}

fn default_tolerance() -> Length {
    Length::um(1.0)
}

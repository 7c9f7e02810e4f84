//! `[[texture]]` as written.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::job::direction::Direction;
use crate::job::file_unit::FileUnit;
use crate::texture::pattern::{Lattice, Pattern};
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
    /// A generated pattern; or give `file` or `curves`.
    #[schemars(example = &"hatch")]
    #[serde(default)]
    pub pattern: Option<Pattern>,
    /// A drawing (SVG, DXF, HPGL) or a bitmap (PNG, TIFF, BMP, JPEG), relative to the job file; or give `pattern`.
    #[schemars(example = &"drawing.svg")]
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Space curves (CSV with columns x, y, z, or DXF) in the frame of the surface file, relative to the job file.
    #[schemars(example = &"curves.csv")]
    #[serde(default)]
    pub curves: Option<PathBuf>,
    /// The area: filled by a pattern or by tiles of a drawing, and the limit of a single drawing.
    /// Default for patterns: the part's box. Default for drawings: no limit.
    #[schemars(example = ["-30 mm", "-25 mm", "30 mm", "25 mm"])]
    #[serde(default)]
    pub area: Option<AreaKeys>,
    /// Hatch: distance of lines. Cells and honeycomb: distance of neighbouring centres. Riblets: distance of grooves.
    /// Concentric and spiral: distance of circles or turns. Dots: distance of sites. Poisson: least distance.
    /// Drawing: distance of the lines that fill areas; default: half the spot.
    #[schemars(example = &"0.5 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub pitch: Option<Length>,
    /// Hatch and riblets: direction of the lines from +x, counter-clockwise; hatch also `"contour"`: in every section
    /// along the level lines of the part. Drawing: direction of the lines that fill areas, an angle or `"contour"`.
    #[schemars(example = &"0 deg")]
    #[serde(default)]
    pub direction: Option<Direction>,
    /// Hilbert: 4^order points.
    #[schemars(example = 8)]
    #[serde(default)]
    pub order: Option<u32>,
    /// Squares: side. Circles, rings: (outer) diameter. Hexagons: width across flats. Crosses, jerusalem: width from tip
    /// to tip. Riblets: width of a groove.
    #[schemars(example = &"0.6 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub cell: Option<Length>,
    /// Cells and dots: how their centres lie; default: `"hex"` for hexagons, `"square"` for all others.
    #[serde(default)]
    pub lattice: Option<Lattice>,
    /// Crosses, jerusalem: width of the arms, and of the bars.
    #[schemars(example = &"0.1 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub width: Option<Length>,
    /// Jerusalem: length of the bars across the ends of the arms.
    #[schemars(example = &"0.3 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub bar: Option<Length>,
    /// Rings: inner diameter.
    #[schemars(example = &"0.4 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub inner: Option<Length>,
    /// Riblets: distance of the lines in a groove.
    #[schemars(example = &"0.02 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub line: Option<Length>,
    /// Concentric and spiral: part-frame position of the centre; default: the middle of the area.
    #[schemars(example = ["0 mm", "0 mm"])]
    #[serde(default)]
    pub centre: Option<[Length; 2]>,
    /// Dots: how far a dot may lie from its site, at random; 100 % is half a pitch. Default: 0 %.
    #[schemars(example = &"50 %")]
    #[serde(default)]
    pub jitter: Option<Share>,
    /// Dots, poisson, bitmap with `screen = "noise"`, and with `soft`: what random places follow from; default: 0.
    #[schemars(example = 1)]
    #[serde(default)]
    pub seed: Option<u64>,
    /// Drawing: width and height that the whole page gets; required where the file has no physical size.
    #[schemars(example = ["50 mm", "50 mm"])]
    #[serde(default)]
    pub size: Option<[Length; 2]>,
    /// Drawing: how many times as large as its file states; not together with `size` or `fit`.
    #[schemars(example = 2.0)]
    #[serde(default)]
    pub scale: Option<f64>,
    /// Drawing: how large its page becomes in its area, or in the part's box.
    #[serde(default)]
    pub fit: Option<Fit>,
    /// Drawing: which side or corner of its area, or of the part's box, the page touches; default with `fit`: the middle.
    #[serde(default)]
    pub align: Option<Align>,
    /// Only what lies inside an area of a drawing is marked: `"mask.svg#outline"`, placed by the keys of this texture, or
    /// a table with keys of its own.
    #[schemars(example = &"mask.svg#outline")]
    #[serde(default)]
    pub inside: Option<MaskKeys>,
    /// What lies inside an area of a drawing is not marked.
    #[schemars(example = &"mask.svg#holes")]
    #[serde(default)]
    pub outside: Option<MaskKeys>,
    /// Width over which marks fade at the border of `inside` and `outside`; default: a sharp border.
    #[schemars(example = &"2 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub soft: Option<Length>,
    /// DXF drawing, curves: a unit of the file; required where it states none.
    #[schemars(example = &"mm")]
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Drawing: part-frame position of the page's lower left corner; default: lower left of the area, or,
    /// without an area, the page in the middle of the part.
    #[schemars(example = ["0 mm", "0 mm"])]
    #[serde(default)]
    pub origin: Option<[Length; 2]>,
    /// Drawing: turn of the page about its lower left corner, counter-clockwise.
    #[schemars(example = &"90 deg")]
    #[serde(default)]
    pub turn: Angle,
    /// Drawing: mirror the page about its middle, before it is turned: `"x"` exchanges left and right.
    #[serde(default, deserialize_with = "mirror_axis")]
    pub mirror: Option<Mirror>,
    /// Drawing: repeat the page over the area.
    #[serde(default)]
    pub tile: bool,
    /// Drawing: how strokes are marked.
    #[serde(default)]
    pub stroke: Option<StrokeMode>,
    /// Drawing: how areas are marked; by lines at `pitch` along `direction`.
    #[serde(default)]
    pub fill: Option<FillMode>,
    /// Drawing: a second set of lines crosses the first at a right angle in filled areas.
    #[serde(default)]
    pub cross: bool,
    /// Drawing: all lines of filled areas have one direction; else each is opposite to its neighbours.
    #[serde(default)]
    pub one_way: bool,
    /// Drawing: distance of the lines of filled areas from the border; default: half the spot.
    #[schemars(example = &"0.01 mm")]
    #[serde(default)]
    pub inset: Option<Length>,
    /// Drawing: whether the contour of filled areas is marked too, `inset` inside.
    #[serde(default)]
    pub contour: Option<ContourPass>,
    /// Drawing: what is done with elements that cannot be reproduced.
    #[serde(default)]
    pub on_unsupported: Option<OnUnsupported>,
    /// Drawing: pens by colour (`"#ff0000"`, `"red"`) or label (`"layer:Grain"`, `"id:rim"`, `"class:fine"`); all else is
    /// marked with `pen`.
    #[schemars(example = BTreeMap::from([("#ff0000", "fill")]))]
    #[serde(default)]
    pub pens: BTreeMap<String, String>,
    /// Drawing: the colours and labels that exist; default: all.
    #[schemars(example = ["layer:Grain"])]
    #[serde(default)]
    pub only: Vec<String>,
    /// Drawing: the colours and labels that do not exist.
    #[schemars(example = ["layer:Notes"])]
    #[serde(default)]
    pub except: Vec<String>,
    /// Drawing: which colours are the page, which hides what lies below and is not marked: a colour (`"#fefefe"`: it and
    /// what lies between it and white) or a CIE lightness L* from 50 to 100; default: 98, what the eye cannot tell from
    /// white.
    #[schemars(example = &"#fefefe")]
    #[serde(default)]
    pub paper: Option<PaperKeys>,
    /// Bitmap: pixels in an inch, or `"file"` for what the file states; or give `size`.
    #[schemars(example = 300)]
    #[serde(default)]
    pub dpi: Option<DpiKeys>,
    /// Bitmap: the density of a sample from 0 (black) to 1 (white) is 1 - sample^gamma; default: 1.
    #[schemars(example = 2.2)]
    #[serde(default)]
    pub gamma: Option<f64>,
    /// Bitmap: mark what is light.
    #[serde(default)]
    pub invert: bool,
    /// Bitmap: how grey becomes marks; lines, dashes and dots lie at `pitch`, by default the spot, along `direction`.
    #[serde(default)]
    pub screen: Option<Screen>,
    /// Bitmap with `screen = "threshold"`: density above which an area is marked; default: 50 %.
    #[schemars(example = &"50 %")]
    #[serde(default)]
    pub threshold: Option<Share>,
    /// Bitmap with `screen = "dashes"`: distance of the dashes on their line; with `"halftone"`: side of the cells;
    /// default: ten pitches.
    #[schemars(example = &"0.2 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub period: Option<Length>,
    /// Curves: largest distance from the surface along z; default: half of `focus.pdof`.
    #[schemars(example = &"0.1 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub max_distance: Option<Length>,
    /// Curves: what is done where a curve lies farther from the surface than that.
    #[serde(default)]
    pub on_distance: Option<OnDistance>,
    /// Largest distance between a curve and its polyline.
    #[serde(default = "default_tolerance", deserialize_with = "positive")]
    pub tolerance: Length,
    /// Name of the pen; default: the first.
    #[schemars(example = &"fill")]
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

//! How the lines and areas of a drawing are marked.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use svgtypes::Color;

use super::{Colour, Paper};
use terrace_core::diag::{self, Diag, Error};
use terrace_core::program::PenId;

/// How strokes of a drawing are marked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StrokeMode {
    /// As it looks: strokes wider than one and a half spots are hatched, thinner ones marked along their centre.
    #[default]
    Shown,
    /// Along their centre.
    Centre,
    /// Along the border of the area that they cover.
    Outline,
    /// As areas.
    Hatch,
}

/// How areas of a drawing are marked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FillMode {
    /// By parallel lines.
    #[default]
    Hatch,
    /// By rings along their contours, from outside in.
    Rings,
    /// Along their contours.
    Outline,
    /// Not at all; they hide what lies below all the same.
    None,
}

/// When the contour of a hatched area is marked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ContourPass {
    /// Never.
    #[default]
    None,
    /// Before its hatch.
    Before,
    /// After its hatch.
    After,
}

/// Whether marks show what a drawing shows where it holds something that is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::texture) enum Weight {
    /// They do, or what is missing has no extent, or is marked as viewers show it.
    Warned,
    /// Something that is seen would be missing: refused unless the job asks for warnings.
    Refused,
}

/// How the grey of a bitmap becomes marks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Screen {
    /// What is darker than a threshold is an area.
    #[default]
    Threshold,
    /// By the number of parallel lines.
    Lines,
    /// By the length of dashes on parallel lines.
    Dashes,
    /// By clusters of dots that grow.
    Halftone,
    /// By dots, by the diffusion of errors.
    Diffusion,
    /// By dots, with thresholds of blue noise.
    Noise,
}

impl Screen {
    /// The screen's name in job files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Threshold => "threshold",
            Self::Lines => "lines",
            Self::Dashes => "dashes",
            Self::Halftone => "halftone",
            Self::Diffusion => "diffusion",
            Self::Noise => "noise",
        }
    }

    /// Whether it makes dots.
    pub fn is_of_dots(self) -> bool {
        matches!(self, Self::Halftone | Self::Diffusion | Self::Noise)
    }
}

/// The axis along which a drawing is mirrored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mirror {
    /// Left and right are exchanged.
    X,
    /// Top and bottom are exchanged.
    Y,
}

/// Where a bitmap's resolution comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Pixels in an inch.
    Dpi(f64),
    /// What the file states.
    File,
}

/// What is said of bitmaps alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Where no size is given.
    pub resolution: Option<Resolution>,
    /// The density of a sample is 1 - sample^gamma.
    pub gamma: f64,
    /// Whether light is marked instead of dark.
    pub invert: bool,
    /// How grey becomes marks.
    pub screen: Screen,
    /// Density above which an area is marked, 0 to 1.
    pub threshold: f64,
    /// Distance of dashes on their line, or side of halftone cells, mm; None for ten pitches.
    pub period_mm: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Tone {
    fn default() -> Self {
        let screen = Screen::default();
        Self { resolution: None, gamma: 1.0, invert: false, screen, threshold: 0.5, period_mm: None, seed: 0 }
    }
}

/// What chooses shapes of a drawing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selector {
    /// The shapes of a colour, red, green, blue.
    Colour([u8; 3]),
    /// The shapes with a label, such as `layer:Grain`.
    Label(String),
}

/// How labels begin: of the layers, ids, classes and blocks of drawings, and of the pens of plots.
const LABELS: [&str; 5] = ["layer:", "id:", "class:", "block:", "pen:"];

impl Selector {
    /// What a colour (`#ff0000`, `red`) or a label with its kind (`layer:Grain`) chooses.
    pub fn parse(name: &str) -> Option<Self> {
        let is_label = LABELS.iter().any(|kind| name.len() > kind.len() && name.starts_with(kind));
        if is_label {
            return Some(Self::Label(name.to_owned()));
        }
        Color::from_str(name).ok().filter(|c| c.alpha == 255).map(|c| Self::Colour([c.red, c.green, c.blue]))
    }
}

impl std::fmt::Display for Selector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Colour([r, g, b]) => write!(f, "#{r:02x}{g:02x}{b:02x}"),
            Self::Label(label) => f.write_str(label),
        }
    }
}

/// How a drawing is marked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marking {
    /// Lines.
    pub stroke: StrokeMode,
    /// Areas.
    pub fill: FillMode,
    /// Distance of the lines that fill areas, mm; None for half a spot.
    pub pitch_mm: Option<f64>,
    /// Direction of these lines in the part frame.
    pub direction_rad: f64,
    /// Whether they follow the level lines of the part instead, and by which part of their distance they are moved
    /// then.
    pub along_contours: Option<f64>,
    /// Whether a second set of lines crosses the first at a right angle.
    pub cross: bool,
    /// Whether all lines have one direction.
    pub one_way: bool,
    /// Distance of these lines from the border of the area, mm; None for half a spot.
    pub inset_mm: Option<f64>,
    /// When the contour of a hatched area is marked.
    pub contour: ContourPass,
    /// Whether elements that cannot be reproduced are left out with a warning instead of refused.
    pub is_lenient: bool,
    /// Pens of colours and labels; all else takes the pen of the texture.
    pub pens: Vec<(Selector, PenId)>,
    /// Where not empty, only these exist.
    pub only: Vec<Selector>,
    /// Selectors of the shapes that are left out.
    pub except: Vec<Selector>,
    /// Whether the labels of shapes are kept though nothing chooses by them.
    pub lists_labels: bool,
    /// Which colours are the page: they hide what lies below and are not marked.
    pub paper: Paper,
    /// Whether the page is mirrored about its middle, before it is turned.
    pub mirror: Option<Mirror>,
    /// Where the drawing is a bitmap; None where nothing is said of it.
    pub tone: Option<Tone>,
}

/// Strokes wider than this are areas, in spots.
const WIDEST_LINE: f64 = 1.5;

impl Marking {
    /// Width up to which a stroke is a line, mm.
    pub(in crate::texture) fn widest_line_mm(&self, spot_mm: f64) -> f64 {
        WIDEST_LINE * spot_mm
    }

    /// The diameter of the disc that a point of a drawing (a mark without length) stands for, mm; None for a dot of the
    /// pen. A point is as wide as the stroke or pen that draws it, and an area where a line of that width would be one.
    pub(in crate::texture) fn point_disc_mm(&self, width_mm: Option<f64>, widest_line_mm: f64) -> Option<f64> {
        let is_area = |width: &f64| match self.stroke {
            StrokeMode::Shown => *width > widest_line_mm,
            StrokeMode::Centre => false,
            StrokeMode::Outline | StrokeMode::Hatch => *width > 0.0,
        };
        width_mm.filter(is_area)
    }

    /// Whether elements with these labels do not exist, whatever they hold.
    pub(in crate::texture) fn excepts<'a>(&self, mut labels: impl Iterator<Item = &'a String>) -> bool {
        labels.any(|label| self.except.iter().any(|s| matches!(s, Selector::Label(l) if l == label)))
    }

    /// Whether an element with these labels that holds no others does not exist, whatever its colour.
    pub(in crate::texture) fn leaves_out<'a>(&self, labels: impl Iterator<Item = &'a String> + Clone) -> bool {
        let may_choose = |s: &Selector| match s {
            Selector::Colour(_) => true,
            Selector::Label(label) => labels.clone().any(|l| l == label),
        };
        self.excepts(labels.clone()) || !(self.only.is_empty() || self.only.iter().any(may_choose))
    }

    /// Whether `pens` or `only` name a colour, so that it is marked though it may be that of the page.
    pub(in crate::texture) fn names(&self, colour: Colour) -> bool {
        self.pens.iter().map(|(s, _)| s).chain(&self.only).any(|s| *s == Selector::Colour(colour))
    }

    /// Whether what has this colour is the page, unless a label gives it a pen.
    pub(in crate::texture) fn is_page(&self, colour: Colour) -> bool {
        !self.names(colour) && self.paper.holds(colour)
    }

    /// What is reported of things that cannot be marked as they are drawn: an error, or, where the job leaves them out,
    /// a warning that says what was `done` instead.
    pub(in crate::texture) fn unmarkable(
        &self,
        code: &'static str,
        what: &str,
        done: &str,
        count: &str,
        hint: &str,
    ) -> Diag {
        if self.is_lenient {
            return Diag::warning(code, format!("{what}{done}{count}")).hint(hint);
        }
        let hint = format!("{hint}, or leave them out with on_unsupported = \"warn\"");
        Diag::input(code, format!("{what}{count}")).hint(hint)
    }

    /// Adds messages about a drawing to the notes.
    ///
    /// # Errors
    /// Those of them that are errors.
    pub(in crate::texture) fn tell(
        &self,
        messages: impl Iterator<Item = Diag>,
        notes: &mut Vec<Diag>,
    ) -> Result<(), Error> {
        let (warnings, errors): (Vec<_>, Vec<_>) = messages.partition(|d| d.kind == diag::Kind::Warning);
        notes.extend(warnings);
        if errors.is_empty() { Ok(()) } else { Err(Error::many(errors)) }
    }

    /// Whether it tells shapes apart.
    pub(in crate::texture) fn chooses(&self) -> bool {
        !(self.pens.is_empty() && self.only.is_empty() && self.except.is_empty())
    }
}

//! The job file as written: every key of the TOML, each with its default.
//!
//! `super::resolve` makes a [`super::Job`] of it; nothing else reads these types, but for the enums that
//! have the same meaning in both. They are the authority for the JSON schema (`terrace init --schema`) and
//! for `docs/job-file.md`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file_unit::FileUnit;
use super::texture::keys::TextureKeys;
use terrace_core::format::Format;
use terrace_core::units::{
    Angle, Frequency, Length, Power, Share, Speed, Time, non_negative, non_negative_option, positive, positive_option,
};

/// The keys of a job file.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JobFile {
    /// How the part is marked: stop by stop, or while the stage moves.
    #[serde(default)]
    pub mode: Mode,
    /// The part's surface.
    pub surface: SurfaceKeys,
    /// Where the part lies on the stage.
    #[serde(default)]
    pub placement: PlacementKeys,
    /// What to mark; one or more.
    pub texture: Vec<TextureKeys>,
    /// Depth of focus.
    pub focus: FocusKeys,
    /// How the surface is divided.
    #[serde(default)]
    pub partition: PartitionKeys,
    /// In which order stops and strokes are marked.
    #[serde(default)]
    pub order: OrderKeys,
    /// How many times the texture is marked.
    #[serde(default)]
    pub passes: PassesKeys,
    /// Set-ups of a part beyond the stage travel; default: one.
    #[serde(default)]
    pub setups: Option<SetupsKeys>,
    /// What is skipped, and what causes a warning.
    #[serde(default)]
    pub limits: LimitsKeys,
    /// Whether pens compensate for the slope; default: they do not.
    #[serde(default)]
    pub dose: Option<Dose>,
    /// The machine.
    pub machine: MachineKeys,
    /// Laser settings by name; a texture without a pen uses the first.
    pub pen: Vec<PenKeys>,
    /// What to write.
    #[serde(default)]
    pub emit: EmitKeys,
}

/// How a part is marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// The stage steps from stop to stop; the galvo marks while it stands.
    #[default]
    Stepped,
    /// The galvo marks while the stage moves.
    OnTheFly,
}

impl Mode {
    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stepped => "stepped",
            Self::OnTheFly => "on-the-fly",
        }
    }
}

/// `[surface]`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceKeys {
    /// STL, OBJ, PLY, 3MF, STEP, IGES, height map (PNG, TIFF, ESRI ASCII grid), or XYZ / CSV point cloud;
    /// relative to the job file.
    #[schemars(example = &"part.stl")]
    pub file: PathBuf,
    /// Unit of the file's numbers; required for STL, OBJ, PLY and point clouds. 3MF files state theirs.
    #[schemars(example = &"mm")]
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Where the part's origin lies in the file: x, y and z in its own unit, subtracted from all coordinates; default
    /// (0, 0, 0). Not for height maps, STEP and IGES.
    #[schemars(example = [0.0, 0.0, 0.0])]
    #[serde(default)]
    pub datum: Option<[f64; 3]>,
    /// Factor on all coordinates, such as 4e-5 for a map at 1 : 25000; default 1. Not for height maps, STEP and IGES.
    #[schemars(example = 1.0)]
    #[serde(default)]
    pub scale: Option<f64>,
    /// Vertices nearer to each other than this become one; default: only those equal to the nanometre.
    #[schemars(example = &"2 um")]
    #[serde(default, deserialize_with = "non_negative")]
    pub weld: Length,
    /// What happens where an edge joins three facets, or another odd number above: a sheet hangs on another.
    #[serde(default)]
    pub non_manifold: NonManifold,
    /// How far facets, samples or points of the file lie from the part, for the depth budget: the chord tolerance of an
    /// export, the error of a measurement. Not for STEP and IGES, whose chord tolerance is known.
    #[schemars(example = &"0.01 mm")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub tessellation: Option<Length>,
    /// Scale of a height map; required for PNG and TIFF.
    #[serde(default)]
    pub heightmap: Option<HeightmapKeys>,
    /// Longest triangle edge that a point cloud may be meshed with; default: eight times the typical
    /// spacing. Longer ones are holes.
    #[schemars(example = &"5 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub max_edge: Option<Length>,
}

/// What happens at an edge on which a sheet hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum NonManifold {
    /// The surface is refused.
    #[default]
    Refuse,
    /// The topmost sheet is marked, with a warning.
    Topmost,
}

/// `[surface.heightmap]`: samples are nodes, row 0 is the top (+y).
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeightmapKeys {
    /// Distance of neighbouring samples.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pixel: Length,
    /// Heights that the two `values` stand for.
    #[schemars(example = ["0 mm", "12 mm"])]
    pub z: [Length; 2],
    /// Sample values that stand for the two heights; default the full range of the file's depth, where its samples are
    /// whole numbers.
    #[schemars(example = [1.0, 65535.0])]
    #[serde(default)]
    pub values: Option<[f64; 2]>,
    /// Sample value that means "no surface here", beside NaN and the value that the file states.
    #[schemars(example = 0.0)]
    #[serde(default)]
    pub nodata: Option<f64>,
    /// Part-frame position of the lower left sample; default (0, 0).
    #[serde(default)]
    pub origin: [Length; 2],
}

/// `[placement]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacementKeys {
    /// Table-frame position of the (turned) part's origin; default: centre of the texture at the
    /// centre of travel.
    #[schemars(example = ["300 mm", "200 mm", "-80 mm"])]
    #[serde(default)]
    pub origin: Option<[Length; 3]>,
    /// Rotations of the surface file about its x, y and z axis, in this order, before all else: how the part is laid.
    #[schemars(example = ["0 deg", "90 deg", "0 deg"])]
    #[serde(default)]
    pub rotate: Option<[Angle; 3]>,
    /// Instead of `rotate`: the direction in the surface file that is to look at the lens.
    #[schemars(example = [0.0, 0.0, 1.0])]
    #[serde(default)]
    pub up: Option<[f64; 3]>,
    /// Instead of `rotate`: three points of the surface file whose plane is to be level; counter-clockwise as the lens
    /// sees them.
    #[schemars(example = [[0.0, 0.0, 5.0], [100.0, 0.0, 5.0], [0.0, 80.0, 5.0]])]
    #[serde(default)]
    pub level: Option<[[f64; 3]; 3]>,
    /// Turn of the part about its z axis, counter-clockwise.
    #[serde(default)]
    pub turn: Angle,
    /// How far points of the part lie, in x and y, from where the placement has them once the part is registered, for
    /// the error budget.
    #[schemars(example = &"0.02 mm")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub residual: Option<Length>,
    /// The same in z: how exactly the height of the part is set, for the depth budget.
    #[schemars(example = &"0.01 mm")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub residual_z: Option<Length>,
}

/// Position of the focal plane of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Middle of the block's depth interval: deviation at most half of it.
    #[default]
    Mid,
    /// Mean height of the block's marks (the article's step 4).
    Mean,
}

/// What PDOF bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DepthRule {
    /// The depth range of a block is at most PDOF (the article).
    #[default]
    Range,
    /// The deviation from the focal plane is at most PDOF: the range is at most twice PDOF.
    Half,
}

/// `[focus]`: give `pdof`, or `dof` and `factor`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FocusKeys {
    /// Processing depth of focus.
    #[serde(default)]
    pub pdof: Option<Length>,
    /// Depth of focus of the optics.
    #[schemars(example = &"0.06 mm")]
    #[serde(default)]
    pub dof: Option<Length>,
    /// PDOF = factor × DOF, 0.8 to 1.2 in the article.
    #[schemars(example = 1.2)]
    #[serde(default)]
    pub factor: Option<f64>,
    /// What is taken off PDOF for errors of part, set-up and machine; blocks are made for the rest.
    #[schemars(example = &"0.01 mm")]
    #[serde(default, deserialize_with = "non_negative")]
    pub reserve: Length,
    /// Focal plane of a block.
    #[serde(default)]
    pub level: Level,
    /// What PDOF bounds.
    #[serde(default)]
    pub rule: DepthRule,
}

/// Ways to divide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A grid of sections, evenly spaced levels of the whole part (the article).
    Contour,
    /// A grid of sections, in each the fewest levels that cover the texture's depths.
    ZRange,
    /// Windows of the field and levels placed freely, as few as can be found.
    Window,
    /// Sections each at a tilt of its own, levels along the tilted beam; for machines with tilt axes.
    Tilt,
    /// Every method that the machine can run; the one with the least job time is kept.
    #[default]
    Auto,
}

impl Method {
    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Contour => "contour",
            Self::ZRange => "z-range",
            Self::Window => "window",
            Self::Tilt => "tilt",
            Self::Auto => "auto",
        }
    }
}

/// `[partition]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartitionKeys {
    /// The method.
    #[serde(default)]
    pub method: Method,
    /// Pitch of the grid of sections; default: the usable field.
    #[schemars(example = &"39 mm")]
    #[serde(default, deserialize_with = "positive_option")]
    pub section: Option<Length>,
    /// Fragments shorter than this are skipped and counted; default: those shorter than half the spot that a cut made,
    /// next to a mark of their stroke.
    #[schemars(example = &"5 um")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub min_mark: Option<Length>,
    /// What `auto` minimises.
    #[serde(default)]
    pub objective: Objective,
    /// Closed figures and strokes no larger than this along x and y are marked in one piece wherever a stop can contain
    /// them; default: none.
    #[schemars(example = &"2 mm")]
    #[serde(default, deserialize_with = "non_negative")]
    pub keep_whole: Length,
    /// Strokes are cut at a random place within this length before the border of a stop, where both stops admit it, so
    /// that cuts do not line up; default: none, all cuts lie on the border.
    #[schemars(example = &"0.2 mm")]
    #[serde(default, deserialize_with = "non_negative")]
    pub zone: Length,
    /// Strokes that are cut between two stops are marked by both over this length before the cut, as far as both admit
    /// it; default: none. Not together with `zone`.
    #[schemars(example = &"0.05 mm")]
    #[serde(default, deserialize_with = "non_negative")]
    pub overlap: Length,
    /// How far levels overlap up and down, so that a rough surface does not change the stop at every ripple. It is
    /// taken from the depth range. Default: from the surface's roughness.
    #[schemars(example = &"5 um")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub hysteresis: Option<Length>,
}

/// What `auto` minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Objective {
    /// Estimated job time.
    #[default]
    Time,
    /// Stops; of equal numbers the least time.
    Stops,
}

impl Objective {
    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Stops => "stops",
        }
    }
}

/// In which order the stage visits the stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StopOrder {
    /// The one with the least time of stage moves that is found.
    #[default]
    Time,
    /// The one with the least time of stage moves in which no focal plane lies lower than the one before.
    ZUp,
    /// The one with the least time of stage moves in which no focal plane lies higher than the one before.
    ZDown,
}

/// In which order the strokes of a block are marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StrokeOrder {
    /// With short jumps: either way round, closed figures from any of their vertices.
    #[default]
    Shortest,
    /// As they were drawn: in that order and direction.
    Drawing,
}

/// `[order]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OrderKeys {
    /// Order of the stops.
    #[serde(default)]
    pub stops: StopOrder,
    /// Order of the strokes within a block.
    #[serde(default)]
    pub strokes: StrokeOrder,
}

/// `[passes]`: how many times the whole texture is marked, each time with its own stops.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PassesKeys {
    /// How many times, 1 to 100.
    #[schemars(example = 3)]
    #[serde(default = "once")]
    pub count: u32,
    /// By how much straight hatches turn from pass to pass, counter-clockwise.
    #[schemars(example = &"67 deg")]
    #[serde(default)]
    pub rotate: Angle,
    /// By how much focal planes sink from pass to pass, the depth that a pass removes.
    #[schemars(example = &"8 um")]
    #[serde(default, deserialize_with = "non_negative")]
    pub lower: Length,
    /// By how much the grid of sections moves along x and y from pass to pass, so that seams do not coincide; default:
    /// the golden part of a section. With "0 mm" levels do not move either.
    #[schemars(example = &"10 mm")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub shift: Option<Length>,
}

impl Default for PassesKeys {
    fn default() -> Self {
        Self { count: once(), rotate: Angle::default(), lower: Length::default(), shift: None }
    }
}

/// `[setups]`: a part beyond the stage travel is moved on the table and marked from several places.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SetupsKeys {
    /// Number of columns into which the stops are divided along x.
    #[serde(default)]
    pub columns: Parts,
    /// Number of rows along y.
    #[serde(default)]
    pub rows: Parts,
    /// Points of the part's own frame that the operator finds with the pilot laser, x and y; every set-up
    /// must reach two.
    #[schemars(example = [["0 mm", "0 mm"], ["100 mm", "0 mm"]])]
    pub registration: Vec<[Length; 2]>,
}

/// How many columns or rows of set-ups there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged, expecting = "a number of set-ups, or \"auto\"")]
pub enum Parts {
    /// `"auto"`.
    Named(PartsName),
    /// This many.
    Number(u32),
}

impl Default for Parts {
    fn default() -> Self {
        Self::Named(PartsName::Auto)
    }
}

/// Numbers with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PartsName {
    /// The fewest that the travel allows.
    Auto,
}

/// Which value of a pen compensates for the slope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Compensate {
    /// Marks are slower by the cosine of the slope.
    Speed,
    /// Power is higher by one over the cosine.
    Power,
}

/// `[dose]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dose {
    /// What is changed.
    #[schemars(example = &"speed")]
    pub compensate: Compensate,
    /// By how much at most: 1.5 is a speed of two thirds, or half as much power again.
    #[serde(default = "default_cap")]
    pub cap: f64,
    /// Factors are multiples of this.
    #[serde(default = "default_step")]
    pub step: f64,
}

fn default_cap() -> f64 {
    1.5
}

fn default_step() -> f64 {
    0.01
}

/// What happens to texture on slopes beyond `max_incidence`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Steep {
    /// Not marked, counted and reported by a warning.
    #[default]
    Skip,
    /// The job is refused.
    Refuse,
}

/// What happens to values that the machine's optics make implausible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Implausible {
    /// The job is refused.
    #[default]
    Refuse,
    /// The values are used, with a warning.
    Allow,
}

/// `[limits]`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LimitsKeys {
    /// Beam incidence above which a warning says so.
    #[serde(default = "default_warn_incidence")]
    pub warn_incidence: Angle,
    /// Beam incidence above which nothing is marked; below 90 deg.
    #[serde(default = "default_max_incidence")]
    pub max_incidence: Angle,
    /// What happens to texture beyond it.
    #[serde(default)]
    pub steep: Steep,
    /// Share of the length of a drawing, or of a pattern with an area, that may lie off the part, where nothing is
    /// marked; beyond it the job is refused.
    #[serde(default = "default_max_off_part")]
    pub max_off_part: Share,
    /// What happens where a value is far from what the machine's optics allow: a depth of focus beyond twice that
    /// of the optics, or a hatch pitch below a quarter of the spot.
    #[serde(default)]
    pub implausible: Implausible,
}

fn default_max_off_part() -> Share {
    Share::percent(1.0)
}

fn default_warn_incidence() -> Angle {
    Angle::deg(10.0)
}

fn default_max_incidence() -> Angle {
    Angle::deg(60.0)
}

impl Default for LimitsKeys {
    fn default() -> Self {
        Self {
            warn_incidence: default_warn_incidence(),
            max_incidence: default_max_incidence(),
            steep: Steep::Skip,
            max_off_part: default_max_off_part(),
            implausible: Implausible::Refuse,
        }
    }
}

/// `[machine]`: a built-in profile or a file.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MachineKeys {
    /// Name of a built-in profile (`terrace machines`).
    #[schemars(example = &"xyz-galvo-40")]
    #[serde(default)]
    pub profile: Option<String>,
    /// A machine file, relative to the job file.
    #[schemars(example = &"our-machine.toml")]
    #[serde(default)]
    pub file: Option<PathBuf>,
}

/// `[[pen]]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PenKeys {
    /// Name that textures refer to.
    #[schemars(example = &"fill")]
    pub name: String,
    /// Mark speed.
    #[serde(deserialize_with = "positive")]
    pub speed: Speed,
    /// Laser power.
    pub power: Power,
    /// Repetition rate.
    #[serde(deserialize_with = "positive")]
    pub frequency: Frequency,
    /// How often every stroke is marked.
    #[serde(default = "once")]
    pub passes: u32,
    /// How long the beam is on at a dot; or give `pulses`. Dots need one of the two.
    #[schemars(example = &"1 ms")]
    #[serde(default, deserialize_with = "positive_option")]
    pub dwell: Option<Time>,
    /// Pulses of a dot: the dwell is so many periods of `frequency`.
    #[schemars(example = 20)]
    #[serde(default)]
    pub pulses: Option<u32>,
    /// Seven axes only: the spot gets to its speed before a mark and loses it after the mark, with the laser off.
    #[serde(default)]
    pub skywriting: bool,
}

fn once() -> u32 {
    1
}

/// `[emit]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EmitKeys {
    /// The formats; default: those that the job's mode is usually marked with.
    #[schemars(example = ["dxf", "linuxcnc", "ovf"])]
    #[serde(default)]
    pub formats: Option<Vec<Format>>,
    /// Pen that the frames of the blocks are drawn with, of a power that leaves no mark; no texture may use it. Default:
    /// no frames.
    #[schemars(example = &"pilot")]
    #[serde(default)]
    pub frames: Option<String>,
    /// What the power of marks on the fly follows.
    #[serde(default)]
    pub power: MarkPower,
}

/// What the power of marks on the fly follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MarkPower {
    /// The pen: it is constant, however fast the spot moves.
    #[default]
    Pen,
    /// The speed of the spot: that of the pen times the share of its speed, so that every length of a line gets as much.
    Speed,
}

/// The JSON schema of a job file.
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(JobFile);
    serde_json::to_string_pretty(&schema).expect("a schema is plain JSON")
}

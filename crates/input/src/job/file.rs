//! The job file as written: every key of the TOML, each with its default.
//!
//! `super::resolve` makes a [`super::Job`] of it; nothing else reads these types, but for the enums that
//! have the same meaning in both. They are the authority for the JSON schema (`terrace init --schema`) and
//! for `docs/reference/job-file.md`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file_unit::FileUnit;
use super::fixtures::FixtureKeys;
use super::marked::MarkedKeys;
use super::partition::PartitionKeys;
use super::texture::keys::TextureKeys;
use terrace_core::format::Format;
use terrace_core::units::{
    Angle, Frequency, Length, Power, Share, Speed, Time, non_negative, non_negative_option, positive, positive_option,
};

/// The keys of a job file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct JobFile {
    /// How the part is marked; written above all tables.
    #[serde(default)]
    pub mode: Mode,
    /// The part's surface.
    pub surface: SurfaceKeys,
    /// Where the part lies on the stage.
    #[serde(default)]
    pub placement: PlacementKeys,
    /// What holds the part; never marked, and the head keeps clear of it.
    #[serde(default)]
    pub fixture: Vec<FixtureKeys>,
    /// Jobs that have marked some of the texture before, on the same part; that is left out.
    #[serde(default)]
    pub marked: Vec<MarkedKeys>,
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
pub(crate) struct SurfaceKeys {
    /// Meshes: `.stl`, `.obj`, `.ply`, `.3mf`. CAD: `.step`, `.stp`, `.iges`, `.igs`. Height maps: `.png`, `.tif`,
    /// `.tiff`. Points or an ESRI grid: `.xyz`, `.csv`, `.asc`, `.txt`, `.pts`, `.ptx`.
    #[schemars(example = &"part.stl", extend("x-value" = "path"))]
    pub file: PathBuf,
    /// Length of one unit of the file's numbers. Refused for STEP and IGES, which state theirs.
    #[schemars(example = &"mm", extend("x-default" = "required for STL, OBJ, PLY and points"))]
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Where the part's origin lies in the file, in its unit: subtracted from all coordinates; see below. Not for
    /// height maps, STEP and IGES.
    #[schemars(example = [0.0, 0.0, 0.0], extend("x-value" = "[x, y, z] as numbers", "x-default" = "[0, 0, 0]"))]
    #[serde(default)]
    pub datum: Option<[f64; 3]>,
    /// Factor on all coordinates: 4e-5 for a map at 1 : 25000. Not for height maps, STEP and IGES.
    #[schemars(example = 1.0, extend("x-value" = "number above 0", "x-default" = "1"))]
    #[serde(default)]
    pub scale: Option<f64>,
    /// Vertices closer together than this become one; see below.
    #[schemars(example = &"2 um")]
    #[serde(default, deserialize_with = "non_negative")]
    pub weld: Length,
    /// Edges that join three facets, or another odd number above: the surface is refused, or the topmost sheet is
    /// marked.
    #[serde(default)]
    pub non_manifold: NonManifold,
    /// How far facets, samples or points lie from the part, for the [depth budget](#error-and-depth-budget); not for
    /// STEP and IGES.
    #[schemars(example = &"0.01 mm")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub tessellation: Option<Length>,
    /// Scale of a height map; required for PNG and TIFF.
    #[serde(default)]
    pub heightmap: Option<HeightmapKeys>,
    /// Point clouds: triangles with a longer edge in plan are holes.
    #[schemars(example = &"5 mm", extend("x-default" = "eight times the typical spacing"))]
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
pub(crate) struct HeightmapKeys {
    /// Distance between neighbouring samples, in x and in y.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pixel: Length,
    /// Heights that the two `values` stand for; the second may be the lower one.
    #[schemars(example = ["0 mm", "12 mm"])]
    pub z: [Length; 2],
    /// The sample values that `z` belongs to.
    #[schemars(example = [1.0, 65535.0], extend("x-default" = "the range of the type, such as [0, 65535]; required for floats and grids"))]
    #[serde(default)]
    pub values: Option<[f64; 2]>,
    /// Samples of this value are holes, as are NaN and the value that the file states.
    #[schemars(example = 0.0)]
    #[serde(default)]
    pub nodata: Option<f64>,
    /// Part-frame position of the lower left sample.
    #[serde(default)]
    pub origin: [Length; 2],
}

/// `[placement]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlacementKeys {
    /// Position of the turned part's origin in the table frame.
    #[schemars(example = ["300 mm", "200 mm", "-80 mm"], extend("x-default" = "the middle of the stops at the centre of travel; with tilted stops or set-ups, the centre of the texture"))]
    #[serde(default)]
    pub origin: Option<[Length; 3]>,
    /// How the part is laid: rotations of the surface file about its x, then its y, then its z axis, right-handed.
    /// `terrace orient JOB --apply` writes it.
    #[schemars(example = ["0 deg", "90 deg", "0 deg"])]
    #[serde(default)]
    pub rotate: Option<[Angle; 3]>,
    /// Instead of `rotate`: the direction in the surface file that is to look at the lens.
    #[schemars(example = [0.0, 0.0, 1.0])]
    #[serde(default)]
    pub up: Option<[f64; 3]>,
    /// Instead of `rotate`: three points of the surface file whose plane is to be level; the lens sees them
    /// counter-clockwise.
    #[schemars(example = [[0.0, 0.0, 5.0], [100.0, 0.0, 5.0], [0.0, 80.0, 5.0]], extend("x-value" = "three points of three numbers"))]
    #[serde(default)]
    pub level: Option<[[f64; 3]; 3]>,
    /// Turn of the part about the z axis of its own frame, counter-clockwise seen from the lens. The texture turns with
    /// it.
    #[serde(default)]
    pub turn: Angle,
    /// How far points of the part lie in x and y from where the placement has them, once it is registered; for the
    /// [error budget](#error-and-depth-budget).
    #[schemars(example = &"0.02 mm")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub residual: Option<Length>,
    /// The same in z: how exactly the height is set; for the depth budget.
    #[schemars(example = &"0.01 mm")]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub residual_z: Option<Length>,
    /// Points that were measured on the part: it is marked as it lies.
    #[serde(default)]
    pub measured: Option<MeasuredKeys>,
}

/// `[placement.measured]`: where the part lies, from measured points.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeasuredKeys {
    /// The table of points, see [measured.md](measured.md); relative to the job file.
    #[schemars(example = &"measured.csv", extend("x-value" = "path"))]
    pub file: PathBuf,
    /// Standard deviations of the part's height that every stop keeps free above and below its marks, place by place.
    #[schemars(extend("x-value" = "0 to 10"))]
    #[serde(default = "default_sigmas")]
    pub sigmas: f64,
    /// The part may be warped by up to this much: its height is corrected by what the rigid fit leaves of the points.
    /// Points farther off than that do not lie on the part. Rigid without it.
    #[schemars(example = &"0.5 mm")]
    #[serde(default)]
    pub warp: Option<Length>,
    /// What is done where so many deviations do not fit into the depth range.
    #[serde(default)]
    pub unsure: Unsure,
}

/// What is done where the height of a measured part is not known closely enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Unsure {
    /// The job is refused.
    #[default]
    Refuse,
    /// No more than a quarter of the depth range stays free above and below, with a warning.
    Warn,
}

fn default_sigmas() -> f64 {
    3.0
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
pub(crate) struct FocusKeys {
    /// Processing depth of focus: height range in which your process gives the wanted result.
    #[schemars(extend("x-default" = "this or `dof`"))]
    #[serde(default)]
    pub pdof: Option<Length>,
    /// Depth of focus of the optics; pdof = factor x dof.
    #[schemars(example = &"0.06 mm", extend("x-default" = "this or `pdof`"))]
    #[serde(default)]
    pub dof: Option<Length>,
    /// See `dof`; the article uses 0.8 to 1.2, beyond which a warning says so; no effect beside `pdof`.
    #[schemars(example = 1.2, extend("x-default" = "1"))]
    #[serde(default)]
    pub factor: Option<f64>,
    /// Part of pdof that is kept for errors of part, set-up and machine; see [below](#error-and-depth-budget). Blocks
    /// are made for the rest.
    #[schemars(example = &"0.01 mm", extend("x-value" = "length below pdof"))]
    #[serde(default, deserialize_with = "non_negative")]
    pub reserve: Length,
    /// Focal plane of a block: in the middle of the heights of its marks, or at their mean (step 4 of the article).
    #[serde(default)]
    pub level: Level,
    /// What pdof bounds: the whole height range of a block, or the deviation to either side (the range is then 2 x
    /// pdof).
    #[serde(default)]
    pub rule: DepthRule,
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
pub(crate) struct OrderKeys {
    /// Order of the stops: least time of stage moves, or focal planes that only rise, or only fall.
    #[serde(default)]
    pub stops: StopOrder,
    /// Order of the strokes within a block: short jumps, or order and direction as drawn.
    #[serde(default)]
    pub strokes: StrokeOrder,
}

/// `[passes]`: how many times the whole texture is marked, each time with its own stops.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PassesKeys {
    /// Number of passes.
    #[schemars(example = 3, extend("x-value" = "1 to 100"))]
    #[serde(default = "once")]
    pub count: u32,
    /// Turn of straight hatches from pass to pass, counter-clockwise about the corner where they begin.
    #[schemars(example = &"67 deg")]
    #[serde(default)]
    pub rotate: Angle,
    /// By how much focal planes sink from pass to pass: the depth that a pass removes.
    #[schemars(example = &"8 um", extend("x-value" = "length up to the depth range"))]
    #[serde(default, deserialize_with = "non_negative")]
    pub lower: Length,
    /// By how much the grid of sections moves from pass to pass, in x and in y, so that seams do not coincide. With "0
    /// mm" levels do not move either.
    #[schemars(example = &"10 mm", extend("x-default" = "0.618 of a section"))]
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
pub(crate) struct SetupsKeys {
    /// Number of columns of set-ups along x; "auto" chooses the smallest number for which all stops are within travel.
    #[schemars(extend("x-value" = "1 to 100 or \"auto\""))]
    #[serde(default)]
    pub columns: Parts,
    /// The same along y.
    #[schemars(extend("x-value" = "1 to 100 or \"auto\""))]
    #[serde(default)]
    pub rows: Parts,
    /// Points that the operator can find with the pilot laser, in the part frame before `placement.turn`; every set-up
    /// must reach two.
    #[schemars(example = [["0 mm", "0 mm"], ["100 mm", "0 mm"]], extend("x-value" = "list of [x, y], lengths"))]
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
    /// "speed": marks are slower by the cosine. "power": power is divided by the cosine.
    #[schemars(example = &"speed")]
    pub compensate: Compensate,
    /// By how much at most: 1.5 is a speed of two thirds, or half as much power again.
    #[schemars(extend("x-value" = "1.01 to 10"))]
    #[serde(default = "default_cap")]
    pub cap: f64,
    /// Factors are multiples of this.
    #[schemars(extend("x-value" = "0.001 to 0.2"))]
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
pub(crate) struct LimitsKeys {
    /// Marks on a slope above this cause a warning.
    #[serde(default = "default_warn_incidence")]
    pub warn_incidence: Angle,
    /// Nothing is marked on slopes above this.
    #[schemars(extend("x-value" = "angle below 90 deg"))]
    #[serde(default = "default_max_incidence")]
    pub max_incidence: Angle,
    /// What happens to texture on steeper slopes: it is not marked, counted as `skipped_steep_mm` and reported by a
    /// warning; or the job is refused.
    #[serde(default)]
    pub steep: Steep,
    /// The job is refused where more of the length of a texture that the job places lies off the part; see below.
    #[serde(default = "default_max_off_part")]
    pub max_off_part: Share,
    /// Blocks deeper than twice the depth of focus of the optics or shallower than a thousandth of it, and hatches with
    /// a pitch below a quarter of the spot: refused, or accepted with a warning.
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
pub(crate) struct MachineKeys {
    /// A built-in profile; `terrace machines` lists them.
    #[schemars(example = &"xyz-galvo-40", extend("x-value" = "name", "x-default" = "this or `file`"))]
    #[serde(default)]
    pub profile: Option<String>,
    /// A machine file, see [machine-file.md](machine-file.md).
    #[schemars(example = &"our-machine.toml", extend("x-value" = "path", "x-default" = "this or `profile`"))]
    #[serde(default)]
    pub file: Option<PathBuf>,
}

/// `[[pen]]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PenKeys {
    /// What textures call it.
    #[schemars(example = &"fill", extend("x-value" = "letters, digits, - and _"))]
    pub name: String,
    /// Mark speed across the beam.
    #[serde(deserialize_with = "positive")]
    pub speed: Speed,
    /// Percent of the machine's `laser.max_power`, or W.
    #[schemars(extend("x-value" = "\"60 %\" or \"8 W\""))]
    pub power: Power,
    /// Repetition rate.
    #[serde(deserialize_with = "positive")]
    pub frequency: Frequency,
    /// How many times in a row the controller marks each stroke; not to be confused with `[passes]`.
    #[schemars(extend("x-value" = "1 to 1000"))]
    #[serde(default = "once")]
    pub passes: u32,
    /// How long the beam is on at a dot, each time.
    #[schemars(example = &"1 ms", extend("x-value" = "time up to 10 s", "x-default" = "this or `pulses` for dots"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub dwell: Option<Time>,
    /// Pulses of a dot: the dwell is so many periods of `frequency`.
    #[schemars(example = 20, extend("x-default" = "this or `dwell` for dots"))]
    #[serde(default)]
    pub pulses: Option<u32>,
    /// On the fly with seven axes: the spot gets to its speed before a mark and loses it after the mark, with the laser
    /// off.
    #[serde(default)]
    pub skywriting: bool,
}

fn once() -> u32 {
    1
}

/// `[emit]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EmitKeys {
    /// What is written in addition to the manifest, the program text, the pictures and the run sheets.
    #[schemars(example = ["dxf", "linuxcnc", "ovf"], extend("x-default" = "stepped: [\"dxf\", \"linuxcnc\", \"ovf\"]; on the fly: [\"linuxcnc\", \"pmac\"]"))]
    #[serde(default)]
    pub formats: Option<Vec<Format>>,
    /// Frames of the blocks are written too, drawn with this pen, which no texture may use: its power leaves no mark.
    #[schemars(example = &"pilot", extend("x-value" = "pen"))]
    #[serde(default)]
    pub frames: Option<String>,
    /// On the fly: the power of marks is that of their pens, or follows the speed of the spot, see below.
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

//! The machine: lens, scanner, stage, laser, delays, controller, as its file states them.
//!
//! A machine file is TOML with a unit in every value (`docs/reference/machine-file.md`). Six profiles are built
//! in; each number in them names its source or says that it is an assumption. Signs and limits live
//! here and nowhere else: a stage target is made by [`Machine::stage_from_part`], that of a tilted head by
//! [`Machine::stand`].
//!
//! Frames: the *table* frame is fixed to what carries the part; with all axes at 0 the optical axis
//! stands over its origin. The part lies in it shifted by the placement origin. An axis that moves the
//! head by +1 mm moves the optical axis by +1 mm over the part; one that moves the part, by -1 mm.

mod command;
mod cost;
mod head_tilt;
mod lift;
mod over_field;
mod probe;
mod range;
mod read;
mod settling;
mod tilt_axes;
mod tool_servo;
mod unused;

pub use command::{Commanded, Origin, TiltAngles};
pub use cost::{Cost, Rate};
pub use head_tilt::Stand;
pub use over_field::OverField;
pub use probe::Probe;
pub use read::{PROFILES, json_schema};
pub use settling::{AxisSettling, Settling};
pub use tilt_axes::{AngleCommands, AxisTravel, Letter, RotaryAxis, Tilt};
pub use tool_servo::{Drive, Oscillation, ToolServo};

use crate::math;
use serde::{Deserialize, Serialize};

use crate::diag::Diag;
use crate::geom::{ControllerPoint, FieldPoint, NM_PER_MM, Nm, P2, Turn, Turned};
use crate::units::{
    Acceleration, Angle, Frequency, Jerk, Length, LengthTime, Speed, Time, Watts, non_negative, non_negative_option,
    positive, positive_option,
};

/// A machine file. Every value is as written; [`Machine::load`] has checked it.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Shown in run sheets, reports and program heads.
    pub name: String,
    /// Where the numbers come from.
    #[serde(default)]
    pub source: String,
    /// The lens and its field.
    pub lens: Lens,
    /// The galvo head.
    pub scanner: Scanner,
    /// The stage and its axes.
    pub stage: Stage,
    /// The laser.
    pub laser: Laser,
    /// Waiting times of scanner and laser.
    #[serde(default)]
    pub delays: Delays,
    /// What the controllers accept.
    #[serde(default)]
    pub controller: Controller,
    /// A zoom optic in the head, where there is one.
    #[serde(default)]
    pub zoom: Option<Zoom>,
    /// Two tilt axes, where there are some.
    #[serde(default)]
    pub tilt: Option<Tilt>,
    /// Who loads and starts the blocks of a stepped job, and how long a person takes.
    #[serde(default)]
    pub operator: Operator,
    /// What an hour costs, where that is stated.
    #[serde(default)]
    pub cost: Option<Cost>,
    /// A fast tool servo and its spindle, where there is one.
    #[serde(default)]
    pub tool_servo: Option<ToolServo>,
    /// A BJJCZ (LMC) card, where lists are written for one.
    #[serde(default)]
    pub lmc: Option<Lmc>,
    /// A SCANLAB RTC board, where lists are written for one.
    #[serde(default)]
    pub rtc: Option<Rtc>,
    /// A touch probe beside the lens, where there is one.
    #[serde(default)]
    pub probe: Option<Probe>,
}

/// Shape of the scan field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema, Default)]
#[serde(rename_all = "lowercase")]
pub enum FieldShape {
    /// A rectangle of the two sizes.
    #[default]
    Rectangle,
    /// A circle whose diameter is the smaller of the two sizes.
    Circle,
}

/// A telecentric scan lens.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Full sizes of the scan field along x and y, up to 1 m.
    pub field: [Length; 2],
    /// A circle has the smaller of the two sizes as its diameter; sections are then squares inside it.
    #[serde(default)]
    pub shape: FieldShape,
    /// Rim of the field that is not used, on every side.
    #[serde(default, deserialize_with = "non_negative")]
    pub margin: Length,
    /// From the lens edge to the focal plane.
    #[serde(deserialize_with = "positive")]
    pub working_distance: Length,
    /// Outer diameter of the lens or head, whichever could touch the part.
    #[serde(deserialize_with = "positive")]
    pub diameter: Length,
    /// Spot diameter (1/e²) in focus; with wavelength and M² it decides `pdof-large`, alone `pitch-small` and the
    /// default of `partition.min_mark`.
    #[serde(deserialize_with = "positive")]
    pub spot: Length,
    /// Largest angle between beam and optical axis over the field; for the [error
    /// budget](job-file.md#error-and-depth-budget).
    #[schemars(extend("x-value" = "angle, or by distance"))]
    #[serde(default, deserialize_with = "over_field::option")]
    pub telecentricity: Option<OverField<Angle>>,
    /// Largest distance of the spot from its place once the field is corrected; for the error budget.
    #[schemars(extend("x-value" = "length, or by distance"))]
    #[serde(default, deserialize_with = "over_field::option")]
    pub field_residual: Option<OverField<Length>>,
}

/// The galvo head.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scanner {
    /// Top speed of jumps, for times.
    #[serde(deserialize_with = "positive")]
    pub jump_speed: Speed,
    /// Largest mark speed; a faster pen is refused.
    #[serde(deserialize_with = "positive")]
    pub max_mark_speed: Speed,
    /// Top acceleration of the spot along x and along y; with it all times count the spot from rest to rest, see below.
    #[serde(default, deserialize_with = "positive_option")]
    pub acceleration: Option<Acceleration>,
    /// Top jerk along x and along y; without it the acceleration steps.
    #[serde(default, deserialize_with = "positive_option")]
    pub jerk: Option<Jerk>,
    /// How the spot follows its command, as a damped oscillator, see below; only for comparisons.
    #[schemars(extend("x-value" = "{ frequency = \"1000 Hz\", damping = 0.7, feed_forward = \"velocity\" }"))]
    #[serde(default)]
    pub servo: Option<Servo>,
    /// E_lim in eq. 5 of Cui et al.: up to this sum of the stage's following error over time the scanner compensates
    /// it; only for `terrace compare --protection accumulated`.
    #[schemars(extend("x-value" = "sum of a length over time (\"mm s\", \"um s\")", "x-default" = "\"0.02 mm s\""))]
    #[serde(default, deserialize_with = "positive_option")]
    pub accumulated_error: Option<LengthTime>,
    /// The controller's x is the field's y and the other way round.
    #[serde(default)]
    pub swap_xy: bool,
    /// The controller's x runs against the field's, after a swap.
    #[serde(default)]
    pub mirror_x: bool,
    /// The controller's y runs against the field's, after a swap.
    #[serde(default)]
    pub mirror_y: bool,
}

impl Scanner {
    /// Controller coordinates of a field point, both in nm: first the swap, then the mirrors.
    pub fn controller_from_field(&self, FieldPoint { x, y }: FieldPoint) -> ControllerPoint {
        let [x, y] = if self.swap_xy { [y, x] } else { [x, y] };
        ControllerPoint { x: if self.mirror_x { -x } else { x }, y: if self.mirror_y { -y } else { y } }
    }
}

/// How an axis follows its command: as a damped oscillator of second order.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Servo {
    /// Natural frequency.
    #[serde(deserialize_with = "positive")]
    pub frequency: Frequency,
    /// Damping ratio; 1 is critical.
    pub damping: f64,
    /// What of the command it knows in advance.
    #[serde(default)]
    pub feed_forward: FeedForward,
}

/// What of its command a servo knows in advance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema, Default)]
#[serde(rename_all = "lowercase")]
pub enum FeedForward {
    /// Nothing: it is behind by a time constant times its speed.
    #[default]
    None,
    /// The speed: only its acceleration keeps it behind.
    Velocity,
}

/// What an axis moves when it moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Carries {
    /// The table with the part.
    Part,
    /// The scan head.
    Head,
}

/// One linear axis.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Lowest and highest commanded position, within 4 m.
    pub travel: [Length; 2],
    /// What the axis moves.
    pub carries: Carries,
    /// A positive command moves it against the frame's axis.
    #[serde(default)]
    pub reversed: bool,
    /// Top speed.
    #[serde(deserialize_with = "positive")]
    pub speed: Speed,
    /// Top acceleration, such as "1000 mm/s2".
    #[serde(deserialize_with = "positive")]
    pub acceleration: Acceleration,
    /// Top jerk, such as "20000 mm/s3"; without it the acceleration steps.
    #[serde(default, deserialize_with = "positive_option")]
    pub jerk: Option<Jerk>,
}

impl Axis {
    /// Lower and upper end of its travel, as commanded.
    pub fn travel_nm(&self) -> [Nm; 2] {
        self.travel.map(|end| end.as_nm().expect("travel beyond 4 m is refused when the machine is read"))
    }
    /// The middle of its travel, as commanded.
    pub fn middle(&self) -> Nm {
        let [lo, hi] = self.travel_nm();
        (lo + hi) / 2
    }
    /// +1 where a positive command moves the optical axis in + direction over the part, else -1.
    pub fn sign(&self) -> i64 {
        match (self.carries, self.reversed) {
            (Carries::Head, false) | (Carries::Part, true) => 1,
            (Carries::Head, true) | (Carries::Part, false) => -1,
        }
    }
}

/// Fixed measured times of a stage move, settling included; they stand in for the axis profiles.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MoveTimes {
    /// Any move that changes x or y.
    #[serde(deserialize_with = "non_negative")]
    pub xy: Time,
    /// A move of z alone.
    #[serde(deserialize_with = "non_negative")]
    pub z: Time,
}

/// The XYZ stage.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Axis along x.
    pub x: Axis,
    /// Axis along y.
    pub y: Axis,
    /// Axis along z (focus).
    pub z: Axis,
    /// Smallest step of a commanded position; every stage target is a multiple of it.
    #[serde(default = "default_increment", deserialize_with = "positive")]
    pub increment: Length,
    /// Wait after a move before the laser may fire. It is the dwell in the stage programs too (at least 50 ms there).
    /// With two times, the longer one of the axes that have moved.
    #[schemars(extend("x-value" = "time, or { xy = time, z = time }"))]
    #[serde(default)]
    pub settle: Settling,
    /// Whether z moves together with x and y, see below; not on a machine with `[tilt]`.
    #[serde(default)]
    pub diagonal: bool,
    /// Positioning accuracy of x and of y after a move; for the error budget, and the stitching error in `compare`.
    #[serde(default, deserialize_with = "positive_option")]
    pub accuracy: Option<Length>,
    /// The same of z; for the depth budget.
    #[serde(default, deserialize_with = "positive_option")]
    pub z_accuracy: Option<Length>,
    /// How the stage follows its command, as a damped oscillator; on the fly room for its following error at top speed
    /// is reserved in the field (20 Hz and 0.7 where nothing is stated).
    #[schemars(extend("x-value" = "{ frequency = \"20 Hz\", damping = 0.7 }"))]
    #[serde(default)]
    pub servo: Option<Servo>,
    /// Smallest gap between lens and part in any move; between lens and fixtures or table too.
    #[serde(deserialize_with = "positive")]
    pub clearance: Length,
    /// Height of the table's surface in the table frame: a part whose height the job does not state rests on it, and
    /// the head keeps clear of it. Not on a machine with `[tilt]`.
    #[schemars(example = &"-180 mm", extend("x-value" = "length within 4 m"))]
    #[serde(default)]
    pub table: Option<Length>,
    /// Measured times of a move, see below.
    #[schemars(extend("x-value" = "{ xy = time, z = time }"))]
    #[serde(default, rename = "move")]
    pub move_times: Option<MoveTimes>,
}

fn default_increment() -> Length {
    Length::um(0.1)
}

/// The laser source.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Laser {
    /// Full power; percent in pens refers to it, and a pen that asks for more is refused.
    #[schemars(extend("x-value" = "power in W"))]
    #[serde(deserialize_with = "positive")]
    pub max_power: Watts,
    /// With `lens.spot` and `m2` it gives the depth of focus of the optics.
    #[serde(deserialize_with = "positive")]
    pub wavelength: Length,
    /// Beam quality M²; 1 is an ideal Gaussian beam.
    #[schemars(extend("x-value" = "1 to 1000"))]
    #[serde(default = "ideal_beam")]
    pub m2: f64,
}

fn ideal_beam() -> f64 {
    1.0
}

/// Waiting times of scanner and laser.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema, Default)]
#[serde(deny_unknown_fields)]
pub struct Delays {
    /// Laser-on delay; may be negative. No time of its own in the estimate.
    #[serde(default)]
    pub laser_on: Time,
    /// Laser-off delay; may be negative. No time of its own in the estimate.
    #[serde(default)]
    pub laser_off: Time,
    /// Wait after a jump, once per stroke.
    #[serde(default, deserialize_with = "non_negative")]
    pub jump: Time,
    /// Wait after a mark, once per stroke; in times only without `scanner.acceleration`.
    #[serde(default, deserialize_with = "non_negative")]
    pub mark: Time,
    /// Wait at a corner inside a stroke; in times only without `scanner.acceleration`.
    #[serde(default, deserialize_with = "non_negative")]
    pub polygon: Time,
}

/// What the controllers accept.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Longest line of the stage program, in characters (at most 70 in `stage_m0.nc`).
    #[schemars(extend("x-value" = "whole number, 40 to 1000000"))]
    #[serde(default = "default_line")]
    pub max_line: usize,
    /// Most strokes in one block; 0 for no limit.
    #[serde(default)]
    pub max_strokes: usize,
    /// Period of the servo; on the fly the laser is switched up to one period early, and each program states the length
    /// that this is at the fastest mark.
    #[schemars(extend("x-default" = "\"1 ms\" for LinuxCNC, \"50 us\" for PMAC"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub servo_period: Option<Time>,
    /// The control that reads `stage_m0.nc`, see below.
    #[serde(default)]
    pub dialect: Dialect,
}

/// Dialects of the stage program that stops at every block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema, Default)]
#[serde(rename_all = "lowercase")]
pub enum Dialect {
    /// LinuxCNC; without tilt axes GRBL and Mach read the same words.
    #[default]
    Linuxcnc,
    /// GRBL: it has the axes X, Y and Z alone.
    Grbl,
    /// Mach: it may turn its coordinates (G68), which the program cancels (G69).
    Mach,
}

impl Controller {
    /// Period of its servo, s, where `usual` is that of its kind.
    pub fn servo_s(&self, usual: f64) -> f64 {
        self.servo_period.map_or(usual, Time::as_s)
    }
}

fn default_line() -> usize {
    255
}

impl Default for Controller {
    fn default() -> Self {
        Self { max_line: default_line(), max_strokes: 0, servo_period: None, dialect: Dialect::default() }
    }
}

/// A zoom optic (focus shifter, 3-axis head): moves the focal plane inside a field without the stage.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Zoom {
    /// Full range of the focal plane; half of it is above, half below the plane at `lens.working_distance`.
    #[serde(deserialize_with = "positive")]
    pub range: Length,
    /// Speed of the focal plane.
    #[serde(deserialize_with = "positive")]
    pub speed: Speed,
    /// Wait after a move.
    #[serde(default, deserialize_with = "non_negative")]
    pub settle: Time,
    /// How far the focal plane may lie from where the optic is commanded to set it; for the depth budget.
    #[serde(default, deserialize_with = "positive_option")]
    pub accuracy: Option<Length>,
}

/// Who loads and starts the blocks of a stepped job.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema, Default)]
#[serde(deny_unknown_fields)]
pub struct Operator {
    /// Who loads and starts the blocks, see below.
    #[serde(default)]
    pub way: Option<LoadingWay>,
    /// Time to load one block and to start it, by a person or by `terrace run`. It has no effect with "card" and "ovf".
    #[schemars(extend("x-default" = "\"15 s\" by a person; else not counted"))]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub load: Option<Time>,
}

/// Who loads and starts the blocks of a stepped job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema, Default)]
#[serde(rename_all = "lowercase")]
pub enum LoadingWay {
    /// `terrace run` loads and starts each block.
    Run,
    /// The scan card has all blocks stored; the handshake of `stage.ngc` starts each.
    Card,
    /// A person loads and starts each block.
    #[default]
    Person,
    /// A controller reads `job.ovf` and marks the whole job.
    Ovf,
}

impl LoadingWay {
    /// The way's name in machine files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Card => "card",
            Self::Person => "person",
            Self::Ovf => "ovf",
        }
    }
}

/// A BJJCZ (LMC) card: how it counts.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lmc {
    /// Units of the card per mm; it has 65536 along each axis, centre 32768.
    #[schemars(extend("x-value" = "number, 1 to 1e6"))]
    pub units_per_mm: f64,
    /// What it drives; they take power and frequency by different commands.
    #[serde(default)]
    pub laser: LmcLaser,
}

/// Lasers that an LMC card drives, which take power and frequency by different commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema, Default)]
#[serde(rename_all = "lowercase")]
pub enum LmcLaser {
    /// A fibre laser: pump current and Q-switch period.
    #[default]
    Fiber,
    /// A CO2 laser: pulse period and duty ratio.
    Co2,
}

/// A SCANLAB RTC board: how it counts.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rtc {
    /// Decides ranges and units.
    pub board: RtcBoard,
    /// Bits per mm, from the correction file.
    #[schemars(extend("x-value" = "number, 1 to 1e6"))]
    pub bits_per_mm: f64,
    /// Bits per mm of the focus shift, where the board drives a zoom optic.
    #[schemars(extend("x-value" = "number, 1 to 1e6"))]
    #[serde(default)]
    pub focus_bits_per_mm: Option<f64>,
    /// Most commands in one list.
    #[schemars(extend("x-value" = "whole number, 100 to 8000000"))]
    #[serde(default = "default_list")]
    pub list_memory: usize,
}

fn default_list() -> usize {
    4000
}

/// SCANLAB boards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RtcBoard {
    /// RTC4: 16 bits along each axis.
    Rtc4,
    /// RTC5: 20 bits.
    Rtc5,
    /// RTC6: 20 bits.
    Rtc6,
}

/// A fault of a machine file, and the key whose value it is of.
pub type Fault = (String, Diag);

impl Machine {
    /// Depth of focus of the optics, mm: twice the Rayleigh length of a Gaussian beam, 2 z_R = 2 π w² / (M² λ), where
    /// w is half the spot (ISO 11146-1).
    pub fn depth_of_focus_mm(&self) -> f64 {
        let waist = self.lens.spot.as_mm() / 2.0;
        2.0 * std::f64::consts::PI * waist * waist / (self.laser.m2 * self.laser.wavelength.as_mm())
    }

    /// The three linear axes with their names.
    pub fn axes(&self) -> [(&'static str, &Axis); 3] {
        [("x", &self.stage.x), ("y", &self.stage.y), ("z", &self.stage.z)]
    }

    /// Height of the table's surface in the table frame, where it is stated.
    pub fn table(&self) -> Option<Nm> {
        self.stage.table.map(|height| height.as_nm().expect("a table beyond 4 m is refused when the machine is read"))
    }

    /// What the stage has at the middle of its travel over the table frame's origin.
    pub fn centre_of_travel(&self) -> [Nm; 3] {
        self.axes().map(|(_, axis)| axis.middle() * axis.sign())
    }

    /// Full sizes of the rectangle in which marks may lie: the field less its margin; for a
    /// circle the square inside it.
    pub fn usable_field(&self) -> [Nm; 2] {
        let m = self.lens.margin.as_mm();
        let [fx, fy] = self.lens.field.map(|f| f.as_mm() - 2.0 * m);
        let size = match self.lens.shape {
            FieldShape::Rectangle => [fx, fy],
            FieldShape::Circle => [fx.min(fy) * std::f64::consts::FRAC_1_SQRT_2; 2],
        };
        // Even and rounded down, so that the half is exact and nothing lies outside.
        size.map(|s| Nm::floor(s * NM_PER_MM + 1e-3).max(Nm(0)) / 2 * 2)
    }

    /// How far marks may lie from the optical axis along x and y, mm: half of [`Self::usable_field`].
    pub fn half_usable_field_mm(&self) -> [f64; 2] {
        self.usable_field().map(|size| size.mm() / 2.0)
    }

    /// Full sizes of the upright rectangle around all places that may be marked from one standstill.
    pub fn field_box(&self) -> [Nm; 2] {
        match self.lens.shape {
            FieldShape::Rectangle => self.usable_field(),
            FieldShape::Circle => [Nm::ceil(2.0 * self.field_reach() * NM_PER_MM); 2],
        }
    }

    /// How far from the optical axis a point may be marked at all, mm.
    pub fn farthest_in_field(&self) -> f64 {
        let [x, y] = self.lens.field.map(|f| f.as_mm() / 2.0 - self.lens.margin.as_mm());
        match self.lens.shape {
            FieldShape::Rectangle => math::hypot(x, y),
            FieldShape::Circle => x.min(y),
        }
    }

    /// How far from the optical axis a point may be marked in any direction, mm.
    pub fn field_reach(&self) -> f64 {
        let [x, y] = self.lens.field.map(|f| f.as_mm() / 2.0 - self.lens.margin.as_mm());
        x.min(y)
    }

    /// Whether a field point (nm, from the optical axis) may be marked.
    pub fn field_holds(&self, FieldPoint { x, y }: FieldPoint) -> bool {
        let m = self.lens.margin.as_mm();
        let [fx, fy] = self.lens.field.map(|f| (f.as_mm() / 2.0 - m) * NM_PER_MM + 1e-3);
        let (x, y) = (f64::from(x), f64::from(y));
        match self.lens.shape {
            FieldShape::Rectangle => x.abs() <= fx && y.abs() <= fy,
            FieldShape::Circle => math::hypot(x, y) <= fx.min(fy),
        }
    }

    /// The stage increment.
    pub fn increment_nm(&self) -> Nm {
        self.stage.increment.as_nm().expect("an increment beyond 1 mm is refused when the machine is read")
    }

    /// The axis commands that bring the optical axis over the point `p` of the part and the focal plane to
    /// the focal height `lpfl`, the part lying at `origin`.
    pub fn stage_from_part(&self, p: P2<Turned>, lpfl: Nm, origin: Origin) -> Commanded {
        let p = [p.x, p.y, lpfl.0];
        let mut out = Commanded::default();
        for (i, (_, axis)) in self.axes().into_iter().enumerate() {
            out[i] = axis.sign() * (p[i] + origin[i]);
        }
        out
    }

    /// How far the zoom optic shifts the focal plane up or down at most, in whole stage increments; 0 without one.
    pub fn most_focus_shift(&self) -> Nm {
        let half = self.zoom.as_ref().map_or(0.0, |zoom| zoom.range.as_mm() / 2.0 * NM_PER_MM);
        Nm::floor(half + 1e-3).down_to(self.increment_nm())
    }

    /// Time in which the zoom optic goes from one focus shift to another, settling included, s.
    pub fn zoom_time_s(&self, from: Nm, to: Nm) -> f64 {
        let Some(zoom) = self.zoom.as_ref().filter(|_| from != to) else { return 0.0 };
        (to - from).abs().mm() / zoom.speed.as_mm_s() + zoom.settle.as_s()
    }

    /// How commanded angles turn a part whose origin lies at `origin`, as the head sees it; not at all where the
    /// machine has no tilt axes.
    pub fn turn(&self, tilt: TiltAngles, origin: Origin) -> Turn {
        self.tilt.as_ref().map_or_else(Turn::none, |table| table.turn(tilt, origin))
    }

    /// Time in which the tilt axes go from one pair of commands to another, s.
    pub fn tilt_time_s(&self, from: TiltAngles, to: TiltAngles) -> f64 {
        let axes = self.tilt.iter().flat_map(|table| &table.axes).zip(from.0.iter().zip(to.0));
        axes.filter(|(_, (from, to))| **from != *to).map(|(axis, _)| axis.move_time.as_s()).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_profile_loads_and_names_its_sources() {
        for (name, text) in PROFILES {
            let m = Machine::built_in(name).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(m.name, name);
            for line in text.lines().filter(|l| l.contains(" = ") && l.chars().any(|c| c.is_ascii_digit())) {
                assert!(
                    line.contains('#') || line.starts_with("name") || line.starts_with("source"),
                    "{name}: {line:?} names no source"
                );
            }
        }
    }

    #[test]
    fn stage_commands_have_the_signs_of_their_axes() {
        let mut m = Machine::built_in("xyz-galvo-40").expect("profile");
        for carries in [Carries::Part, Carries::Head] {
            for reversed in [false, true] {
                m.stage.x.carries = carries;
                m.stage.z.reversed = reversed;
                let stage = m.stage_from_part(P2::new(1_000_001, -5), Nm(77), Origin([3, 4_000_000, -9]));
                let signs = m.axes().map(|(_, axis)| axis.sign());
                assert_eq!([0, 1, 2].map(|k| signs[k] * stage[k]), [1_000_004, 3_999_995, 68]);
            }
        }
    }

    #[test]
    fn the_usable_field_is_even_and_inside_the_field() {
        let m = Machine::built_in("xyz-galvo-40").expect("profile");
        assert_eq!(m.usable_field(), [Nm(40_000_000); 2]);
        assert!(m.field_holds(FieldPoint::new(20_000_000, -20_000_000)));
        assert!(!m.field_holds(FieldPoint::new(20_000_001, 0)));
    }
}

//! The table of compared systems: what each is called, how its figures are found, and when its turn comes.
//!
//! A system is a function from what all systems share to its figures, and a row here.

use super::follow::Follower;
use super::{Curves, Figures, Subject, stepped, tool_servo};
use terrace_core::diag::Error;
use terrace_core::progress::Task;
use terrace_input::job::Method;
use terrace_plan::on_the_fly::decompose::Family;
use terrace_plan::on_the_fly::xyzacuv::ToolPath;

/// How the figures of a system are found.
#[derive(Clone, Copy, Debug)]
pub(super) enum Run {
    /// Of a stepped plan. These share a plan, so they run one after the other.
    Stepped(fn(&Subject<'_>, Task<'_>) -> Result<Figures, Error>),
    /// Of the beam's path on the fly, with what the system has to show. Each of these runs by itself.
    OnTheFly(fn(&Follower<'_>, &mut Curves) -> Result<Figures, Error>),
}

/// Ways of marking that differ in little else than their methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// X, Y and Z step.
    Stepped,
    /// The same with a zoom optic.
    Zoom,
    /// The same with a tilt table.
    Tilt,
    /// The same with tilt axes that carry the head.
    HeadTilt,
    /// Scanner and stage move together.
    OnTheFly,
    /// Five stage axes and the scanner move together.
    SevenAxes,
    /// Five stage axes alone.
    FiveAxes,
    /// Another process: a fast tool servo turns the surface.
    ToolServo,
}

/// A way of marking a part.
#[derive(Debug)]
pub struct System {
    /// Its name on the command line and in tables.
    pub name: &'static str,
    /// Of one kind, the verdict tells the fastest.
    pub(super) kind: Kind,
    pub(super) run: Run,
    /// Systems of the lowest number begin first: what takes longest on one thread should not begin last.
    pub(super) start: u8,
}

/// All systems, in the order of the table.
pub static SYSTEMS: [&System; 14] = [
    // What `compile` makes where no method is asked for.
    &System {
        name: "auto",
        kind: Kind::Stepped,
        run: Run::Stepped(|s, t| stepped::measure_method(s, Method::Auto, t)),
        start: 1,
    },
    // Fields side by side, one focal plane each.
    &System { name: "flat", kind: Kind::Stepped, run: Run::Stepped(stepped::flat), start: 1 },
    // The methods of partition.
    &System {
        name: "contour",
        kind: Kind::Stepped,
        run: Run::Stepped(|s, t| stepped::measure_method(s, Method::Contour, t)),
        start: 1,
    },
    &System { name: "z-range", kind: Kind::Stepped, run: Run::Stepped(stepped::z_range), start: 1 },
    &System {
        name: "window",
        kind: Kind::Stepped,
        run: Run::Stepped(|s, t| stepped::measure_method(s, Method::Window, t)),
        start: 1,
    },
    // Levels changed by a zoom optic in the head.
    &System { name: "zoom", kind: Kind::Zoom, run: Run::Stepped(stepped::zoom), start: 1 },
    // The part tilted at each stop.
    &System { name: "tilt", kind: Kind::Tilt, run: Run::Stepped(stepped::tilt), start: 1 },
    // The head tilted at each stop: rob-scan.
    &System { name: "head-tilt", kind: Kind::HeadTilt, run: Run::Stepped(stepped::head_tilt), start: 1 },
    // Scanner and stage synchronised, strokes in their order, the stage by moving average.
    &System { name: "sync", kind: Kind::OnTheFly, run: Run::OnTheFly(|f, c| f.synchronised(c)), start: 2 },
    // As "sync", the texture cut into bands of depth over the whole part; z steps between them.
    &System { name: "sync-bands", kind: Kind::OnTheFly, run: Run::OnTheFly(|f, _| f.bands()), start: 4 },
    // Seven axes, by the Gaussian decomposition of the article and by least acceleration.
    &System {
        name: "7-axis",
        kind: Kind::SevenAxes,
        run: Run::OnTheFly(|f, c| f.turning(ToolPath::Filtered(Family::Gaussian), c)),
        start: 3,
    },
    &System {
        name: "7-axis-smooth",
        kind: Kind::SevenAxes,
        run: Run::OnTheFly(|f, c| f.turning(ToolPath::LeastAcceleration, c)),
        start: 0,
    },
    // Five axes, the scanner at rest.
    &System {
        name: "5-axis",
        kind: Kind::FiveAxes,
        run: Run::OnTheFly(|f, c| f.turning(ToolPath::OnTheMark, c)),
        start: 5,
    },
    // The surface itself, turned with a fast tool servo.
    &System { name: "tool-servo", kind: Kind::ToolServo, run: Run::OnTheFly(|f, _| tool_servo::turned(f)), start: 5 },
];

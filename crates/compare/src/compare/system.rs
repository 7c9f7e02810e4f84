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
    /// The name of the system on the command line and in tables.
    pub name: &'static str,
    /// What it is, as a phrase in Markdown.
    pub about: &'static str,
    /// Of one kind, the verdict names the fastest.
    pub(super) kind: Kind,
    pub(super) run: Run,
    /// Systems of the lowest number begin first: what takes longest on one thread should not begin last.
    pub(super) start: u8,
}

/// All systems, in the order of the table.
pub static SYSTEMS: [&System; 14] = [
    &System {
        name: "auto",
        about: "the stepped job that `terrace compile` makes where no method is asked for: the best of `contour`, \
                `z-range` and `window`",
        kind: Kind::Stepped,
        run: Run::Stepped(|s, t| stepped::measure_method(s, Method::Auto, t)),
        start: 1,
    },
    &System {
        name: "flat",
        about: "fields side by side, each focused on the middle of its marks; no levels",
        kind: Kind::Stepped,
        run: Run::Stepped(stepped::flat),
        start: 1,
    },
    &System {
        name: "contour",
        about: "the stepped job that `terrace compile` makes by this method",
        kind: Kind::Stepped,
        run: Run::Stepped(|s, t| stepped::measure_method(s, Method::Contour, t)),
        start: 1,
    },
    &System {
        name: "z-range",
        about: "the stepped job that `terrace compile` makes by this method",
        kind: Kind::Stepped,
        run: Run::Stepped(stepped::z_range),
        start: 1,
    },
    &System {
        name: "window",
        about: "the stepped job that `terrace compile` makes by this method",
        kind: Kind::Stepped,
        run: Run::Stepped(|s, t| stepped::measure_method(s, Method::Window, t)),
        start: 1,
    },
    &System {
        name: "zoom",
        about: "the stepped job by `z-range` on the machine with its zoom optic, as `terrace compile` makes it; all \
                other rows do without the optic",
        kind: Kind::Zoom,
        run: Run::Stepped(stepped::zoom),
        start: 1,
    },
    &System {
        name: "tilt",
        about: "the stepped job with the part tilted at every stop",
        kind: Kind::Tilt,
        run: Run::Stepped(stepped::tilt),
        start: 1,
    },
    &System {
        name: "head-tilt",
        about: "the same with the head tilted over a part that stays: the article's rob-scan, stepped",
        kind: Kind::HeadTilt,
        run: Run::Stepped(stepped::head_tilt),
        start: 1,
    },
    &System {
        name: "sync",
        about: "scanner and stage synchronised: the stage follows a moving average of the beam's path, z included",
        kind: Kind::OnTheFly,
        run: Run::OnTheFly(|f, c| f.synchronised(c)),
        start: 2,
    },
    &System {
        name: "sync-bands",
        about: "the same for each band of depth over the whole part, without skywriting; z steps from band to band",
        kind: Kind::OnTheFly,
        run: Run::OnTheFly(|f, _| f.bands()),
        start: 4,
    },
    &System {
        name: "7-axis",
        about: "X Y Z A C follow the Gaussian-smoothed path with its normal; the scanner adds the difference (Ma et \
                al. 2025)",
        kind: Kind::SevenAxes,
        run: Run::OnTheFly(|f, c| f.turning(ToolPath::Filtered(Family::Gaussian), c)),
        start: 3,
    },
    &System {
        name: "7-axis-smooth",
        about: "the same with stage axes of least acceleration within the same limits",
        kind: Kind::SevenAxes,
        run: Run::OnTheFly(|f, c| f.turning(ToolPath::LeastAcceleration, c)),
        start: 0,
    },
    &System {
        name: "5-axis",
        about: "X Y Z A C carry the whole motion; the scanner does not move",
        kind: Kind::FiveAxes,
        run: Run::OnTheFly(|f, c| f.turning(ToolPath::OnTheMark, c)),
        start: 5,
    },
    &System {
        name: "tool-servo",
        about: "another process, for reference: a fast tool servo turns the surface itself (Brecher et al.); needs \
                `[tool_servo]` in the machine file and `--nurbs`",
        kind: Kind::ToolServo,
        run: Run::OnTheFly(|f, _| tool_servo::turned(f)),
        start: 5,
    },
];

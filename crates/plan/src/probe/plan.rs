//! Points to measure, what measures them, and how it gets there.

use terrace_core::geom::SpacePoint;
use terrace_core::machine::{Commanded, Machine, Origin, Probe};
use terrace_register::Known;

/// What measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tool {
    /// The touch probe of the machine file.
    Touch(Probe),
    /// A distance sensor along the beam, or whatever else brings the focus onto a point; its standard deviation, mm.
    Sensor(f64),
}

/// A move of the stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Move {
    /// At top speed, all axes that differ; x and y never together with z.
    Rapid(Commanded),
    /// Down until the tip touches, at most to here.
    Touch(Commanded),
}

/// A point to measure.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbePoint {
    /// Its name: P001 and so on.
    pub name: String,
    /// Where it lies on the part, mm.
    pub part_mm: SpacePoint,
    /// Where the axes stand as the tip would touch there, or with the focus there, commanded, nm.
    pub stage: Commanded,
}

/// Points to measure, and what they would show.
#[derive(Clone, Debug)]
pub struct Probing {
    /// What measures.
    pub tool: Tool,
    /// How far the part may lie from where the job says, mm.
    pub search_mm: f64,
    /// The machine.
    pub machine: Machine,
    /// Where the part's origin lies, about.
    pub origin: Origin,
    /// The points in the order in which they are measured.
    pub points: Vec<ProbePoint>,
    /// How the probe gets there; none without a touch probe.
    pub moves: Vec<Move>,
    /// What is known before, after these points, and after an even net of as many. The cost is stops over those of a
    /// part that is known exactly.
    pub before: Known,
    /// See `before`.
    pub after: Known,
    /// See `before`.
    pub of_net: Known,
    /// Deviations that stops keep free.
    pub sigmas: f64,
    /// How far the part was believed to be warped, mm; None of a rigid part, and where earlier points have shown it.
    pub believed: Option<f64>,
    /// How many earlier points were taken into account.
    pub earlier: usize,
    /// The job's texture, and its standard deviation after these points: place, mm beside the placement, and mm.
    pub deviations: Vec<([f64; 2], f64)>,
}

//! Where a pass begins: what the passes before it have left.

use super::setups::{CellId, Setups};
use terrace_core::geom::Nm;
use terrace_core::machine::{Commanded, Machine, Origin};
use terrace_core::program::{PassId, Stop};

/// Where a pass begins and how deep it lies.
pub(super) struct Start {
    /// The pass, from 0.
    pub(super) pass: PassId,
    /// By how much the surface has sunk.
    pub(super) lowered: Nm,
    /// Where the part lies, as the first pass has laid it; None in that pass.
    pub(super) part: Option<PartPosition>,
    /// Position of the stage.
    pub(super) from: Commanded,
    /// Where the pass before has left the head, in heights of the surface as it was; None in the first pass.
    pub(super) before: Option<HeadPosition>,
    /// By how much the zoom optic shifts the focal plane.
    pub(super) focus_shift: Nm,
}

/// Where the first pass has laid the part.
pub(super) struct PartPosition {
    /// The part's origin, as it has sunk since.
    pub(super) origin: Origin,
    pub(super) setups: Setups,
}

/// Where the head stands.
#[derive(Clone)]
pub(super) struct HeadPosition {
    /// The stop, its focus the plane that the stage sets.
    pub(super) stop: Stop,
    /// Position of the stage.
    pub(super) stage: Commanded,
    /// The cell of its set-up.
    pub(super) cell: CellId,
}

impl Start {
    /// The start of the first pass: the stage at the centre of its travel, lifted.
    pub(super) fn first(machine: &Machine) -> Self {
        let [x, y, _] = machine.axes().map(|(_, axis)| axis.middle().0);
        let from = Commanded([x, y, machine.retract_z().0]);
        Self { pass: PassId(0), lowered: Nm(0), part: None, from, before: None, focus_shift: Nm(0) }
    }
}

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
    pub(super) laid: Option<Laid>,
    /// Position of the stage.
    pub(super) from: Commanded,
    /// The stop where it stands, its focus the plane that the stage sets, in heights of the surface as it was, and the
    /// cell of its set-up.
    pub(super) before: Option<(Stop, CellId)>,
    /// What the zoom optic is at.
    pub(super) focus_shift: Nm,
}

/// Where the first pass has laid the part.
pub(super) struct Laid {
    /// The part's origin, as it has sunk since.
    pub(super) origin: Origin,
    pub(super) setups: Setups,
}

impl Start {
    /// The start of the first pass: the stage at the centre of its travel, lifted.
    pub(super) fn first(machine: &Machine) -> Self {
        let [x, y, _] = machine.axes().map(|(_, axis)| axis.middle().0);
        let from = Commanded([x, y, machine.retract_z().0]);
        Self { pass: PassId(0), lowered: Nm(0), laid: None, from, before: None, focus_shift: Nm(0) }
    }
}

//! The stage as a pass finds it, and when the head lifts between two stops.

use super::start::{HeadPosition, Start};
use terrace_core::clearance::{Clearance, Head};
use terrace_core::geom::Nm;
use terrace_core::machine::{Commanded, Machine, Origin, TiltAngles};
use terrace_core::program::Stop;
use terrace_input::job::StopOrder;

/// The stage as a pass finds it.
pub(super) struct PassStage<'a> {
    pub(super) machine: &'a Machine,
    pub(super) clearance: &'a Clearance,
    pub(super) start: &'a Start,
    /// Where the part's origin lies, nm.
    pub(super) origin: Origin,
    pub(super) climb: StopOrder,
}

/// A stop, its focus the plane that the stage sets, and the position of the stage there.
#[derive(Clone, Copy)]
pub(super) struct CommandedStop<'a> {
    pub(super) stop: &'a Stop,
    pub(super) stage: Commanded,
}

/// Says of the blocks of a pass, one after another, whether the stage must lift on its way there.
pub(super) struct Lifts<'a> {
    stage: &'a PassStage<'a>,
    /// Where the head stands; None before the first block of the first pass.
    head: Option<HeadPosition>,
}

impl<'a> Lifts<'a> {
    pub(super) fn new(stage: &'a PassStage<'a>) -> Self {
        Self { stage, head: stage.start.before.clone() }
    }

    /// Whether the stage must lift on its way to the next block, the part at `origin` in its set-up; the head stands
    /// there then.
    pub(super) fn is_needed_to(&mut self, next: HeadPosition, origin: Origin) -> bool {
        let is_needed = self.head.as_ref().is_some_and(|last| {
            // The part is set up anew between two set-ups.
            last.cell != next.cell || self.stage.lifts_between(last.commanded(), next.commanded(), origin)
        });
        self.head = Some(next);
        is_needed
    }
}

impl HeadPosition {
    fn commanded(&self) -> CommandedStop<'_> {
        CommandedStop { stop: &self.stop, stage: self.stage }
    }
}

impl PassStage<'_> {
    /// Whether the commands of a stop are those of a tilted head, which are rounded.
    pub(super) fn rounds(&self, stop: &Stop) -> bool {
        self.machine.tilts_head() && !stop.tilt.is_upright()
    }

    /// Whether the stage must lift between two stops with their commands, of a part that lies at `origin`.
    pub(super) fn lifts_between(&self, from: CommandedStop<'_>, to: CommandedStop<'_>, origin: Origin) -> bool {
        // Where commands are rounded they decide, not the stops that they stand for.
        if !self.rounds(from.stop) && !self.rounds(to.stop) {
            return self.lifts(from.stop, to.stop);
        }
        // The surface is that before it sank, as everywhere here.
        let Origin([x, y, z]) = origin;
        let head =
            Head { machine: self.machine, origin: Origin([x, y, z + self.start.lowered.0]), clearance: self.clearance };
        head.over_move((from.stage, from.stop.tilt), (to.stage, to.stop.tilt)) > Nm(0)
    }

    /// Whether the stage must lift between two stops.
    pub(super) fn lifts(&self, a: &Stop, b: &Stop) -> bool {
        if a.tilt == b.tilt {
            return a.centre != b.centre && self.lowest_between(a, b) - self.start.lowered < self.lowest_over(a, b);
        }
        let turn = |u: i64, v: i64| self.machine.turn(TiltAngles([u, v]), self.origin);
        let [[a0, a1], [b0, b1]] = [a.tilt.0, b.tilt.0];
        a.lpfl - self.start.lowered
            < self.clearance.lowest_swing([turn(a0, a1), turn(b0, a1), turn(a0, b1), turn(b0, b1)])
    }

    /// The lowest focal plane on the way from one stop to another of the same tilt, without a lift.
    pub(super) fn lowest_between(&self, a: &Stop, b: &Stop) -> Nm {
        if self.machine.stage.diagonal { a.lpfl.min(b.lpfl) } else { a.lpfl }
    }

    /// Whether the head keeps clear of the part where it stands at a stop.
    pub(super) fn is_clear(&self, stop: &Stop) -> bool {
        stop.lpfl - self.start.lowered >= self.lowest_over(stop, stop)
    }

    /// The lowest focal plane at which the stage may go straight from one stop to another of the same tilt.
    pub(super) fn lowest_over(&self, a: &Stop, b: &Stop) -> Nm {
        if a.tilt.is_upright() {
            return self.clearance.lowest_focus(a.centre, b.centre);
        }
        let turn = self.machine.turn(a.tilt, self.origin);
        self.clearance.lowest_swing([turn; 4])
    }
}

//! The time of a program by the machine's motion model.

use super::start::Start;
use crate::manifest::{Loading, Times};
use terrace_core::machine::{Machine, TiltAngles};
use terrace_core::motion::{self, Marking, StageMove};
use terrace_core::program::Program;
use terrace_input::job::Job;

/// Time that loading one block takes, s, as far as it is known.
pub(super) fn load_s(job: &Job, machine: &Machine) -> f64 {
    Loading::new(job, machine, 0, 0.0).load_s
}

/// The time of a program that begins as every job does.
pub fn of_program(machine: &Machine, program: &Program) -> Times {
    times(machine, &Start::first(machine), program).0
}

/// The time of a program that begins at `start`, and that of every block without the stage's moves, s.
pub(super) fn times(machine: &Machine, start: &Start, program: &Program) -> (Times, Vec<f64>) {
    let mut t = Times::default();
    let mut blocks = Vec::with_capacity(program.blocks.len());
    for BlockStep { moved, zoom_s, marking } in steps(machine, start, program) {
        t.stage += moved.travel_s;
        t.settle += moved.settle_s;
        t.zoom += zoom_s;
        t.mark += marking.mark_s;
        t.jump += marking.jump_s;
        t.delay += marking.delay_s;
        blocks.push(marking.total_s());
    }
    t.total = t.stage + t.settle + t.zoom + t.mark + t.jump + t.delay;
    (t, blocks)
}

/// For every block of a program that begins as every job does: when the stage begins to move there, when the first mark
/// begins and when the last one ends, s.
pub fn clock_of_program(machine: &Machine, program: &Program) -> Vec<[f64; 3]> {
    let mut now = 0.0;
    let mut clock = Vec::with_capacity(program.blocks.len());
    for BlockStep { moved, zoom_s, marking } in steps(machine, &Start::first(machine), program) {
        let begin = now;
        let start = begin + moved.total_s() + zoom_s;
        now = start + marking.total_s();
        clock.push([begin, start, now]);
    }
    clock
}

/// What it takes to go to a block and mark it.
struct BlockStep {
    moved: StageMove,
    /// Time of the zoom optic beyond the move of the stage.
    zoom_s: f64,
    marking: Marking,
}

/// The steps of a program that begins at `start`.
fn steps<'a>(machine: &'a Machine, start: &Start, program: &'a Program) -> impl Iterator<Item = BlockStep> + use<'a> {
    let mut focus_shift = start.focus_shift;
    let (mut at, mut tilt) = (start.from, start.before.as_ref().map_or(TiltAngles::UPRIGHT, |head| head.stop.tilt));
    program.blocks.iter().map(move |block| {
        let retract = block.retract.then(|| machine.retract_z());
        let turning = machine.tilt_time_s(tilt, block.stop.tilt);
        let moved = motion::tilting_move(machine, at, block.stage, retract, turning);
        tilt = block.stop.tilt;
        // The optic moves together with the stage.
        let zoom_s = (machine.zoom_time_s(focus_shift, block.focus_shift) - moved.total_s()).max(0.0);
        (at, focus_shift) = (block.stage, block.focus_shift);
        let marks = program.strokes_of(block).iter().map(|s| {
            let pen = &program.pens[s.pen.index()];
            motion::Mark { points: program.points_of(s), speed: pen.speed, passes: pen.passes, dwell: pen.dwell }
        });
        BlockStep { moved, zoom_s, marking: motion::marking(machine, marks) }
    })
}

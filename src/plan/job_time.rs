//! The time of a program by the machine's motion model.

use super::start::Start;
use crate::emit;
use crate::job::Job;
use crate::machine::{Machine, TiltAngles};
use crate::manifest::Times;
use crate::motion;
use crate::program::Program;

/// Time that a person needs for each block, s; 0 where nobody is needed.
pub(super) fn load_s(job: &Job, machine: &Machine) -> f64 {
    if emit::needs_person(&job.formats) { machine.load_s() } else { 0.0 }
}

/// The time of a program that begins as every job does.
pub fn of_program(machine: &Machine, program: &Program) -> Times {
    times(machine, &Start::first(machine), program).0
}

/// The time of a program that begins at `start`, and that of every block without the stage's moves, s.
pub(super) fn times(machine: &Machine, start: &Start, program: &Program) -> (Times, Vec<f64>) {
    let mut t = Times::default();
    let mut focus_shift = start.focus_shift;
    let (mut at, mut tilt) = (start.from, start.before.as_ref().map_or(TiltAngles::UPRIGHT, |(stop, _)| stop.tilt));
    let mut blocks = Vec::with_capacity(program.blocks.len());
    for block in &program.blocks {
        let retract = block.retract.then(|| machine.retract_z());
        let turning = machine.tilt_time_s(tilt, block.stop.tilt);
        let moved = motion::tilting_move(machine, at, block.stage, retract, turning);
        tilt = block.stop.tilt;
        t.stage += moved.travel_s;
        t.settle += moved.settle_s;
        // The optic moves together with the stage.
        t.zoom += (machine.zoom_time_s(focus_shift, block.focus_shift) - moved.total_s()).max(0.0);
        (at, focus_shift) = (block.stage, block.focus_shift);
        let marks = program.strokes_of(block).iter().map(|s| {
            let pen = &program.pens[s.pen.index()];
            motion::Mark { points: program.points_of(s), speed: pen.speed, passes: pen.passes, dwell: pen.dwell }
        });
        let m = motion::marking(machine, marks);
        t.mark += m.mark_s;
        t.jump += m.jump_s;
        t.delay += m.delay_s;
        blocks.push(m.total_s());
    }
    t.total = t.stage + t.settle + t.zoom + t.mark + t.jump + t.delay;
    (t, blocks)
}

//! The estimated times of a job, found again from the program and the machine file by the model that
//! `docs/reference/formats.md` states, with arithmetic of the verifier's own.

use crate::read::program::ProgramFile;
use crate::rest_to_rest::{CORNER, profile_time};
use terrace_core::geom::{FieldPoint, NM_PER_MM, Nm, mm_from_nm};
use terrace_core::machine::{Axis, Commanded, Machine, TiltAngles};
use terrace_core::math;
use terrace_core::program::{Block, Program, Stroke};

/// Times of the blocks or of a job, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Times {
    pub(super) stage: f64,
    pub(super) settle: f64,
    pub(super) zoom: f64,
    pub(super) mark: f64,
    pub(super) jump: f64,
    pub(super) delay: f64,
}

impl Times {
    pub(super) fn total(&self) -> f64 {
        self.stage + self.settle + self.zoom + self.mark + self.jump + self.delay
    }
}

/// Marks, jumps and delays of a block. Each stroke is marked as often as its pen says before the next, with a jump back
/// to its start in between. Where the machine states the acceleration of its scanner, the spot rests at both ends of
/// every jump, and at ends and corners of marks, and every pass costs a jump delay; else it is always at speed, and a
/// pass costs a jump delay, a mark delay, and a polygon delay at each inner point. Of a dot the dwell of its pen takes
/// the place of the way.
pub(super) fn marking(program: &Program, block: &Block, machine: &Machine) -> Times {
    let mut out = Times::default();
    // Where the beam stands: at the end of the stroke before, and before the first on the axis.
    let mut beam = FieldPoint::AXIS;
    let jump_speed = machine.scanner.jump_speed.as_mm_s();
    for stroke in program.strokes_of(block) {
        let pen = &program.pens[stroke.pen.index()];
        let points = program.points_of(stroke);
        let (Some(&first), Some(&last)) = (points.first(), points.last()) else { continue };
        let passes = f64::from(pen.passes);
        let dwell = if points.len() == 1 { pen.dwell.map_or(0.0, |dwell| dwell.as_s()) } else { 0.0 };
        // Every pass but the first begins with a jump back to the start.
        let again = (passes - 1.0).max(0.0);
        let delays = &machine.delays;
        out.mark += passes * dwell;
        if let Some(acceleration) = machine.scanner.acceleration {
            let acceleration = acceleration.as_mm_s2();
            let jerk = machine.scanner.jerk.map(|j| j.as_mm_s3());
            out.mark += passes * from_rest_to_rest(points, pen.speed.as_mm_s(), acceleration, jerk);
            let jump = |from, to| from_rest_to_rest(&[from, to], jump_speed, acceleration, jerk);
            out.jump += jump(beam, first) + again * jump(last, first);
            out.delay += passes * delays.jump.as_s();
        } else {
            out.mark += passes * points.windows(2).map(|w| way_mm(w[0], w[1])).sum::<f64>() / pen.speed.as_mm_s();
            out.jump += (way_mm(beam, first) + again * way_mm(last, first)) / jump_speed;
            let corners = points.len().saturating_sub(2) as f64;
            out.delay += passes * (delays.jump.as_s() + delays.mark.as_s() + corners * delays.polygon.as_s());
        }
        beam = last;
    }
    out
}

/// Time of a polyline at the end of which the spot rests, and wherever it turns by more than [`CORNER`]. Along either
/// axis of the field it keeps its limits: acceleration, mm/s², and jerk, mm/s³, where there is one. A piece in which an
/// axis has no more than a share of the way goes faster by as much as that leaves.
fn from_rest_to_rest(points: &[FieldPoint], speed: f64, acceleration: f64, jerk: Option<f64>) -> f64 {
    // Of the piece from the last rest on: its length, and the largest share of it that one axis has.
    let (mut sum, mut way, mut share) = (0.0, 0.0, 0.0f64);
    let piece = |way: f64, share: f64| profile_time(way, speed, acceleration / share, jerk.map(|j| j / share));
    let mut before: Option<[f64; 2]> = None;
    for pair in points.windows(2) {
        let [dx, dy] = [f64::from(pair[1].x) - f64::from(pair[0].x), f64::from(pair[1].y) - f64::from(pair[0].y)];
        let length = math::hypot(dx, dy);
        if length == 0.0 {
            continue;
        }
        let heading = [dx / length, dy / length];
        let turns = |[x, y]: [f64; 2]| x * heading[0] + y * heading[1] < math::cos(CORNER);
        if before.is_some_and(turns) {
            sum += piece(way, share);
            (way, share) = (0.0, 0.0);
        }
        way += length / NM_PER_MM;
        share = share.max(heading[0].abs().max(heading[1].abs()));
        before = Some(heading);
    }
    sum + piece(way, share)
}

/// Length of a stroke, every pass of its pen counted.
pub(super) fn marked_mm(program: &Program, stroke: &Stroke) -> f64 {
    let mm: f64 = program.points_of(stroke).windows(2).map(|w| way_mm(w[0], w[1])).sum();
    mm * f64::from(program.pens[stroke.pen.index()].passes)
}

/// Length of a block's jumps, each stroke marked once.
pub(super) fn jump_mm(program: &Program, block: &Block) -> f64 {
    let mut beam = FieldPoint::AXIS;
    let mut sum = 0.0;
    for points in program.strokes_of(block).iter().map(|s| program.points_of(s)) {
        if let (Some(&first), Some(&last)) = (points.first(), points.last()) {
            sum += way_mm(beam, first);
            beam = last;
        }
    }
    sum
}

/// Stage, settling and zoom optic of the whole job: from the centre of travel, lifted and in focus, over all blocks in
/// order. The optic moves together with the stage; what it takes longer counts.
pub(super) fn stage(file: &ProgramFile, machine: &Machine) -> Times {
    let mut out = Times::default();
    let mut shift = Nm(0);
    for (block, moved) in file.program.blocks.iter().zip(moves(file, machine)) {
        let way = (block.focus_shift - shift).abs().mm();
        let optic = machine.zoom.as_ref().filter(|_| block.focus_shift != shift);
        let optic = optic.map_or(0.0, |zoom| way / zoom.speed.as_mm_s() + zoom.settle.as_s());
        out.stage += moved.stage;
        out.settle += moved.settle;
        out.zoom += (optic - moved.stage - moved.settle).max(0.0);
        shift = block.focus_shift;
    }
    out
}

/// The move of the stage to every block.
fn moves(file: &ProgramFile, machine: &Machine) -> Vec<Times> {
    let centre = |axis: &Axis| axis.travel.iter().map(|t| t.as_nm().unwrap_or_default().0).sum::<i64>() / 2;
    let Nm(top) = machine.retract_z();
    let (mut at, mut tilt) =
        (Commanded([centre(&machine.stage.x), centre(&machine.stage.y), top]), TiltAngles::UPRIGHT);
    let mut all = Vec::with_capacity(file.program.blocks.len());
    for block in &file.program.blocks {
        let mut out = Times::default();
        let turning = machine.tilt.iter().flat_map(|t| &t.axes).zip(tilt.0.iter().zip(block.stop.tilt.0));
        let turning = turning.filter(|(_, (from, to))| **from != *to).map(|(axis, _)| axis.move_time.as_s());
        let turning = turning.fold(0.0, f64::max);
        let [x, y, z] = [0, 1, 2].map(|k| (at[k], block.stage[k]));
        let lifted = block.retract && at[2] != top;
        let across = x.0 != x.1 || y.0 != y.1 || turning > 0.0;
        (at, tilt) = (block.stage, block.stop.tilt);
        if across || z.0 != z.1 || lifted {
            if let Some(measured) = machine.stage.move_times {
                // They hold the settling; a move of z alone that lifts first is one measured move of z.
                let base = if across { measured.xy.as_s().max(turning) } else { measured.z.as_s() };
                out.stage = base + if lifted && across { measured.z.as_s() } else { 0.0 };
            } else {
                let high = if block.retract { top } else { z.0 };
                let axes = &machine.stage;
                let plane = axis_time(&axes.x, x.0, x.1).max(axis_time(&axes.y, y.0, y.1)).max(turning);
                let (up, down) = (axis_time(&axes.z, z.0, high), axis_time(&axes.z, high, z.1));
                let is_diagonal = axes.diagonal && !block.retract && z.0 != top;
                out.stage = if is_diagonal { plane.max(down) } else { up + down + plane };
                let settling = axes.settle.by_axis().map(|time| time.as_s());
                let moved = [across, z.0 != z.1 || lifted];
                out.settle =
                    settling.into_iter().zip(moved).filter(|(_, moved)| *moved).map(|(s, _)| s).fold(0.0, f64::max);
            }
        }
        all.push(out);
    }
    all
}

/// An axis of the stage from rest to rest.
fn axis_time(axis: &Axis, from: i64, to: i64) -> f64 {
    let way = mm_from_nm((to - from).abs());
    let jerk = axis.jerk.map(|j| j.as_mm_s3());
    profile_time(way, axis.speed.as_mm_s(), axis.acceleration.as_mm_s2(), jerk)
}

fn way_mm(a: FieldPoint, b: FieldPoint) -> f64 {
    math::hypot(f64::from(b.x) - f64::from(a.x), f64::from(b.y) - f64::from(a.y)) / NM_PER_MM
}

//! `travel`: the stage is at the position of the block, within its travel and on its increment, and so does every
//! position that the stage programs command on the way.

use std::collections::BTreeMap;

use super::stage::{Moves, StageFile};
use super::stage_text;
use crate::geometry::{HeadPose, Turn};
use crate::proof::Rule;
use crate::read::program::ProgramFile;
use terrace_core::geom::{NM_PER_MM, Nm, P3, mm_from_nm};
use terrace_core::machine::{AngleCommands, Carries, Machine, Origin};
use terrace_core::program::Block;

/// Holds the rule.
pub(super) fn check(stages: &[StageFile], file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    rule.ran = true;
    for (id, block) in file.ids.iter().zip(&file.program.blocks) {
        rule.checked += 1;
        let (c, place) = (block.stop.centre, super::part_place(block.stop.centre));
        // The heights that stage and zoom optic set together are for `depth`.
        if let Some(fault) = head_fault(machine, block, file.origin(block)) {
            rule.broken(id, place, fault);
            continue;
        }
        let mut wanted = machine.stage_from_part(c, block.stop.lpfl, file.origin(block));
        if leans(machine, block) {
            wanted = block.stage;
        } else if machine.zoom.is_some() {
            wanted[2] = block.stage[2];
        }
        if block.stage != wanted {
            let text =
                format!("the stage is at {}, but the block is at {}", stage_text(block.stage), stage_text(wanted));
            rule.broken(id, place, text);
        } else if let Some(fault) = fault(machine, block.stage.0.map(Some)).or_else(|| tilt_fault(machine, block)) {
            rule.broken(id, place, fault);
        }
    }
    for (i, origin) in file.origins.iter().enumerate() {
        rule.checked += 1;
        let by = [0, 1, 2].map(|k| origin[k] - file.origins[0][k]);
        if by[2] != 0 || by.iter().any(|v| v % machine.increment_nm().0.max(1) != 0) {
            let text = format!("set-up {} is not moved by whole increments in x and y alone", i + 1);
            rule.broken("", "program.txt", text);
        }
    }
    moves(stages, file, machine, rule);
}

/// Holds it for the moves of stage programs.
pub(super) fn moves(stages: &[StageFile], file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    let blocks: BTreeMap<&str, &Block> = file.ids.iter().map(String::as_str).zip(&file.program.blocks).collect();
    for stage in stages {
        for moved in Moves::new(stage) {
            rule.checked += 1;
            // The targets themselves were checked above; a lift on the way is a position of its own.
            let target = blocks.get(moved.block).map(|b| b.stage);
            let to = [0, 1, 2].map(|k| moved.to[k].filter(|&v| target.is_none_or(|t| t[k] != v)));
            if let Some(fault) = fault(machine, to) {
                rule.broken(moved.block, stage.place(moved.line), fault);
            }
        }
    }
}

/// Whether the head is turned at a block.
fn leans(machine: &Machine, block: &Block) -> bool {
    !block.stop.tilt.is_upright() && machine.tilt.as_ref().is_some_and(|axes| axes.carries == Carries::Head)
}

/// Where a turned head is not where its block lies. Its centre and its focal plane are whole nanometres there, so that
/// the two may lie half a nanometre apart along each axis of the head.
fn head_fault(machine: &Machine, block: &Block, origin: Origin) -> Option<String> {
    /// Half a nanometre, and what f64 adds.
    const APART: f64 = 0.51;
    let axes = machine.tilt.as_ref().filter(|_| leans(machine, block))?;
    let head = HeadPose::new(machine, block.stage, block.stop.tilt, origin);
    let found = Turn::new(axes, block.stop.tilt, origin).apply(P3::new(head.centre));
    let plane = block.stop.lpfl - block.focus_shift;
    let wanted = [block.stop.centre.x, block.stop.centre.y, plane.0];
    (0..3).any(|k| (found[k] - wanted[k] as f64).abs() > APART).then(|| {
        let mm = |p: [f64; 3]| p.map(|v| v.round() / NM_PER_MM);
        format!(
            "the head is brought to {:?} mm of the part as it sees it, but the block is at {:?} mm",
            mm(found.at),
            mm(wanted.map(|v| v as f64))
        )
    })
}

/// The fault of the commands of the tilt axes.
fn tilt_fault(machine: &Machine, block: &Block) -> Option<String> {
    let Some(table) = &machine.tilt else {
        return (!block.stop.tilt.is_upright()).then(|| "the block is tilted, the machine has no tilt axes".into());
    };
    let wrong = table.axes.iter().zip(block.stop.tilt.0).find(|(axis, command)| !axis.takes(*command));
    wrong.map(|(axis, command)| {
        let (letter, step) = (axis.letter.char(), axis.increment);
        let travel = match (axis.travel.ends(), axis.commands) {
            (Some([lo, hi]), _) => format!("its travel is {lo} to {hi}"),
            (None, AngleCommands::Modulo) => "it is commanded modulo a turn".into(),
            (None, AngleCommands::Absolute) => "it turns".into(),
        };
        format!("{letter} is commanded to {} deg, but {travel} in steps of {step}", command as f64 / 1e6)
    })
}

fn fault(machine: &Machine, to: [Option<i64>; 3]) -> Option<String> {
    for ((name, axis), value) in machine.axes().into_iter().zip(to) {
        let Some(value) = value else { continue };
        let [lo, hi] = axis.travel.map(|t| t.as_nm());
        let (value, mm) = (Nm(value), mm_from_nm(value));
        if lo.is_none_or(|lo| value < lo) || hi.is_none_or(|hi| value > hi) {
            return Some(format!(
                "{name} is commanded to {mm} mm, outside its travel of {} to {}",
                axis.travel[0], axis.travel[1]
            ));
        }
        if value % machine.increment_nm().max(Nm(1)) != Nm(0) {
            return Some(format!(
                "{name} is commanded to {mm} mm, which is not a multiple of {}",
                machine.stage.increment
            ));
        }
    }
    None
}

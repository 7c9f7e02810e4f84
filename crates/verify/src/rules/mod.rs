//! The rules, each with its own file and its own entry in the proof.

pub(super) mod agreement;
pub(super) mod bitmap;
mod clearance;
pub(super) mod coverage;
pub(super) mod curves;
pub(super) mod depth_and_field;
pub(super) mod dose;
pub(super) mod draped;
pub(super) mod drawing;
pub(super) mod drawing_files;
pub(super) mod fill;
mod frames;
pub(super) mod hash;
pub(super) mod laser;
pub(super) mod marked;
pub(super) mod mask;
pub(super) mod measured;
mod off_axis;
pub(super) mod page;
mod paper;
mod planes;
mod poses;
pub(super) mod runsheets;
mod setups;
pub(super) mod shadow;
mod slopes;
mod stage;
pub(super) mod stated;
mod stretch;
mod subset;
pub(super) mod summary;
pub(super) mod sweep;
mod texture_stroke;
mod times;
pub(super) mod travel;
mod turned;

use std::path::Path;

use super::findings::{Findings, RuleCode};
use super::fixtures::Fixture;
use super::geometry::Geometry;
use super::job_facts::JobFacts;
use super::proof::Rule;
use super::read::manifest::Manifest;
use super::read::program::ProgramFile;
use terrace_core::geom::P2;
use terrace_core::machine::Commanded;
use terrace_core::program::{Block, Program};

/// The rules that need the folder alone; returns the stage programs that could be read.
pub(super) fn without_inputs(
    folder: &Path,
    manifest: &Manifest,
    program: &mut ProgramFile,
    facts: &JobFacts,
    findings: &mut Findings,
) -> Stages {
    findings.stops = stops(&program.program);
    findings.fragments = program.program.strokes.len();
    let stages = stage::read(folder, manifest, facts, stage::Targets::Blocks, &mut findings.rules[RuleCode::Agreement]);
    let chosen = subset::chosen(manifest, program, &mut findings.rules[RuleCode::Agreement]);
    agreement::check(manifest, program, &chosen, facts, &mut findings.rules[RuleCode::Agreement]);
    agreement::all_are_known(manifest, &chosen, facts, &mut findings.rules[RuleCode::Agreement]);
    subset::on_chosen(program, &chosen, |program| {
        agreement::files(folder, manifest, program, &chosen, facts, &mut findings.rules[RuleCode::Agreement]);
        stage::agreement(&stages, manifest, program, &facts.machine, &mut findings.rules[RuleCode::Agreement]);
        runsheets::check(folder, manifest, program, facts, &mut findings.rules[RuleCode::Agreement]);
    });
    travel::check(&stages, program, &facts.machine, &mut findings.rules[RuleCode::Travel]);
    laser::check(&stages, &manifest.blocks, &facts.machine, &mut findings.rules[RuleCode::Laser]);
    depth_and_field::field(program, &facts.machine, &mut findings.rules[RuleCode::Field]);
    let frames =
        frames::Frames::read(folder, manifest, program, &chosen, facts, &mut findings.rules[RuleCode::Agreement]);
    if let Some(frames) = &frames {
        travel::moves(&frames.stages, &frames.outline, &facts.machine, &mut findings.rules[RuleCode::Travel]);
        laser::check(&frames.stages, &manifest.blocks, &facts.machine, &mut findings.rules[RuleCode::Laser]);
    }
    Stages { blocks: stages, frames }
}

/// The stage programs of a folder.
pub(super) struct Stages {
    /// The stage files of the blocks.
    blocks: Vec<stage::StageFile>,
    /// The stage files of the blocks' frames, where the job has frames.
    frames: Option<frames::Frames>,
}

/// The moves between the blocks whose files the folder holds, and the figures of these.
pub(super) fn moves(
    stages: &Stages,
    manifest: &Manifest,
    program: &mut ProgramFile,
    facts: &JobFacts,
    around: &Around<'_>,
    findings: &mut Findings,
) {
    // A list that cannot be was reported with the files.
    let chosen = subset::chosen(manifest, program, &mut Rule::new("", ""));
    subset::on_chosen(program, &chosen, |program| {
        clearance::check(&stages.blocks, program, facts, around, findings);
        subset::figures(manifest, program, facts, &mut findings.rules[RuleCode::Summary]);
    });
    if let Some(frames) = &stages.frames {
        clearance::check(&frames.stages, &frames.outline, facts, around, findings);
    }
}

/// What the head keeps clear of.
pub(super) struct Around<'a> {
    pub(super) part: &'a Geometry,
    pub(super) fixtures: &'a [Fixture],
}

/// Standstills of the stage: a block is one, unless the zoom optic alone changes on the way to it.
fn stops(program: &Program) -> usize {
    let stays = |w: &&[Block]| {
        let place = |b: &Block| (b.pass, b.setup, b.stop.tilt, b.stage);
        place(&w[0]) == place(&w[1]) && w[0].focus_shift != w[1].focus_shift && !w[1].retract
    };
    program.blocks.len() - program.blocks.windows(2).filter(stays).count()
}

/// A point of the part as the place of a violation.
fn part_place<F>(p: P2<F>) -> String {
    let [x, y] = p.mm();
    format!("part at ({x:.6}, {y:.6}) mm")
}

/// The name of a place as [`part_place`] writes it, for a point in nm that lies between grid points.
fn part_place_nm([x, y]: [f64; 2]) -> String {
    format!("part at ({:.6}, {:.6}) mm", x / terrace_core::geom::NM_PER_MM, y / terrace_core::geom::NM_PER_MM)
}

/// A stage position in messages.
fn stage_text(stage: Commanded) -> String {
    let [x, y, z] = stage.mm();
    format!("({x}, {y}, {z}) mm")
}

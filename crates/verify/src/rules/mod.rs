//! The rules, each with its own file and its own entry in the proof.

pub(super) mod agreement;
pub(super) mod bitmap;
mod clearance;
pub(super) mod coverage;
pub(super) mod curves;
pub(super) mod depth_and_field;
pub(super) mod dose;
pub(super) mod drawing;
pub(super) mod files;
pub(super) mod fill;
mod frames;
pub(super) mod hash;
pub(super) mod laser;
pub(super) mod mask;
mod off_axis;
pub(super) mod page;
mod paper;
mod planes;
mod poses;
pub(super) mod runsheets;
mod setups;
mod slopes;
mod stage;
pub(super) mod stated;
mod stretch;
mod subset;
pub(super) mod summary;
mod sweep;
mod texture_stroke;
mod times;
pub(super) mod travel;
mod turned;

use std::path::Path;

use super::geometry::Geometry;
use super::job_facts::JobFacts;
use super::proof::{Input, Lengths, NotProved, Proof, Rule};
use super::read::manifest::Manifest;
use super::read::program::ProgramFile;
use terrace_core::geom::P2;
use terrace_core::machine::Commanded;
use terrace_core::program::{Block, Program};

/// The rules and figures while they are being found.
pub(super) struct Findings {
    pub(super) hash: Rule,
    pub(super) agreement: Rule,
    pub(super) depth: Rule,
    pub(super) field: Rule,
    pub(super) travel: Rule,
    pub(super) clearance: Rule,
    pub(super) laser: Rule,
    pub(super) surface: Rule,
    pub(super) dose: Rule,
    pub(super) fill: Rule,
    pub(super) drawing: Rule,
    pub(super) bitmap: Rule,
    pub(super) mask: Rule,
    pub(super) curves: Rule,
    pub(super) source: Rule,
    pub(super) once: Rule,
    pub(super) coverage: Rule,
    pub(super) summary: Rule,
    pub(super) stops: usize,
    pub(super) fragments: usize,
    pub(super) lengths: Lengths,
    pub(super) worst_defocus_um: f64,
    pub(super) worst_incidence_deg: f64,
    pub(super) against: Vec<Input>,
    pub(super) not_proved: Vec<NotProved>,
}

impl Findings {
    pub(super) fn new() -> Self {
        Self {
            hash: Rule::new("hash", "every file is as listed, none is unlisted, and the inputs are unchanged"),
            agreement: Rule::new("agreement", "all files that describe the program agree"),
            depth: Rule::new("depth", "every mark lies within the depth of focus of its block"),
            field: Rule::new("field", "every mark lies in the usable scan field"),
            travel: Rule::new(
                "travel",
                "every stage position is that of its block, within travel and on the increment",
            ),
            clearance: Rule::new("clearance", "the head keeps clear of the part in every move"),
            laser: Rule::new(
                "laser",
                "the laser output is off during every stage move, and the stage settles before the next mark",
            ),
            surface: Rule::new("surface", "no mark lies off the part or on a slope beyond the limit"),
            dose: Rule::new("dose", "pens compensate for the slope under their marks as the job specifies"),
            fill: Rule::new("fill", "lines along contours keep their pitch and fill the job's sections"),
            drawing: Rule::new(
                "drawing",
                "SVG drawings are marked where they show something, with the pen of its colour or label",
            ),
            bitmap: Rule::new("bitmap", "bitmaps are marked where they are dark, and as densely"),
            mask: Rule::new("mask", "what inside and outside leave of a texture is marked, and nothing else"),
            curves: Rule::new("curves", curves::WHAT),
            source: Rule::new("source", "every mark is the piece of texture that it claims to be"),
            once: Rule::new("once", "nothing is marked twice in a pass except declared overlaps"),
            coverage: Rule::new("coverage", "all texture is marked where the part can be marked"),
            summary: Rule::new("summary", "lengths, counts, times and slopes are as stated"),
            stops: 0,
            fragments: 0,
            lengths: Lengths::default(),
            worst_defocus_um: 0.0,
            worst_incidence_deg: 0.0,
            against: Vec::new(),
            not_proved: Vec::new(),
        }
    }

    pub(super) fn into_proof(self) -> Proof {
        let rules = vec![
            self.hash,
            self.agreement,
            self.depth,
            self.field,
            self.travel,
            self.clearance,
            self.laser,
            self.surface,
            self.dose,
            self.fill,
            self.drawing,
            self.bitmap,
            self.mask,
            self.curves,
            self.source,
            self.once,
            self.coverage,
            self.summary,
        ];
        Proof {
            ok: rules.iter().all(|r| r.ran && r.violated == 0),
            rules,
            stops: self.stops,
            fragments: self.fragments,
            lengths: self.lengths,
            worst_defocus_um: self.worst_defocus_um,
            worst_incidence_deg: self.worst_incidence_deg,
            against: self.against,
            not_proved: self.not_proved,
            worst_position_um: None,
        }
    }
}

/// The rules that need the folder alone; answers with the stage programs that could be read.
pub(super) fn without_inputs(
    folder: &Path,
    manifest: &Manifest,
    program: &mut ProgramFile,
    facts: &JobFacts,
    findings: &mut Findings,
) -> Stages {
    findings.stops = stops(&program.program);
    findings.fragments = program.program.strokes.len();
    let stages = stage::read(folder, manifest, facts, false, &mut findings.agreement);
    let chosen = subset::chosen(manifest, program, &mut findings.agreement);
    agreement::check(manifest, program, &chosen, facts, &mut findings.agreement);
    agreement::all_are_known(manifest, &chosen, facts, &mut findings.agreement);
    subset::with(program, &chosen, |program| {
        agreement::files(folder, manifest, (program, &chosen), facts, &mut findings.agreement);
        stage::agreement(&stages, manifest, program, &facts.machine, &mut findings.agreement);
        runsheets::check(folder, manifest, program, facts, &mut findings.agreement);
    });
    travel::check(&stages, program, &facts.machine, &mut findings.travel);
    laser::check(&stages, &manifest.blocks, &facts.machine, &mut findings.laser);
    depth_and_field::field(program, &facts.machine, &mut findings.field);
    let frames = frames::Frames::read(folder, manifest, (program, &chosen), facts, &mut findings.agreement);
    if let Some(frames) = &frames {
        travel::moves(&frames.stages, &frames.outline, &facts.machine, &mut findings.travel);
        laser::check(&frames.stages, &manifest.blocks, &facts.machine, &mut findings.laser);
    }
    Stages { blocks: stages, frames }
}

/// The stage programs of a folder.
pub(super) struct Stages {
    /// Those of the blocks.
    blocks: Vec<stage::StageFile>,
    /// Those of their frames, where it has frames.
    frames: Option<frames::Frames>,
}

/// The moves between the blocks whose files the folder holds, and the figures of these.
pub(super) fn moves(
    stages: &Stages,
    manifest: &Manifest,
    program: &mut ProgramFile,
    facts: &JobFacts,
    geometry: &Geometry,
    findings: &mut Findings,
) {
    // A list that cannot be was reported with the files.
    let chosen = subset::chosen(manifest, program, &mut Rule::new("", ""));
    subset::with(program, &chosen, |program| {
        clearance::check(&stages.blocks, program, facts, geometry, findings);
        subset::figures(manifest, program, facts, &mut findings.summary);
    });
    if let Some(frames) = &stages.frames {
        clearance::check(&frames.stages, &frames.outline, facts, geometry, findings);
    }
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

/// As [`part_place`], for a point in nm that lies between grid points.
fn part_place_nm([x, y]: [f64; 2]) -> String {
    format!("part at ({:.6}, {:.6}) mm", x / terrace_core::geom::NM_PER_MM, y / terrace_core::geom::NM_PER_MM)
}

/// A stage position in messages.
fn stage_text(stage: Commanded) -> String {
    let [x, y, z] = stage.mm();
    format!("({x}, {y}, {z}) mm")
}

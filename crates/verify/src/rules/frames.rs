//! `agreement` of frames: each is the rectangle around the marks of its block in `program.txt`, or a square of one spot
//! where they are no larger than that, lies in the field, and is drawn with the pen that
//! the manifest names, which draws nothing else; the blocks of the outline hold the marks that lie farthest out; the
//! programs of the stage and the OVF go to these blocks.

use std::path::Path;

use super::agreement::{self, Drawings};
use super::{poses, stage, subset};
use crate::geometry::Turn;
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::formats::{self, Stepped};
use crate::read::manifest::Manifest;
use crate::read::program::ProgramFile;
use terrace_core::geom::{FieldPoint, NM_PER_MM, P3};
use terrace_core::machine::Machine;
use terrace_core::program::{Block, PenId, Program, Stroke, StrokeId};

/// By how much rounding on a tilted part may move a mark, nm.
const ROUNDING: i64 = 2;

/// The frames that were found in a folder.
pub(super) struct Frames {
    /// The blocks of the outline with their frames.
    pub(super) outline: ProgramFile,
    /// The programs that go to them.
    pub(super) stages: Vec<stage::StageFile>,
}

impl Frames {
    /// Holds the frames of the chosen blocks against the program.
    pub(super) fn read(
        folder: &Path,
        manifest: &Manifest,
        file: &ProgramFile,
        chosen: &[usize],
        facts: &JobFacts,
        rule: &mut Rule,
    ) -> Option<Self> {
        let stated = manifest.frames.as_ref()?;
        rule.checked += 1;
        let Some(pen) = file.program.pens.iter().position(|pen| pen.name == stated.pen) else {
            rule.broken("", "manifest.json", "the pen of its frames is not a pen of the program");
            return None;
        };
        if file.program.strokes.iter().any(|stroke| stroke.pen.index() == pen) {
            rule.broken("", "manifest.json", "the pen of its frames marks the part");
        }
        let mut ids = file.ids.iter().enumerate();
        let place = |wanted: &String| ids.find(|(_, id)| *id == wanted).map(|(i, _)| i);
        let places: Option<Vec<usize>> = stated.outline.iter().map(place).collect();
        let Some(places) = places.filter(|p| !p.is_empty()) else {
            rule.broken("", "manifest.json", "its outline is not a list of blocks in the order of program.txt");
            return None;
        };
        if !is_outline(file, chosen, &places, facts) {
            rule.broken("", "manifest.json", "its outline does not hold the marks that lie farthest out");
        }
        let mut all = framed(file, PenId(pen as u16), &facts.machine);
        check_drawings(folder, manifest, &all, chosen, facts, rule);
        let stages = stage::read(folder, manifest, facts, stage::Targets::Frames, rule);
        let outline = subset::on_chosen(&mut all, &places, |outline| {
            check_whole_files(folder, manifest, outline, facts, rule);
            stage::agreement(&stages, manifest, outline, &facts.machine, rule);
            let program = Program { blocks: outline.program.blocks.clone(), ..Program::default() };
            ProgramFile { origins: outline.origins.clone(), program, ids: outline.ids.clone() }
        });
        Some(Self { outline, stages })
    }
}

/// Holds that every frame lies in the field, and the drawings of frames of the chosen blocks.
fn check_drawings(
    folder: &Path,
    manifest: &Manifest,
    frames: &ProgramFile,
    chosen: &[usize],
    facts: &JobFacts,
    rule: &mut Rule,
) {
    let program = &frames.program;
    for (id, block) in frames.ids.iter().zip(&program.blocks) {
        let mut points = program.strokes_of(block).iter().flat_map(|stroke| program.points_of(stroke));
        if points.any(|&p| !facts.machine.field_holds(p)) {
            rule.broken(id, "frames", "its frame leaves the usable field");
        }
    }
    for (_, files) in formats::expected(&facts.formats, &manifest.files, &manifest.blocks) {
        let Stepped::Blocks(files) = files else { continue };
        let drawings = Drawings { folder, files, program, machine: &facts.machine };
        for &i in chosen {
            let id = &frames.ids[i];
            drawings.check(&formats::of_frame(id, files.ending), id, &program.blocks[i], rule);
        }
    }
}

/// Holds the files that have the frames of all blocks of the outline.
fn check_whole_files(folder: &Path, manifest: &Manifest, outline: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
    for (_, files) in formats::expected(&facts.formats, &manifest.files, &manifest.blocks) {
        match files {
            Stepped::Planes { file: name, open } => {
                agreement::whole(folder, &formats::of_frames(name), open, outline, &facts.machine, rule);
            }
            Stepped::Poses { file: name, read } => {
                poses::check(folder, &formats::of_frames(name), read, outline, &facts.machine, rule);
            }
            Stepped::Blocks(_) | Stepped::Stage { .. } => {}
        }
    }
}

/// The program with the rectangle around the marks of each block in their place, each entered by a lift.
fn framed(file: &ProgramFile, pen: PenId, machine: &Machine) -> ProgramFile {
    let mut program = Program { pens: file.program.pens.clone(), ..Program::default() };
    for block in &file.program.blocks {
        let marks = || file.program.strokes_of(block).iter().flat_map(|stroke| file.program.points_of(stroke));
        let ends = |values: &dyn Fn(&FieldPoint) -> i32| {
            [marks().map(values).min().unwrap_or_default(), marks().map(values).max().unwrap_or_default()]
        };
        let mut box_nm = [ends(&|p| p.x), ends(&|p| p.y)];
        let [width, depth] = machine.usable_field();
        let spot = (machine.lens.spot.as_mm() * NM_PER_MM).min(width.min(depth).f64()) as i32;
        if box_nm.iter().all(|[from, to]| to - from < spot) {
            box_nm = square(box_nm.map(|[from, to]| from + (to - from) / 2), spot, machine);
        }
        let [[left, right], [low, high]] = box_nm;
        let first = program.points.len();
        let round = [(left, low), (right, low), (right, high), (left, high), (left, low)];
        // Marks in a line have a frame without width, whose corners coincide: each point comes once.
        for (x, y) in round {
            let point = FieldPoint::new(x, y);
            if program.points.len() == first || program.points.last() != Some(&point) {
                program.points.push(point);
            }
        }
        let len = (program.points.len() - first) as u32;
        let at = program.strokes.len();
        let source = StrokeId(0);
        program.strokes.push(Stroke { source, segment: 0, reversed: false, pen, first: first as u32, len });
        program.blocks.push(Block { strokes: at..at + 1, retract: true, ..block.clone() });
    }
    ProgramFile { origins: file.origins.clone(), program, ids: file.ids.clone() }
}

/// A square of one spot, for marks that would be hidden by it: around their middle, unless it leaves the field there;
/// then by one spot nearer to the axis.
fn square(middle: [i32; 2], spot: i32, machine: &Machine) -> [[i32; 2]; 2] {
    let around = |middle: [i32; 2]| middle.map(|v| v - spot / 2).map(|from| [from, from + spot]);
    let [[left, right], [low, high]] = around(middle);
    let is_inside =
        [left, right].iter().all(|&x| [low, high].iter().all(|&y| machine.field_holds(FieldPoint::new(x, y))));
    if is_inside {
        return around(middle);
    }
    around(middle.map(|v| if v.abs() <= spot { 0 } else { v - spot * v.signum() }))
}

/// Whether in no direction of eight a mark of the chosen blocks, of the pass of the first of them, lies farther out in
/// its set-up than those of the blocks at `places` do.
fn is_outline(file: &ProgramFile, chosen: &[usize], places: &[usize], facts: &JobFacts) -> bool {
    let Some(pass) = chosen.first().map(|&i| file.program.blocks[i].pass) else { return false };
    let of_pass: Vec<usize> = chosen.iter().copied().filter(|&i| file.program.blocks[i].pass == pass).collect();
    let all = farthest(file, &of_pass, facts);
    let shown = farthest(file, places, facts);
    places.iter().all(|i| of_pass.binary_search(i).is_ok())
        && all.iter().zip(&shown).all(|(all, shown)| (all - shown).abs() <= ROUNDING)
}

/// How far out the marks of some blocks lie on the part, by set-up and direction, nm.
fn farthest(file: &ProgramFile, places: &[usize], facts: &JobFacts) -> Vec<i64> {
    let mut most = vec![i64::MIN / 2; 8 * file.origins.len()];
    for block in places.iter().map(|&i| &file.program.blocks[i]) {
        let upright = block.stop.tilt.is_upright();
        let table = facts.machine.tilt.as_ref().filter(|_| !upright);
        let turn = table.map(|table| Turn::new(table, block.stop.tilt, file.origin(block)));
        let most = &mut most[8 * block.setup.index()..];
        for p in file.program.strokes_of(block).iter().flat_map(|stroke| file.program.points_of(stroke)) {
            let flat = [block.stop.centre.x + i64::from(p.x), block.stop.centre.y + i64::from(p.y)];
            let [x, y] = turn.as_ref().map_or(flat, |turn| {
                let at = turn.back(P3::new([flat[0], flat[1], block.stop.lpfl.0].map(|v| v as f64)));
                [at[0].round() as i64, at[1].round() as i64]
            });
            for (best, far) in most.iter_mut().zip([x, y, -x, -y, x + y, x - y, -x + y, -x - y]) {
                *best = far.max(*best);
            }
        }
    }
    most
}

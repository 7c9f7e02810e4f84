//! Frames: the rectangle around the marks of each block, with which the operator sees where they will lie. Of a dot, and
//! of marks that a spot hides, a frame would be a point, at which the beam rests: it is a square of one spot.
//!
//! The same writers write them, from a program whose blocks hold that one stroke each. Programs of the stage go to the
//! blocks of the outline alone, and first to the registration points; they stop at each place for the operator and
//! never start a scan card, which would mark the block that it has loaded.

use crate::check::Checked;
use terrace_core::geom::{FieldPoint, NM_PER_MM, Nm, P3, Turn};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, BlockId, PenId, Program, Stroke, StrokeId};

/// The directions in which the marks of a set-up that lie farthest out belong to its outline: corners first, which often
/// lie farthest along an axis too.
const DIRECTIONS: [[i64; 2]; 8] = [[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 0], [0, 1], [-1, 0], [0, -1]];

/// The name that the frame of a block has in the job folder.
pub fn of_block(block: BlockId, ending: &str) -> String {
    format!("frames/{block}-frame.{ending}")
}

/// The name of the frames' version of a file that holds the whole job.
pub fn of_whole(file: &str) -> String {
    let (stem, ending) = file.rsplit_once('.').unwrap_or((file, "txt"));
    format!("frames/{stem}-frame.{ending}")
}

/// The program with the frame of each block instead of its strokes, drawn with a pen. The stage lifts on its way to each:
/// the operator may have moved it.
pub fn frames(checked: &Checked, pen: PenId, machine: &Machine) -> Checked {
    let program = checked.program();
    let mut framed = Program { pens: program.pens.clone(), subset_of: program.subset_of.clone(), ..Program::default() };
    for block in &program.blocks {
        let first = framed.points.len();
        framed.points.extend(rectangle(program, block, machine));
        let strokes = framed.strokes.len();
        let len = framed.points.len() - first;
        framed.strokes.push(Stroke {
            source: StrokeId(0),
            segment: 0,
            reversed: false,
            pen,
            first: first as u32,
            len: len as u32,
        });
        framed.blocks.push(Block { strokes: strokes..strokes + 1, retract: true, ..block.clone() });
    }
    Checked::as_written(framed, checked.origins().to_vec())
}

/// The frames of the outline alone.
pub fn of_outline(checked: &Checked, pen: PenId, machine: &Machine) -> Checked {
    let framed = frames(checked, pen, machine).program().clone();
    Checked::as_written(framed.subset(&outline(checked, machine)), checked.origins().to_vec())
}

/// The rectangle around the marks of a block; of marks on one line there and back.
fn rectangle(program: &Program, block: &Block, machine: &Machine) -> Vec<FieldPoint> {
    let points = program.strokes_of(block).iter().flat_map(|stroke| program.points_of(stroke));
    let ends = |[lo, hi]: [i32; 2], v: i32| [lo.min(v), hi.max(v)];
    let start = [[i32::MAX, i32::MIN]; 2];
    let [x, y] = points.fold(start, |[x, y], p| [ends(x, p.x), ends(y, p.y)]);
    // A field smaller than a spot holds no square of one.
    let spot = (machine.lens.spot.as_mm() * NM_PER_MM)
        .min(machine.usable_field().map(Nm::f64).into_iter().fold(f64::INFINITY, f64::min)) as i32;
    let is_hidden = [x, y].iter().all(|[lo, hi]| hi - lo < spot);
    let mut corners = around(if is_hidden { spot_around([x, y], spot, machine) } else { [x, y] }).to_vec();
    corners.dedup();
    corners
}

/// The way round a rectangle, from its least corner.
fn around([[x0, x1], [y0, y1]]: [[i32; 2]; 2]) -> [FieldPoint; 5] {
    [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]].map(|[x, y]| FieldPoint::new(x, y))
}

/// The square of one spot around marks that a spot hides. At the rim of the field, where a corner of it would lie beyond,
/// it lies one spot nearer to the axis, in x and y.
fn spot_around(sides: [[i32; 2]; 2], spot: i32, machine: &Machine) -> [[i32; 2]; 2] {
    let middle = sides.map(|[lo, hi]| lo + (hi - lo) / 2);
    let square = |[x, y]: [i32; 2]| [x, y].map(|v| [v - spot / 2, v - spot / 2 + spot]);
    let whole = square(middle);
    if around(whole).into_iter().all(|corner| machine.field_holds(corner)) {
        return whole;
    }
    square(middle.map(|v| v.signum() * (v.abs() - spot).max(0)))
}

/// The outline: blocks of the first pass which hold, in each set-up, the marks that lie farthest out on the part in eight
/// directions, every 45 degrees. By their places in the program, rising.
pub fn outline(checked: &Checked, machine: &Machine) -> Vec<usize> {
    let program = checked.program();
    let Some(pass) = program.blocks.first().map(|b| b.pass) else { return Vec::new() };
    let of_pass = || program.blocks.iter().enumerate().filter(|(_, b)| b.pass == pass);
    let mut found = Vec::new();
    for (setup, &origin) in checked.origins().iter().enumerate() {
        let mine = of_pass().filter(|(_, b)| b.setup.index() == setup);
        let far: Vec<(usize, [i64; 8])> = mine.map(|(i, b)| (i, farthest(program, b, machine, origin))).collect();
        let mut corners: Vec<usize> = Vec::new();
        for k in 0..DIRECTIONS.len() {
            let Some(most) = far.iter().map(|(_, far)| far[k]).max() else { continue };
            let is_farthest = |at: &usize| far[*at].1[k] == most;
            if !corners.iter().any(is_farthest) {
                corners.extend((0..far.len()).find(is_farthest));
            }
        }
        found.extend(corners.into_iter().map(|at| far[at].0));
    }
    found.sort_unstable();
    found
}

/// How far out the marks of a block lie on the part in each direction, nm.
fn farthest(program: &Program, block: &Block, machine: &Machine, origin: Origin) -> [i64; 8] {
    let turn = machine.turn(block.stop.tilt, origin);
    let points = program.strokes_of(block).iter().flat_map(|stroke| program.points_of(stroke));
    let points = points.map(|p| on_part(block, &turn, p));
    points.fold([i64::MIN; 8], |far, [x, y]| {
        let here = DIRECTIONS.map(|[u, v]| u * x + v * y);
        std::array::from_fn(|k| far[k].max(here[k]))
    })
}

/// A point of a block on the part, nm; of a turned part where the beam meets the focal plane.
fn on_part(block: &Block, turn: &Turn, p: &FieldPoint) -> [i64; 2] {
    let [x, y] = [block.stop.centre.x + i64::from(p.x), block.stop.centre.y + i64::from(p.y)];
    if block.stop.tilt.is_upright() {
        return [x, y];
    }
    let at = turn.back(P3::new([x, y, block.stop.lpfl.0].map(|v| v as f64)));
    [at[0].round() as i64, at[1].round() as i64]
}

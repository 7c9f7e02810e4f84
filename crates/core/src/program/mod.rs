//! The stepped program: blocks in machining order, each one standstill of the stage and the strokes
//! marked there. It is the intermediate form that every target is written from, in the spirit of a
//! job whose work planes are machined while the axes stand still.
//!
//! # Invariants
//! A [`Program`] holds P1 to P7 once the check of `terrace-plan` has made it a `Checked` one:
//! - P1 every block has at least one stroke; a stroke has two points or more, no two neighbours equal, or is a dot: one
//!   point, whose pen has a dwell; strokes lie block by block, points stroke by stroke;
//! - P2 every point lies in the usable field of the machine;
//! - P3 the marks of a block lie within what its stop admits and span at most the depth range, to what rounding a
//!   cut point does to its height;
//! - P4 stage targets lie on multiples of the stage increment, inside travel, and say the same place
//!   as the block's centre and plane; the focus shift is within the range of the zoom optic;
//! - P5 every pen exists;
//! - P6 the focal plane of a block lies among its marks, to a stage increment, or all of them lie within half the depth
//!   range of it;
//! - P7 passes follow each other, and within each the set-ups.
//!
//! Two more speak of the texture and the part's surface, which a program does not hold. `split` makes them, and
//! `terrace verify` proves them from job file and surface file (rules `source` and `coverage`):
//! - P8 where the part is tilted, a stroke of the texture is marked along a line of the field that runs
//!   within [`CHORD_NM`] of the projected one;
//! - P9 every stroke names the texture stroke and the segment it begins on.
//!
//! # Units and frames
//! Heights of pass k are those of the surface as the passes before have left it: lowered k times.
//! Points are field frame (origin on the optical axis, x and y as the turned part's), integer nm.
//! Centres, focus heights and depth intervals are turned part frame, integer nm. Stage targets are
//! commanded axis values, integer nm. At a stop with a tilt the part is the tilted one: centres and
//! heights are those of the part as the table has turned it, in the frame that it had before.

mod figures;
mod ids;
mod off_axis;
#[cfg(any(test, feature = "test-support"))]
pub mod sample;
mod sections;
pub mod text;

pub use figures::{BlockFigures, Slope};
pub use ids::{BlockId, PassId, PenId, PieceId, SectionId, SetupId, StopId, StrokeId};
pub use off_axis::OffAxis;
pub use sections::Sections;

use std::ops::Range;

use crate::geom::{FieldPoint, NM_PER_MM, Nm, P2, Turned};
use crate::machine::{Commanded, TiltAngles};
use crate::units::{Frequency, Power, Speed, Time};

/// How far a stroke on a tilted part may run off the exact projection of its line, nm: between two points of the
/// program, where the projection bends with the surface.
pub const CHORD_NM: f64 = 100.0;

/// A laser setting of the program.
#[derive(Clone, Debug, PartialEq)]
pub struct Pen {
    /// Name in the job file.
    pub name: String,
    /// Mark speed.
    pub speed: Speed,
    /// Laser power as written.
    pub power: Power,
    /// Repetition rate.
    pub frequency: Frequency,
    /// How often the controller marks every stroke.
    pub passes: u32,
    /// How long the beam is on at a dot, each time; None where the pen marks none.
    pub dwell: Option<Time>,
}

/// One stop of the stage: its position and what it admits.
#[derive(Clone, Debug, PartialEq)]
pub struct Stop {
    /// The section that the stop marks.
    pub section: SectionId,
    /// Number of the level in the section's or part's list of levels, upwards.
    pub level: i32,
    /// Commanded angles of the tilt axes; zeros where there are none.
    pub tilt: TiltAngles,
    /// Point of the turned part under the optical axis.
    pub centre: P2<Turned>,
    /// Height of the focal plane (LPFL) in the part frame.
    pub lpfl: Nm,
    /// Lowest height that the stop admits.
    pub z_lo: Nm,
    /// Highest height that the stop admits.
    pub z_hi: Nm,
}

/// One stop and its strokes.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// The pass that it belongs to, from 0; passes follow each other.
    pub pass: PassId,
    /// How the part lies meanwhile, from 0; set-ups follow each other within a pass.
    pub setup: SetupId,
    /// Position of the stage.
    pub stop: Stop,
    /// Commanded axis values x, y, z.
    pub stage: Commanded,
    /// By how much the zoom optic raises the focal plane above the one that the stage sets; 0 without an optic.
    pub focus_shift: Nm,
    /// Whether the stage must lift to the clearance height on its way here.
    pub retract: bool,
    /// Lowest height of a mark.
    pub z_lo: Nm,
    /// Highest height of a mark.
    pub z_hi: Nm,
    /// The strokes of the block, as a range of [`Program::strokes`], in marking order.
    pub strokes: Range<usize>,
}

impl Block {
    /// Height of the plane that the stage sets: the focal plane with the zoom optic at rest.
    pub fn stage_plane(&self) -> Nm {
        self.stop.lpfl - self.focus_shift
    }
    /// Whether the zoom optic alone goes to this block from the one before it; the stage stands still.
    pub fn is_reached_by_zoom(&self, before: &Block) -> bool {
        let standstill = |b: &Block| (b.pass, b.setup, b.stage, b.stop.tilt);
        standstill(self) == standstill(before) && self.focus_shift != before.focus_shift && !self.retract
    }
}

/// One mark: the beam is on from its first point to its last, or for the dwell of its pen where it is a dot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stroke {
    /// Which stroke of the texture it is a piece of.
    pub source: StrokeId,
    /// Segment of that stroke on which the piece's end with the smaller parameter lies. A whole closed
    /// figure may begin at any of its vertices: then it is the segment that begins there, and the points
    /// run on over the point where the figure was drawn from.
    pub segment: u32,
    /// Whether it is marked against the direction in which the texture was drawn.
    pub reversed: bool,
    /// Index of its pen.
    pub pen: PenId,
    /// First point in [`Program::points`].
    pub first: u32,
    /// How many points; 1 of a dot.
    pub len: u32,
}

impl Stroke {
    /// Whether it is a dot.
    pub fn is_dot(&self) -> bool {
        self.len == 1
    }
}

/// Blocks in machining order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// Laser settings.
    pub pens: Vec<Pen>,
    /// Blocks in machining order.
    pub blocks: Vec<Block>,
    /// All strokes, block by block.
    pub strokes: Vec<Stroke>,
    /// All points, field frame, nm.
    pub points: Vec<FieldPoint>,
    /// The names that its blocks have in the program that it is a subset of; empty where it is whole, and blocks are
    /// named by their place.
    pub subset_of: Vec<BlockId>,
}

impl Program {
    /// The name of the block at a place of the list.
    pub fn id(&self, index: usize) -> BlockId {
        self.subset_of.get(index).copied().unwrap_or_else(|| BlockId::new(index))
    }
    /// These blocks alone, in their order and under their names. The stage lifts on its way to each that follows on
    /// another one now.
    #[must_use]
    pub fn subset(mut self, chosen: &[usize]) -> Self {
        self.subset_of = chosen.iter().map(|&i| self.id(i)).collect();
        let follows = |at: usize| at > 0 && chosen[at - 1] + 1 == chosen[at];
        self.blocks = (0..chosen.len())
            .map(|at| {
                let block = self.blocks[chosen[at]].clone();
                Block { retract: block.retract || !follows(at), ..block }
            })
            .collect();
        self
    }
    /// Standstills of the stage: the blocks but those that the zoom optic alone goes to.
    pub fn stops(&self) -> usize {
        let by_zoom = self.blocks.windows(2).filter(|w| w[1].is_reached_by_zoom(&w[0])).count();
        self.blocks.len() - by_zoom
    }
    /// The strokes of a block in marking order.
    pub fn strokes_of(&self, block: &Block) -> &[Stroke] {
        &self.strokes[block.strokes.clone()]
    }
    /// The points of a stroke in marking order, field frame.
    pub fn points_of(&self, stroke: &Stroke) -> &[FieldPoint] {
        &self.points[stroke.first as usize..(stroke.first + stroke.len) as usize]
    }
    /// Indices of the pens of a block, rising.
    pub fn pens_of(&self, block: &Block) -> Vec<PenId> {
        let mut used = vec![false; self.pens.len()];
        self.strokes_of(block).iter().for_each(|s| used[s.pen.index()] = true);
        (0..used.len()).filter(|&pen| used[pen]).map(|pen| PenId(pen as u16)).collect()
    }
    /// Names of the pens of a block.
    pub fn pen_names(&self, block: &Block) -> Vec<&str> {
        self.pens_of(block).into_iter().map(|pen| self.pens[pen.index()].name.as_str()).collect()
    }
    /// Where the file of a block with an ending lies in the job folder.
    pub fn block_file(block: BlockId, ending: &str) -> String {
        format!("blocks/{block}.{ending}")
    }
    /// Marked length of a block in mm, every pass counted.
    pub fn mark_mm(&self, block: &Block) -> f64 {
        self.strokes_of(block)
            .iter()
            .map(|s| stroke_mm(self.points_of(s)) * f64::from(self.pens[s.pen.index()].passes))
            .sum()
    }
    /// Jump length of a block in mm: from the field's centre to the first stroke, then between
    /// strokes; for one pass.
    pub fn jump_mm(&self, block: &Block) -> f64 {
        let mut at = FieldPoint::AXIS;
        let mut sum = 0.0;
        for s in self.strokes_of(block) {
            let points = self.points_of(s);
            sum += stroke_mm(&[at, points[0]]);
            at = points[points.len() - 1];
        }
        sum
    }
}

/// Length in mm of a polyline in field coordinates.
pub fn stroke_mm(points: &[FieldPoint]) -> f64 {
    points
        .windows(2)
        .map(|w| {
            let dx = f64::from(w[1].x) - f64::from(w[0].x);
            let dy = f64::from(w[1].y) - f64::from(w[0].y);
            (dx * dx + dy * dy).sqrt()
        })
        .sum::<f64>()
        / NM_PER_MM
}

//! What a person looks at before a part is risked: `layout.svg` and `report.html`.
//!
//! Consumes a checked program, its machine and its record, a [`Scene`] and a [`Relief`], and of a stepped job a
//! [`BlockMap`]: a raster that says which block owns each small cell of the part. Promises text that is equal byte for
//! byte for equal input, is well-formed, loads nothing from elsewhere and runs no script.
//!
//! Points of blocks are the turned part frame, nm; the drawing is in mm of that frame with y pointing
//! up (written as -y, since SVG's y points down): a user unit of the drawing is a millimetre of the part.
//!
//! Limits: borders of blocks are traced from the map, the part's outline from the relief, and both are as exact as
//! their cells: a drawn border lies within about one cell of the true one. The drawing is for eyes and rulers; what is
//! machined is in the program.

mod blocks;
mod colour;
mod energy;
mod energy_map;
mod error_budget;
mod fixtures;
mod fly_report;
mod fly_sheet;
mod image;
mod job_report;
mod label;
mod layout;
mod legend;
mod marks;
mod measured_map;
mod outline;
pub mod page;
mod part;
mod pdf;
pub mod plot;
mod probe_map;
mod raster;
mod record;
pub mod runsheet;
#[cfg(test)]
mod sample;
mod sheet;
mod stage;
pub mod table;
#[cfg(test)]
mod tests;
mod travel;
mod unmarked;

pub use energy_map::{EnergyMap, energy_svg};
pub use fly_report::on_the_fly_html;
pub use fly_sheet::on_the_fly_txt;
pub use job_report::{NOT_VERIFIED, of_rest, report_html};
pub use layout::{layout_svg, layout_svgs, on_the_fly_svg};
pub use marks::Marks;
pub use measured_map::measured_svg;
pub use part::{RELIEF_CELLS, relief_area};
pub use pdf::pdf;
pub use probe_map::points_svg;
pub use raster::png;

use std::ops::Range;

use crate::report::table::plain;
use crate::scene::{Group, Relief, Scene};
use terrace_core::geom::{Box2, Nm, P2, P3, Turn};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, BlockFigures, BlockId, Pen, Sections};
use terrace_plan::block_map::BlockMap;
use terrace_plan::check::Checked;
use terrace_plan::fixtures::Fixture;
use terrace_plan::manifest::{OnTheFlySummary, Summary};
use terrace_plan::measured::MeasuredPart;
use terrace_plan::on_the_fly::program::Program as OnTheFlyProgram;

/// Everything the pictures of a stepped job are made of.
#[derive(Clone, Debug)]
pub struct Layout<'a> {
    /// Name of the job, any text.
    pub job: &'a str,
    /// The program.
    pub checked: &'a Checked,
    /// The blocks of the first pass, or of the one that is drawn.
    pub blocks: Range<usize>,
    /// How many passes there are.
    pub passes: u32,
    /// The machine it was checked against.
    pub machine: &'a Machine,
    /// The grid of sections.
    pub sections: Sections,
    /// Which block lies where.
    pub map: &'a BlockMap,
    /// The box of the part.
    pub part: Box2,
    /// The box of the texture as placed.
    pub texture: Box2,
    /// Every mark, what is not marked, and how the part looks.
    pub scene: &'a Scene,
    /// Heights of the part around the texture.
    pub relief: &'a Relief,
    /// The marks of those blocks as they are drawn.
    pub marks: &'a Marks,
    /// By how much the part is turned against its file, rad.
    pub turn_rad: f64,
    /// The figures of each block of the program.
    pub figures: &'a [BlockFigures],
    /// The blocks as they lie over the part.
    pub drawn: Vec<Block>,
    /// What the colours of blocks stand for.
    pub shade: Shade,
    /// Where the part lies, if it was measured.
    pub measured: Option<&'a MeasuredPart>,
    /// What holds the part.
    pub fixtures: &'a [Fixture],
    /// The figures of the job.
    pub summary: &'a Summary,
}

/// Everything the picture of an on-the-fly job is made of.
#[derive(Clone, Copy, Debug)]
pub struct OnTheFlyLayout<'a> {
    /// Name of the job, any text.
    pub job: &'a str,
    /// The program.
    pub program: &'a OnTheFlyProgram,
    /// Whether the power of its marks follows the speed of the spot.
    pub power_by_speed: bool,
    /// The machine it was checked against.
    pub machine: &'a Machine,
    /// The box of the part.
    pub part: Box2,
    /// The box of the texture as placed.
    pub texture: Box2,
    /// Every mark, what is not marked, and how the head moves.
    pub scene: &'a Scene,
    /// Heights of the part around the texture.
    pub relief: &'a Relief,
    /// The marks as they are drawn.
    pub marks: &'a Marks,
    /// By how much the part is turned against its file, rad.
    pub turn_rad: f64,
    /// The figures of the job.
    pub summary: &'a OnTheFlySummary,
}

/// What the pictures of both modes show.
struct Picture<'a> {
    job: &'a str,
    machine: &'a Machine,
    pens: &'a [Pen],
    origins: &'a [Origin],
    part: Box2,
    texture: Box2,
    turn_rad: f64,
    scene: &'a Scene,
    /// The part of [`Scene::groups`] that is drawn.
    groups: Range<usize>,
    relief: &'a Relief,
    marks: &'a Marks,
    mode: Mode<'a>,
}

/// The layout of the mode that the job has.
enum Mode<'a> {
    Stepped(&'a Layout<'a>),
    OnTheFly(&'a OnTheFlyLayout<'a>),
}

impl<'a> Picture<'a> {
    fn of_stepped(layout: &'a Layout<'a>) -> Self {
        let Layout { job, machine, part, texture, turn_rad, scene, relief, marks, .. } = *layout;
        let pens = layout.checked.program().pens.as_slice();
        let origins = layout.checked.origins();
        let groups = layout.blocks.clone();
        let mode = Mode::Stepped(layout);
        Self { job, machine, pens, origins, part, texture, turn_rad, scene, groups, relief, marks, mode }
    }

    fn of_on_the_fly(layout: &'a OnTheFlyLayout<'a>) -> Self {
        let OnTheFlyLayout { job, machine, part, texture, turn_rad, scene, relief, marks, .. } = *layout;
        let pens = layout.program.pens.as_slice();
        let origins = std::slice::from_ref(&layout.program.origin);
        let groups = 0..scene.groups.len();
        let mode = Mode::OnTheFly(layout);
        Self { job, machine, pens, origins, part, texture, turn_rad, scene, groups, relief, marks, mode }
    }

    /// The groups that are drawn.
    fn groups(&self) -> &'a [Group] {
        &self.scene.groups[self.groups.clone()]
    }

    /// The layout of a stepped job.
    fn stepped(&self) -> Option<&'a Layout<'a>> {
        match self.mode {
            Mode::Stepped(layout) => Some(layout),
            Mode::OnTheFly(_) => None,
        }
    }

    /// Where the centre of the field is over the part, in order: at every block, or on the fly along its way.
    fn places(&self) -> Vec<P2> {
        match self.mode {
            Mode::Stepped(layout) => layout.blocks().iter().map(|block| Turn::drawn(block.stop.centre)).collect(),
            Mode::OnTheFly(layout) => {
                let samples = layout.scene.motion.iter().flat_map(|motion| &motion.samples);
                samples.filter_map(|s| P2::from_mm(s.centre[0], s.centre[1])).collect()
            }
        }
    }
}

/// What the colours of blocks stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shade {
    /// The height of the focal plane.
    Height,
    /// The angle between beam and surface normal.
    Incidence,
}

impl Layout<'_> {
    /// The blocks that are drawn, as they lie over the part.
    fn blocks(&self) -> &[Block] {
        &self.drawn[self.blocks.clone()]
    }

    /// The name of the block with that number in [`Layout::blocks`].
    fn id(&self, i: usize) -> String {
        BlockId::new(self.blocks.start + i).to_string()
    }

    /// The layout with the blocks of all passes.
    fn whole(&self) -> Self {
        Self { blocks: 0..self.checked.program().blocks.len(), ..self.clone() }
    }

    /// Whether the marks of each block lie in a section; else windows lie freely.
    fn is_gridded(&self) -> bool {
        terrace_plan::block_map::is_gridded(self.checked.program(), self.blocks(), &self.sections)
    }

    /// The figures of the block with that number in [`Layout::blocks`].
    fn figures(&self, i: usize) -> &BlockFigures {
        &self.figures[self.blocks.start + i]
    }

    /// What the colour of a block stands for: nm, or millionths of a degree.
    fn shade_of(&self, i: usize) -> i64 {
        match self.shade {
            Shade::Height => self.blocks()[i].stop.lpfl.0,
            Shade::Incidence => (self.figures(i).slope.incidence_deg()[0] * 1e6).round() as i64,
        }
    }

    /// Least and greatest of what the colours of blocks stand for, zeros without a block.
    fn shades(&self) -> [i64; 2] {
        let shades = || (0..self.blocks().len()).map(|i| self.shade_of(i));
        [shades().min().unwrap_or(0), shades().max().unwrap_or(0)]
    }

    /// Extents of the texture; zeros without one.
    fn texture_size(&self) -> [Nm; 2] {
        if self.texture.is_empty() { [Nm(0); 2] } else { self.texture.size() }
    }

    /// Lowest and highest value over the blocks; zeros without a block.
    fn range(&self, lo: impl Fn(&Block) -> Nm, hi: impl Fn(&Block) -> Nm) -> [Nm; 2] {
        let blocks = self.blocks();
        [blocks.iter().map(lo).min().unwrap_or_default(), blocks.iter().map(hi).max().unwrap_or_default()]
    }
}

/// The blocks as they lie over the part: those that are tilted with the place where the optical axis meets
/// the focal plane, in the frame of the part that is not turned, for pictures.
pub fn drawn(checked: &Checked, machine: &Machine) -> Vec<Block> {
    let blocks = checked.program().blocks.iter();
    blocks
        .map(|block| if block.stop.tilt.is_upright() { block.clone() } else { upright(block, checked, machine) })
        .collect()
}

/// A tilted block with the place where the optical axis meets the focal plane in the frame of the part that is not
/// turned; its heights keep their distances from the focal plane.
fn upright(block: &Block, checked: &Checked, machine: &Machine) -> Block {
    let mut block = block.clone();
    let stop = &mut block.stop;
    let turn = machine.turn(stop.tilt, checked.origin());
    let focal_point = turn.back(P3::new([stop.centre.x, stop.centre.y, stop.lpfl.0].map(|v| v as f64)));
    let [x, y, z] = focal_point.at.map(|v| v.round() as i64);
    let shift = Nm(z) - stop.lpfl;
    stop.centre = P2::new(x, y);
    for height in [&mut stop.lpfl, &mut stop.z_lo, &mut stop.z_hi, &mut block.z_lo, &mut block.z_hi] {
        *height += shift;
    }
    block
}

/// Name of the drawing of a pass after the first, `k` from 1.
pub(crate) fn pass_file(k: u32) -> String {
    format!("layout-pass{}.svg", k + 1)
}

/// mm in text, `decimals` digits, without a negative zero.
fn mm(length: Nm, decimals: usize) -> String {
    plain(length.mm(), decimals)
}

/// A length for reading: mm below 10 m, m above.
fn length_text(mm: f64) -> String {
    if mm.abs() < 10_000.0 { format!("{} mm", plain(mm, 1)) } else { format!("{} m", plain(mm / 1000.0, 1)) }
}

/// Text that XML can hold: control characters, which no escape makes legal, become spaces.
fn clean(text: &str) -> String {
    text.chars().map(|c| if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { ' ' } else { c }).collect()
}

//! What a person looks at before a part is risked: `layout.svg` and `report.html`.
//!
//! Consumes a [`Checked`] program, its machine and its record, and a [`BlockMap`]: a raster that says
//! which block owns each small cell of the part. Promises text that is equal byte for byte for equal
//! input, is well-formed, loads nothing from elsewhere and runs no script.
//!
//! Points of blocks are the turned part frame, nm; the drawing is in mm of that frame with y pointing
//! up (written as -y, since SVG's y points down), so it measures true in a browser or in Inkscape.
//!
//! Limits: borders of blocks are traced from the map and are as exact as its cells: a drawn border
//! lies within about one cell of the true one. The drawing is for eyes and rulers; what is machined is in
//! the program.

mod blocks;
mod colour;
mod job_report;
mod label;
mod layout;
mod legend;
mod outline;
pub mod page;
pub mod plot;
pub mod runsheet;
#[cfg(test)]
mod sample;
mod sheet;
mod stage;
pub mod table;
#[cfg(test)]
mod tests;

pub use job_report::report_html;
pub use layout::layout_svg;

use std::ops::Range;

use crate::block_map::BlockMap;
use crate::check::Checked;
use crate::geom::{Box2, Nm, P2, P3};
use crate::machine::Machine;
use crate::manifest::Summary;
use crate::program::{Block, BlockFigures, BlockId, Sections};
use crate::report::table::plain;

/// Everything the pictures are made of.
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
    /// The box of the texture as placed.
    pub texture: Box2,
    /// Where texture that the job places lies off the part: boxes that do not overlap.
    pub off_part: &'a [Box2],
    /// By how much the part is turned against its file, rad.
    pub turn_rad: f64,
    /// The figures of each block of the program.
    pub figures: &'a [BlockFigures],
    /// The blocks as they lie over the part.
    pub drawn: Vec<Block>,
    /// What the colours of blocks stand for.
    pub shade: Shade,
    /// The figures of the job.
    pub summary: &'a Summary,
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

    /// Whether the stops stand on the grid of sections; else their windows lie freely.
    fn is_gridded(&self) -> bool {
        crate::block_map::is_gridded(self.blocks(), &self.sections)
    }

    /// The figures of the block with that number in [`Layout::blocks`].
    fn figures(&self, i: usize) -> &BlockFigures {
        &self.figures[self.blocks.start + i]
    }

    /// What the colour of a block stands for: nm, or millionths of a degree.
    fn shade_of(&self, i: usize) -> i64 {
        match self.shade {
            Shade::Height => self.blocks()[i].stop.focus.0,
            Shade::Incidence => (self.figures(i).slope.incidence_deg()[0] * 1e6).round() as i64,
        }
    }

    /// Least and greatest of it, zeros without a block.
    fn shades(&self) -> [i64; 2] {
        let all = || (0..self.blocks().len()).map(|i| self.shade_of(i));
        [all().min().unwrap_or(0), all().max().unwrap_or(0)]
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
    let over = |block: &Block| {
        let mut block = block.clone();
        let stop = &mut block.stop;
        if !stop.tilt.is_upright() {
            let turn = machine.turn(stop.tilt, checked.origin());
            let at = turn.back(P3::new([stop.centre.x, stop.centre.y, stop.focus.0].map(|v| v as f64)));
            let [x, y, z] = at.at.map(|v| v.round() as i64);
            let by = Nm(z) - stop.focus;
            stop.centre = P2::new(x, y);
            for v in [&mut stop.focus, &mut stop.z_lo, &mut stop.z_hi, &mut block.z_lo, &mut block.z_hi] {
                *v += by;
            }
        }
        block
    };
    checked.program().blocks.iter().map(over).collect()
}

/// Name of the drawing of a pass after the first, `k` from 1.
pub fn pass_file(k: u32) -> String {
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

/// `text` in at most `limit` characters.
fn short(text: &str, limit: usize) -> String {
    let text = clean(text);
    if text.chars().count() <= limit {
        return text;
    }
    text.chars().take(limit.saturating_sub(1)).chain(['…']).collect()
}

//! DXF drawings: the lines and areas of model space, in mm.
//!
//! Consumes a DXF file of R12 to 2018, text or binary. Promises an [`Artwork`] whose page is the box of all that is
//! drawn and whose corner is where that box lies in the drawing's coordinates. Lines, arcs, circles, ellipses,
//! polylines with bulges, splines and the lines of hatch patterns are lines; solids, traces, solid hatches and
//! polylines with a width are areas. Blocks are inserted with their scales, turns, mirrors and arrays. Shapes are in
//! drawing order, each with its colour, its layer and the blocks that it comes from. A drawing that shows nothing gives
//! an artwork without shapes.
//!
//! What is not drawn, or not as it looks, is counted by type and reported by one warning per issue (`tally`).
//!
//! Everything is f64 from the text of the number to the page; curves are flattened after all maps, within the
//! tolerance and with all points on the curve. z is read and mapped, and dropped where a point is put down. No other
//! file is ever opened. Time and memory are bounded: 256 MB of file, 2 million entities once blocks are inserted, 64
//! levels of blocks, 20 million points, 8 million crossings of the lines of one hatch; counts in the file are never
//! trusted.

mod colour;
mod entity;
mod file;
mod gaps;
mod hatch;
mod outline;
mod pattern;
mod record;
mod space;
mod spline;
mod tags;
mod tally;
mod units;
mod walk;
mod wide;

use std::path::Path;

use super::artwork::{Artwork, Figure};
use crate::diag::{Diag, Error, Place, memory};
use crate::geom::BoxMm;
use gaps::{Ends, gaps};

/// Largest drawing file, bytes.
pub(super) const MAX_FILE: u64 = 256 << 20;

/// Reads a drawing. `unit_mm` is what the job says a drawing unit is, where the file may not.
///
/// # Errors
/// `dxf-…`, `texture-far`, `texture-large`, `memory`.
pub(super) fn load(
    bytes: &[u8],
    path: &Path,
    unit_mm: Option<f64>,
    tolerance_mm: f64,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Error> {
    let name = path.display().to_string();
    parse(&name, bytes, unit_mm, tolerance_mm, notes).map_err(|mut d| {
        match &mut d.place {
            Place::File { path, .. } if path.is_empty() => *path = name,
            Place::Nowhere => d.place = Place::file(name),
            _ => {}
        }
        (*d).into()
    })
}

fn parse(
    name: &str,
    bytes: &[u8],
    unit_mm: Option<f64>,
    tolerance: f64,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Box<Diag>> {
    if bytes.len() as u64 > MAX_FILE {
        let text = format!("the drawing has {} bytes, more than {MAX_FILE}", bytes.len());
        return Err(Diag::limit("dxf-large", text).hint("split it into several drawings").into());
    }
    // The tags of one entity at a time, and entities: a polyline takes most for its bytes, 48 for a vertex of 12.
    memory::ask("the drawing", 8 * bytes.len() as u64)?;
    let file = file::read(bytes)?;
    if !file.has_end {
        let d = Diag::warning("dxf-eof", "the drawing has no end mark (EOF): it may have been cut off");
        notes.push(d.at(Place::file(name)).hint("save the drawing again, and compare what is marked with it"));
    }
    let unit = units::unit_mm(file.unit, unit_mm)?;
    let walked = walk::walk(&file, unit, tolerance);
    notes.extend(file.tally.warnings(name));
    let (mut art, tally) = walked?;
    notes.extend(tally.warnings(name));
    notes.extend(open_contours(&art, tolerance).map(|(d, element)| {
        d.at(Place::Element { path: name.to_owned(), element }).hint("join the ends in the drawing program")
    }));
    on_page(&mut art);
    Ok(art)
}

/// Moves the lines to the page, which is their box.
fn on_page(art: &mut Artwork) {
    if art.lines.points.is_empty() {
        return;
    }
    let all = BoxMm::of(art.lines.points.iter().copied());
    art.lines.points.iter_mut().for_each(|p| *p = [p[0] - all.lo[0], p[1] - all.lo[1]]);
    (art.size, art.corner) = (all.size(), Some(all.lo));
}

/// What is said of contours that look closed and are not, and the entity at the first gap.
fn open_contours(art: &Artwork, tolerance: f64) -> Option<(Diag, String)> {
    let single = art.shapes.iter().filter(|s| s.figure == Figure::Lines && s.lines.len() == 1);
    let ends: Vec<Ends> = single
        .filter_map(|s| {
            let line = art.lines.get(s.lines.start);
            let length = line.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).sum();
            let ends = [line[0], line[line.len() - 1]];
            (ends[0] != ends[1]).then_some(Ends { ends, length, name: s.name })
        })
        .collect();
    let gaps = gaps(&ends, tolerance);
    let first = gaps.first()?;
    let text = format!(
        "contours are not closed ({}): the first, of {} lines, has a gap of {:.4} mm",
        gaps.len(),
        first.lines,
        first.width
    );
    Some((Diag::warning("dxf-open", text), art.names[first.name as usize].clone()))
}

#[cfg(test)]
mod tests;

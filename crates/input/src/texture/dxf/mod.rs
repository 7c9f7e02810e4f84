//! DXF drawings: the lines and areas of model space, in mm.
//!
//! Consumes a DXF file of R12 to 2018, text or binary. Promises an [`Artwork`] whose page is the box of all that is
//! drawn and whose corner is where that box lies in the drawing's coordinates. Lines, arcs, circles, ellipses,
//! polylines with bulges, splines and the lines of hatch patterns are lines; solids, traces, solid hatches and
//! polylines with a width are areas. Blocks are inserted with their scales, turns, mirrors and arrays. Shapes are in
//! drawing order, each with its colour, its layer and the blocks that it comes from. A drawing that shows nothing gives
//! an artwork without shapes.
//!
//! What is not drawn, or not as it looks, is counted by type, and refused or reported by one message per issue
//! (`tally`).
//!
//! Everything is f64 from the text of the number to the page; curves are flattened after all maps, within the
//! tolerance and with all points on the curve. z is read and mapped, and dropped where a point of a drawing is put
//! down; [`curves`] keeps it, for lines in space, and takes no areas. No other file is ever opened. Time and memory are
//! bounded: 256 MB of file, 2 million entities once blocks are inserted, 64 levels of blocks, 20 million points,
//! 8 million crossings of the lines of one hatch; counts in the file are never trusted.

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
mod text;
mod units;
mod walk;
mod wide;

use std::collections::HashMap;
use std::path::Path;
use terrace_core::math;

use super::artwork::{Artwork, Marking, ShapeFigure};
use super::clip::Polylines;
use gaps::{LineEnds, gaps};
use terrace_core::diag::{Diag, Error, Place, memory};
use walk::DrawnModel;

/// Largest drawing file, bytes.
pub(super) const MAX_FILE: u64 = 256 << 20;

/// How a drawing is read.
pub(super) struct DxfOptions<'a> {
    /// The file.
    pub(super) path: &'a Path,
    /// What the job says a drawing unit is, where the file may not.
    pub(super) unit_mm: Option<f64>,
    /// Largest distance between a curve and its polyline, mm.
    pub(super) tolerance: f64,
    /// Width up to which a polyline is a line where strokes are marked as they look, mm.
    pub(super) widest_line: f64,
    pub(super) marking: &'a Marking,
}

/// Reads a drawing.
///
/// # Errors
/// `dxf-…`, `texture-far`, `texture-large`, `memory`.
pub(super) fn load(bytes: &[u8], options: &DxfOptions<'_>, notes: &mut Vec<Diag>) -> Result<Artwork, Error> {
    let mut art = read(bytes, options, Polylines::default(), notes)?;
    art.fit_page();
    Ok(art)
}

/// Reads the lines of a drawing as curves in space, mm, in its own coordinates; shapes are lines alone.
///
/// # Errors
/// As [`load`]; `dxf-area`.
pub(super) fn curves(bytes: &[u8], options: &DxfOptions<'_>, notes: &mut Vec<Diag>) -> Result<Artwork, Error> {
    let mut art = read(bytes, options, Polylines::in_space(), notes)?;
    add_labels_to_names(&mut art);
    Ok(art)
}

/// Gives every shape a name with its labels: an entity is found in the drawing by handle and layer, and copies by
/// blocks have those of the block.
fn add_labels_to_names(art: &mut Artwork) {
    let mut numbers: HashMap<(u32, u32), u32> = HashMap::new();
    let mut names = Vec::new();
    let mut name_of = Vec::with_capacity(art.shapes.len());
    for shape in &art.shapes {
        let number = numbers.entry((shape.name, shape.labels)).or_insert_with(|| {
            let labels: Vec<&str> = art.labels(shape.labels).map(String::as_str).collect();
            names.push(format!("{} ({})", art.names[shape.name as usize], labels.join(", ")));
            u32::try_from(names.len() - 1).expect("fewer names than shapes")
        });
        name_of.push(*number);
    }
    art.shapes.iter_mut().zip(name_of).for_each(|(shape, name)| shape.name = name);
    art.names = names;
}

fn read(bytes: &[u8], options: &DxfOptions<'_>, lines: Polylines, notes: &mut Vec<Diag>) -> Result<Artwork, Error> {
    let name = options.path.display().to_string();
    let mut errors = Vec::new();
    let art = parse(bytes, options, &name, lines, &mut errors, notes).map_err(|mut d| {
        match &mut d.place {
            Place::File { path, .. } if path.is_empty() => *path = name,
            Place::Nowhere => d.place = Place::file(name),
            _ => {}
        }
        Error::from(*d)
    })?;
    if errors.is_empty() { Ok(art) } else { Err(Error::many(errors)) }
}

/// Reads a drawing into `lines`, which keep z or do not. What is refused goes to `errors`.
fn parse(
    bytes: &[u8],
    options: &DxfOptions<'_>,
    name: &str,
    lines: Polylines,
    errors: &mut Vec<Diag>,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Box<Diag>> {
    let &DxfOptions { unit_mm, tolerance, marking, .. } = options;
    let is_flat = !lines.is_spatial();
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
    let walked = walk::walk(&file, unit, options, lines);
    file.tally.messages(name, marking, errors, notes);
    let DrawnModel { art, tally, z } = walked?;
    tally.messages(name, marking, errors, notes);
    if is_flat && z[1] - z[0] > tolerance {
        let text = format!("the drawing is not flat (z {:.3} to {:.3} mm): its z is not used", z[0], z[1]);
        let hint = "to hold it to the surface as space curves, give it by curves in place of file";
        notes.push(Diag::warning("dxf-space", text).at(Place::file(name)).hint(hint));
    }
    notes.extend(open_contours(&art, tolerance).map(|(d, element)| {
        d.at(Place::Element { path: name.to_owned(), element }).hint("join the ends in the drawing program")
    }));
    Ok(art)
}

/// What is said of contours that look closed and are not, and the entity at the first gap.
fn open_contours(art: &Artwork, tolerance: f64) -> Option<(Diag, String)> {
    let single = art.shapes.iter().filter(|s| s.figure == ShapeFigure::Lines && s.lines.len() == 1);
    let ends: Vec<LineEnds> = single
        .filter_map(|s| {
            let line = art.lines.get(s.lines.start);
            let length = line.windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum();
            let ends = [line[0], line[line.len() - 1]];
            (ends[0] != ends[1]).then_some(LineEnds { ends, length, name: s.name })
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

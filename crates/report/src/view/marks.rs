//! The marks in chunks of whole groups, each decoded by itself when it comes into view.

use std::ops::Range;

use serde::Serialize;

use super::pack::Data;
use crate::scene::{Group, Mark, Point, Scene};
use terrace_core::geom::BoxMm;

/// Points of a chunk; a group with more is a chunk of its own.
const POINTS: usize = 1 << 15;
/// Points of a mark at most, so that their number takes 16 bits; of a longer one the parts share their ends.
const LONGEST: usize = 60_000;
/// The finest step of coordinates, mm: finer ones would only make the file larger.
const FINEST: f64 = 2e-5;
/// The step of incidence, deg.
pub(super) const INCIDENCE_STEP: f64 = 0.25;

/// What the page knows of a chunk before it is decoded.
#[derive(Debug, Serialize)]
pub(super) struct ChunkHead {
    pub(super) name: String,
    /// The groups of the chunk: the first, and one behind the last.
    first: usize,
    last: usize,
    marks: usize,
    points: usize,
    #[serde(rename = "box")]
    pub(super) bounds: [[f64; 3]; 2],
    xy_mm: f64,
    z_mm: f64,
}

/// The groups of each chunk.
pub(super) fn chunks(scene: &Scene) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    let mut points = 0;
    for (i, group) in scene.groups.iter().enumerate() {
        let more = group.points.len();
        match out.last_mut() {
            // Indices of groups within a chunk are 16 bits.
            Some(chunk) if points + more <= POINTS && chunk.len() < 60_000 => {
                chunk.end = i + 1;
                points += more;
            }
            _ => {
                out.push(i..i + 1);
                points = more;
            }
        }
    }
    out
}

/// A chunk, and its element of the page. `defocus_step` is that of an on-the-fly job, um.
pub(super) fn chunk(
    scene: &Scene,
    index: usize,
    groups: Range<usize>,
    defocus_step: Option<f64>,
) -> (ChunkHead, String) {
    let mut lines: Vec<Line<'_>> = Vec::new();
    for (k, group) in scene.groups[groups.clone()].iter().enumerate() {
        lines.extend(group.marks.iter().flat_map(parts).map(|mark| Line { number: k as u16, group, mark }));
    }
    let points = || lines.iter().flat_map(|line| line.group.points_of(&line.mark));
    let xy_mm = step_mm(points(), 0..2);
    let z_mm = step_mm(points(), 2..3);
    let stepped =
        |axis: usize, mm: f64| points().map(move |p| (f64::from(p.at[axis]) / 1e6 / mm).round() as i16 as u16);
    let count = points().count();
    let mut data = Data::default();
    data.u32(lines.len() as u32);
    data.u32(count as u32);
    data.u16_planes(lines.iter().map(|line| line.number));
    data.u8(lines.iter().map(|line| line.mark.pen.0 as u8));
    data.u16_planes(lines.iter().map(|line| line.mark.len as u16));
    for (axis, mm) in [xy_mm, xy_mm, z_mm].into_iter().enumerate() {
        data.u16_delta(stepped(axis, mm));
    }
    data.u8(points().map(|p| (f64::from(p.incidence_deg) / INCIDENCE_STEP).round().min(255.0) as u8));
    if let Some(um) = defocus_step {
        data.u16_delta(points().map(move |p: &Point| (f64::from(p.defocus_um) / um).round() as i16 as u16));
        let times = lines.iter().flat_map(|line| &line.group.times_us[line.mark.points()]);
        data.u32_delta(times.map(|&us| us as u32));
    }
    let mut bounds = BoxMm::of([]);
    for group in &scene.groups[groups.clone()] {
        group.points.iter().for_each(|p| bounds.add(group.frame.part_from_group(p.at)));
    }
    let name = format!("marks-{index}");
    let head = ChunkHead {
        name: name.clone(),
        first: groups.start,
        last: groups.end,
        marks: lines.len(),
        points: count,
        bounds: [bounds.lo, bounds.hi],
        xy_mm,
        z_mm,
    };
    (head, data.element(&name))
}

/// A mark, or a part of a long one, as it is written.
struct Line<'a> {
    /// Number of its group in the chunk.
    number: u16,
    group: &'a Group,
    mark: Mark,
}

/// The step, mm, in which the coordinates of points along some axes fit in 16 bits with sign.
fn step_mm<'a>(points: impl Iterator<Item = &'a Point>, axes: Range<usize>) -> f64 {
    let coordinates = points.flat_map(|p| p.at[axes.clone()].iter().copied());
    let reach = coordinates.map(i32::unsigned_abs).max().unwrap_or(0);
    (f64::from(reach) / 1e6 / f64::from(i16::MAX)).max(FINEST)
}

/// A mark as one that can be written, or in parts that share their ends.
fn parts(mark: &Mark) -> impl Iterator<Item = Mark> {
    let mark = *mark;
    let step = LONGEST as u32 - 1;
    let count = mark.len.saturating_sub(1).div_ceil(step).max(1);
    (0..count).map(move |k| {
        let from = k * step;
        Mark { first: mark.first + from, len: (mark.len - from).min(LONGEST as u32), ..mark }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::program::PenId;

    #[test]
    fn parts_of_a_long_mark_share_their_ends_and_cover_it() {
        let mark = |len| Mark { pen: PenId(0), length_mm: 1.0, first: 10, len };
        for len in [1, 2, 59_999, 60_000] {
            assert_eq!(parts(&mark(len)).map(|m| (m.first, m.len)).collect::<Vec<_>>(), [(10, len)]);
        }
        let all: Vec<Mark> = parts(&mark(150_000)).collect();
        assert_eq!(all.len(), 3);
        for w in all.windows(2) {
            assert_eq!(w[0].first + w[0].len - 1, w[1].first);
        }
        assert_eq!(all[2].first + all[2].len, 150_010);
    }
}

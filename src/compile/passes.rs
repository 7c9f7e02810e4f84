//! Several passes: the whole texture again, each time with sections, levels and stops of its own.
//!
//! The first pass is compiled as a job of one pass is. What `auto` found best there is the method of all
//! passes. Every other pass has its own texture (hatches turned, lines along contours moved), a grid of
//! sections and levels that are shifted, and begins where the one before ended. The surface sinks by
//! `passes.lower` from pass to pass: a pass is compiled on the surface as it was, with the part's origin
//! lowered instead, so that focal planes lie where the stage can stand; its heights are lowered in the end.

use std::ops::Range;

use super::cut::{MAX_FRAGMENTS, MAX_POINTS, too_large};
use super::{Ground, Made, Setups};
use crate::diag::{Diag, Error};
use crate::geom::Box2;
use crate::machine::Machine;
use crate::map::Map;
use crate::program::{Program, Sections, Stop};
use crate::record::Times;
use crate::texture::Texture;

/// A pass after the first.
#[derive(Debug)]
pub struct Pass {
    /// Its grid of sections.
    pub sections: Sections,
    /// Directions of what is filled along contours, by section, in hundredths of a degree.
    pub directions: Vec<u16>,
    /// Which of its blocks owns which place; numbered from its first.
    pub map: Map,
    /// The box of its texture.
    pub texture: Box2,
    /// No partition of it has fewer stops; None where no bound is known.
    pub bound: Option<usize>,
    /// Its blocks in the program.
    pub blocks: Range<usize>,
}

/// Where a pass begins and how deep it lies.
pub(super) struct Place {
    /// From 0.
    pub(super) number: u32,
    /// By how much the surface has sunk, nm.
    pub(super) lowered: i64,
    /// The part's origin as it sank, nm; None where it is still to be found.
    pub(super) origin: Option<[i64; 3]>,
    /// Where the stage stands, nm.
    pub(super) from: [i64; 3],
    /// The stop where it stands, in heights of the surface as it was, and the cell of its set-up.
    pub(super) before: Option<(Stop, u32)>,
    /// The set-ups of the first pass; None where they are still to be found.
    pub(super) setups: Option<Setups>,
}

impl Place {
    pub(super) fn first(machine: &Machine) -> Self {
        Self { number: 0, lowered: 0, origin: None, from: super::start(machine), before: None, setups: None }
    }

    /// The place of pass `number`, after what has been made.
    fn after(first: &Ground<'_>, made: &Made, number: u32) -> Self {
        let lowered = first.job.file.passes.lowered_nm(number);
        let [x, y, z] = first.origin;
        let last = made.program.blocks.last();
        let raised = |s: &Stop| Stop { focus: s.focus + lowered, ..s.clone() };
        Self {
            number,
            lowered,
            origin: Some([x, y, z - lowered]),
            from: last.map_or(first.place.from, |b| b.stage),
            before: last.map(|b| (raised(&b.stop), b.setup)),
            setups: Some(made.setups.clone()),
        }
    }
}

/// Makes the passes after the first and puts them behind it.
///
/// # Errors
/// As for the first; `program-large` where all together are too large.
pub(super) fn further(first: &Ground<'_>, mut made: Made) -> Result<(Made, Vec<Pass>), Error> {
    let mut more = Vec::new();
    for number in 1..first.job.file.passes.count() {
        let Ground { job, machine, surface, .. } = *first;
        let turn = job.file.placement.turn.as_rad();
        let requests = job.texture_requests(number);
        // The first pass has given the warnings.
        let mut texture = Texture::load(&requests, surface.part_box_mm(), turn, &mut Vec::new())?;
        let place = Place::after(first, &made, number);
        let mut ground = super::ground(job, machine, surface, &mut texture, place)?;
        super::most_stops(&ground)?;
        let Some(stops) = super::divide(&ground, made.method) else {
            return Err(Diag::bug("no-candidate", "a pass cannot be divided as the first was").into());
        };
        let parts = super::cut(&ground, std::slice::from_ref(&stops))?.pop().unwrap_or_default();
        let next = super::make(&ground, made.method, &stops, parts);
        let marks = ground.marks.take();
        let bound = super::bound::certificate(&ground, marks, made.method).map(|c| c.stops());
        let bounds = ground.texture.bounds();
        let map = Map::new(&next.program, &ground.sections, machine, ground.origin, surface, bounds);
        let begin = made.program.blocks.len();
        let (fragments, points) =
            (made.fragments + next.fragments, made.program.points.len() + next.program.points.len());
        if fragments > MAX_FRAGMENTS || points > MAX_POINTS {
            return Err(too_large(first).into());
        }
        let lowered = ground.place.lowered;
        let directions = ground.texture.directions().map_or_else(Vec::new, |d| d.hundredths.clone());
        let sections = ground.sections;
        made = joined(made, next, lowered);
        let blocks = begin..made.program.blocks.len();
        more.push(Pass { sections, directions, map, texture: bounds, bound, blocks });
    }
    Ok((made, more))
}

/// Both, one after the other, the second lowered.
fn joined(mut a: Made, b: Made, lowered: i64) -> Made {
    append(&mut a.program, b.program, lowered);
    let sum = |a: f64, b: f64| a + b;
    let (s, t) = (a.times, b.times);
    a.times = Times {
        stage: sum(s.stage, t.stage),
        settle: sum(s.settle, t.settle),
        mark: sum(s.mark, t.mark),
        jump: sum(s.jump, t.jump),
        delay: sum(s.delay, t.delay),
        total: sum(s.total, t.total),
    };
    a.block_times.extend(b.block_times);
    a.slopes.extend(b.slopes);
    a.fragments += b.fragments;
    a.split = super::join(a.split, b.split);
    a.worst_defocus = a.worst_defocus.max(b.worst_defocus);
    a.worst_defocus_mean = a.worst_defocus_mean.max(b.worst_defocus_mean);
    a
}

fn append(program: &mut Program, next: Program, lowered: i64) {
    let (strokes, points) = (program.strokes.len(), program.points.len() as u32);
    program.points.extend(next.points);
    // Pens that make up for the slope differ from pass to pass.
    let pens: Vec<u16> = next
        .pens
        .into_iter()
        .map(|pen| {
            let known = program.pens.iter().position(|p| *p == pen);
            known.unwrap_or_else(|| {
                program.pens.push(pen);
                program.pens.len() - 1
            }) as u16
        })
        .collect();
    program.strokes.extend(next.strokes.into_iter().map(|mut s| {
        s.first += points;
        s.pen = pens[usize::from(s.pen)];
        s
    }));
    program.blocks.extend(next.blocks.into_iter().map(|mut b| {
        b.strokes = b.strokes.start + strokes..b.strokes.end + strokes;
        for z in [&mut b.stop.focus, &mut b.stop.z_lo, &mut b.stop.z_hi, &mut b.z_lo, &mut b.z_hi] {
            *z -= lowered;
        }
        b
    }));
}

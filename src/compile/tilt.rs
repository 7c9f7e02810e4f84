//! The stops of a machine that tilts the part: sections and tilts by sample points of the marks, then what
//! each must hold by all of them.

use rayon::prelude::*;

use super::{Ground, chunks};
use crate::geom::Box2;
use crate::partition::{Stops, tilt};
use crate::trace::{Facings, GridTracer, Marks, Tracer, Turned};

/// The stops, and the square of the tangent of the largest angle between beam and surface.
pub(super) fn divide(ground: &Ground<'_>) -> (Stops, f64) {
    let tilted = tilt::Ground {
        machine: ground.machine,
        origin: ground.origin,
        // Sections of later passes begin elsewhere.
        area: Box2 { lo: ground.sections.origin, hi: ground.texture.bounds().hi },
        window: ground.window.map(|w| w / 2 * 2),
        lattice: ground.lattice,
    };
    let samples = samples(ground, &tilted);
    let mut facings = tilted.plan(&samples);
    let tiles = ground.surface.tiles();
    let top = |area: Box2| {
        let near = |b: &Box2| b.lo.x <= area.hi.x && area.lo.x <= b.hi.x && b.lo.y <= area.hi.y && area.lo.y <= b.hi.y;
        tiles.iter().filter(|(b, _)| near(b)).map(|t| t.1).max().map_or(f64::NEG_INFINITY, |t| t as f64)
    };
    let highest = tiles.iter().map(|t| t.1).max().unwrap_or(0) as f64;
    let lowest = samples.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
    let mut areas = vec![Box2::EMPTY; facings.list.len()];
    for (cell, &facing) in facings.of_cell.iter().enumerate() {
        let area = &mut areas[facing as usize];
        *area = area.union(facings.grid.area(cell));
    }
    for (facing, area) in facings.list.iter_mut().zip(areas) {
        // What could hide the lowest mark is no farther away than this.
        let [x, y, z] = facing.turn.up();
        let reach = ((highest - lowest) * x.hypot(y) / z).ceil() as i64 + 1;
        let [mut lo, mut hi] = [area.lo, area.hi];
        (lo.x, lo.y, hi.x, hi.y) = (lo.x - reach, lo.y - reach, hi.x + reach, hi.y + reach);
        facing.top = top(Box2 { lo, hi });
    }
    loop {
        let held = held(ground, &facings);
        let bad: Vec<usize> = (0..facings.list.len())
            .filter(|&i| (held.0[i].is_hidden || held.0[i].is_beside) && facings.list[i].tilt != [0; 2])
            .collect();
        if bad.is_empty() {
            let worst = held.0.iter().map(|h| h.worst_slope2).fold(0.0, f64::max);
            return (tilted.stops(&facings, &held, &ground.sections), worst);
        }
        bad.into_iter().for_each(|i| tilted.set_upright(&mut facings, i));
    }
}

/// Sample points of the marks.
fn samples(ground: &Ground<'_>, tilted: &tilt::Ground<'_>) -> Vec<[f64; 3]> {
    let grid = tilted.samples();
    chunks(ground.texture)
        .into_par_iter()
        .fold(Marks::default, |mut marks, chunk| {
            let mut tracer = GridTracer::new(Tracer::new(ground.surface, ground.max_slope), &grid);
            let mut points = Vec::new();
            for i in chunk {
                ground.texture.stroke(i, &mut points);
                marks.add(&points, &mut tracer);
            }
            marks
        })
        .reduce(Marks::default, |mut a, b| {
            a.merge(b);
            a
        })
        .list()
}

/// What every facing must hold.
fn held(ground: &Ground<'_>, facings: &Facings) -> Turned {
    let none = || Turned::new(facings.list.len());
    chunks(ground.texture)
        .into_par_iter()
        .fold(none, |mut held, chunk| {
            let mut tracer = GridTracer::new(Tracer::new(ground.surface, ground.max_slope), &facings.grid);
            let mut points = Vec::new();
            for i in chunk {
                ground.texture.stroke(i, &mut points);
                held.add(&points, &mut tracer, facings, ground.keep);
            }
            held
        })
        .reduce(none, |mut a, b| {
            a.merge(b);
            a
        })
        .joined()
}

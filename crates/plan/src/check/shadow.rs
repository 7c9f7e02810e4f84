//! Beams that would meet a fixture: where a mark lies under one, or so near to it that it cuts the beam.
//!
//! A beam comes down parallel to the optical axis and is the wider the higher above its focal plane. What it must have
//! to itself is taken as upright cylinders, each from one height up and as wide as the beam is at twice that height: a
//! stroke sweeps them as a move sweeps the head.

use super::Limits;
use crate::fixtures::Fixture;
use terrace_core::clearance::{Facets, Way};
use terrace_core::diag::{Diag, Place};
use terrace_core::geom::{FieldPoint, NM_PER_MM, P3};
use terrace_core::machine::Machine;
use terrace_core::program::{Block, BlockId, Program};

/// Radii of the beam (1/e²) that stay free: but for 0.03 % all power of an ideal beam passes there.
const RADII: f64 = 2.0;

/// The height above the focal plane, nm, from which on cylinders are told apart.
const FIRST_HEIGHT: f64 = 1e6;

/// Blocks that a message names.
const NAMED: usize = 3;

/// Marks whose beams would meet a fixture: one fault a fixture.
pub(super) fn broken(program: &Program, limits: &Limits<'_>) -> Vec<Diag> {
    limits.fixtures.iter().filter_map(|fixture| shadowed(fixture, program, limits)).collect()
}

/// The fault of a fixture that is in the way of beams.
fn shadowed(fixture: &Fixture, program: &Program, limits: &Limits<'_>) -> Option<Diag> {
    let facets = Facets::above(f64::NEG_INFINITY, &|sink| fixture.facets.iter().for_each(|f| sink(*f)));
    let blocks = program.blocks.iter().enumerate().filter(|(_, block)| fixture.is_in(block.setup));
    let hits: Vec<(usize, P3)> =
        blocks.filter_map(|(i, block)| Some((i, met(&facets, fixture, block, program, limits)?))).collect();
    let &(_, at) = hits.first()?;
    let ids: Vec<String> = hits.iter().take(NAMED).map(|(i, _)| BlockId::new(*i).to_string()).collect();
    let more = hits.len() - ids.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let text = format!(
        "fixture {:?} would be in the way of the beam at {} of {} stops ({}{more})",
        fixture.name,
        hits.len(),
        program.blocks.len(),
        ids.join(", ")
    );
    let [x_mm, y_mm] = [at.at[0], at.at[1]].map(|v| v / NM_PER_MM);
    let hint = "move the fixture, mark what lies under it in another set-up or job, or leave that area out of the \
                texture with `outside`";
    Some(Diag::limit("fixture-beam", text).at(Place::Part { x_mm, y_mm }).hint(hint))
}

/// The first place of a fixture that is met by the beam of a block.
fn met(facets: &Facets, fixture: &Fixture, block: &Block, program: &Program, limits: &Limits<'_>) -> Option<P3> {
    let turn = limits.machine.turn(block.stop.tilt, limits.origins[block.setup.index()]);
    let [lo, hi] = fixture.ends();
    let corners = (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { lo[k] } else { hi[k] }));
    let top = corners.map(|p| turn.apply(P3::new(p)).at[2]).fold(f64::NEG_INFINITY, f64::max);
    let plane = block.stop.lpfl.f64();
    let cylinders = cylinders(limits.machine, block.z_lo.f64() - plane, top - plane);
    if cylinders.is_empty() {
        return None;
    }
    let centre = [block.stop.centre.x, block.stop.centre.y];
    let at = |p: &FieldPoint| [(centre[0] + i64::from(p.x)) as f64, (centre[1] + i64::from(p.y)) as f64];
    let places = program.strokes_of(block).iter().flat_map(|stroke| {
        let points = program.points_of(stroke);
        // A dot is a way without length.
        let last = if points.len() == 1 { 0 } else { 1 };
        points.iter().zip(&points[last..]).map(|(a, b)| [at(a), at(b)])
    });
    let ways = places.flat_map(|ends| {
        cylinders.iter().map(move |&[from, radius]| Way { turn, ends: ends.map(|[x, y]| [x, y, plane + from]), radius })
    });
    ways.into_iter().find_map(|way| facets.entered(&way)).map(|met| met.at)
}

/// The cylinders that beams have to themselves, from a height above the focal plane up to another, nm: where each
/// begins, and its radius.
fn cylinders(machine: &Machine, lowest: f64, top: f64) -> Vec<[f64; 2]> {
    let mut cylinders = Vec::new();
    let mut from = lowest;
    while from < top {
        let to = (2.0 * from).max(FIRST_HEIGHT);
        cylinders.push([from, RADII * beam_radius(machine, to.max(-from))]);
        from = to;
    }
    cylinders
}

/// The radius (1/e²) of the beam at a height above its focal plane, nm.
fn beam_radius(machine: &Machine, height: f64) -> f64 {
    let waist = machine.lens.spot.as_mm() * NM_PER_MM / 2.0;
    let rayleigh = machine.depth_of_focus_mm() * NM_PER_MM / 2.0;
    waist * (1.0 + (height / rayleigh).powi(2)).sqrt()
}

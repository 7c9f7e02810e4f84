//! Where to measure a part, and how a touch probe gets there.
//!
//! Consumes a job whose part lies about where `placement.origin` says, and how far it may lie from there. Promises
//! points that can be measured, in an order in which the stage goes little, what would be known after them, and the
//! moves of a touch probe: nothing of the probe or the head comes nearer to the part or a fixture than that distance,
//! except the tip where it touches. What is believed before is a motion of that size, and a warp as large as the job says; once the
//! job's table is there, what its points have shown.
//!
//! Frame: part as the job turns it, nm, and the table frame, mm.

mod belief;
mod choice;
mod place;
mod plan;
mod program;
mod sites;
mod ways;

pub use plan::{Move, ProbePoint, Probing, Tool};
pub use program::{LOG, program};

use crate::fixtures;
use crate::measured::{self, Lying};
use crate::order::stops::{EFFORT, HeightOrder, Stage, tour};
use crate::plan::Inputs;
use belief::Belief;
use choice::Question;
use place::Place;
use terrace_core::diag::{Diag, Error, Place as In};
use terrace_core::geom::NM_PER_MM;
use terrace_core::machine::{Commanded, Machine};
use terrace_input::job::Job;
pub use terrace_register::Known;

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// What measures.
    pub tool: Tool,
    /// How far the part may lie from where the job says, in any direction, mm.
    pub search_mm: f64,
    /// How many points.
    pub count: Count,
}

/// How many points there are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Count {
    /// So many that what is kept free of the depth costs few stops more, at most [`MOST_BY_COST`].
    ByCost,
    /// This many.
    Of(usize),
    /// So many that no height where something is marked has a larger standard deviation than this, mm.
    BySigma(f64),
}

/// Most points that are chosen for their cost alone.
pub const MOST_BY_COST: usize = 120;

/// Most points.
pub const MOST: usize = 500;

/// Deviations in what a part may be off at most.
const IN_MOST: f64 = 3.0;

/// Plans the points of a job.
///
/// # Errors
/// Faults of the job and its inputs; `probe-start`, `probe-none`, `probe-reach`.
pub fn probing(job: &Job, asked: &Asked, warnings: &mut Vec<Diag>) -> Result<Probing, Error> {
    // Where it was measured before is not what is asked.
    let mut bare = job.clone();
    bare.placement.measured = None;
    let inputs = Inputs::load(&bare)?;
    warnings.extend(inputs.warnings.iter().cloned());
    let machine = inputs.machine.clone();
    let Some(origin) = job.placement.origin else {
        let text = "the probe has to know where the part lies, about: placement.origin is missing";
        let fault = Diag::input("probe-start", text).at(job.place_of("placement"));
        return Err(fault
            .hint("state where the part's origin lies on the table, and --search, how far off it may be")
            .into());
    };
    warnings.extend(fixtures::beyond(&bare, &machine, &inputs.fixtures, &[origin]));
    let shape = ways::Shape::new(&machine, &asked.tool, asked.search_mm);
    let ways = ways::Ways::new(&inputs, origin, shape);
    let marked = sites::marked(&inputs.texture, &inputs.surface, job.limits.max_slope());
    let fine = sites::even_places(&inputs.surface, inputs.texture.bounds(), &ways);
    let spread = sites::reached(&fine, &ways);
    if spread.len() < 3 || marked.is_empty() {
        let text = format!("only {} places of the part under the texture can be measured", spread.len());
        let hint = "a place is measured where the part is no steeper than 30 degrees, no edge is as near as the tip and \
                    --search, axes reach it, and neither body nor head of the probe touches the part";
        return Err(Diag::limit("probe-none", text)
            .at(In::file(job.surface_path().display().to_string()))
            .hint(hint)
            .into());
    }
    let known = known(job, &inputs, warnings)?;
    let belief = Belief::new(job, origin, asked, (&marked, machine.usable_field()), known.as_ref());
    let question = Question {
        belief: &belief,
        marked: &marked,
        shown: known.as_ref().and_then(|lying| lying.warp.as_ref()).map_or(&[][..], |warp| warp.points()),
        sigma: match asked.tool {
            Tool::Touch(probe) => probe.noise.as_mm(),
            Tool::Sensor(sigma) => sigma,
        },
        spread,
        fine: &fine,
        reaches: &|place| ways.reaches(place),
    };
    let chosen = question.choose(asked.count);
    let deviations = marked.iter().zip(&chosen.deviations).map(|(m, &sigma)| (m.place.plane_mm(), sigma)).collect();
    let order = in_order(&machine, chosen.places.iter().collect());
    let moves = match asked.tool {
        Tool::Touch(_) => ways.moves(&order)?,
        Tool::Sensor(_) => Vec::new(),
    };
    let points = (1..).zip(&order).map(|(number, place)| ProbePoint {
        name: format!("P{number:03}"),
        part_mm: place.at.map(|nm| nm / NM_PER_MM),
        stage: place.stage,
    });
    Ok(Probing {
        tool: asked.tool,
        search_mm: asked.search_mm,
        origin,
        points: points.collect(),
        moves,
        before: chosen.before,
        after: chosen.after,
        of_net: chosen.of_net,
        sigmas: belief.sigmas,
        believed: job.placement.measured.as_ref().and_then(|m| m.warp).filter(|_| known.is_none()).map(|w| w.as_mm()),
        earlier: known.as_ref().map_or(0, |lying| lying.points.len()),
        deviations,
        machine,
    })
}

/// What an earlier measurement shows, if the job's table is there.
fn known(job: &Job, inputs: &Inputs, warnings: &mut Vec<Diag>) -> Result<Option<Lying>, Error> {
    let is_there = job.placement.measured.as_ref().is_some_and(|measured| job.relative(&measured.file).exists());
    if !is_there {
        return Ok(None);
    }
    measured::lying(job, &inputs.machine, &inputs.surface, warnings)
}

/// The order in which the stage goes little.
fn in_order<'a>(machine: &Machine, places: Vec<&'a Place>) -> Vec<&'a Place> {
    // Between points the stage rises over what lies there, so their own heights say little of the way.
    let stops: Vec<Commanded> = places.iter().map(|place| Commanded([place.stage[0], place.stage[1], 0])).collect();
    let from = Commanded(machine.axes().map(|(_, axis)| axis.middle().0));
    let order = tour(&stops, &Stage { machine, from, lifts: None }, HeightOrder::Free, EFFORT);
    order.into_iter().map(|i| places[i]).collect()
}

//! Where to measure a part, and how a touch probe gets there.
//!
//! Consumes a job whose part lies about where `placement.origin` says, and how far it may lie from there. Promises
//! points that can be measured, in an order in which the stage goes little, what would be known after them, and the
//! moves of a touch probe: nothing of the probe or the head comes nearer to the part or a fixture than that distance,
//! except the tip where it touches. What is believed before is a motion of that size, and a warp as large as the job says; once the
//! job's table is there, what its points have shown.
//!
//! Frame: part as the job turns it, nm, and the table frame, mm.

mod place;
mod plan;
mod program;
mod sites;
mod ways;

pub use plan::{Move, ProbePoint, Probing, Tool};
pub use program::{LOG, program};

use crate::measured::{self, Lying};
use crate::order::stops::{EFFORT, HeightOrder, Stage, tour};
use crate::plan::Inputs;
use place::Place;
use sites::MarkedPlace;
use terrace_core::diag::{Diag, Error, Place as In};
use terrace_core::geom::{NM_PER_MM, SpacePoint};
use terrace_core::machine::{Commanded, Machine, Origin};
use terrace_core::math;
use terrace_input::job::Job;
pub use terrace_register::Known;
use terrace_register::{Candidate, Prior, Site, Unknown, even_net};

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

/// Stops over those of a part that is known exactly at which more points are not worth their time.
const ENOUGH: f64 = 1.05;

/// Deviations in what a part may be off at most.
const IN_MOST: f64 = 3.0;

/// Part of the extent over which a part is believed to be warped at least, before points have shown anything: fewer than
/// some hundred points could not follow a shorter one. They tell if it is, and then the next points are chosen by that.
const SHORTEST: f64 = 6.5;

/// Of a range of depth that is kept free up to this share, stops grow as the rest becomes smaller; beyond they would
/// grow without bound, and are taken to grow evenly.
const MOST_KEPT: f64 = 0.8;

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
    let shape = ways::Shape::new(&machine, &asked.tool, asked.search_mm);
    let ways = ways::Ways::new(&inputs, origin, shape);
    let marked = sites::marked(&inputs.texture, &inputs.surface, job.limits.max_slope());
    let places = sites::places(&inputs.surface, inputs.texture.bounds(), &ways);
    if places.len() < 3 || marked.is_empty() {
        let text = format!("only {} places of the part under the texture can be measured", places.len());
        let hint = "a place is measured where the part is no steeper than 30 degrees, no edge is as near as the tip and \
                    --search, axes reach it, and neither body nor head of the probe touches the part";
        return Err(Diag::limit("probe-none", text)
            .at(In::file(job.surface_path().display().to_string()))
            .hint(hint)
            .into());
    }
    let known = known(job, &inputs, warnings)?;
    let belief = Belief::new(job, origin, asked, &marked, known.as_ref());
    let shown = known.as_ref().and_then(|lying| lying.warp.as_ref()).map_or(&[][..], |warp| warp.points());
    let sigma = match asked.tool {
        Tool::Touch(probe) => probe.noise.as_mm(),
        Tool::Sensor(sigma) => sigma,
    };
    let sites: Vec<Site> = places.iter().map(|place| belief.site(place)).collect();
    let targets: Vec<Site> = marked.iter().map(|place| belief.site(&place.place)).collect();
    let unknown = || Unknown::new(&belief.prior, shown, &sites, &targets, sigma);
    let by_stops = |t: usize, variance: f64| belief.stops(&marked[t], variance);
    let before = unknown().known(&by_stops);
    let mut chosen_of = unknown();
    let chosen = match asked.count {
        Count::Of(count) => chosen_of.choose(&by_stops, &|n, _| n >= count),
        Count::ByCost => chosen_of.choose(&by_stops, &|n, known| known.cost <= ENOUGH || n >= MOST_BY_COST),
        Count::BySigma(wanted) => {
            // The fourth power of variances: their largest counts most.
            let by_worst = |_: usize, variance: f64| (variance / (wanted * wanted)).powi(4);
            chosen_of.choose(&by_worst, &|n, known| known.worst <= wanted || n >= MOST)
        }
    };
    let mut of_net = unknown();
    even_net(&sites, chosen.len()).into_iter().for_each(|site| of_net.measure(site));
    let deviations = marked.iter().zip(chosen_of.deviations()).map(|(m, sigma)| (m.place.plane_mm(), sigma)).collect();
    let order = in_order(&machine, chosen.iter().map(|&i| &places[i]).collect());
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
        before,
        after: chosen_of.known(&by_stops),
        of_net: of_net.known(&by_stops),
        sigmas: belief.sigmas,
        believed: believed(job, known.as_ref(), &belief.prior),
        earlier: known.as_ref().map_or(0, |lying| lying.points.len()),
        deviations,
        machine,
    })
}

/// How far a part may be warped, and over which length at least, where nothing has shown it.
fn believed(job: &Job, known: Option<&Lying>, prior: &Prior) -> Option<[f64; 2]> {
    let limit = job.placement.measured.as_ref()?.warp.filter(|_| known.is_none())?;
    Some([limit.as_mm(), prior.warp.iter().map(|c| c.length).fold(f64::INFINITY, f64::min)])
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

/// What is believed before, and what not knowing costs.
struct Belief {
    prior: Prior,
    origin_mm: SpacePoint,
    sigmas: f64,
    /// Depth range of a block, mm.
    depth: f64,
    /// Sum of the weights of all marked places.
    weights: f64,
}

impl Belief {
    fn new(job: &Job, origin: Origin, asked: &Asked, marked: &[MarkedPlace], known: Option<&Lying>) -> Self {
        let origin_mm = origin.mm();
        let place = |m: &MarkedPlace| m.place.at.map(|nm| nm / NM_PER_MM);
        let (lo, hi) = marked.iter().map(place).fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(lo, hi), p| {
            ([0, 1, 2].map(|k| lo[k].min(p[k])), [0, 1, 2].map(|k| hi[k].max(p[k])))
        });
        let extent = math::hypot(hi[0] - lo[0], hi[1] - lo[1]).max(1.0);
        let measured = job.placement.measured.as_ref();
        let prior = match known {
            Some(lying) => Self::of_fit(lying),
            None => {
                let shift = asked.search_mm / IN_MOST;
                let turn = shift / (extent / 2.0);
                let amplitude = measured.and_then(|m| m.warp).map(|limit| limit.as_mm() / IN_MOST);
                let lengths: Vec<f64> = terrace_register::lengths(extent).filter(|l| *l >= extent / SHORTEST).collect();
                let weight = 1.0 / lengths.len() as f64;
                let of_length = |amplitude| move |&length: &f64| Candidate { length, amplitude, weight };
                Prior {
                    centre: [0, 1, 2].map(|k| f64::midpoint(lo[k], hi[k]) + origin_mm[k]),
                    covariance: Prior::independent([turn, turn, turn, shift, shift, shift]),
                    warp: amplitude.map_or_else(Vec::new, |a| lengths.iter().map(of_length(a)).collect()),
                }
            }
        };
        Self {
            prior,
            origin_mm,
            sigmas: measured.map_or(IN_MOST, |m| m.sigmas),
            depth: job.focus.depth.mm(),
            weights: marked.iter().map(|m| m.weight).sum(),
        }
    }

    /// What a fit leaves unknown. Of a warped part its correction holds what the pose is off by in height.
    fn of_fit(lying: &Lying) -> Prior {
        let uncertainty = &lying.fit.uncertainty;
        let (covariance, warp) = match &lying.warp {
            None => (uncertainty.covariance, Vec::new()),
            Some(warp) => {
                let grown = |c: Candidate| Candidate { amplitude: c.amplitude * warp.factor(), ..c };
                ([[0.0; 6]; 6], warp.candidates().into_iter().map(grown).collect())
            }
        };
        Prior { centre: uncertainty.centre, covariance, warp }
    }

    fn site(&self, place: &Place) -> Site {
        Site { at: [0, 1, 2].map(|k| place.at[k] / NM_PER_MM + self.origin_mm[k]), slope: place.slope }
    }

    /// The share of all stops that a place asks for, whose height has a variance, mm²: so many as the depth that is left
    /// is smaller.
    fn stops(&self, marked: &MarkedPlace, variance: f64) -> f64 {
        let kept = 2.0 * self.sigmas * variance.sqrt() / self.depth;
        let slope = 1.0 / (1.0 - MOST_KEPT).powi(2);
        let times =
            if kept < MOST_KEPT { 1.0 / (1.0 - kept) } else { 1.0 / (1.0 - MOST_KEPT) + slope * (kept - MOST_KEPT) };
        times * marked.weight / self.weights
    }
}

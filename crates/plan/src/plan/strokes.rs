//! The strokes of a texture as far as they lie on the part, in the order in which an on-the-fly machine marks
//! them.
//!
//! Consumes surface, texture and the job's limits; there is no field and no stop. All strokes are one band, or lie in
//! bands of a depth over the whole part, bottom up. The order begins at the texture's upper right corner.

use super::assemble::append_stroke;
use super::cut::Members;
use super::early;
use super::grid::{default_height, default_origin};
use super::inputs::Inputs;
use super::off_part::OffPart;
use super::parts::Parts;
use super::plausible::Shares;
use super::progress::{Phase, Progress};
use super::split::{CutRules, join, split};
use super::stroke_chunks::Sweep;
use super::{hatch_direction, nothing, warnings};
use crate::ordered_strokes::{Band, OrderedStrokes};
use crate::partition::{self, Lattice, Stops};
use crate::projection::{HeightRange, Keep};
use crate::split::{Fragments, Skipped};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, FieldPoint, Nm, P2, length_mm};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Sections, StopId, Stroke};
use terrace_core::progress::Task;
use terrace_input::job::Job;
use terrace_input::texture::Texture;

/// Strokes in order.
#[derive(Clone, Debug)]
pub struct Strokes {
    /// The strokes, band by band.
    pub ordered: OrderedStrokes,
    /// The bands of depth, upwards; one where there are none.
    pub bands: Vec<Band>,
    /// Where the part's origin lies in the table frame, nm: where the job says, or so that the middle of the marks
    /// is at the centre of travel.
    pub origin: Origin,
    /// The box of the texture, turned part frame.
    pub texture: Box2,
    /// The strokes as they were followed over the part.
    pub followed: Texture,
    /// Length of the texture, mm.
    pub texture_mm: f64,
    /// What of it lies where nothing may be marked.
    pub skipped: Skipped,
    /// What of it each texture has.
    pub(super) shares: Shares,
    /// What the user should know of what is not marked.
    pub warnings: Vec<Diag>,
}

/// Puts the strokes in order; with `band`, a depth, in bands of that depth.
///
/// # Errors
/// `job-empty`; `fly-large` where the texture is wider than block coordinates reach; `steep` where the job refuses
/// steep places; `off-part`.
pub fn in_order(
    job: &Job,
    machine: &Machine,
    inputs: &Inputs,
    band: Option<Nm>,
    progress: Progress<'_>,
) -> Result<Strokes, Error> {
    let area = inputs.texture.bounds();
    check_texture(job, inputs)?;
    // One section holds all of it: nothing divides it but the bands.
    let pitch = area.size().map(|side| (side + Nm(1)) * 2);
    let section = Sections { origin: area.lo, pitch, count: [1, 1] };
    let max_slope = job.limits.max_slope();
    let depth = band.unwrap_or(WIDEST);
    let [hatching, tracing] = Phase::Footprint.task(progress).split([1, 4]);
    let texture =
        hatch_direction::along_contours(inputs.texture.clone(), &inputs.surface, &section, max_slope, depth, hatching)?;
    let sweep = Sweep { surface: &inputs.surface, texture: &texture, max_slope, reserve: None };
    let (footprint, _) = sweep.footprint(&section, Keep(Nm(0)), pitch.map(|p| p / 2), None, tracing);
    let Some(heights) = footprint.range() else { return Err(nothing::marked(job, &inputs.surface).into()) };
    let origin = origin(job, machine, area, heights);
    let Some(lattice) = Lattice::new(depth, machine.increment_nm(), Nm(origin[2])) else {
        return Err(Diag::limit("depth-small", "the depth range is below two stage increments").into());
    };
    let lattice = lattice.with_hysteresis(footprint.roughness());
    let stops = partition::z_range(&footprint, &section, pitch, &lattice);
    let cutting = Phase::Split.task(progress);
    let parts = split(sweep, &[&stops], &section, &job.pens, CutRules::default(), cutting)?.pop().unwrap_or_default();
    let (ordered, bands) = in_bands(job, &stops, &parts, Phase::Order.task(progress));
    let totals = parts.into_list().into_iter().fold(Fragments::default(), join);
    let warnings = what_is_not_marked(job, inputs, sweep, &totals)?;
    let strokes_of = |i: usize, visit: &mut dyn FnMut(&Stroke, f64)| {
        let band: &Band = &bands[i];
        ordered.strokes[band.strokes.clone()].iter().for_each(|s| visit(s, length_mm(ordered.points_of(s))));
    };
    let shares = Shares::new(job, &texture, bands.len(), &strokes_of, inputs.part_box(job), machine);
    let Fragments { texture_mm, skipped, .. } = totals;
    Ok(Strokes { ordered, bands, origin, texture: area, followed: texture, texture_mm, skipped, shares, warnings })
}

/// What coordinates of blocks reach, which have 32 bits.
const WIDEST: Nm = Nm(i32::MAX as i64);

/// Refuses dots, at which the beam would have to stand still, and textures that coordinates do not reach over.
///
/// # Errors
/// `fly-job`, `fly-large`.
fn check_texture(job: &Job, inputs: &Inputs) -> Result<(), Error> {
    if !inputs.texture.dot_pens().is_empty() {
        return Err(early::no_dots().at(job.place()).into());
    }
    if inputs.texture.bounds().size().iter().any(|&side| side >= WIDEST) {
        let text = "the texture is wider than 2.1 m, which on-the-fly programs cannot hold";
        return Err(Diag::limit("fly-large", text).at(job.place()).hint("mark a smaller area").into());
    }
    Ok(())
}

/// Where the part's origin lies: where the job says, or so that the middle of the marks, which lie in `area` at these
/// heights, is at the centre of travel.
fn origin(job: &Job, machine: &Machine, area: Box2, heights: HeightRange) -> Origin {
    job.placement.origin.unwrap_or_else(|| {
        let [x, y] = default_origin(machine, area, [Nm(0); 2]);
        Origin([x.0, y.0, default_height(machine, heights).0])
    })
}

/// What the user should know of what is not marked.
///
/// # Errors
/// What the job refuses: `steep`, `off-part`.
fn what_is_not_marked(job: &Job, inputs: &Inputs, sweep: Sweep<'_>, totals: &Fragments) -> Result<Vec<Diag>, Error> {
    let is_off = totals.skipped.off_part > 0.0 || totals.dots.off_part > 0;
    let off_part = if is_off { OffPart::of(job, sweep) } else { OffPart::default() };
    let slips: Vec<_> = inputs.texture.slips().map(|(k, slip)| (k, slip.clone())).collect();
    let mut warnings = Vec::new();
    warnings::warn(job, totals, &off_part, &slips, &mut warnings)?;
    Ok(warnings)
}

impl Strokes {
    /// These strokes, each as often in the list as its pen has passes.
    #[must_use]
    pub fn repeated(mut self) -> Self {
        self.ordered = self.ordered.repeated(&mut self.bands);
        self
    }
}

/// The fragments in order, band by band.
fn in_bands(job: &Job, stops: &Stops, parts: &Parts, task: Task<'_>) -> (OrderedStrokes, Vec<Band>) {
    let members = Members::new(parts.list(), stops.stops.len());
    let mut ordered = OrderedStrokes { pens: job.pens.clone(), ..OrderedStrokes::default() };
    let mut bands = Vec::new();
    let task = task.of_steps(stops.stops.len());
    for (i, placed) in stops.stops.iter().enumerate() {
        let id = StopId(i as u32);
        if members.of(id).is_empty() {
            continue;
        }
        let first = ordered.strokes.len();
        let stop = &placed.stop;
        let on_part = |p: FieldPoint| P2::new(stop.centre.x + i64::from(p.x), stop.centre.y + i64::from(p.y));
        for fragment in members.ordered(parts.list(), id, job.order.strokes) {
            append_stroke(&mut ordered.strokes, &mut ordered.points, parts.list(), fragment, on_part);
        }
        let heights = members.fragments(parts, id).map(|(_, measure, _)| measure.z);
        let z = heights.fold([i32::MAX, i32::MIN], |z, f| [z[0].min(f[0]), z[1].max(f[1])]);
        let [lo, hi] = z.map(|z| stop.z_lo + Nm(i64::from(z)));
        bands.push(Band { lpfl: (lo + hi) / 2, z: [stop.z_lo, stop.z_hi], strokes: first..ordered.strokes.len() });
        task.step();
    }
    (ordered, bands)
}

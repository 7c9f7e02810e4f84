//! Where a measured part lies, and what of it is planned on.
//!
//! Consumes the table of a job and the part as designed, turned as the job says. Promises the rigid motion onto the
//! stage, as a placement of whole increments and a rotation with a rest below one, and the surface and texture as they
//! lie: all that follows plans on these. Points that do not go together, or leave a motion free, are refused by name.
//! Where the job says that the part may be warped, its heights are corrected by what the rigid fit leaves.

mod faults;

use std::sync::Arc;

use crate::projection::{HeightDoubt, HeightReserve, KeptFree, Short};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{Box2, BoxMm, Correction, Grid, NM_PER_MM, Nm, P2, SpacePoint, Turn, cos_sin};
use terrace_core::machine::{Machine, Origin};
use terrace_core::math;
use terrace_input::job::{Job, MeasuredInput, Unsure};
use terrace_input::measured::{Measure, MeasuredPoint, read_table};
use terrace_input::surface::{Joining, Surface};
use terrace_input::texture::{Draped, Draping, Lost, LostMarks, Texture};
pub use terrace_register::Warp;
use terrace_register::{
    DEVIATION_OF_LIMIT, Facets, Fit, Motion, Observation, Pair, Points, Told, Touch, TouchResidual, fit, pairs_fault,
    warp,
};

/// A part as it lies, measured.
#[derive(Clone, Debug)]
pub struct Lying {
    /// The fit, in mm; from the part as the job turns it to the table frame.
    pub fit: Fit,
    /// The points, in the order of the table.
    pub points: Vec<PointResidual>,
    /// The placement that the job is planned with: whole increments.
    pub origin: Origin,
    /// What moves the part beside its placement: the rows of a rotation, and a shift below an increment, nm.
    pub rows: [SpacePoint; 3],
    /// See `rows`.
    pub rest_nm: SpacePoint,
    /// How it is warped; None where the job says that it is rigid.
    pub warp: Option<Warp>,
}

/// A measured point, and what the fit leaves of it.
#[derive(Clone, Debug, PartialEq)]
pub struct PointResidual {
    /// Its name.
    pub name: String,
    /// Where it lies in the table frame, mm.
    pub at: SpacePoint,
    /// Measured less fitted, mm: along x, y and z of a feature; of a touch its distance above the part, along the
    /// normal.
    pub residual: Residual,
    /// What a correction of the height leaves of it along z, mm; None of a rigid part, or where the point says nothing
    /// of the height.
    pub left: Option<f64>,
}

/// What the fit leaves of a point, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Residual {
    /// Of a feature.
    Place(SpacePoint),
    /// Above the part; and whether the point lies on it.
    Above(f64, bool),
}

/// What a measured part changes of the inputs.
#[derive(Clone, Debug)]
pub struct MeasuredPart {
    /// Where it lies.
    pub lying: Lying,
    /// The part as designed and as it lies.
    pub draping: Arc<Draping>,
    /// The texture of the first pass, as designed.
    pub texture: Texture,
    /// What of it is left out in the first pass.
    pub lost: Lost,
    /// What its warp adds to it, beside its placement, and how surely.
    pub correction: Option<Arc<Correction>>,
    /// How surely its height is known, and what is kept free for that.
    pub reserve: Arc<HeightReserve>,
}

impl PointResidual {
    /// How far the point lies from where the fit has it, mm.
    pub fn distance_mm(&self) -> f64 {
        match self.residual {
            Residual::Place(r) => r.iter().map(|v| v * v).sum::<f64>().sqrt(),
            Residual::Above(distance, _) => distance.abs(),
        }
    }

    /// Whether it counts: no touch beside the part.
    pub fn counts(&self) -> bool {
        !matches!(self.residual, Residual::Above(_, false))
    }
}

impl Lying {
    /// Largest distance of a point that counts from where the fit has it, mm.
    pub fn worst_residual_mm(&self) -> f64 {
        self.points.iter().filter(|p| p.counts()).map(PointResidual::distance_mm).fold(0.0, f64::max)
    }

    /// The motion of the part beside its placement.
    pub fn turn(&self) -> Turn {
        Turn::rigid(self.rows, self.rest_nm)
    }
}

/// A point of the stage's axes in the table frame, mm.
pub fn table_from_stage(machine: &Machine, stage: SpacePoint) -> SpacePoint {
    let signs = machine.axes().map(|(_, axis)| axis.sign() as f64);
    [0, 1, 2].map(|k| signs[k] * stage[k])
}

/// Where the stage's axes stand at a point of the table frame, mm.
pub fn stage_from_table(machine: &Machine, table: SpacePoint) -> SpacePoint {
    // Signs are their own inverse.
    table_from_stage(machine, table)
}

/// Fits the part of a job to the points of its table; None where it was not measured.
///
/// # Errors
/// Faults of the table, and those of [`fitted`].
pub fn lying(
    job: &Job,
    machine: &Machine,
    designed: &Surface,
    warnings: &mut Vec<Diag>,
) -> Result<Option<Lying>, Error> {
    let Some(MeasuredInput { file, .. }) = &job.placement.measured else { return Ok(None) };
    let path = job.relative(file);
    let points = read_table(&path)?;
    fitted(job, machine, designed, &points, &path.display().to_string(), warnings).map(Some)
}

/// Fits the part of a job to measured points; `shown` names their file.
///
/// # Errors
/// `measured-start`, `measured-apart`, `measured-free`, `measured-twice`, `measured-off`, `measured-far`,
/// `measured-warp`.
pub fn fitted(
    job: &Job,
    machine: &Machine,
    designed: &Surface,
    points: &[MeasuredPoint],
    shown: &str,
    warnings: &mut Vec<Diag>,
) -> Result<Lying, Error> {
    let turn = cos_sin(job.placement.turn.as_rad());
    let (mut pairs, mut touches) = (Vec::new(), Vec::new());
    for point in points {
        let stage = table_from_stage(machine, point.stage);
        let [sigma, sigma_z] = point.sigma_mm;
        match point.measure {
            Measure::Optical { part } => {
                pairs.push(Pair { part: turned(part, turn), stage, sigma: [sigma, sigma, sigma_z] });
            }
            Measure::Touch { tip_mm } => touches.push(Touch { stage, off: tip_mm, sigma, is_along_z: false }),
            Measure::Distance => touches.push(Touch { stage, off: 0.0, sigma, is_along_z: true }),
        }
    }
    let of_pairs: Vec<&MeasuredPoint> =
        points.iter().filter(|p| matches!(p.measure, Measure::Optical { .. })).collect();
    let limit = job.placement.measured.as_ref().and_then(|measured| measured.warp).map(|limit| limit.as_mm());
    let held: Vec<Pair> = pairs.iter().map(|pair| loosened(pair, limit)).collect();
    if let Some(fault) = pairs_fault(&held) {
        return Err(faults::apart(fault, &of_pairs, limit.is_some(), shown).into());
    }
    let start = match job.placement.origin {
        Some(origin) => Motion::shift(origin.mm()),
        None if pairs.len() >= 3 => Motion::shift([0.0; 3]),
        None => {
            let text = "points without partners on the part need a start: placement.origin, right to some millimetres";
            let fault = Diag::input("measured-start", text).at(job.place_of("placement"));
            return Err(fault.hint("state where the part's origin lies on the table, about").into());
        }
    };
    let mut facets = Vec::new();
    if !touches.is_empty() || limit.is_some() {
        designed.each_facet(&mut |facet| facets.push(facet.map(|at| at.map(|nm| nm / NM_PER_MM))));
    }
    let part = Facets::new(facets);
    let mut found = fit(
        &Points { pairs: &held, touches: &touches, part: &part, warp: limit.map(|limit| limit * DEVIATION_OF_LIMIT) },
        &start,
    );
    if !found.free.is_empty() {
        return Err(faults::free(&found.free, shown).into());
    }
    if let Some(limit) = limit {
        found.touches.iter_mut().for_each(|t| t.is_on_part = t.distance.abs() <= limit);
    }
    let touched: Vec<&MeasuredPoint> =
        points.iter().filter(|p| !matches!(p.measure, Measure::Optical { .. })).collect();
    if let Some(fault) = faults::twice(&found.touches, &touched, shown) {
        return Err(fault.into());
    }
    let off = found.touches.iter().filter(|t| !t.is_on_part).count();
    if off * MOST_OFF > touches.len() {
        let text = format!("{off} of {} points do not lie on the part as it would lie", touches.len());
        let hint = "check the radius and the offset of the probe, placement.origin, which is the start, and the unit of the part";
        return Err(Diag::limit("measured-off", text).at(Place::file(shown)).hint(hint).into());
    }
    warnings.extend(faults::beside(&found.touches, &touched, shown)?);
    if !found.is_held_by_pairs && job.placement.origin.is_some() {
        faults::far(&found, &start, shown)?;
    }
    warnings.extend(faults::turned_round(&found, job.placement.turn, shown));
    if limit.is_none() {
        warnings.extend(faults::noise(&found, shown));
    }
    warnings.extend(faults::grown(&found, designed, shown));
    let (origin, rest_nm) = placed(machine, &found.motion, shown)?;
    let observed = Observed::new(points, &pairs, &found, &part);
    let mut points = residuals(points, machine, &found);
    let mut lying = Lying { points: Vec::new(), rows: found.motion.rows(), fit: found, origin, rest_nm, warp: None };
    if let Some(limit) = limit {
        let Some(warp) = warp(&observed.all, limit) else {
            let fault = Diag::input("measured-warp", "fewer than four points say how the part is warped");
            let hint =
                "touch it in more places that are not steeper than 45 degrees, or leave placement.measured.warp out";
            return Err(fault.at(Place::file(shown)).hint(hint).into());
        };
        let names: Vec<&str> = observed.of.iter().map(|&i| points[i].name.as_str()).collect();
        warnings.extend(faults::odd(&warp, &names, shown));
        for (&i, observation) in observed.of.iter().zip(&observed.all) {
            points[i].left = Some(observation.height - warp.at(observation.at).height);
        }
        lying.warp = Some(warp);
        let (features, of_touches) = observed.all.split_at(observed.features);
        warnings.extend(faults::heights_of_warped(features, of_touches, limit, shown));
    } else if !touches.is_empty() {
        warnings.extend(faults::heights(&lying.fit.pairs, &pairs, shown));
    }
    Ok(Lying { points, ..lying })
}

/// A feature of a part that may be warped by up to `limit`, mm: so much surer it is of its place aside than of its height.
fn loosened(pair: &Pair, limit: Option<f64>) -> Pair {
    let [x, y, z] = pair.sigma;
    Pair { sigma: [x, y, math::hypot(z, limit.unwrap_or(0.0) * DEVIATION_OF_LIMIT)], ..*pair }
}

/// Touches on steeper faces say nothing of the height: cosine of 45 degrees.
const LEAST_UP: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// What points say of the height of the part over the rigid fit: features first, then touches, as the table has them.
struct Observed {
    all: Vec<Observation>,
    /// The point of the table that each is of.
    of: Vec<usize>,
    /// How many are of features.
    features: usize,
}

impl Observed {
    fn new(points: &[MeasuredPoint], pairs: &[Pair], fit: &Fit, part: &Facets) -> Self {
        let each = observations(points, pairs, fit, part);
        let is_feature = |i: &usize| matches!(points[*i].measure, Measure::Optical { .. });
        let (mut of, touches): (Vec<usize>, Vec<usize>) =
            (0..points.len()).filter(|&i| each[i].is_some()).partition(is_feature);
        let features = of.len();
        of.extend(touches);
        Self { all: of.iter().filter_map(|&i| each[i]).collect(), of, features }
    }
}

/// What each point says of the height of the part over the rigid fit, in the order of the table.
fn observations(points: &[MeasuredPoint], pairs: &[Pair], fit: &Fit, part: &Facets) -> Vec<Option<Observation>> {
    let of_pair = |(pair, residual): (&Pair, &SpacePoint)| {
        let [nx, ny, nz] = fit.motion.turned(part.flattest(pair.part)?);
        // A feature that lies aside of its place on a slope is higher or lower for that.
        let slope = [-nx / nz, -ny / nz];
        let height = residual[2] - slope[0] * residual[0] - slope[1] * residual[1];
        let [sx, sy, sz] = pair.sigma;
        let sigma = (sz * sz + (slope[0] * sx).powi(2) + (slope[1] * sy).powi(2)).sqrt();
        let [x, y, z] = fit.motion.apply(pair.part);
        let aside = fit.uncertainty.aside_row([x, y, z], slope);
        (nz >= LEAST_UP).then_some(Observation { at: [x, y], height, sigma, aside })
    };
    let of_touch = |touch: &TouchResidual| {
        let [nx, ny, up] = touch.normal;
        let [x, y, _] = touch.at;
        let aside = fit.uncertainty.aside_row(touch.at, [-nx / up, -ny / up]);
        let observation = Observation { at: [x, y], height: touch.distance / up, sigma: touch.sigma / up, aside };
        (touch.is_on_part && up >= LEAST_UP).then_some(observation)
    };
    let mut of_pairs = pairs.iter().zip(&fit.pairs).map(of_pair);
    let mut of_touches = fit.touches.iter().map(of_touch);
    let each = points.iter().map(|point| match point.measure {
        Measure::Optical { .. } => of_pairs.next().flatten(),
        Measure::Touch { .. } | Measure::Distance => of_touches.next().flatten(),
    });
    each.collect()
}

/// The correction over an area of the part as it lies, beside its placement, on a grid fine enough for what is warped in
/// the shortest length.
fn correction(warp: &Warp, lying: &Lying, area: Box2) -> Correction {
    let extent = [area.hi.x - area.lo.x, area.hi.y - area.lo.y].map(|length| length.max(1) as f64);
    let shortest = warp.candidates().iter().map(|c| c.length).fold(f64::INFINITY, f64::min) * NM_PER_MM;
    let pitch = (shortest / NODES_IN_LENGTH).max(extent[0].max(extent[1]) / MOST_CELLS).ceil();
    let count = extent.map(|length| (length / pitch).ceil() as u32);
    let grid = Grid { origin: area.lo, pitch: [Nm(pitch as i64); 2], count };
    let shift = lying.origin.mm();
    Correction::new(grid, |[x, y]| {
        let Told { height, deviation, aside: [turn, x, y] } =
            warp.at([x / NM_PER_MM + shift[0], y / NM_PER_MM + shift[1]]);
        [height * NM_PER_MM, deviation * NM_PER_MM, turn * NM_PER_MM, x, y]
    })
}

/// The box of a part as it lies.
fn box_of(part: &Surface) -> Box2 {
    let BoxMm { lo, hi } = part.part_box_mm();
    let nm = |mm: f64| Nm::round(mm * NM_PER_MM).0;
    Box2 { lo: P2::new(nm(lo[0]), nm(lo[1])), hi: P2::new(nm(hi[0]), nm(hi[1])) }
}

/// A correction reaches so far beyond the texture: farther than a cell in which depth is kept free.
const AROUND: i64 = 5_000_000;

/// Nodes of a correction in the shortest length that counts, and its most cells along x or y.
const NODES_IN_LENGTH: f64 = 8.0;
const MOST_CELLS: f64 = 150.0;

/// At most one in so many touches may lie off the part.
const MOST_OFF: usize = 3;

/// The placement of a motion, and the rest below an increment, nm.
fn placed(machine: &Machine, motion: &Motion, shown: &str) -> Result<(Origin, SpacePoint), Error> {
    let step = machine.increment_nm();
    let at = motion.origin().map(|mm| mm * NM_PER_MM);
    if at.iter().any(|nm| nm.abs() > terrace_core::geom::MAX_NM.f64()) {
        let fault = Diag::input("measured-apart", "the part would lie beyond 4 m of the table's origin");
        return Err(fault.at(Place::file(shown)).hint("check the unit of the points").into());
    }
    let origin = at.map(|nm| (Nm::round(nm / step.f64()) * step.0).0);
    let rest_nm = [0, 1, 2].map(|k| at[k] - origin[k] as f64);
    Ok((Origin(origin), rest_nm))
}

/// What the fit leaves of each point.
fn residuals(points: &[MeasuredPoint], machine: &Machine, fit: &Fit) -> Vec<PointResidual> {
    let (mut pairs, mut touches) = (fit.pairs.iter(), fit.touches.iter());
    let residual = |point: &MeasuredPoint| match point.measure {
        Measure::Optical { .. } => Residual::Place(pairs.next().copied().unwrap_or_default()),
        Measure::Touch { .. } | Measure::Distance => {
            touches.next().map_or(Residual::Above(0.0, false), |t| Residual::Above(t.distance, t.is_on_part))
        }
    };
    let residuals: Vec<Residual> = points.iter().map(residual).collect();
    let named = points.iter().zip(residuals).map(|(point, residual)| PointResidual {
        name: point.name.clone(),
        at: table_from_stage(machine, point.stage),
        residual,
        left: None,
    });
    named.collect()
}

/// A point of the part as the job turns it.
fn turned([x, y, z]: SpacePoint, [c, s]: [f64; 2]) -> SpacePoint {
    [c * x - s * y, s * x + c * y, z]
}

/// The surface and the texture of a job as its measured part lies.
///
/// # Errors
/// Those of the part as it lies; `texture-empty`.
pub(crate) fn draped(
    job: &Job,
    lying: Lying,
    designed: &Arc<Surface>,
    texture: Texture,
    joining: Joining,
    warnings: &mut Vec<Diag>,
) -> Result<(Arc<Surface>, Texture, MeasuredPart), Error> {
    let turn = lying.turn();
    let rigid = Arc::new(designed.moved(&turn, None, joining)?);
    let draping = Arc::new(Draping::new(Arc::clone(designed), Arc::clone(&rigid), turn, job.limits.max_slope()));
    let Draped { texture: moved, lost, .. } = texture.draped(&draping)?;
    let correction = lying.warp.as_ref().map(|warp| {
        // Where textures of later passes lie is not known yet.
        let area = if job.passes.count > 1 { box_of(&rigid) } else { moved.bounds() };
        let [lo, hi] = [(area.lo, -AROUND), (area.hi, AROUND)].map(|(p, by)| P2::new(p.x + by, p.y + by));
        Arc::new(correction(warp, &lying, Box2 { lo, hi }))
    });
    let surface = match &correction {
        None => Arc::clone(&rigid),
        Some(correction) => Arc::new(designed.moved(&turn, Some(correction), joining)?),
    };
    warnings.extend(left_out(&lost));
    let keep = kept(job);
    let doubt =
        HeightDoubt { uncertainty: &lying.fit.uncertainty, origin: lying.origin, correction: correction.as_deref() };
    let reserve = Arc::new(HeightReserve::new(&surface, &doubt, job.limits.max_slope(), keep));
    warnings.extend(reserve.short(moved.bounds()).map(|short| unsure(job, keep, short)));
    Ok((surface, moved, MeasuredPart { lying, draping, texture, lost, correction, reserve }))
}

/// What stays free for the height of a job's part.
fn kept(job: &Job) -> KeptFree {
    let Some(measured) = &job.placement.measured else { return KeptFree { sigmas: 0.0, most: f64::INFINITY } };
    let most = match measured.unsure {
        Unsure::Refuse => f64::INFINITY,
        Unsure::Warn => MOST_KEPT * job.focus.depth.f64(),
    };
    KeptFree { sigmas: measured.sigmas, most }
}

/// The most of the depth range that stays free above and below marks where the job asks for a warning alone.
const MOST_KEPT: f64 = 0.25;

/// What is said where less stays free than deviations ask for.
fn unsure(job: &Job, keep: KeptFree, short: Short) -> Diag {
    let text = format!(
        "on {:.1} % of the texture marks keep {:.1} um free above and below, not {} deviations of the height, which are \
         up to {:.1} um: they may be out of focus there",
        100.0 * short.share,
        keep.most / 1e3,
        keep.sigmas,
        short.wanted / 1e3
    );
    let hint = "measure more points there: red in measured.svg";
    Diag::warning("measured-unsure", text).at(job.place_of("placement.measured")).hint(hint)
}

/// What of the texture a measured part does not show.
fn left_out(lost: &Lost) -> Vec<Diag> {
    let hint = "it leans: clamp it straighter, or mark that part of it in another set-up";
    let text = |marks: LostMarks, what: &str| {
        let dots = if marks.dots > 0 { format!(" and {} dots", marks.dots) } else { String::new() };
        format!("{:.3} mm{dots} of texture {what} the part as it lies, and is not marked", Nm(marks.nm).mm())
    };
    let mut warnings = Vec::new();
    if !lost.hidden.is_none() {
        warnings.push(Diag::warning("measured-hidden", text(lost.hidden, "is hidden by")).hint(hint));
    }
    if !lost.beside.is_none() {
        warnings.push(Diag::warning("measured-beside", text(lost.beside, "lies beside")).hint(hint));
    }
    warnings
}

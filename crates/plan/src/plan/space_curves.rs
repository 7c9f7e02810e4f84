//! Space curves against the surface: how far from it they lie, and how long they are on it.
//!
//! Each stretch of a curve between two points is followed over the surface as marks are. Its height and that of the
//! surface are both linear along each piece, so the largest distance lies at the end of a piece: it is exact, not
//! sampled. Distances are along z, as the focus sees them. What is not marked, off the part or too steep, is not
//! compared.

use crate::manifest::SpaceCurves;
use crate::projection::Tracer;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{NM_PER_MM, Nm, P2, cos_sin};
use terrace_core::math;
use terrace_core::parallel;
use terrace_input::job::Job;
use terrace_input::surface::Surface;
use terrace_input::texture::{Curves, Kind, OnDistance, Request, SpacePoint, Texture};

/// Curves that are followed by one task.
const CHUNK: usize = 64;

/// Pieces up to this, nm, may be rounding: next to a step the grid decides which side of it they show.
const GRAIN: f64 = 3.0;

/// Holds the space curves of a texture to the surface; None where it has none.
///
/// # Errors
/// `curve-distance`, for each texture of which a curve lies too far from the surface, unless the job asks for a
/// warning.
pub(super) fn compare(
    job: &Job,
    surface: &Surface,
    texture: &Texture,
    warnings: &mut Vec<Diag>,
) -> Result<Option<SpaceCurves>, Error> {
    let max_slope = job.limits.max_slope();
    let mut all: Option<SpaceCurves> = None;
    let mut faults = Vec::new();
    for (k, curves) in texture.curves() {
        let request = &job.textures[k];
        let Kind::Curves { max_distance, on_distance, .. } = &request.kind else { continue };
        let fit = follow(curves, surface, max_slope, *max_distance);
        let figures = all.get_or_insert_default();
        figures.count += curves.count();
        figures.plan_mm += fit.plan / NM_PER_MM;
        figures.surface_mm += fit.on_surface / NM_PER_MM;
        let Some(worst) = fit.worst else { continue };
        figures.worst_distance_um = figures.worst_distance_um.max(worst.distance.abs() / 1e3);
        if fit.beyond == 0 {
            continue;
        }
        let (text, place, usual) = message(curves, &worst, fit.beyond, request, job.placement.turn.as_rad());
        let slip = texture.slips().find(|(of, _)| *of == k);
        let hint = slip.map_or(usual.to_owned(), |(_, slip)| slip.cause());
        match on_distance {
            OnDistance::Error => faults.push(Diag::limit("curve-distance", text).at(place).hint(hint)),
            OnDistance::Warn => warnings.push(Diag::warning("curve-distance", text).at(place).hint(hint)),
        }
    }
    if faults.is_empty() { Ok(all) } else { Err(Error::many(faults)) }
}

/// What is said of curves that lie too far from the surface: text, place, hint.
fn message(
    curves: &Curves,
    worst: &Worst,
    beyond: usize,
    request: &Request,
    turn_rad: f64,
) -> (String, Place, &'static str) {
    let Kind::Curves { path, max_distance, .. } = &request.kind else { unreachable!("a request of curves") };
    let name = curves.name(worst.curve);
    let side = if worst.distance > 0.0 { "above" } else { "below" };
    // As the file has it.
    let [c, s] = cos_sin(turn_rad);
    let [x, y] = worst.at.mm();
    let text = format!(
        "{beyond} of {} curves lie farther than {} mm from the surface: {name} is {:.6} mm {side} it at x {:.4}, y {:.4} mm",
        curves.count(),
        max_distance.mm(),
        worst.distance.abs() / NM_PER_MM,
        c * x + s * y,
        c * y - s * x
    );
    let all = (0..curves.count()).flat_map(|i| curves.points(i));
    let (lo, hi) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| (lo.min(p.z), hi.max(p.z)));
    let hint = if lo == hi {
        "the curves are flat: give a drawing that is to be projected by file in place of curves"
    } else {
        "curves are in the frame of the surface file: check their unit and origin; max_distance allows more, \
         on_distance = \"warn\" marks them all the same"
    };
    (text, Place::Element { path: path.display().to_string(), element: name.to_owned() }, hint)
}

/// The place of a curve that lies farthest from the surface.
#[derive(Clone, Copy, Debug)]
struct Worst {
    /// nm, positive above the surface.
    distance: f64,
    at: P2,
    curve: usize,
}

/// What following some curves came to; lengths in nm.
#[derive(Debug, Default)]
struct CurveFit {
    plan: f64,
    on_surface: f64,
    worst: Option<Worst>,
    /// Curves that are too far from the surface somewhere.
    beyond: usize,
}

impl CurveFit {
    /// Takes the distance of a place from the surface.
    fn see(&mut self, distance: f64, at: P2, curve: usize) {
        if self.worst.is_none_or(|w| distance.abs() > w.distance.abs()) {
            self.worst = Some(Worst { distance, at, curve });
        }
    }

    /// With what the curves that follow came to.
    fn and(mut self, next: Self) -> Self {
        self.plan += next.plan;
        self.on_surface += next.on_surface;
        self.beyond += next.beyond;
        if let Some(Worst { distance, at, curve }) = next.worst {
            self.see(distance, at, curve);
        }
        self
    }
}

/// Follows all curves, the first ones first.
fn follow(curves: &Curves, surface: &Surface, max_slope: f64, max_distance: Nm) -> CurveFit {
    let chunks = parallel::map(curves.count().div_ceil(CHUNK), |k| {
        let mut tracer = Tracer::new(surface, max_slope);
        let numbers = k * CHUNK..((k + 1) * CHUNK).min(curves.count());
        numbers.fold(CurveFit::default(), |sum, i| {
            let mut fit = follow_one(curves.points(i), i, &mut tracer);
            fit.beyond = usize::from(fit.worst.is_some_and(|w| w.distance.abs() > max_distance.f64()));
            sum.and(fit)
        })
    });
    chunks.into_iter().fold(CurveFit::default(), CurveFit::and)
}

/// A place of a curve as the lens sees it, where several points may lie above each other.
struct Stack {
    at: P2,
    /// Heights of the first and the last point, nm.
    ends: [f64; 2],
    /// Lowest and highest point, nm.
    range: [f64; 2],
}

/// The places of a curve, in its order.
fn stacks(points: &[SpacePoint]) -> Vec<Stack> {
    let mut out: Vec<Stack> = Vec::with_capacity(points.len());
    for &SpacePoint { at, z } in points {
        match out.last_mut().filter(|last| last.at == at) {
            Some(last) => (last.ends[1], last.range) = (z, [last.range[0].min(z), last.range[1].max(z)]),
            None => out.push(Stack { at, ends: [z; 2], range: [z; 2] }),
        }
    }
    out
}

/// Follows one curve.
fn follow_one(points: &[SpacePoint], number: usize, tracer: &mut Tracer<'_>) -> CurveFit {
    let mut fit = CurveFit::default();
    let stacks = stacks(points);
    // Heights of the surface where the segments before and after a place meet it.
    let mut heights: Vec<[f64; 2]> = vec![[f64::INFINITY, f64::NEG_INFINITY]; stacks.len()];
    let mut meets = |i: usize, z: f64| heights[i] = [heights[i][0].min(z), heights[i][1].max(z)];
    // A dot is a segment without length.
    let dot = if let [dot] = stacks.as_slice() { Some((dot, dot)) } else { None };
    for (i, (a, b)) in stacks.windows(2).map(|w| (&w[0], &w[1])).chain(dot).enumerate() {
        let whole = a.at.distance(b.at);
        let height = |t: f64| a.ends[1] + t * (b.ends[0] - a.ends[1]);
        tracer.segment(a.at, b.at, |p| {
            if p.skip.is_some() {
                return;
            }
            let length = (p.t1 - p.t0) * whole;
            fit.plan += length;
            fit.on_surface += math::hypot(length, p.z1 - p.z0);
            if length <= GRAIN && whole > GRAIN {
                return;
            }
            for (t, z) in [(p.t0, p.z0), (p.t1, p.z1)] {
                fit.see(height(t) - z, a.at.lerp(b.at, t), number);
            }
            if p.t0 == 0.0 {
                meets(i, p.z0);
            }
            if p.t1 == 1.0 && whole > 0.0 {
                meets(i + 1, p.z1);
            }
        });
    }
    // A stretch that runs down a wall lies on it as far as the wall reaches.
    for (stack, [lo, hi]) in
        stacks.iter().zip(heights).filter(|(stack, z)| stack.range[0] < stack.range[1] && z[0] <= z[1])
    {
        for z in stack.range {
            fit.see(z - z.clamp(lo, hi), stack.at, number);
        }
    }
    fit
}

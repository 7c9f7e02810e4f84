//! Where a measured part lies: the pose of the manifest is the one that fits the points of the table best.

use crate::geometry::{Correction, Geometry, Pose};
use crate::job_facts::JobFacts;
use crate::pose_fit::{JudgedPose, PosePair, PosePoints, PoseTouch, on_part};
use crate::proof::Rule;
use crate::read::manifest::{Manifest, MeasuredPlacement, WarpPlacement};
use crate::warp_fit::{Covariance, WarpPoints};
use terrace_core::geom::{NM_PER_MM, SpacePoint, cos_sin};
use terrace_core::math;
use terrace_input::job::MeasuredInput;
use terrace_input::measured::{Measure, MeasuredPoint};

/// Where the manifest states it.
const PLACE: &str = "manifest.json placement.measured";
const WARP: &str = "manifest.json placement.measured.warp";

/// How far a pose of pairs may take a point from where the verifier's own fit takes it, nm; and of touches the step that
/// would make it fit better.
const SAME_NM: f64 = 10.0;
const UNREST_NM: f64 = 100.0;

/// The same of a warped part: nearest facets change with every step there, and the correction holds what the pose is off
/// by in height.
const UNREST_WARPED_NM: f64 = 5_000.0;

/// By how much another pose may fit the points better, in squares of their deviations.
const SAME_LOSS: f64 = 5.0;

/// How far from 0 and 1 products of the rows of a rotation may be.
const SKEW: f64 = 1e-12;

/// How far a residual may be from its own, nm.
const RESIDUAL_NM: f64 = 100.0;

/// Holds the pose of the manifest against the points; returns it, beside the placement.
pub(crate) fn check(
    manifest: &Manifest,
    points: &[MeasuredPoint],
    input: &MeasuredInput,
    facts: &JobFacts,
    designed: &Geometry,
    rule: &mut Rule,
) -> Option<ProvedPose> {
    let limit = input.warp.map(|warp| warp.as_mm() * NM_PER_MM);
    rule.ran = true;
    let Some(stated) = &manifest.placement.measured else {
        rule.broken("", PLACE, "the manifest does not say how the measured part lies");
        return None;
    };
    let beside = Pose { rows: stated.rows, shift: stated.rest_nm };
    rule.require(PLACE, beside.skew() <= SKEW, "its rows are not those of a rotation");
    let increment = facts.machine.increment_nm().f64();
    let is_rest = stated.rest_nm.iter().all(|v| v.abs() <= increment / 2.0 + 1e-3);
    rule.require(PLACE, is_rest, "its rest is more than half an increment of the stage");
    let origin = manifest.placement.origin_mm.map(|mm| (mm * NM_PER_MM).round());
    let pose = Pose { shift: [0, 1, 2].map(|k| origin[k] + stated.rest_nm[k]), ..beside };
    let all = placed(points, facts, designed, limit);
    if all.touches.is_empty() {
        let own = all.by_pairs();
        let off = own.map_or(f64::INFINITY, |own| farthest(&pose, &own, designed, &all));
        rule.require(PLACE, off <= SAME_NM, &format!("it takes the part {off:.1} nm from where the points have it"));
    }
    let Some(JudgedPose { unrest_nm: step, touches, covariance }) = all.judged(&pose) else {
        rule.broken("", PLACE, "the points do not hold the part");
        return None;
    };
    let most = if limit.is_some() { UNREST_WARPED_NM } else { UNREST_NM };
    rule.require(PLACE, step <= most, &format!("the part fits its points better {step:.0} nm from there"));
    if let Some(fall) = all.falls_elsewhere(&pose) {
        let elsewhere = "another pose, by which touches beside the part lie on it, fits the points better";
        rule.require(PLACE, fall <= SAME_LOSS, elsewhere);
    }
    let on_part = match limit {
        Some(limit) => touches.iter().map(|t| t.distance.abs() <= limit).collect(),
        None => on_part(&touches),
    };
    let off = on_part.iter().filter(|on| !**on).count();
    rule.require(PLACE, stated.off_part == off, "its number of points beside the part is another");
    let of_touches = touches.iter().zip(on_part).filter(|(_, on)| *on).map(|(t, _)| t.distance.abs());
    let of_pairs = all.pairs.iter().map(|pair| apart(pose.apply(pair.part), pair.table));
    let worst = of_touches.chain(of_pairs).fold(0.0, f64::max);
    let is_worst = (worst - stated.worst_residual_um * 1e3).abs() <= RESIDUAL_NM;
    rule.require(PLACE, is_worst, "its worst residual is another");
    figures(stated, points, rule);
    rule.checked += points.len() as u64;
    let centre = all.middle();
    let centre = [0, 1, 2].map(|k| centre[k] - origin[k]);
    let Some(limit) = limit else {
        rule.require(PLACE, stated.warp.is_none(), "it says how the part is warped, but the job says that it is rigid");
        return Some(ProvedPose { beside, centre, covariance, correction: None });
    };
    let Some(stated) = &stated.warp else {
        rule.broken("", PLACE, "it does not say how the part is warped");
        return None;
    };
    let points = WarpPoints::new(all.of_height(&pose, &touches, limit), limit / NM_PER_MM);
    let correction = warped(stated, &points, [origin[0], origin[1]], rule)?;
    Some(ProvedPose { beside, centre, covariance, correction: Some(correction) })
}

/// Holds the warp of the manifest against the points; returns what it adds to the part beside its placement `origin`, nm.
fn warped(stated: &WarpPlacement, points: &WarpPoints, origin: [f64; 2], rule: &mut Rule) -> Option<Correction> {
    rule.require(WARP, stated.points == points.len(), "its number of points is not that of the table");
    let figures = stated.lengths_mm.iter().zip(&stated.amplitudes_um).zip(&stated.weights);
    let all: Vec<Covariance> = figures
        .map(|((&length, &amplitude), &weight)| Covariance { length, amplitude: amplitude / 1e3, weight })
        .collect();
    let is_whole = [stated.lengths_mm.len(), stated.amplitudes_um.len(), stated.weights.len()] == [all.len(); 3];
    rule.require(WARP, is_whole, "its lengths, amplitudes and weights are not as many");
    if let Some(fault) = points.fault(&all, stated.factor) {
        rule.broken("", WARP, &fault);
        return None;
    }
    let pitch = stated.grid_pitch_nm as f64;
    let [columns, rows] = stated.grid_cells.map(|count| count as usize);
    let shortest = all.iter().map(|c| c.length * NM_PER_MM).fold(f64::INFINITY, f64::min);
    let longest = columns.max(rows) as f64;
    let is_fine = pitch >= 1.0 && (pitch <= shortest / 8.0 + 1.0 || longest >= 149.0);
    if !is_fine || columns == 0 || rows == 0 || longest > 151.0 {
        rule.broken("", WARP, "its grid is not as fine as its lengths ask for");
        return None;
    }
    let warp = points.warped(&all, stated.factor)?;
    let at = |p: [f64; 2]| {
        let [height, deviation, turn, x, y] = warp.at([0, 1].map(|k| (p[k] + origin[k]) / NM_PER_MM));
        [height * NM_PER_MM, deviation * NM_PER_MM, turn * NM_PER_MM, x, y]
    };
    let correction = Correction::new(stated.grid_origin_nm.map(|nm| nm as f64), pitch, [columns, rows], at);
    for (of, stated) in [stated.height_um, stated.deviation_um].into_iter().enumerate() {
        let own = correction.range(of);
        let is_same = (0..2).all(|k| (own[k] - stated[k] * 1e3).abs() <= RESIDUAL_NM);
        rule.require(WARP, is_same, "its range of heights or deviations is another");
    }
    Some(correction)
}

/// The pose of a measured part beside its placement, and how surely it is known.
pub(crate) struct ProvedPose {
    pub(crate) beside: Pose,
    /// What small motions turn about, nm, beside the placement.
    pub(crate) centre: SpacePoint,
    /// Of the rotation vector, rad, and the shift, nm.
    pub(crate) covariance: [[f64; 6]; 6],
    /// How it is warped.
    pub(crate) correction: Option<Correction>,
}

/// Holds what follows from the pose and the table.
fn figures(stated: &MeasuredPlacement, points: &[MeasuredPoint], rule: &mut Rule) {
    rule.require(PLACE, stated.points == points.len(), "its number of points is not that of the table");
    let [_, _, [x, y, z]] = stated.rows;
    let lean = math::atan2(math::hypot(x, y), z).to_degrees();
    rule.require(PLACE, (lean - stated.lean_deg).abs() <= 1e-9, "its lean is not that of its rows");
}

/// The points in the table frame, nm.
fn placed<'a>(points: &[MeasuredPoint], facts: &JobFacts, part: &'a Geometry, limit: Option<f64>) -> PosePoints<'a> {
    let [cos, sin] = cos_sin(facts.turn_deg.to_radians());
    let signs = facts.machine.axes().map(|(_, axis)| axis.sign() as f64);
    let (mut pairs, mut touches) = (Vec::new(), Vec::new());
    for point in points {
        let table = [0, 1, 2].map(|k| signs[k] * point.stage[k] * NM_PER_MM);
        let [sigma, sigma_z] = point.sigma_mm.map(|mm| mm * NM_PER_MM);
        match point.measure {
            Measure::Optical { part: [x, y, z] } => {
                let part = [x * cos - y * sin, x * sin + y * cos, z].map(|mm| mm * NM_PER_MM);
                // A warped part may be higher there by a third of the limit, as one deviation.
                let loose = math::hypot(sigma_z, limit.unwrap_or(0.0) / 3.0);
                pairs.push(PosePair { part, table, sigma: [sigma, sigma, loose], sigma_z });
            }
            Measure::Touch { tip_mm } => {
                touches.push(PoseTouch { table, off: tip_mm * NM_PER_MM, sigma, is_along_z: false });
            }
            Measure::Distance => touches.push(PoseTouch { table, off: 0.0, sigma, is_along_z: true }),
        }
    }
    PosePoints { pairs, touches, part, warp: limit.map(|limit| limit / 3.0) }
}

fn apart(a: SpacePoint, b: SpacePoint) -> f64 {
    math::hypot(math::hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2])
}

/// How far two poses take the corners of the part, and its points, from each other, nm.
fn farthest(a: &Pose, b: &Pose, designed: &Geometry, points: &PosePoints<'_>) -> f64 {
    let mut corners: Vec<SpacePoint> = points.pairs.iter().map(|p| p.part).collect();
    let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    designed.each_facet(&mut |facet| {
        for p in facet {
            lo = [0, 1, 2].map(|k| lo[k].min(p[k]));
            hi = [0, 1, 2].map(|k| hi[k].max(p[k]));
        }
    });
    corners.extend((0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { lo[k] } else { hi[k] })));
    corners.iter().map(|&p| apart(a.apply(p), b.apply(p))).fold(0.0, f64::max)
}

//! `dose`: pens compensate for the slope that the facets have.
//!
//! The pens after the job's own are made of them: `fill x0.97` is `fill` at 0.97 of its speed, or, where power
//! compensates for the slope, at that much more power. The factor of a mark's pen is checked against the mean cosine
//! over the mark, found on the surface file's own facets: half a step and [`NEAR`] apart at most, within the cap.

use super::part_place_nm;
use super::turned::Turned;
use crate::findings::{Findings, RuleCode};
use crate::geometry::{Geometry, Line, Scratch, Slope};
use crate::job_facts::JobFacts;
use crate::read::program::ProgramFile;
use terrace_core::geom::FieldPoint;
use terrace_core::program::{Block, Pen, Stroke};
use terrace_input::job::{Compensate, Dose};

/// How far rounding of vertices and ends of marks may move a factor, as docs/explanation/verify.md states.
const NEAR: f64 = 0.002;

/// Marks shorter than this, nm, lie where they are rounded to: docs/explanation/verify.md states 1 um.
const SHORTEST: f64 = 1000.0;

/// The job's pen of which a pen says that it is made, and its factor; the pen itself and 1 where it is the
/// job's. None for a pen that says neither.
pub(super) fn origin(pens: &[Pen], pen: usize, facts: &JobFacts) -> Option<(usize, f64)> {
    let own = facts.pens.as_ref().map_or(pens.len(), Vec::len);
    if pen < own {
        return Some((pen, 1.0));
    }
    let _asked = facts.dose?;
    let (name, factor) = pens.get(pen)?.name.rsplit_once(" x")?;
    let base = pens[..own.min(pens.len())].iter().position(|p| p.name == name)?;
    Some((base, factor.parse().ok()?))
}

/// Whether a pen is what it says.
pub(super) fn is_made(pens: &[Pen], pen: usize, facts: &JobFacts) -> bool {
    let Some((base, factor)) = origin(pens, pen, facts) else { return false };
    let (made, base) = (&pens[pen], &pens[base]);
    let is_same = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
    let watts = |p: &Pen| p.power.as_w(facts.machine.laser.max_power);
    let by_speed = facts.dose.is_none_or(|d| d.compensate == Compensate::Speed);
    let [speed, power] = if by_speed { [factor, 1.0] } else { [1.0, factor] };
    is_same(made.speed.as_mm_s(), base.speed.as_mm_s() * speed)
        && is_same(watts(made), watts(base) * power)
        && made.frequency == base.frequency
        && made.passes == base.passes
        && match (made.dwell, base.dwell) {
            (Some(made), Some(base)) => is_same(made.as_s(), base.as_s() / speed),
            (made, base) => made == base,
        }
}

/// Holds `dose`.
pub(crate) fn check(file: &ProgramFile, facts: &JobFacts, geometry: &Geometry, findings: &mut Findings) {
    let rule = &mut findings.rules[RuleCode::Dose];
    rule.ran = true;
    let Some(dose) = facts.dose else {
        // No compensation: pens are the job's own, which `agreement` checks.
        rule.checked = file.program.strokes.len() as u64;
        return;
    };
    let pens = &file.program.pens;
    let factors: Vec<Option<f64>> = (0..pens.len()).map(|p| origin(pens, p, facts).map(|o| o.1)).collect();
    let mut scratch = Scratch::default();
    let mut turned: Option<Turned> = None;
    for (id, block) in file.ids.iter().zip(&file.program.blocks) {
        let is_turned = Turned::prepare(file, block, facts, geometry, &mut turned);
        let geometry = turned.as_ref().filter(|_| is_turned).map_or(geometry, |t| &t.geometry);
        for stroke in file.program.strokes_of(block) {
            let Some(factor) = factors[stroke.pen.index()] else { continue };
            rule.checked += 1;
            let mut wanted = [f64::INFINITY, f64::NEG_INFINITY];
            // A mark along an edge may be on either side of it.
            for shift in [0.0, geometry.reach(), -geometry.reach()] {
                let Some(cos) = mean_cos(file, block, stroke, shift, geometry, &mut scratch) else { continue };
                let ideal = ideal(&dose, cos);
                wanted = [wanted[0].min(ideal), wanted[1].max(ideal)];
                if is_near(&dose, factor, wanted) {
                    break;
                }
            }
            if wanted[0] <= wanted[1] && !is_near(&dose, factor, wanted) {
                let FieldPoint { x, y } = file.program.points_of(stroke)[0];
                let [x, y] = [x, y].map(f64::from);
                let place = part_place_nm([block.stop.centre.x as f64 + x, block.stop.centre.y as f64 + y]);
                let text = format!("its pen has the factor {factor}, but the slope needs {:.4}", wanted[0]);
                rule.broken(id, place, text);
            }
        }
    }
}

/// The factor of the pen that a slope needs, within the cap.
fn ideal(dose: &Dose, cos: f64) -> f64 {
    match dose.compensate {
        Compensate::Speed => cos.max(1.0 / dose.cap),
        Compensate::Power => (1.0 / cos).min(dose.cap),
    }
}

/// Whether a factor is the step next to one of an interval.
fn is_near(dose: &Dose, factor: f64, [lo, hi]: [f64; 2]) -> bool {
    // Factors are rounded to the nearest step, half a step away. At the cap and at 1 a factor may be a whole step off:
    // it is rounded to one side there.
    let cap = if dose.compensate == Compensate::Speed { 1.0 / dose.cap } else { dose.cap };
    let at_end = [lo, hi].iter().any(|v| (v - cap).abs() < dose.step || (v - 1.0).abs() < dose.step);
    let slack = NEAR + if at_end { dose.step } else { dose.step / 2.0 };
    lo - slack <= factor && factor <= hi + slack
}

/// Mean cosine of the slope over a mark moved sideways by `shift`; None where what lies
/// under it is too short.
fn mean_cos(
    file: &ProgramFile,
    block: &Block,
    stroke: &Stroke,
    shift: f64,
    geometry: &Geometry,
    scratch: &mut Scratch,
) -> Option<f64> {
    let c = block.stop.centre;
    let part = |p: FieldPoint| [c.x as f64 + f64::from(p.x), c.y as f64 + f64::from(p.y)];
    if let [dot] = file.program.points_of(stroke) {
        let [x, y] = part(*dot);
        let around = geometry.around([x, y + shift], scratch);
        let sheet = around.iter().find_map(|p| p.sheet.filter(|s| s.slope != Slope::Steep))?;
        return Some(1.0 / (1.0 + sheet.slope2).sqrt());
    }
    // What is off the part or too steep is left out: a mark there breaks the rule `surface`.
    let (mut length, mut sum) = (0.0, 0.0);
    for w in file.program.points_of(stroke).windows(2).filter(|w| w[0] != w[1]) {
        let line = Line::new(part(w[0]), part(w[1]));
        geometry.along(&line.part([0.0, line.len], shift), scratch, |p| {
            if let Some(s) = p.sheet.filter(|s| s.slope != Slope::Steep) {
                length += p.len();
                sum += p.len() / (1.0 + s.slope2).sqrt();
            }
        });
    }
    (length > SHORTEST).then(|| sum / length)
}

//! The manifest and the figures of an on-the-fly job.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::head::text;
use super::stepped::Placement;
use super::{Head, SpaceCurves};
use crate::budget::Budget;
use crate::on_the_fly::check::{Checked, LineEnergy};
use crate::on_the_fly::program::Program;
use crate::split::Skipped;
use terrace_core::diag::Message;
use terrace_core::machine::Machine;
use terrace_core::program::Pen;
use terrace_input::job::Job;

/// How far marks lie from what their beam would like best, on the part itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviations {
    /// Largest distance of a mark from the focal plane along the beam, um.
    pub worst_fod_um: f64,
    /// Largest angle between the beam and the surface's normal, degrees.
    pub worst_bia_deg: f64,
}

/// A stretch of a stroke of the texture that is not marked because the axes cannot keep it in focus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// Stroke of the texture, from 0.
    pub stroke: u32,
    /// Where it begins: length along the stroke as it is drawn, beyond its seam where it is closed.
    pub from_mm: f64,
    /// Where it ends.
    pub to_mm: f64,
}

/// What of the texture is not marked and why, mm in plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlyLengths {
    /// All texture.
    pub texture_mm: f64,
    /// Not marked, all reasons together.
    pub skipped_mm: f64,
    /// Off the part.
    pub skipped_off_part_mm: f64,
    /// On slopes beyond the limit.
    pub skipped_steep_mm: f64,
    /// Fragments below the smallest that is marked.
    pub skipped_small_mm: f64,
    /// Where the part steps and the axes cannot keep focus and incidence.
    pub skipped_focus_mm: f64,
}

impl FlyLengths {
    /// The lengths of a texture. `skipped` is what was not marked when the texture was followed over the part;
    /// `left_out` is what the axes cannot keep in focus, and none of it is in `skipped`.
    pub fn new(texture_mm: f64, skipped: &Skipped, left_out: &[LeftOut]) -> Self {
        let skipped_focus_mm = left_out.iter().map(|stretch| stretch.to_mm - stretch.from_mm).sum();
        Self {
            texture_mm,
            skipped_mm: skipped.off_part + skipped.steep + skipped.small + skipped_focus_mm,
            skipped_off_part_mm: skipped.off_part,
            skipped_steep_mm: skipped.steep,
            skipped_small_mm: skipped.small,
            skipped_focus_mm,
        }
    }
}

/// Everything that the manifest of an on-the-fly job says.
#[derive(Clone, Copy)]
pub struct OnTheFlyFacts<'a> {
    /// The job.
    pub job: &'a Job,
    /// The machine of the job.
    pub machine: &'a Machine,
    /// The program.
    pub program: &'a Program,
    /// What is not marked next to steps of the part.
    pub left_out: &'a [LeftOut],
    /// The figures.
    pub summary: &'a OnTheFlySummary,
}

/// The figures of an on-the-fly job; keys are a promise, units are in the suffix.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OnTheFlySummary {
    /// Sides of the box of the part as it is laid, along x, y and z, before it is turned.
    #[serde(default)]
    pub part_mm: [f64; 3],
    /// What is marked of the texture, and what is not.
    #[serde(flatten)]
    pub lengths: FlyLengths,
    /// Moves of the program.
    pub moves: usize,
    /// Pieces of strokes that are marked one by one.
    pub marks: usize,
    /// Time from the first move to the last, s.
    pub time_s: f64,
    /// Time of it with the laser on, s.
    pub mark_s: f64,
    /// Length of the marks, seen along z, mm.
    pub mark_mm: f64,
    /// Length of the jumps, mm.
    pub jump_mm: f64,
    /// How far marks lie from the best.
    #[serde(flatten)]
    pub deviations: Deviations,
    /// Largest distance of the spot from the field's centre, mm.
    pub worst_displacement_mm: f64,
    /// Fastest mark, mm/s.
    pub mark_speed_mm_s: f64,
    /// What the laser gives to each length of the marks.
    #[serde(default)]
    pub line_energy: FlyEnergy,
    /// How early the laser may be switched, by program.
    pub laser: Vec<LaserSwitching>,
    /// How far blending rounds a corner of a mark, mm: by the program for PMAC.
    pub blend_mm: f64,
    /// How far marks may lie from where they should.
    #[serde(default)]
    pub budget: Budget,
    /// The space curves; left out where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curves: Option<SpaceCurves>,
    /// Peak speed, acceleration and jerk, by axis letter.
    pub peaks: BTreeMap<String, AxisPeaks>,
    /// What the user should know.
    pub warnings: Vec<Message>,
}

/// What the laser gives to each length of the marks, where the power of a pen is constant and the spot slows down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlyEnergy {
    /// Mean over the length of the marks, J/m.
    pub mean_j_per_m: f64,
    /// How much of the length is marked at the speed of its pen, within 1 %, percent.
    pub length_at_speed_percent: f64,
    /// Time with the laser on at less than half the speed of the pen, s.
    pub slow_s: f64,
    /// The most that a line gets over the length of a spot, as a multiple of P / v of its pen.
    pub worst_share: f64,
    /// Where that is, mm in the part frame.
    pub worst_at_mm: [f64; 2],
}

impl FlyEnergy {
    fn of(energy: &LineEnergy) -> Self {
        Self {
            mean_j_per_m: energy.mean_j_per_m,
            length_at_speed_percent: 100.0 * energy.at_speed,
            slow_s: energy.slow_s,
            worst_share: energy.worst_share,
            worst_at_mm: energy.worst_at,
        }
    }
}

/// How far the marks of a program may lie from where they should.
#[derive(Clone, Debug, Default)]
pub struct FlyAccuracy {
    /// Sides of the part's box, mm.
    pub part_mm: [f64; 3],
    /// On the part itself.
    pub deviations: Deviations,
    /// How far blending rounds a corner, mm.
    pub blend_mm: f64,
    /// By switching the laser.
    pub laser: Vec<LaserSwitching>,
    /// By all causes together.
    pub budget: Budget,
}

/// How early the laser of a program may be switched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LaserSwitching {
    /// File of the program.
    pub file: String,
    /// Period of the controller's servo, in which the laser is switched, s.
    pub servo_period_s: f64,
    /// Distance that the spot travels in that period, mm.
    pub laser_error_mm: f64,
}

/// Peaks of one axis; mm or deg, s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisPeaks {
    /// Speed.
    pub speed: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// Jerk.
    pub jerk: f64,
}

impl OnTheFlySummary {
    /// The figures of a checked program.
    pub fn new(
        checked: &Checked,
        lengths: FlyLengths,
        accuracy: FlyAccuracy,
        curves: Option<SpaceCurves>,
        warnings: Vec<Message>,
    ) -> Self {
        let FlyAccuracy { part_mm, deviations, blend_mm, laser, budget } = accuracy;
        let figures = checked.figures();
        let program = checked.program();
        let letters = program.kind.letters().chars().map(String::from);
        let peak = |&k: &usize| {
            let p = &figures.peaks[k];
            AxisPeaks { speed: p.speed.size, acceleration: p.acceleration.size, jerk: p.jerk.size }
        };
        Self {
            part_mm,
            lengths,
            moves: program.moves.len(),
            marks: figures.marks,
            time_s: figures.time_s,
            mark_s: figures.mark_s,
            mark_mm: figures.mark_mm,
            jump_mm: figures.jump_mm,
            deviations,
            worst_displacement_mm: figures.displacement_mm,
            mark_speed_mm_s: figures.mark_speed,
            line_energy: FlyEnergy::of(&figures.energy),
            laser,
            blend_mm,
            budget,
            curves,
            peaks: letters.zip(program.kind.axes().iter().map(peak)).collect(),
            warnings,
        }
    }
}

/// The manifest: JSON, a line feed at the end.
pub fn on_the_fly_manifest(head: &Head, facts: &OnTheFlyFacts<'_>) -> Vec<u8> {
    let document = Document {
        head,
        machine: facts.machine,
        placement: Placement::new(facts.program.origin, facts.job, None),
        axes: facts.program.kind.letters(),
        limits: Limits {
            pdof_mm: facts.job.focus.pdof.mm(),
            reserve_mm: facts.job.focus.reserve.mm(),
            fod_um: facts.job.focus.half_depth_mm() * 1000.0,
            bia_deg: facts.job.limits.max_incidence.as_deg(),
        },
        pens: facts.program.pens.iter().map(|p| pen(p, facts.machine)).collect(),
        left_out: facts.left_out,
        summary: facts.summary,
    };
    text(&document, 4096)
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    head: &'a Head,
    machine: &'a Machine,
    placement: Placement,
    axes: &'a str,
    limits: Limits,
    pens: Vec<PenEntry<'a>>,
    left_out: &'a [LeftOut],
    summary: &'a OnTheFlySummary,
}

#[derive(Serialize)]
struct Limits {
    pdof_mm: f64,
    reserve_mm: f64,
    fod_um: f64,
    bia_deg: f64,
}

#[derive(Serialize)]
struct PenEntry<'a> {
    name: &'a str,
    speed_mm_s: f64,
    power: String,
    power_percent: f64,
    frequency_khz: f64,
}

fn pen<'a>(pen: &'a Pen, machine: &Machine) -> PenEntry<'a> {
    let full = machine.laser.max_power;
    PenEntry {
        name: &pen.name,
        speed_mm_s: pen.speed.as_mm_s(),
        power: pen.power.to_string(),
        power_percent: pen.power.as_w(full) / full.as_w() * 100.0,
        frequency_khz: pen.frequency.as_khz(),
    }
}

//! Warnings about a plan, and the faults that stop it.

use super::grid::PassGrid;
use super::methods::row;
use super::off_part::{OffPart, length, lengths_and_dots};
use super::plausible;
use crate::emit::Target;
use crate::manifest::Loading;
use crate::projection::Footprint;
use crate::split::Fragments;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::format::Format;
use terrace_core::geom::Nm;
use terrace_core::machine::{LoadingWay, Machine};
use terrace_core::math;
use terrace_core::program::Program;
use terrace_input::job::{Job, Method, Steep};
use terrace_input::texture::Slip;

/// Share of the texture on slopes that are too steep from which the part may not lie as it is meant.
const LEANING: f64 = 0.25;

/// Warnings about what is not marked, or the faults that stop the plan.
///
/// # Errors
/// `steep`, `off-part`.
pub(super) fn warn(
    job: &Job,
    split: &Fragments,
    off_part: &OffPart,
    slips: &[(usize, Slip)],
    warnings: &mut Vec<Diag>,
) -> Result<(), Error> {
    warnings.extend(steep(job, split)?);
    warnings.extend(incidence(job, split));
    if let Some(fault) = off_part.fault(job.limits.max_off_part) {
        return Err(fault.into());
    }
    warnings.extend(plausible::odd_sizes(job, slips));
    warnings.extend(lies_off_part(split));
    warnings.extend(small(job, split));
    Ok(())
}

/// Texture on slopes that are too steep.
///
/// # Errors
/// `steep` where the job refuses them.
fn steep(job: &Job, split: &Fragments) -> Result<Option<Diag>, Error> {
    let limits = &job.limits;
    if !(split.skipped.steep > 0.0 || split.dots.steep > 0) {
        return Ok(None);
    }
    let limit = limits.max_incidence.as_deg();
    let what = lengths_and_dots(split.skipped.steep, split.dots.steep);
    let text = format!("{what} of texture lie on slopes above {limit:.1} deg and are not marked");
    let place = split.steep_at.map_or(Place::Nowhere, |p| {
        let [x_mm, y_mm] = p.mm();
        Place::Part { x_mm, y_mm }
    });
    if limits.steep == Steep::Refuse {
        return Err(Diag::limit("steep", text).at(place).hint("limits.steep = \"skip\" marks the rest").into());
    }
    let hint = match split.skipped.steep > LEANING * split.texture_mm {
        true => "lay the part with `terrace orient JOB --apply`, or see limits.max_incidence",
        false => "see limits.max_incidence",
    };
    Ok(Some(Diag::warning("steep", text).at(place).hint(hint)))
}

/// Marks that the beam meets at an angle.
fn incidence(job: &Job, split: &Fragments) -> Option<Diag> {
    let incidence = math::atan(split.worst_slope2.sqrt()).to_degrees();
    let text =
        format!("the beam meets the surface at up to {incidence:.1} deg: marks are stretched and the dose falls");
    (incidence > job.limits.warn_incidence.as_deg())
        .then(|| Diag::warning("incidence", text).hint("see limits.warn_incidence"))
}

/// Texture that lies off the part, no more of it than the job allows.
fn lies_off_part(split: &Fragments) -> Option<Diag> {
    let Fragments { skipped, dots, .. } = split;
    if !(skipped.off_part > 0.0 || dots.off_part > 0) {
        return None;
    }
    let percent = |part: f64, all: f64| if all > 0.0 { 100.0 * part / all } else { 0.0 };
    let share = percent(skipped.off_part, split.texture_mm).max(percent(dots.off_part as f64, dots.texture as f64));
    let what = lengths_and_dots(skipped.off_part, dots.off_part);
    let text = format!("{what} of texture ({share:.1} % of it) lie off the part and are not marked");
    Some(Diag::warning("off-part", text).hint("see limits.max_off_part"))
}

/// Fragments that are shorter than the job asks for.
fn small(job: &Job, split: &Fragments) -> Option<Diag> {
    // Slivers that are left out by default are counted only: the spot beside them covers them.
    let is_asked_for = job.partition.min_mark.is_some();
    (split.skipped.small > 0.0 && is_asked_for).then(|| {
        let small = length(split.skipped.small);
        Diag::warning("small", format!("{small} of texture is in fragments shorter than partition.min_mark"))
    })
}

/// Marks farther from their focal planes than half the depth range; `rounding` is by how much these planes are rounded.
pub(super) fn defocus(worst: Nm, depth: Nm, rounding: Nm) -> Option<Diag> {
    (worst > depth / 2 + rounding).then(|| {
        let text = format!(
            "marks lie up to {:.1} um from the focal plane, more than half the depth range of {:.1} um",
            worst.f64() / 1000.0,
            depth.f64() / 1000.0
        );
        Diag::warning("defocus", text).hint("focus.level = \"mid\" keeps it at half the depth range")
    })
}

/// The targets of the job whose files are used by the way in which its blocks are loaded.
fn used(job: &Job, way: LoadingWay) -> impl Iterator<Item = &'static Target> {
    job.formats.iter().map(|&format| Target::of(format)).filter(move |target| target.ways.contains(&way))
}

/// Pens that compensate for the slope, and no file that passes them to the marking software.
pub(super) fn not_carried(job: &Job, machine: &Machine, program: &Program) -> Option<Diag> {
    let Loading { way, .. } = Loading::new(job, machine, 0, 0.0);
    let carried = used(job, way).any(|target| target.carries_pens);
    (program.pens.len() > job.pens.len() && !carried).then(|| {
        let text = format!(
            "no file that is used by operator.way = {:?} carries pens: the dose is not compensated",
            way.name()
        );
        Diag::warning("dose-lost", text)
            .at(job.place_of("emit.formats"))
            .hint("add a format of single blocks, such as \"dxf\", and set each layer's pen from the run sheet")
    })
}

/// Skywriting that the job does not get; why, and what to do.
pub(super) fn no_skywriting(job: &Job, [why, hint]: [&str; 2]) -> Option<Diag> {
    let pen = job.skywriting.iter().position(|asks| *asks)?;
    let text = format!("pen {:?} asks for skywriting, {why}", job.pens[pen].name);
    Some(Diag::warning("skywriting-lost", text).at(job.place_of(&format!("pen.{pen}.skywriting"))).hint(hint))
}

/// A zoom optic, and no file that sets it: a warning where somebody else does, before each block.
///
/// # Errors
/// `focus-shift-lost` where `stage.ngc` would start blocks out of focus.
pub(super) fn focus_shift_lost(job: &Job, machine: &Machine, program: &Program) -> Result<Option<Diag>, Error> {
    let Loading { way, .. } = Loading::new(job, machine, 0, 0.0);
    let shifted = program.blocks.iter().filter(|b| b.focus_shift != Nm(0)).count();
    // Where nothing is written, nothing is lost.
    if shifted == 0 || job.formats.is_empty() || used(job, way).any(|target| target.carries_focus_shift) {
        return Ok(None);
    }
    let place = job.place_of("emit.formats");
    let needed = format!("the zoom optic must be shifted for {shifted} blocks");
    let starts = job.formats.contains(&Format::Linuxcnc);
    match way {
        LoadingWay::Card => {
            let text = format!("{needed}, and no file sets it: stage.ngc would start them out of focus");
            let hint = "add \"rtc\", whose lists set the optic, or state another operator.way in the machine file";
            Err(Diag::limit("focus-shift-lost", text).at(place).hint(hint).into())
        }
        LoadingWay::Person if machine.operator.way.is_none() && starts => {
            let text = format!("{needed}, and whoever starts stage.ngc would mark them out of focus");
            let hint = "state operator.way in the machine file: \"run\", \"card\", \"person\" or \"ovf\"; or leave \
                        \"linuxcnc\" out";
            Err(Diag::limit("focus-shift-lost", text).at(place).hint(hint).into())
        }
        LoadingWay::Run => {
            let text = format!("{needed}, and no file that terrace run loads sets it");
            let hint = "add \"rtc\", or use a command with {shift} in the run file: other drivers refuse the job";
            Ok(Some(Diag::warning("focus-shift-lost", text).at(place).hint(hint)))
        }
        LoadingWay::Person | LoadingWay::Ovf => {
            let text = format!("{needed}, and no file that a person loads sets it");
            let hint = "set it before each block from the run sheet (SHIFT), or add \"rtc\"";
            Ok(Some(Diag::warning("focus-shift-lost", text).at(place).hint(hint)))
        }
    }
}

/// What was to stay whole and does not, and why.
pub(super) fn not_kept(grid: &PassGrid, footprint: &Footprint, method: Method, split: &Fragments) -> Option<Diag> {
    if split.not_kept == 0 {
        return None;
    }
    let [broken, astride] = footprint.not_whole();
    let figures = (0..grid.sections.len()).flat_map(|i| footprint.figures_of(i));
    let deep = figures.filter(|&&figure| !grid.lattice.holds(figure)).count();
    let mut why = format!("{deep} span more than the depth range");
    if broken > 0 {
        why += &format!(", {broken} touch a rim or a steep area");
    }
    if astride > 0 && row(method).has_borders {
        why += &format!(", {astride} cross a border of sections");
    }
    if !row(method).keeps_figures {
        why += ", the others cross a level border";
    }
    let text = format!("{} figures that partition.keep_whole wants whole are cut: {why}", split.not_kept);
    let hint = if row(method).keeps_figures {
        "smaller figures or a larger focus.pdof keep more of them"
    } else {
        "method \"z-range\" or \"window\" keeps more of them"
    };
    Some(Diag::warning("figures-cut", text).hint(hint))
}

/// Cuts that were to overlap and do not in full.
pub(super) fn short_overlaps(split: &Fragments) -> Option<Diag> {
    let Fragments { cuts, short, .. } = *split;
    let text = format!("{short} of {cuts} cuts overlap by less than partition.overlap: no two stops admit all of it");
    let hint = "a larger partition.hysteresis or focus.pdof helps on slopes; a shorter overlap everywhere";
    (short > 0).then(|| Diag::warning("overlap-short", text).hint(hint))
}

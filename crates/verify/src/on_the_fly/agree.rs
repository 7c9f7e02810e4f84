//! `agreement`, `summary`: both programs, the manifest and the job say the same.

use std::path::Path;
use terrace_core::math;

use super::chain::Chain;
use super::energy::Energy;
use crate::job_facts::JobFacts;
use crate::proof::{Lengths, Rule};
use crate::read::FORMATS;
use crate::read::comments::CommentKind;
use crate::read::formats::{self, OnTheFly};
use crate::read::number::nm_from_mm;
use crate::read::on_the_fly::FlyProgram;
use crate::read::on_the_fly::manifest::Manifest;
use crate::read::runsheet;
use crate::rules::runsheets::are_pens;
use terrace_core::program::Pen;
use terrace_core::units::Power;
use terrace_input::job::Format;

/// The files of every on-the-fly job, besides its programs.
const OF_EVERY_JOB: [&str; 5] = ["runsheet.txt", "layout.svg", "energy.svg", "report.html", "view.html"];

const PLACE: &str = "manifest.json";

/// Relative difference at which two figures are still the same.
const SAME: f64 = 1e-9;
/// A power is written with three decimals of a percent: half of the last, and a tenth of the last more.
const PERCENT: f64 = 0.0006;
/// How far power may lie from what the speed of the spot asks for, as a share of that of its pen:
/// docs/explanation/verify.md states 1 %.
const FOLLOWED: f64 = 0.01;
/// How far a blending controller may round a corner, nm: docs/explanation/verify.md states 0.2 um; and half a
/// nanometre.
const ROUNDED: f64 = 200.5;

/// The formats of programs for a machine of these axes.
fn targets(axes: &str) -> impl Iterator<Item = (Format, OnTheFly)> {
    let targets = FORMATS.iter().filter_map(|row| row.on_the_fly.map(|target| (row.format, target)));
    targets.filter(move |(_, target)| target.axes.contains(&axes))
}

/// Reads the programs that the manifest lists, each with its file's name. What cannot be read breaks the rule; that at
/// least one program is left is for the caller to see to.
pub(super) fn read(folder: &Path, manifest: &Manifest, rule: &mut Rule) -> Vec<(&'static str, FlyProgram)> {
    rule.ran = true;
    let mut out = Vec::new();
    for (_, target) in targets(&manifest.axes) {
        if !manifest.files.iter().any(|f| f.file == target.file) {
            continue;
        }
        rule.checked += 1;
        let name = target.file;
        match formats::bytes(folder, name).map(|bytes| (target.read)(&bytes, &manifest.axes)) {
            Ok(Ok(program)) => out.push((name, program)),
            Ok(Err(fault)) => rule.broken("", format!("{name}:{}", fault.line), fault.message),
            Err(unread) => rule.broken("", name, unread),
        }
    }
    out
}

/// The programs of one job say the same; one violation for each, the first difference.
pub(super) fn programs(all: &[(&'static str, FlyProgram)], rule: &mut Rule) {
    for (name, program) in all {
        rule.checked += 1;
        if program.rounded_nm > ROUNDED {
            let um = program.rounded_nm / 1e3;
            rule.broken("", *name, format!("lets corners be rounded by {um} um"));
        }
    }
    let Some(((first, a), others)) = all.split_first() else { return };
    for (name, b) in others {
        rule.checked += a.steps.len() as u64;
        if let Some((place, message)) = differs(first, a, name, b) {
            rule.broken("", place, message);
        }
    }
}

/// Holds the figures in the comments of a program to those of the manifest.
pub(super) fn comments(name: &str, program: &FlyProgram, manifest: &Manifest, rule: &mut Rule) {
    let s = &manifest.summary;
    let laser = s.laser.iter().find(|l| l.file == name);
    let [period, error] = laser.map_or([f64::NAN; 2], |l| [l.servo_period_s, l.laser_error_mm]);
    for (line, kind, figures) in &program.said {
        let stated = match kind {
            CommentKind::Words => Vec::new(),
            CommentKind::Size => vec![s.moves as f64, s.marks as f64, s.time_s],
            CommentKind::Switch => vec![period * 1e3, error / period],
            CommentKind::LaserError => vec![error],
            CommentKind::Blend => vec![s.blend_mm],
            CommentKind::Pen => stated_pen(figures, manifest),
        };
        rule.checked += 1;
        if !figures.iter().zip(&stated).all(|(figure, stated)| is_rounded(figure, *stated)) {
            rule.broken("", format!("{name}:{line}"), "a comment says other figures than the manifest");
        }
    }
}

/// Number, speed, power and frequency of the pen whose number a comment gives first; NaN where there is no such pen.
fn stated_pen(figures: &[String], manifest: &Manifest) -> Vec<f64> {
    let number: usize = figures.first().and_then(|number| number.parse().ok()).unwrap_or(0);
    let Some(pen) = number.checked_sub(1).and_then(|i| manifest.pens.get(i)) else { return vec![f64::NAN] };
    let power = pen.power.split(' ').next().and_then(|v| v.parse().ok()).unwrap_or(f64::NAN);
    vec![number as f64, pen.speed_mm_s, power, pen.frequency_khz]
}

/// Whether a figure in a comment is this one, rounded to its decimals.
fn is_rounded(figure: &str, stated: f64) -> bool {
    let decimals = figure.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    // Rounded where it is written, and where it is stated.
    let tolerance = 0.51 * 10f64.powi(-(decimals as i32)) + 1e-9 * stated.abs();
    figure.parse::<f64>().is_ok_and(|figure| (figure - stated).abs() <= tolerance)
}

/// Where the program `b` first differs from `a`, and how.
fn differs(first: &str, a: &FlyProgram, name: &str, b: &FlyProgram) -> Option<(String, String)> {
    if a.start != b.start || !a.rapids.iter().map(|r| r.1).eq(b.rapids.iter().map(|r| r.1)) {
        return Some((name.into(), format!("begins or ends elsewhere than {first}")));
    }
    let mut moves = a.steps.iter().zip(&b.steps);
    if let Some((x, y)) = moves.find(|(x, y)| (x.us, x.to, x.mark, x.power) != (y.us, y.to, y.mark, y.power)) {
        return Some((format!("{name}:{}", y.line), format!("differs from line {} of {first}", x.line)));
    }
    if a.steps.len() != b.steps.len() {
        return Some((name.into(), format!("has {} moves, {first} has {}", b.steps.len(), a.steps.len())));
    }
    let is_same = a.powers.iter().map(|p| (p.1, p.2)).eq(b.powers.iter().map(|p| (p.1, p.2)));
    (!is_same).then(|| (name.into(), format!("marks with other powers than {first}")))
}

/// Manifest and program against the job.
pub(super) fn with_job(manifest: &Manifest, facts: &JobFacts, program: &FlyProgram, chain: &Chain, rule: &mut Rule) {
    rule.require(PLACE, manifest.machine == facts.machine, "its machine differs from the job file");
    let inputs = manifest.inputs.iter().map(|i| (i.role.as_str(), i.file.as_str()));
    let asked = facts.inputs.as_deref().unwrap_or_default().iter().map(|(role, file)| (*role, file.as_str()));
    rule.require(PLACE, facts.inputs.is_none() || inputs.eq(asked), "its inputs are not those of the job file");
    rule.require(
        PLACE,
        manifest.placement.laid_deg == facts.laid_deg,
        "its part is laid otherwise than the job file says",
    );
    let limits = [
        (manifest.limits.pdof_mm, facts.pdof.mm()),
        (manifest.limits.reserve_mm, facts.reserve.mm()),
        (manifest.limits.fod_um, facts.depth_range_nm() / 2e3),
        (manifest.limits.bia_deg, facts.max_incidence_rad.to_degrees()),
    ];
    let are_same = limits.iter().all(|(stated, asked)| (stated - asked).abs() <= SAME * asked.abs().max(1.0));
    rule.require(PLACE, are_same, "its limits differ from the job file");
    rule.require(
        PLACE,
        (manifest.placement.turn_deg - facts.turn_deg).abs() <= SAME,
        "its turn differs from the job file",
    );
    let origin = manifest.placement.origin_mm.map(nm_from_mm);
    rule.require(PLACE, facts.origin.is_none_or(|o| o.0.map(Some) == origin), "its origin differs from the job file");
    for (format, target) in targets(&manifest.axes) {
        let is_listed = manifest.files.iter().any(|f| f.file == target.file);
        let text = format!("{} is not listed, which the job asks for", target.file);
        rule.require(PLACE, is_listed || !facts.formats.contains(&format), &text);
    }
    // Whoever loads another file marks what nobody has compared.
    for entry in &manifest.files {
        let is_asked =
            |(format, target): (Format, OnTheFly)| target.file == entry.file && facts.formats.contains(&format);
        let is_known = OF_EVERY_JOB.contains(&entry.file.as_str()) || targets(&manifest.axes).any(is_asked);
        rule.require(PLACE, is_known, &format!("{} is listed, but is not a file of this job", entry.file));
    }
    let pens = facts.pens.as_deref().unwrap_or_default();
    rule.require(PLACE, are_stated_pens(manifest, pens, facts), "its pens differ from those of the job file");
    for (us, from, step) in program.moves() {
        let Some(mark) = step.mark else { continue };
        rule.checked += 1;
        let way = || chain.beam(&from.float()).way(&chain.beam(&step.to.float())) / 1e6;
        let wanted = pens.get(mark.pen.index()).map(|pen| wanted_power(pen, facts, way, (step.us - us) as f64));
        let is_near = wanted.zip(step.power).is_some_and(|(wanted, p)| (wanted.percent - p).abs() <= wanted.tolerance);
        if !is_near {
            let what = if facts.power_by_speed { "that its speed asks for" } else { "of its pen" };
            rule.broken("", format!("line {}", step.line), format!("a mark does not have the power {what}"));
        }
    }
}

/// Whether the manifest states the pens of the job.
fn are_stated_pens(manifest: &Manifest, pens: &[Pen], facts: &JobFacts) -> bool {
    let full = facts.machine.laser.max_power;
    manifest.pens.len() == pens.len()
        && manifest.pens.iter().zip(pens).all(|(m, p)| {
            let percent = p.power.as_w(full) / full.as_w() * 100.0;
            m.name == p.name
                && m.speed_mm_s == p.speed.as_mm_s()
                && (m.power_percent - percent).abs() <= SAME * percent
                && m.power.parse::<Power>().is_ok_and(|power| power == p.power)
                && m.frequency_khz == p.frequency.as_khz()
        })
}

/// A power in percent of the laser's, and how far one may lie from it.
struct WantedPower {
    percent: f64,
    tolerance: f64,
}

/// The power of a move of a mark with a pen, by its way in mm and its time in us: that of the pen, or as much less as
/// the spot is slower than the pen.
fn wanted_power(pen: &Pen, facts: &JobFacts, way_mm: impl Fn() -> f64, time_us: f64) -> WantedPower {
    let full = facts.machine.laser.max_power;
    let most = pen.power.as_w(full) / full.as_w() * 100.0;
    if !facts.power_by_speed {
        return WantedPower { percent: most, tolerance: PERCENT };
    }
    let share = way_mm() / (pen.speed.as_mm_s() * time_us / 1e6);
    WantedPower { percent: most * share.min(1.0), tolerance: FOLLOWED * most + PERCENT }
}

/// The run sheet against the job: the part's size and place, the machine, and the pens.
pub(super) fn sheet(folder: &Path, manifest: &Manifest, facts: &JobFacts, rule: &mut Rule) {
    const NAME: &str = "runsheet.txt";
    rule.checked += 1;
    let sheet = match formats::bytes(folder, NAME).map(|bytes| runsheet::txt(&bytes)) {
        Ok(Ok(sheet)) => sheet,
        Ok(Err(fault)) => return rule.broken("", format!("{NAME}:{}", fault.line), fault.message),
        Err(unread) => return rule.broken("", NAME, unread),
    };
    let near = |found: Option<&[f64]>, stated: &[f64], tolerance: f64| match found {
        Some(found) => found.len() == stated.len() && found.iter().zip(stated).all(|(f, s)| (f - s).abs() <= tolerance),
        None => false,
    };
    let laid = sheet.laid.as_ref().map(<[f64; 3]>::as_slice);
    let is_laid = match &facts.laid_deg {
        Some(stated) => near(laid, stated, SAME),
        None => laid.is_none(),
    };
    let machine = format!("{}, axes {}", facts.machine.name, manifest.axes);
    // Sides are written with three decimals of a mm, zeros with four: half of the last, and 1 nm more.
    for (holds, text) in [
        (
            near(sheet.size.as_ref().map(<[f64; 3]>::as_slice), &manifest.summary.part_mm, 0.000_501),
            "its part's size differs from the manifest",
        ),
        (
            near(sheet.zero.as_deref(), &manifest.placement.origin_mm, 0.000_051),
            "its part zero differs from the manifest",
        ),
        (
            sheet.turn.is_some_and(|turn| (turn - facts.turn_deg).abs() <= SAME),
            "its part turn differs from the job file",
        ),
        (is_laid, "how its part is laid differs from the job file"),
        (sheet.machine.as_deref() == Some(machine.trim()), "its machine is another one"),
        (
            are_pens(&sheet, facts.pens.as_deref().unwrap_or_default(), &facts.machine),
            "its pens differ from those of the job file",
        ),
    ] {
        if !holds {
            rule.broken("", NAME, text);
        }
    }
}

/// Lengths along the strokes of the texture, and how far those of what is not marked may be off where corners of facets
/// are welded.
pub(super) struct MeasuredLengths<'a> {
    pub(super) lengths: &'a Lengths,
    pub(super) doubt_mm: f64,
}

/// Figures of the manifest.
pub(super) fn summary(
    manifest: &Manifest,
    facts: &JobFacts,
    program: &FlyProgram,
    chain: &Chain,
    lengths: &MeasuredLengths<'_>,
    rule: &mut Rule,
) {
    rule.ran = true;
    let MeasuredLengths { lengths, doubt_mm } = *lengths;
    let s = &manifest.summary;
    // Of all marks: their time, the largest displacement of the spot and its largest speed, nm/us, and their length.
    let (mut on_us, mut away, mut fastest, mut mark_nm) = (0, 0.0f64, 0.0f64, 0.0);
    for (us, from, step) in program.moves().filter(|(_, _, s)| s.mark.is_some()) {
        on_us += step.us - us;
        let [a, b] = [from, &step.to].map(|to| to.float());
        for field in [&a, &b].map(|to| chain.field(to)) {
            away = away.max(math::hypot(field[0], field[1]));
        }
        let way = chain.beam(&a).way(&chain.beam(&b));
        mark_nm += way;
        fastest = fastest.max(way / (step.us - us) as f64);
    }
    rule.require_figure("", "texture_mm", s.texture_mm, lengths.texture_mm, 1e-6 + SAME * lengths.texture_mm);
    // Both ends of every piece are rounded and merged, 0.2 um each (docs/explanation/verify.md), and may lie elsewhere
    // where corners of facets are welded.
    let ends = doubt_mm + 4e-4 * (1.0 + program.powers.len() as f64 + manifest.left_out.len() as f64);
    rule.require_figure("", "skipped_mm", s.skipped_mm, lengths.skipped_mm, ends);
    let left_out: f64 = manifest.left_out.iter().map(|l| l.to_mm - l.from_mm).sum();
    rule.require_figure("", "skipped_focus_mm", s.skipped_focus_mm, left_out, 1e-6 + SAME * left_out);
    rule.require_figure("", "moves", s.moves as f64, program.steps.len() as f64, 0.0);
    rule.require_figure("", "marks", s.marks as f64, program.powers.len() as f64, 0.0);
    let total = program.steps.last().map_or(0.0, |l| l.us as f64 / 1e6);
    rule.require_figure("", "time_s", s.time_s, total, SAME * total);
    rule.require_figure("", "mark_s", s.mark_s, on_us as f64 / 1e6, SAME * total);
    rule.require_figure("", "mark_mm", s.mark_mm, mark_nm / 1e6, SAME * mark_nm / 1e6);
    rule.require_figure("", "worst_displacement_mm", s.worst_displacement_mm, away / 1e6, 1e-5);
    let energy = &s.line_energy;
    let found = Energy::new(program, facts, chain);
    let near = |v: f64| 1e-6 * v.max(1.0);
    rule.require_figure(
        "",
        "line_energy.mean_j_per_m",
        energy.mean_j_per_m,
        found.mean_j_per_m,
        near(found.mean_j_per_m),
    );
    rule.require_figure("", "line_energy.slow_s", energy.slow_s, found.slow_s, found.slow_doubt_s + near(total));
    let at_speed = found.at_speed_percent;
    rule.require_figure(
        "",
        "line_energy.length_at_speed_percent",
        energy.length_at_speed_percent,
        at_speed,
        found.doubt_percent + 1e-6,
    );
    rule.require_figure("", "line_energy.worst_share", energy.worst_share, found.worst_share, 1e-4 * found.worst_share);
    // nm in us are mm in s; the switch may come a servo period too early, in each program that of its controller.
    for (_, target) in targets(&manifest.axes).filter(|(_, t)| manifest.files.iter().any(|f| f.file == t.file)) {
        let stated = s.laser.iter().find(|l| l.file == target.file);
        let [period, error] = stated.map_or([f64::NAN; 2], |l| [l.servo_period_s, l.laser_error_mm]);
        let servo_s = facts.machine.controller.servo_period.map_or(target.servo_s, |t| t.as_s());
        rule.require_figure("", "servo_period_s", period, servo_s, SAME * servo_s);
        rule.require_figure("", "laser_error_mm", error, fastest * servo_s, 1e-6 + 1e-4 * fastest * servo_s);
    }
}

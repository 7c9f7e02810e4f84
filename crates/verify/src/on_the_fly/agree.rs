//! `agreement`, `summary`: both programs, the manifest and the job say the same.

use std::path::Path;

use super::chain::Chain;
use super::energy::Energy;
use crate::job_facts::JobFacts;
use crate::proof::{Lengths, Rule};
use crate::read::FORMATS;
use crate::read::comments::Kind;
use crate::read::formats::{self, OnTheFly};
use crate::read::number::nm_from_mm;
use crate::read::on_the_fly::FlyProgram;
use crate::read::on_the_fly::manifest::Manifest;
use crate::read::runsheet;
use crate::rules::runsheets::are_pens;
use terrace_core::units::Power;
use terrace_input::job::Format;

/// The files of every on-the-fly job, besides its programs.
const OF_EVERY_JOB: [&str; 5] = ["runsheet.txt", "layout.svg", "energy.svg", "report.html", "view.html"];

/// Relative difference at which two figures are still the same.
const SAME: f64 = 1e-9;
/// A power is written with three decimals of a percent.
const PERCENT: f64 = 0.0006;
/// How far power may lie from what the speed of the spot asks for, as a share of that of its pen.
const FOLLOWED: f64 = 0.01;
/// How far a blending controller may round a corner, nm.
const ROUNDED: f64 = 200.5;

/// The formats of programs for a machine of these axes.
fn targets(axes: &str) -> impl Iterator<Item = (Format, OnTheFly)> {
    let targets = FORMATS.iter().filter_map(|row| row.on_the_fly.map(|target| (row.format, target)));
    targets.filter(move |(_, target)| target.axes.contains(&axes))
}

/// Reads the programs that the manifest lists, one at least.
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

/// What the comments of a program say is what the manifest states.
pub(super) fn comments((name, program): &(&'static str, FlyProgram), manifest: &Manifest, rule: &mut Rule) {
    let s = &manifest.summary;
    let laser = s.laser.iter().find(|l| l.file == *name);
    let [period, error] = laser.map_or([f64::NAN; 2], |l| [l.servo_period_s, l.laser_error_mm]);
    for (line, kind, figures) in &program.said {
        let stated = match kind {
            Kind::Words => Vec::new(),
            Kind::Size => vec![s.moves as f64, s.marks as f64, s.time_s],
            Kind::Switch => vec![period * 1e3, error / period],
            Kind::LaserError => vec![error],
            Kind::Blend => vec![s.blend_mm],
            Kind::Pen => {
                let number: usize = figures.first().and_then(|number| number.parse().ok()).unwrap_or(0);
                let pen = number.checked_sub(1).and_then(|i| manifest.pens.get(i));
                let power = |text: &str| text.split(' ').next().and_then(|v| v.parse().ok()).unwrap_or(f64::NAN);
                pen.map_or_else(
                    || vec![f64::NAN],
                    |pen| vec![number as f64, pen.speed_mm_s, power(&pen.power), pen.frequency_khz],
                )
            }
        };
        rule.checked += 1;
        let is_same = |(figure, stated): (&String, &f64)| {
            let decimals = figure.split_once('.').map_or(0, |(_, decimals)| decimals.len());
            // Rounded where it is written, and where it is stated.
            let tolerance = 0.51 * 10f64.powi(-(decimals as i32)) + 1e-9 * stated.abs();
            figure.parse::<f64>().is_ok_and(|figure| (figure - stated).abs() <= tolerance)
        };
        if !figures.iter().zip(&stated).all(is_same) {
            rule.broken("", format!("{name}:{line}"), "a comment says other figures than the manifest");
        }
    }
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
    let mut hold = |holds: bool, text: &str| {
        rule.checked += 1;
        if !holds {
            rule.broken("", "manifest.json", text);
        }
    };
    hold(manifest.machine == facts.machine, "its machine differs from the job file");
    let inputs = manifest.inputs.iter().map(|i| (i.role.as_str(), i.file.as_str()));
    let asked = facts.inputs.as_deref().unwrap_or_default().iter().map(|(role, file)| (*role, file.as_str()));
    hold(facts.inputs.is_none() || inputs.eq(asked), "its inputs are not those of the job file");
    hold(manifest.placement.laid_deg == facts.laid_deg, "its part is laid otherwise than the job file says");
    let limits = [
        (manifest.limits.pdof_mm, facts.pdof.mm()),
        (manifest.limits.reserve_mm, facts.reserve.mm()),
        (manifest.limits.fod_um, facts.depth_range_nm() / 2e3),
        (manifest.limits.bia_deg, facts.max_incidence_rad.to_degrees()),
    ];
    let are_same = limits.iter().all(|(stated, asked)| (stated - asked).abs() <= SAME * asked.abs().max(1.0));
    hold(are_same, "its limits differ from the job file");
    hold((manifest.placement.turn_deg - facts.turn_deg).abs() <= SAME, "its turn differs from the job file");
    let origin = manifest.placement.origin_mm.map(nm_from_mm);
    hold(facts.origin.is_none_or(|o| o.0.map(Some) == origin), "its origin differs from the job file");
    for (format, target) in targets(&manifest.axes) {
        let is_listed = manifest.files.iter().any(|f| f.file == target.file);
        let text = format!("{} is not listed, which the job asks for", target.file);
        hold(is_listed || !facts.formats.contains(&format), &text);
    }
    // Whoever loads another file marks what nobody has compared.
    for entry in &manifest.files {
        let is_asked =
            |(format, target): (Format, OnTheFly)| target.file == entry.file && facts.formats.contains(&format);
        let is_known = OF_EVERY_JOB.contains(&entry.file.as_str()) || targets(&manifest.axes).any(is_asked);
        hold(is_known, &format!("{} is listed, but is not a file of this job", entry.file));
    }
    let full = facts.machine.laser.max_power;
    let pens = facts.pens.as_deref().unwrap_or_default();
    let same = manifest.pens.len() == pens.len()
        && manifest.pens.iter().zip(pens).all(|(m, p)| {
            let percent = p.power.as_w(full) / full.as_w() * 100.0;
            m.name == p.name
                && m.speed_mm_s == p.speed.as_mm_s()
                && (m.power_percent - percent).abs() <= SAME * percent
                && m.power.parse::<Power>().is_ok_and(|power| power == p.power)
                && m.frequency_khz == p.frequency.as_khz()
        });
    hold(same, "its pens differ from those of the job file");
    for (us, from, step) in program.moves() {
        let Some(mark) = step.mark else { continue };
        rule.checked += 1;
        let wanted = pens.get(mark.pen.index()).map(|pen| {
            let most = pen.power.as_w(full) / full.as_w() * 100.0;
            if !facts.power_by_speed {
                return [most, PERCENT];
            }
            let way = chain.beam(&from.float()).way(&chain.beam(&step.to.float())) / 1e6;
            let share = way / (pen.speed.as_mm_s() * (step.us - us) as f64 / 1e6);
            [most * share.min(1.0), FOLLOWED * most + PERCENT]
        });
        let near = wanted.zip(step.power).is_some_and(|([w, tolerance], p)| (w - p).abs() <= tolerance);
        if !near {
            let what = if facts.power_by_speed { "that its speed asks for" } else { "of its pen" };
            rule.broken("", format!("line {}", step.line), format!("a mark does not have the power {what}"));
        }
    }
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

/// Figures of the manifest.
pub(super) fn summary(
    manifest: &Manifest,
    facts: &JobFacts,
    program: &FlyProgram,
    chain: &Chain,
    (lengths, doubt_mm): (&Lengths, f64),
    rule: &mut Rule,
) {
    rule.ran = true;
    let s = &manifest.summary;
    let (mut on_us, mut away, mut fastest, mut mark_nm) = (0, 0.0f64, 0.0f64, 0.0);
    for (us, from, step) in program.moves().filter(|(_, _, s)| s.mark.is_some()) {
        on_us += step.us - us;
        let [a, b] = [from, &step.to].map(|to| to.float());
        for field in [&a, &b].map(|to| chain.field(to)) {
            away = away.max(field[0].hypot(field[1]));
        }
        let way = chain.beam(&a).way(&chain.beam(&b));
        mark_nm += way;
        fastest = fastest.max(way / (step.us - us) as f64);
    }
    let mut hold = |name: &str, stated: f64, found: f64, tolerance: f64| {
        rule.checked += 1;
        let near = (stated - found).abs() <= tolerance; // never of a NaN
        if !near {
            rule.broken("", "manifest.json", format!("{name} is given as {stated}, but is {found}"));
        }
    };
    hold("texture_mm", s.texture_mm, lengths.texture_mm, 1e-6 + SAME * lengths.texture_mm);
    // Both ends of every piece are rounded and merged, and may lie elsewhere where corners of facets are welded.
    let ends = doubt_mm + 4e-4 * (1.0 + program.powers.len() as f64 + manifest.left_out.len() as f64);
    hold("skipped_mm", s.skipped_mm, lengths.skipped_mm, ends);
    let left_out: f64 = manifest.left_out.iter().map(|l| l.to_mm - l.from_mm).sum();
    hold("skipped_focus_mm", s.skipped_focus_mm, left_out, 1e-6 + SAME * left_out);
    hold("moves", s.moves as f64, program.steps.len() as f64, 0.0);
    hold("marks", s.marks as f64, program.powers.len() as f64, 0.0);
    let total = program.steps.last().map_or(0.0, |l| l.us as f64 / 1e6);
    hold("time_s", s.time_s, total, SAME * total);
    hold("mark_s", s.mark_s, on_us as f64 / 1e6, SAME * total);
    hold("mark_mm", s.mark_mm, mark_nm / 1e6, SAME * mark_nm / 1e6);
    hold("worst_displacement_mm", s.worst_displacement_mm, away / 1e6, 1e-5);
    let energy = &s.line_energy;
    let found = Energy::of(program, facts, chain);
    let near = |v: f64| 1e-6 * v.max(1.0);
    hold("line_energy.mean_j_per_m", energy.mean_j_per_m, found.mean_j_per_m, near(found.mean_j_per_m));
    hold("line_energy.slow_s", energy.slow_s, found.slow_s, found.slow_doubt_s + near(total));
    let at_speed = found.at_speed_percent;
    hold("line_energy.length_at_speed_percent", energy.length_at_speed_percent, at_speed, found.doubt_percent + 1e-6);
    hold("line_energy.worst_share", energy.worst_share, found.worst_share, 1e-4 * found.worst_share);
    // nm in us are mm in s; the switch may come a servo period too early, in each program that of its controller.
    for (_, target) in targets(&manifest.axes).filter(|(_, t)| manifest.files.iter().any(|f| f.file == t.file)) {
        let stated = s.laser.iter().find(|l| l.file == target.file);
        let [period, error] = stated.map_or([f64::NAN; 2], |l| [l.servo_period_s, l.laser_error_mm]);
        let servo_s = facts.machine.controller.servo_period.map_or(target.servo_s, |t| t.as_s());
        hold("servo_period_s", period, servo_s, SAME * servo_s);
        hold("laser_error_mm", error, fastest * servo_s, 1e-6 + 1e-4 * fastest * servo_s);
    }
}

//! The proof of an on-the-fly job from its files.
//!
//! The programs are read again by readers of this module's own, axis values become beams by its own arithmetic
//! (`chain`), and each rule is held: `hash`, `agreement` of the programs, the manifest and the job, `limits`,
//! `laser`, `position`, `focus`, `surface`, `once`, `coverage`, `summary`. Units: nm, us.

mod agree;
mod chain;
mod cover;
mod energy;
mod limits;
mod marks;
mod rests;
#[cfg(test)]
mod tests;
mod track;
mod turntable;

use std::path::Path;

use chain::Chain;
use cover::{Cover, CoverageChecker, Covers};
use marks::{MarkChecker, Rules, Traced, Wanted};
use track::Stroke;

use super::findings::{self, Findings, RuleCode};
use super::geometry::{Geometry, Scratch};
use super::inputs::Inputs;
use super::job_facts::{self, JobFacts};
use super::progress::{Phase, Progress};
use super::proof::{Lengths, Proof, Rule};
use super::read::leaves;
use super::read::manifest::{self, Listed};
use super::read::on_the_fly::manifest::Manifest;
use super::read::on_the_fly::{Commands, FlyProgram, Step};
use super::rules::{curves, hash, stated, summary};
use terrace_core::diag::Error;
use terrace_core::geom::{Nm, P2};
use terrace_core::machine::Origin;
use terrace_core::program::{PassId, Pen, PenId, StrokeId};
use terrace_core::progress::Task;
use terrace_input::job::Mode;
use terrace_input::texture::Texture;

/// Marks and strokes that are counted as one step.
const COUNTED: usize = 64;

/// Verifies an on-the-fly job folder.
pub(super) fn verify(folder: &Path, inputs_override: Option<&Path>, progress: Progress<'_>) -> Result<Proof, Error> {
    let reading = Phase::Read.task(progress);
    let manifest: Manifest = manifest::read(folder, &leaves::ON_THE_FLY)?;
    let mut findings = Findings::new(findings::ON_THE_FLY);
    let inputs = Inputs::locate(folder, &manifest.job.file, inputs_override);
    let listed = Listed { job: &manifest.job, inputs: &manifest.inputs, files: &manifest.files };
    findings.not_proved = stated::of(&listed, &leaves::ON_THE_FLY);
    let unchanged = hash::check(folder, &listed, &inputs, &mut findings.rules[RuleCode::Hash]);
    let mut programs = agree::read(folder, &manifest, &mut findings.rules[RuleCode::Agreement]);
    for (name, program) in &mut programs {
        turntable::unwind(program, name, &manifest.machine, &mut findings.rules[RuleCode::Agreement]);
    }
    drop(reading);
    let comparing = Phase::Files.task(progress);
    agree::programs(&programs, &mut findings.rules[RuleCode::Agreement]);
    programs.iter().for_each(|program| agree::comments(program, &manifest, &mut findings.rules[RuleCode::Agreement]));
    findings.rules[RuleCode::Laser].ran = !programs.is_empty();
    for (name, program) in &programs {
        findings.rules[RuleCode::Laser].checked += program.steps.len() as u64;
        for fault in &program.faults {
            findings.rules[RuleCode::Laser].broken("", format!("{name}:{}", fault.line), &fault.message);
        }
    }
    let origin = Origin(manifest.placement.origin_mm.map(|v| Nm::from_mm(v).unwrap_or_default().0));
    let Some((name, program)) = programs.first() else {
        findings.rules[RuleCode::Agreement].broken("", "manifest.json", "no program is listed that can be read");
        return Ok(findings.into_proof());
    };
    let Some(chain) = Chain::of(&manifest.machine, origin, &manifest.axes) else {
        findings.rules[RuleCode::Agreement].broken(
            "",
            "manifest.json",
            "the machine does not have the axes that are named",
        );
        return Ok(findings.into_proof());
    };
    findings.fragments = program.powers.len();
    if !unchanged {
        check_program(name, program, &chain, &manifest, &[], &mut findings);
        return Ok(findings.into_proof());
    }
    let (job, facts) = job_facts::load(&inputs, Mode::OnTheFly)?;
    findings.against = inputs.used(&job, folder);
    agree::with_job(&manifest, &facts, program, &chain, &mut findings.rules[RuleCode::Agreement]);
    agree::sheet(folder, &manifest, &facts, &mut findings.rules[RuleCode::Agreement]);
    let pens = facts.pens.clone().unwrap_or_default();
    check_program(name, program, &chain, &manifest, &pens, &mut findings);
    drop(comparing);
    let [shaped, drawn, marks] = Phase::Marks.task(progress).split([3, 1, 12]);
    let (shape, box_mm) = job_facts::shape(&job)?;
    let geometry = Geometry::new(shape, facts.max_incidence_rad, facts.weld_nm);
    summary::part(manifest.summary.part_mm, box_mm, &geometry, &facts, &mut findings.rules[RuleCode::Summary]);
    drop(shaped);
    let texture = job_facts::texture(&job, &facts.machine, PassId(0), box_mm)?;
    let rules = findings.rules.several([RuleCode::Curves, RuleCode::Summary]);
    curves::check(&job, &texture, &geometry, manifest.summary.curves.as_ref(), rules);
    drop(drawn);
    let checked = (&facts, &texture, &geometry);
    let covers = check_marks(name, program, &chain, checked, &mut findings, marks);
    check_coverage(covers, &manifest, checked, &mut findings, Phase::Coverage.task(progress));
    let lengths = (&findings.lengths, findings.doubt_mm);
    agree::summary(&manifest, &facts, program, &chain, lengths, &mut findings.rules[RuleCode::Summary]);
    Ok(findings.into_proof())
}

fn check_program(
    name: &str,
    program: &FlyProgram,
    chain: &Chain,
    manifest: &Manifest,
    pens: &[Pen],
    findings: &mut Findings,
) {
    findings.rules[RuleCode::Limits].ran = true;
    limits::check(program, name, chain, &manifest.machine, pens, &mut findings.rules[RuleCode::Limits]);
}

/// The rules of geometry.
fn check_marks(
    name: &str,
    program: &FlyProgram,
    chain: &Chain,
    (facts, texture, geometry): (&JobFacts, &Texture, &Geometry),
    findings: &mut Findings,
    task: Task<'_>,
) -> Covers {
    let task = task.of_steps(program.powers.len() / COUNTED);
    let judged = [RuleCode::Position, RuleCode::Focus, RuleCode::Surface, RuleCode::Once, RuleCode::Coverage];
    let [position, focus, bare, once, coverage] = findings.rules.several(judged);
    for rule in [&mut *position, &mut *focus, &mut *bare, &mut *once, &mut *coverage] {
        rule.ran = true;
    }
    let wanted = Wanted { defocus: facts.defocus_limit_nm(), lean: facts.max_incidence_rad };
    let mut checker = MarkChecker::new(chain, geometry, wanted);
    let mut covers = Covers::default();
    let mut points: Vec<P2> = Vec::new();
    let mut kept: Option<(StrokeId, PenId, Stroke)> = None;
    let mut moves: Vec<(Commands, Step)> = Vec::new();
    let mut marks = 0usize;
    let mut all = program.moves().map(|(_, from, step)| (*from, *step)).peekable();
    while let Some((from, step)) = all.next() {
        let Some(claim) = step.mark else { continue };
        moves.push((from, step));
        if all.peek().is_some_and(|(_, next)| next.mark == step.mark) {
            continue;
        }
        let place = || format!("{name}:{}", step.line);
        if claim.stroke.index() >= texture.len() {
            position.broken("", place(), format!("the texture has no stroke {}", claim.stroke.0));
            moves.clear();
            continue;
        }
        if kept.as_ref().is_none_or(|k| k.0 != claim.stroke) {
            let pen = texture.stroke(claim.stroke.index(), &mut points);
            kept = Some((claim.stroke, pen, Stroke::new(&points)));
        }
        let Some((_, pen, stroke)) = &kept else { continue };
        if *pen != claim.pen {
            position.broken(
                "",
                place(),
                format!("a mark has pen {}, its stroke is drawn with pen {}", claim.pen.number(), pen.number()),
            );
        }
        let mut rules = Rules { position: &mut *position, focus: &mut *focus, surface: &mut *bare };
        let Traced { traces, loose } = checker.mark(name, &moves, stroke, &mut rules);
        let stray = marks::STRAY + loose;
        let back = traces.first().map_or(0.0, |t| t.back);
        if back > stray {
            once.broken("", place(), format!("a mark runs back over {:.6} mm", back / 1e6));
        }
        // What lies elsewhere covers nothing.
        let places = traces.iter().filter(|t| t.worst <= stray).map(|t| cover::of(claim.stroke.0, stroke, t, loose));
        covers.add(places.collect());
        moves.clear();
        marks += 1;
        if marks.is_multiple_of(COUNTED) {
            task.step();
        }
    }
    findings.worst_defocus_um = checker.worst.defocus / 1e3;
    findings.worst_incidence_deg = checker.worst.lean.to_degrees();
    findings.worst_position_um = Some(checker.worst.stray / 1e3);
    covers
}

/// What the manifest says is left out, by strokes and places.
fn left_out(manifest: &Manifest, texture: &Texture, coverage: &mut Rule) -> Vec<Cover> {
    let mut points: Vec<P2> = Vec::new();
    let mut out: Vec<Cover> = Vec::new();
    for l in &manifest.left_out {
        if l.stroke as usize >= texture.len() {
            coverage.broken("", "manifest.json", "`left_out` names strokes that the texture does not have");
            continue;
        }
        texture.stroke(l.stroke as usize, &mut points);
        out.extend(cover::between(l.stroke, &Stroke::new(&points), l.from_mm * 1e6, l.to_mm * 1e6));
    }
    out.sort_by(|a, b| a.stroke.cmp(&b.stroke).then(a.from.total_cmp(&b.from)));
    out
}

/// What the marks cover of every stroke, against what the manifest says is left out.
fn check_coverage(
    covers: Covers,
    manifest: &Manifest,
    (facts, texture, geometry): (&JobFacts, &Texture, &Geometry),
    findings: &mut Findings,
    task: Task<'_>,
) {
    let task = task.of_steps(texture.len() / COUNTED);
    let [once, coverage] = findings.rules.several([RuleCode::Once, RuleCode::Coverage]);
    let mut points: Vec<P2> = Vec::new();
    let left_out = left_out(manifest, texture, coverage);
    let covers = covers.sorted(&left_out);
    let mut coverage_checker =
        CoverageChecker { geometry, facts, scratch: Scratch::default(), lengths: Lengths::default(), doubt_mm: 0.0 };
    let (mut rest, mut stated) = (covers.as_slice(), left_out.as_slice());
    // What of a list in the order of strokes belongs to stroke `i`, the next one.
    let own = |list: &mut &[Cover], i: usize| {
        let (own, others) = list.split_at(list.iter().take_while(|c| c.stroke as usize == i).count());
        *list = others;
        own.to_vec()
    };
    for i in 0..texture.len() {
        texture.stroke(i, &mut points);
        let (own, left_out) = (own(&mut rest, i), own(&mut stated, i));
        let rules = [&mut *once, &mut *coverage];
        coverage_checker.stroke(&Stroke::new(&points), &own, &left_out, &texture.element(i), rules);
        if i % COUNTED == COUNTED - 1 {
            task.step();
        }
    }
    findings.lengths = coverage_checker.lengths;
    findings.doubt_mm = coverage_checker.doubt_mm;
}

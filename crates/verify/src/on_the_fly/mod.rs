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
use cover::{CoverageChecker, CoveredStretch, Covers};
use marks::{FocusLimits, MarkChecker, MarkRules, MarkTraces};
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
use super::read::on_the_fly::{Commands, FlyProgram, FlyStep};
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

/// A job as loaded again from its job file and inputs.
struct LoadedFlyJob<'a> {
    facts: &'a JobFacts,
    texture: &'a Texture,
    /// The facets of its surface file.
    geometry: &'a Geometry,
}

/// Verifies an on-the-fly job folder.
pub(super) fn verify(folder: &Path, inputs_override: Option<&Path>, progress: Progress<'_>) -> Result<Proof, Error> {
    let reading = Phase::Read.task(progress);
    let manifest: Manifest = manifest::read(folder, &leaves::ON_THE_FLY)?;
    let mut findings = Findings::new(findings::ON_THE_FLY);
    let inputs = Inputs::locate(folder, &manifest.job.file, inputs_override);
    let listed = Listed { job: &manifest.job, inputs: &manifest.inputs, files: &manifest.files };
    findings.not_proved = stated::not_proved(&listed, &leaves::ON_THE_FLY);
    let unchanged = hash::check(folder, &listed, &inputs, &mut findings.rules[RuleCode::Hash]);
    let mut programs = agree::read(folder, &manifest, &mut findings.rules[RuleCode::Agreement]);
    for (name, program) in &mut programs {
        turntable::unwind(program, name, &manifest.machine, &mut findings.rules[RuleCode::Agreement]);
    }
    drop(reading);
    let comparing = Phase::Files.task(progress);
    agree::programs(&programs, &mut findings.rules[RuleCode::Agreement]);
    for (name, program) in &programs {
        agree::comments(name, program, &manifest, &mut findings.rules[RuleCode::Agreement]);
    }
    check_laser(&programs, &mut findings.rules[RuleCode::Laser]);
    let origin = Origin(manifest.placement.origin_mm.map(|v| Nm::from_mm(v).unwrap_or_default().0));
    let Some((name, program)) = programs.first() else {
        findings.rules[RuleCode::Agreement].broken("", "manifest.json", "no program is listed that can be read");
        return Ok(findings.into_proof());
    };
    let Some(chain) = Chain::new(&manifest.machine, origin, &manifest.axes) else {
        findings.rules[RuleCode::Agreement].broken(
            "",
            "manifest.json",
            "the machine does not have the axes that are named",
        );
        return Ok(findings.into_proof());
    };
    findings.fragments = program.powers.len();
    if !unchanged {
        // The job cannot be loaded again, but the machine of the manifest has the limits of the axes.
        check_limits(name, program, &chain, &manifest, &[], &mut findings.rules[RuleCode::Limits]);
        return Ok(findings.into_proof());
    }
    let (job, facts) = job_facts::load(&inputs, Mode::OnTheFly)?;
    findings.against = inputs.used(&job, folder);
    agree::with_job(&manifest, &facts, program, &chain, &mut findings.rules[RuleCode::Agreement]);
    agree::sheet(folder, &manifest, &facts, &mut findings.rules[RuleCode::Agreement]);
    let pens = facts.pens.clone().unwrap_or_default();
    check_limits(name, program, &chain, &manifest, &pens, &mut findings.rules[RuleCode::Limits]);
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
    let job = LoadedFlyJob { facts: &facts, texture: &texture, geometry: &geometry };
    let covers = check_marks(name, program, &chain, &job, &mut findings, marks);
    check_coverage(covers, &manifest, &job, &mut findings, Phase::Coverage.task(progress));
    let lengths = &agree::MeasuredLengths { lengths: &findings.lengths, doubt_mm: findings.doubt_mm };
    agree::summary(&manifest, &facts, program, &chain, lengths, &mut findings.rules[RuleCode::Summary]);
    Ok(findings.into_proof())
}

/// Reports what the readers of the programs found of the laser while they followed it.
fn check_laser(programs: &[(&'static str, FlyProgram)], rule: &mut Rule) {
    rule.ran = !programs.is_empty();
    for (name, program) in programs {
        rule.checked += program.steps.len() as u64;
        for fault in &program.faults {
            rule.broken("", format!("{name}:{}", fault.line), &fault.message);
        }
    }
}

fn check_limits(name: &str, program: &FlyProgram, chain: &Chain, manifest: &Manifest, pens: &[Pen], rule: &mut Rule) {
    rule.ran = true;
    limits::check(program, name, chain, &manifest.machine, pens, rule);
}

/// The rules of geometry, mark by mark; returns what the marks cover of the strokes.
fn check_marks(
    name: &str,
    program: &FlyProgram,
    chain: &Chain,
    job: &LoadedFlyJob<'_>,
    findings: &mut Findings,
    task: Task<'_>,
) -> Covers {
    let LoadedFlyJob { facts, texture, geometry } = *job;
    let task = task.of_steps(program.powers.len() / COUNTED);
    let judged = [RuleCode::Position, RuleCode::Focus, RuleCode::Surface, RuleCode::Once, RuleCode::Coverage];
    let [position, focus, bare, once, coverage] = findings.rules.several(judged);
    for rule in [&mut *position, &mut *focus, &mut *bare, &mut *once, &mut *coverage] {
        rule.ran = true;
    }
    let limits = FocusLimits { defocus: facts.defocus_limit_nm(), lean: facts.max_incidence_rad };
    let mut checker = MarkChecker::new(chain, geometry, limits);
    let mut covers = Covers::default();
    let mut strokes = StrokeCache { texture, points: Vec::new(), last: None };
    let mut moves: Vec<(Commands, FlyStep)> = Vec::new();
    let mut marks = 0usize;
    let mut all_moves = program.moves().map(|(_, from, step)| (*from, *step)).peekable();
    while let Some((from, step)) = all_moves.next() {
        let Some(claim) = step.mark else { continue };
        // A mark is all moves that follow each other with the same claim.
        moves.push((from, step));
        if all_moves.peek().is_some_and(|(_, next)| next.mark == step.mark) {
            continue;
        }
        let place = || format!("{name}:{}", step.line);
        let Some((pen, stroke)) = strokes.get(claim.stroke) else {
            position.broken("", place(), format!("the texture has no stroke {}", claim.stroke.0));
            moves.clear();
            continue;
        };
        if pen != claim.pen {
            position.broken(
                "",
                place(),
                format!("a mark has pen {}, its stroke is drawn with pen {}", claim.pen.number(), pen.number()),
            );
        }
        let mut rules = MarkRules { position: &mut *position, focus: &mut *focus, surface: &mut *bare };
        let MarkTraces { traces, loose } = checker.mark(name, &moves, stroke, &mut rules);
        let stray = marks::STRAY + loose;
        let back = traces.first().map_or(0.0, |t| t.back);
        if back > stray {
            once.broken("", place(), format!("a mark runs back over {:.6} mm", back / 1e6));
        }
        // What lies elsewhere covers nothing.
        let on_stroke = traces.iter().filter(|t| t.worst <= stray);
        covers.add(on_stroke.map(|t| cover::of_trace(claim.stroke.0, stroke, t, loose)).collect());
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

/// The strokes of a texture, of which the last is kept: marks of one stroke follow each other.
struct StrokeCache<'a> {
    texture: &'a Texture,
    points: Vec<P2>,
    last: Option<(StrokeId, PenId, Stroke)>,
}

impl StrokeCache<'_> {
    /// A stroke and its pen; None where the texture has no such stroke.
    fn get(&mut self, id: StrokeId) -> Option<(PenId, &Stroke)> {
        if id.index() >= self.texture.len() {
            return None;
        }
        if self.last.as_ref().is_none_or(|(last, ..)| *last != id) {
            let pen = self.texture.stroke(id.index(), &mut self.points);
            self.last = Some((id, pen, Stroke::new(&self.points)));
        }
        self.last.as_ref().map(|(_, pen, stroke)| (*pen, stroke))
    }
}

/// The stretches that the manifest states as left out, by strokes and places.
fn left_out(manifest: &Manifest, texture: &Texture, coverage: &mut Rule) -> Vec<CoveredStretch> {
    let mut points: Vec<P2> = Vec::new();
    let mut out: Vec<CoveredStretch> = Vec::new();
    for stretch in &manifest.left_out {
        if stretch.stroke as usize >= texture.len() {
            coverage.broken("", "manifest.json", "`left_out` names strokes that the texture does not have");
            continue;
        }
        texture.stroke(stretch.stroke as usize, &mut points);
        let stroke = Stroke::new(&points);
        out.extend(cover::between(stretch.stroke, &stroke, stretch.from_mm * 1e6, stretch.to_mm * 1e6));
    }
    out.sort_by(|a, b| a.stroke.cmp(&b.stroke).then(a.from.total_cmp(&b.from)));
    out
}

/// Holds that marks cover every stroke, but for the stretches that the manifest states as left out.
fn check_coverage(
    covers: Covers,
    manifest: &Manifest,
    job: &LoadedFlyJob<'_>,
    findings: &mut Findings,
    task: Task<'_>,
) {
    let LoadedFlyJob { facts, texture, geometry } = *job;
    let task = task.of_steps(texture.len() / COUNTED);
    let [once, coverage] = findings.rules.several([RuleCode::Once, RuleCode::Coverage]);
    let mut points: Vec<P2> = Vec::new();
    let left_out = left_out(manifest, texture, coverage);
    let covers = covers.sorted(&left_out);
    let mut coverage_checker =
        CoverageChecker { geometry, facts, scratch: Scratch::default(), lengths: Lengths::default(), doubt_mm: 0.0 };
    let (mut rest, mut stated) = (covers.as_slice(), left_out.as_slice());
    for i in 0..texture.len() {
        texture.stroke(i, &mut points);
        let own = take_of_stroke(&mut rest, i);
        let left_out = take_of_stroke(&mut stated, i);
        let rules = [&mut *once, &mut *coverage];
        coverage_checker.stroke(&Stroke::new(&points), own, left_out, &texture.element(i), rules);
        if i % COUNTED == COUNTED - 1 {
            task.step();
        }
    }
    findings.lengths = coverage_checker.lengths;
    findings.doubt_mm = coverage_checker.doubt_mm;
}

/// Takes what belongs to stroke `i`, the next one, from a list in the order of strokes.
fn take_of_stroke<'a>(list: &mut &'a [CoveredStretch], i: usize) -> &'a [CoveredStretch] {
    let (own, others) = list.split_at(list.iter().take_while(|c| c.stroke as usize == i).count());
    *list = others;
    own
}

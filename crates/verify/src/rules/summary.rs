//! `summary`: the manifest's figures are the ones found again. A figure that a broken rule has already
//! spoilt is not reported a second time: what is skipped waits for `coverage`, overlaps for `once`, times for
//! `agreement` and `travel`, slopes for all rules of geometry.
//!
//! Of `lower_bound_stops` only this is checked, that there are no fewer stops: a bound is proved by its certificate,
//! which the folder does not hold.

use super::Rule;
use super::coverage::PieceFigures;
use super::depth_and_field::MarkFigures;
use super::off_axis;
use super::slopes::{self, Bounds, Sides};
use super::times::{self, Times};
use super::turned::Turned;
use crate::findings::{Findings, RuleCode};
use crate::geometry::{Geometry, Scratch};
use crate::job_facts::JobFacts;
use crate::proof::Lengths;
use crate::read::FORMATS;
use crate::read::formats::Stepped;
use crate::read::manifest::{BlockEntry, Manifest};
use crate::read::program::ProgramFile;
use terrace_core::geom::{BoxMm, NM_PER_MM};
use terrace_core::machine::LoadingWay;
use terrace_core::math;
use terrace_core::parallel;
use terrace_core::program::Block;
use terrace_input::job::Format;

/// Lengths agree to this, relative, as docs/explanation/verify.md states.
const LENGTH: f64 = 1e-9;

/// The worst defocus agrees to this and the tolerance of its height, nm, as docs/explanation/verify.md states.
const DEFOCUS: f64 = 2.0;

const PLACE: &str = "manifest.json";

/// Holds the sides of the part's box to those of the surface file's own corners.
pub(crate) fn part(stated: [f64; 3], box_mm: BoxMm<2>, geometry: &Geometry, facts: &JobFacts, rule: &mut Rule) {
    let ([x, y], [lo, hi]) = (box_mm.size(), geometry.heights());
    // x and y to a nanometre. Of z both ends, each rounded to the nanometre and moved by welding.
    let tolerance = [1e-6, 1e-6, (2.0 + 2.0 * facts.weld_nm) / NM_PER_MM];
    for (k, found) in [x, y, (hi - lo) / NM_PER_MM].into_iter().enumerate() {
        rule.checked += 1;
        let near = (stated[k] - found).abs() <= tolerance[k]; // never of a NaN
        if !near {
            rule.broken("", PLACE, format!("part_mm is given as {stated:?}, but side {} is {found}", k + 1));
        }
    }
}

/// Holds the rule.
pub(crate) fn check(
    manifest: &Manifest,
    file: &ProgramFile,
    facts: &JobFacts,
    marks: &MarkFigures,
    pieces: &PieceFigures,
    findings: &mut Findings,
) {
    let sound = SoundRules::new(findings);
    let rule = &mut findings.rules[RuleCode::Summary];
    rule.ran = true;
    check_counts(manifest, file, facts, rule);
    check_marked(manifest, file, marks, pieces, rule);
    if sound.times {
        check_times(manifest, file, facts, rule);
    }
    check_dots(manifest, pieces, sound.skipped, rule);
    if sound.skipped {
        check_figures(manifest, pieces, rule);
    }
    if sound.overlaps {
        let Lengths { texture_mm, overlap_mm, .. } = pieces.lengths;
        let tolerance = LENGTH * texture_mm + pieces.rounding_mm;
        rule.require_figure("", "overlap_mm", manifest.summary.overlap_mm, overlap_mm, tolerance);
    }
    if sound.skipped {
        check_skipped(manifest, pieces, rule);
    }
    if sound.heights {
        check_defocus(manifest, file, marks, rule);
    }
    if sound.skipped && sound.times && sound.field {
        rule.checked += 1;
        if let Some(text) = off_axis::fault(&manifest.summary.off_axis_mm, &file.program) {
            rule.broken("", PLACE, text);
        }
    }
    // Without the job it is not known what its formats are.
    if facts.pens.is_some() {
        check_loading(manifest, file, facts, rule);
    }
}

/// Which figures no broken rule has spoilt already.
struct SoundRules {
    overlaps: bool,
    skipped: bool,
    times: bool,
    heights: bool,
    field: bool,
}

impl SoundRules {
    fn new(findings: &Findings) -> Self {
        let holds = |code: RuleCode| findings.rules[code].violated == 0;
        let overlaps = holds(RuleCode::Once) && holds(RuleCode::Source);
        Self {
            overlaps,
            skipped: overlaps && holds(RuleCode::Coverage) && holds(RuleCode::Surface),
            times: holds(RuleCode::Agreement) && holds(RuleCode::Travel),
            heights: holds(RuleCode::Depth) && holds(RuleCode::Surface),
            field: holds(RuleCode::Field),
        }
    }
}

/// Holds what is counted.
fn check_counts(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
    let s = &manifest.summary;
    rule.require_figure("", "stops", s.stops as f64, super::stops(&file.program) as f64, 0.0);
    rule.require_figure("", "blocks", s.blocks as f64, file.program.blocks.len() as f64, 0.0);
    rule.require_figure("", "setups", s.setups as f64, file.origins.len() as f64, 0.0);
    rule.require_figure("", "passes", f64::from(s.passes), f64::from(facts.passes.count), 0.0);
    rule.require_figure("", "fragments", s.fragments as f64, file.program.strokes.len() as f64, 0.0);
}

/// Holds the worst incidence, the lengths of texture and marks, and the lower bound of stops.
fn check_marked(manifest: &Manifest, file: &ProgramFile, marks: &MarkFigures, pieces: &PieceFigures, rule: &mut Rule) {
    let s = &manifest.summary;
    let found = &pieces.lengths;
    let tiny = LENGTH * found.texture_mm;
    // The incidence of every block is held by `slopes`; here the worst is held to be the largest of them.
    let steepest = manifest.blocks.iter().map(|b| b.incidence_deg[1]).fold(0.0, f64::max);
    let cos = |deg: f64| math::cos(deg.to_radians());
    rule.require_figure("", "the cosine of worst_incidence_deg", cos(s.worst_incidence_deg), cos(steepest), LENGTH);
    rule.require_figure("", "texture_mm", s.texture_mm, found.texture_mm, tiny);
    rule.require_figure("", "mark_mm", s.mark_mm, found.mark_mm, tiny + pieces.turned_mm);
    for ((entry, id), &mm) in manifest.blocks.iter().zip(&file.ids).zip(&marks.block_mm) {
        rule.require_figure(id, "mark_mm of the block", entry.mark_mm, mm, LENGTH * mm);
    }
    // The bound is not proved, but there are no fewer stops.
    let bound = s.lower_bound_stops.unwrap_or(0.0);
    rule.require_figure("", "lower_bound_stops", bound, bound.clamp(0.0, super::stops(&file.program) as f64), 0.0);
}

/// Holds the numbers of dots; of those that are not marked where these are sound.
fn check_dots(manifest: &Manifest, pieces: &PieceFigures, skipped_is_sound: bool, rule: &mut Rule) {
    let (stated, found) = (&manifest.summary.dots, &pieces.dots);
    rule.require_figure("", "dots.texture", stated.texture as f64, found.texture as f64, 0.0);
    rule.require_figure("", "dots.marked", stated.marked as f64, found.marked as f64, 0.0);
    if skipped_is_sound {
        let doubtful = found.doubtful as f64;
        let sum = stated.marked + stated.off_part + stated.steep;
        rule.require_figure("", "the sum of marked and skipped dots", sum as f64, stated.texture as f64, 0.0);
        rule.require_figure("", "dots.off_part", stated.off_part as f64, found.off_part as f64, doubtful);
        rule.require_figure("", "dots.steep", stated.steep as f64, found.steep as f64, doubtful);
    }
}

/// Holds how many strokes are cut, and how many figures are.
fn check_figures(manifest: &Manifest, pieces: &PieceFigures, rule: &mut Rule) {
    let s = &manifest.summary;
    rule.require_figure("", "strokes_cut", s.strokes_cut as f64, pieces.strokes_cut as f64, 0.0);
    let doubtful = pieces.doubtful_figures as f64;
    rule.require_figure("", "figures_whole", s.figures_whole as f64, pieces.figures_whole as f64, doubtful);
    let figures = (pieces.figures_whole + pieces.figures_cut) as f64;
    rule.require_figure("", "the sum of figures", (s.figures_whole + s.figures_cut) as f64, figures, 0.0);
}

/// Holds the length that is skipped, and of what it consists.
fn check_skipped(manifest: &Manifest, pieces: &PieceFigures, rule: &mut Rule) {
    let s = &manifest.summary;
    let found = &pieces.lengths;
    let tiny = LENGTH * found.texture_mm;
    let parts = s.skipped_off_part_mm + s.skipped_steep_mm + s.skipped_small_mm;
    let balance = s.mark_mm - s.overlap_mm + s.skipped_mm;
    rule.require_figure("", "mark_mm - overlap_mm + skipped_mm", balance, s.texture_mm, tiny + pieces.rounding_mm);
    rule.require_figure("", "skipped_mm", s.skipped_mm, found.skipped_mm, tiny + pieces.rounding_mm);
    rule.require_figure("", "the sum of skipped parts", parts, s.skipped_mm, tiny);
    // The part's border on the file's own facets is the compiled one to some nanometres at each end.
    let doubt = tiny + pieces.doubt_mm + pieces.rounding_mm;
    rule.require_figure("", "skipped_off_part_mm", s.skipped_off_part_mm, found.skipped_off_part_mm, doubt);
    rule.require_figure("", "skipped_steep_mm", s.skipped_steep_mm, found.skipped_steep_mm, doubt);
    rule.require_figure("", "skipped_small_mm", s.skipped_small_mm, found.skipped_small_mm, doubt);
}

/// Holds the worst defocus.
fn check_defocus(manifest: &Manifest, file: &ProgramFile, marks: &MarkFigures, rule: &mut Rule) {
    let worst_um = manifest.summary.worst_defocus_um;
    let tolerance = (DEFOCUS + marks.worst_tolerance) / 1e3;
    let found = marks.worst_defocus / 1e3;
    // A mark along the part's border may have no facet under it here, yet have its stated heights.
    let off = |b: &Block| (b.z_hi - b.stop.lpfl).max(b.stop.lpfl - b.z_lo).f64() / 1e3;
    let stated = file.program.blocks.iter().map(off).fold(found, f64::max);
    rule.require_figure("", "worst_defocus_um", worst_um, worst_um.clamp(found, stated), tolerance);
}

/// Holds times and jumps, which follow from the program and the machine file alone.
fn check_times(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
    // Each block's own figures, and their sums with the moves between blocks.
    let mut all = times::stage(file, &facts.machine);
    let mut jumps = 0.0;
    let tolerance = |found: f64| LENGTH * found.max(1.0);
    for ((entry, id), block) in manifest.blocks.iter().zip(&file.ids).zip(&file.program.blocks) {
        let found = times::marking(&file.program, block, &facts.machine);
        let jump = times::jump_mm(&file.program, block);
        rule.require_figure(id, "time_s of the block", entry.time_s, found.total(), tolerance(found.total()));
        rule.require_figure(id, "jump_mm of the block", entry.jump_mm, jump, tolerance(jump));
        let Times { mark, jump: jump_s, delay, .. } = found;
        all.mark += mark;
        all.jump += jump_s;
        all.delay += delay;
        jumps += jump;
    }
    let t = &manifest.summary.time_s;
    let way = way(facts);
    let load_s = load_s(way, facts);
    let loading = &manifest.summary.loading;
    let total_s = all.total() + load_s * file.program.blocks.len() as f64;
    let parts = [
        ("time_s.stage", t.stage, all.stage),
        ("time_s.settle", t.settle, all.settle),
        ("time_s.zoom", t.zoom, all.zoom),
        ("time_s.mark", t.mark, all.mark),
        ("time_s.jump", t.jump, all.jump),
        ("time_s.delay", t.delay, all.delay),
        ("time_s.total", t.total, all.total()),
        ("jump_mm", manifest.summary.jump_mm, jumps),
        ("loading.load_s", loading.load_s, load_s),
        ("loading.total_s", loading.total_s, total_s),
    ];
    for (name, stated, found) in parts {
        rule.require_figure("", name, stated, found, tolerance(found));
    }
    // Of the candidates of `auto` the folder holds the program of one.
    for taken in manifest.summary.candidates.iter().filter(|c| c.method == manifest.summary.method) {
        // Further passes are planned after the choice.
        let most = if file.program.blocks.iter().all(|b| b.pass.0 == 0) { total_s } else { taken.total_s.min(total_s) };
        rule.require_figure("", "total_s of the candidate that was taken", taken.total_s, most, tolerance(total_s));
    }
}

/// The way in which blocks are loaded: as the machine file states it; else by a person, but where `job.ovf` alone can
/// mark the job.
pub(super) fn way(facts: &JobFacts) -> LoadingWay {
    let is_of = |of: fn(&Stepped) -> bool| {
        FORMATS.iter().any(|row| facts.formats.contains(&row.format) && row.stepped.as_ref().is_some_and(of))
    };
    let is_whole = is_of(|files| matches!(files, Stepped::Planes { .. }));
    let is_of_blocks = is_of(|files| matches!(files, Stepped::Blocks(_) | Stepped::Stage { .. }));
    let usual = if is_whole && !is_of_blocks { LoadingWay::Ovf } else { LoadingWay::Person };
    facts.machine.operator.way.unwrap_or(usual)
}

/// Time for one block, s. A person takes 15 s where the machine file does not state it: the default of
/// docs/reference/machine-file.md.
pub(super) fn load_s(way: LoadingWay, facts: &JobFacts) -> f64 {
    let stated = facts.machine.operator.load.map(|load| load.as_s());
    match way {
        LoadingWay::Person => stated.unwrap_or(15.0),
        LoadingWay::Run => stated.unwrap_or(0.0),
        LoadingWay::Card | LoadingWay::Ovf => 0.0,
    }
}

/// Holds who loads the blocks to what the machine file says, and what is stated as assumed.
fn check_loading(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
    let (stated, way) = (&manifest.summary.loading, way(facts));
    let operator = facts.machine.operator;
    let found = [
        ("way", stated.way == way.name()),
        ("assumed", stated.assumed == (operator.way.is_none() || facts.is_built_in)),
        ("load_assumed", stated.load_assumed == (way == LoadingWay::Person && operator.load.is_none())),
    ];
    for (name, holds) in found {
        rule.checked += 1;
        if !holds {
            rule.broken("", PLACE, format!("loading.{name} does not follow from the machine file"));
        }
    }
    let is_shifted = file.program.blocks.iter().any(|b| b.focus_shift.0 != 0);
    let [starts, sets] = [Format::Linuxcnc, Format::Rtc].map(|format| facts.formats.contains(&format));
    let trusts_card = way == LoadingWay::Card || operator.way.is_none() && way == LoadingWay::Person;
    rule.checked += 1;
    if is_shifted && starts && trusts_card && !sets {
        rule.broken("", "stage.ngc", "it starts blocks on the scan card whose focus shift no file sets");
    }
}

/// Holds the slopes under the marks of every block, where the marks are what they should be.
pub(crate) fn slopes(
    manifest: &Manifest,
    file: &ProgramFile,
    facts: &JobFacts,
    geometry: &Geometry,
    marks: &MarkFigures,
    findings: &mut Findings,
) {
    let of_marks = [
        RuleCode::Depth,
        RuleCode::Field,
        RuleCode::Surface,
        RuleCode::Dose,
        RuleCode::Source,
        RuleCode::Once,
        RuleCode::Coverage,
        RuleCode::Travel,
    ];
    if of_marks.iter().any(|&code| findings.rules[code].violated > 0) {
        return;
    }
    let rule = &mut findings.rules[RuleCode::Summary];
    let blocks = &file.program.blocks;
    let entries: Vec<&BlockEntry> = manifest.blocks.iter().collect();
    let count = entries.len().min(blocks.len());
    let faults: Vec<Option<String>> = if blocks.iter().all(|b| b.stop.tilt.is_upright()) {
        // What was found while their depth was measured explains the figures of most.
        let is_explained = |i: usize| {
            let bounds = marks.slopes.get(i).copied().flatten();
            bounds.is_some_and(|bounds| StatedSlopes::from_entry(entries[i]).differs(&bounds).is_none())
        };
        parallel::map(count, |i| {
            if is_explained(i) {
                return None;
            }
            slope_fault(entries[i], file, &blocks[i], facts, geometry, &mut Scratch::default())
        })
    } else {
        let mut scratch = Scratch::default();
        let mut turned: Option<Turned> = None;
        let mut faults = Vec::with_capacity(count);
        for (entry, block) in entries.iter().zip(blocks) {
            let is_turned = Turned::prepare(file, block, facts, geometry, &mut turned);
            let geometry = turned.as_ref().filter(|_| is_turned).map_or(geometry, |t| &t.geometry);
            faults.push(slope_fault(entry, file, block, facts, geometry, &mut scratch));
        }
        faults
    };
    for (id, fault) in file.ids.iter().zip(faults) {
        rule.checked += 1;
        if let Some(text) = fault {
            rule.broken(id, PLACE, text);
        }
    }
}

/// The fault of the slopes that the manifest states of a block.
fn slope_fault(
    entry: &BlockEntry,
    file: &ProgramFile,
    block: &Block,
    facts: &JobFacts,
    geometry: &Geometry,
    scratch: &mut Scratch,
) -> Option<String> {
    let stated = StatedSlopes::from_entry(entry);
    // The marks themselves first; only where that does not explain the figures the facets next to them as well.
    let mut differs = None;
    for sides in [Sides::Ignored, Sides::Followed] {
        let Some(bounds) = slopes::bounds_of_block(file, block, facts, geometry, sides, scratch) else { break };
        differs = stated.differs(&bounds);
        if differs.is_none() {
            break;
        }
    }
    let (name, [lo, hi]) = differs?;
    Some(format!("{name} of the block does not follow from its marks, which have a cosine or dose of {lo} to {hi}"))
}

/// The slopes of a block as the manifest states them: mean and worst, as cosines and doses.
struct StatedSlopes {
    cos: [f64; 2],
    stretched: [f64; 2],
    dose: [f64; 2],
}

impl StatedSlopes {
    fn from_entry(entry: &BlockEntry) -> Self {
        Self {
            cos: entry.incidence_deg.map(|deg| math::cos(deg.to_radians())),
            stretched: entry.stretch.map(|s| 1.0 / s),
            dose: entry.dose,
        }
    }

    /// The first figure that is not within its bounds, and these.
    fn differs(&self, bounds: &Bounds) -> Option<(&'static str, [f64; 2])> {
        let figures = [
            ("incidence_deg", self.cos, bounds.cos),
            ("stretch", self.stretched, bounds.cos),
            ("dose", self.dose, bounds.dose),
        ];
        let outside = |stated: f64, [lo, hi]: [f64; 2]| !(lo - LENGTH <= stated && stated <= hi + LENGTH);
        figures.into_iter().find_map(|(name, stated, wanted)| {
            (0..2).find(|&k| outside(stated[k], wanted[k])).map(|k| (name, wanted[k]))
        })
    }
}

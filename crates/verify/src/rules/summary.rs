//! `summary`: the manifest's figures are the ones found again. A figure that a broken rule has already
//! spoilt is not reported a second time: what is skipped waits for `coverage`, overlaps for `once`, times for
//! `agreement` and `travel`, slopes for all rules of geometry.
//!
//! Of `lower_bound_stops` only this is checked, that there are no fewer stops: a bound is proved by its certificate,
//! which the folder does not hold.

use super::Rule;
use super::coverage::Pieces;
use super::depth_and_field::Marks;
use super::off_axis;
use super::slopes::{self, Bounds};
use super::times::{self, Times};
use super::turned::Turned;
use crate::findings::{Findings, RuleCode};
use crate::geometry::{Geometry, Scratch};
use crate::job_facts::JobFacts;
use crate::read::FORMATS;
use crate::read::formats::Stepped;
use crate::read::manifest::{BlockEntry, Manifest};
use crate::read::program::ProgramFile;
use terrace_core::geom::{BoxMm, NM_PER_MM};
use terrace_core::machine::LoadingWay;
use terrace_core::parallel;
use terrace_core::program::Block;
use terrace_input::job::Format;

/// Lengths agree to this, relative.
const LENGTH: f64 = 1e-9;

/// The worst defocus agrees to this and the tolerance of its height, nm.
const DEFOCUS: f64 = 2.0;

const PLACE: &str = "manifest.json";

/// Holds the sides of the part's box to those of the surface file's own corners.
pub(crate) fn part(stated: [f64; 3], box_mm: BoxMm<2>, geometry: &Geometry, facts: &JobFacts, rule: &mut Rule) {
    let ([x, y], [lo, hi]) = (box_mm.size(), geometry.heights());
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
    marks: &Marks,
    pieces: &Pieces,
    findings: &mut Findings,
) {
    let s = &manifest.summary;
    let found = &pieces.lengths;
    let sound = |r: &Rule| r.violated == 0;
    let once = sound(&findings.rules[RuleCode::Once]) && sound(&findings.rules[RuleCode::Source]);
    let placed = sound(&findings.rules[RuleCode::Agreement]) && sound(&findings.rules[RuleCode::Travel]);
    let covered = once && sound(&findings.rules[RuleCode::Coverage]) && sound(&findings.rules[RuleCode::Surface]);
    let deep = sound(&findings.rules[RuleCode::Depth]) && sound(&findings.rules[RuleCode::Surface]);
    let inside = sound(&findings.rules[RuleCode::Field]);
    let rule = &mut findings.rules[RuleCode::Summary];
    rule.ran = true;
    let mut hold = |id: &str, name: &str, stated: f64, found: f64, tolerance: f64| {
        rule.checked += 1;
        let near = (stated - found).abs() <= tolerance; // never of a NaN
        if !near {
            rule.broken(id, PLACE, format!("{name} is given as {stated}, but is {found}"));
        }
    };
    let tiny = LENGTH * found.texture_mm;
    let stops = super::stops(&file.program) as f64;
    hold("", "stops", s.stops as f64, stops, 0.0);
    hold("", "blocks", s.blocks as f64, file.program.blocks.len() as f64, 0.0);
    hold("", "setups", s.setups as f64, file.origins.len() as f64, 0.0);
    hold("", "passes", f64::from(s.passes), f64::from(facts.passes.count), 0.0);
    hold("", "fragments", s.fragments as f64, file.program.strokes.len() as f64, 0.0);
    // Every block's own are held by its slopes.
    let steepest = manifest.blocks.iter().map(|b| b.incidence_deg[1]).fold(0.0, f64::max);
    let cos = |deg: f64| deg.to_radians().cos();
    hold("", "the cosine of worst_incidence_deg", cos(s.worst_incidence_deg), cos(steepest), LENGTH);
    hold("", "texture_mm", s.texture_mm, found.texture_mm, tiny);
    hold("", "mark_mm", s.mark_mm, found.mark_mm, tiny + pieces.turned_mm);
    for ((entry, id), &mm) in manifest.blocks.iter().zip(&file.ids).zip(&marks.block_mm) {
        hold(id, "mark_mm of the block", entry.mark_mm, mm, LENGTH * mm);
    }
    let bound = s.lower_bound_stops.unwrap_or(0.0);
    hold("", "lower_bound_stops", bound, bound.clamp(0.0, stops), 0.0);
    if placed {
        timing(manifest, file, facts, &mut hold);
    }
    hold("", "dots.texture", s.dots.texture as f64, pieces.dots.texture as f64, 0.0);
    hold("", "dots.marked", s.dots.marked as f64, pieces.dots.marked as f64, 0.0);
    if covered {
        let doubtful = pieces.dots.doubtful as f64;
        let sum = s.dots.marked + s.dots.off_part + s.dots.steep;
        hold("", "the sum of marked and skipped dots", sum as f64, s.dots.texture as f64, 0.0);
        hold("", "dots.off_part", s.dots.off_part as f64, pieces.dots.off_part as f64, doubtful);
        hold("", "dots.steep", s.dots.steep as f64, pieces.dots.steep as f64, doubtful);
    }
    if covered {
        hold("", "strokes_cut", s.strokes_cut as f64, pieces.strokes_cut as f64, 0.0);
        let doubtful = pieces.doubtful_figures as f64;
        hold("", "figures_whole", s.figures_whole as f64, pieces.figures_whole as f64, doubtful);
        let figures = (pieces.figures_whole + pieces.figures_cut) as f64;
        hold("", "the sum of figures", (s.figures_whole + s.figures_cut) as f64, figures, 0.0);
    }
    if once {
        hold("", "overlap_mm", s.overlap_mm, found.overlap_mm, tiny + pieces.rounding_mm);
    }
    if covered {
        let parts = s.skipped_off_part_mm + s.skipped_steep_mm + s.skipped_small_mm;
        let balance = s.mark_mm - s.overlap_mm + s.skipped_mm;
        hold("", "mark_mm - overlap_mm + skipped_mm", balance, s.texture_mm, tiny + pieces.rounding_mm);
        hold("", "skipped_mm", s.skipped_mm, found.skipped_mm, tiny + pieces.rounding_mm);
        hold("", "the sum of skipped parts", parts, s.skipped_mm, tiny);
        // The part's border on the file's own facets is the compiled one to some nanometres at each end.
        let doubt = tiny + pieces.doubt_mm + pieces.rounding_mm;
        hold("", "skipped_off_part_mm", s.skipped_off_part_mm, found.skipped_off_part_mm, doubt);
        hold("", "skipped_steep_mm", s.skipped_steep_mm, found.skipped_steep_mm, doubt);
        hold("", "skipped_small_mm", s.skipped_small_mm, found.skipped_small_mm, doubt);
    }
    if deep {
        let tolerance = (DEFOCUS + marks.worst_tolerance) / 1e3;
        let found = marks.worst_defocus / 1e3;
        // A mark along the part's border may have no facet under it here, yet have its stated heights.
        let off = |b: &Block| (b.z_hi - b.stop.focus).max(b.stop.focus - b.z_lo).f64() / 1e3;
        let stated = file.program.blocks.iter().map(off).fold(found, f64::max);
        let nearest = s.worst_defocus_um.clamp(found, stated);
        hold("", "worst_defocus_um", s.worst_defocus_um, nearest, tolerance);
    }
    if covered && placed && inside {
        rule.checked += 1;
        if let Some(text) = off_axis::fault(&s.off_axis_mm, &file.program) {
            rule.broken("", PLACE, text);
        }
    }
    // Without the job it is not known what its formats are.
    if facts.pens.is_some() {
        loading(manifest, file, facts, rule);
    }
}

/// Holds times and jumps, which follow from the program and the machine file alone.
fn timing(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, hold: &mut impl FnMut(&str, &str, f64, f64, f64)) {
    // Each block's own figures, and their sums with the moves between blocks.
    let mut all = times::stage(file, &facts.machine);
    let mut jumps = 0.0;
    let near = |found: f64| LENGTH * found.max(1.0);
    for ((entry, id), block) in manifest.blocks.iter().zip(&file.ids).zip(&file.program.blocks) {
        let (found, jump) =
            (times::marking(&file.program, block, &facts.machine), times::jump_mm(&file.program, block));
        hold(id, "time_s of the block", entry.time_s, found.total(), near(found.total()));
        hold(id, "jump_mm of the block", entry.jump_mm, jump, near(jump));
        let Times { mark, jump: jump_s, delay, .. } = found;
        (all.mark, all.jump, all.delay, jumps) = (all.mark + mark, all.jump + jump_s, all.delay + delay, jumps + jump);
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
        hold("", name, stated, found, near(found));
    }
    // Of the candidates of `auto` the folder holds the program of one.
    for taken in manifest.summary.candidates.iter().filter(|c| c.method == manifest.summary.method) {
        // Further passes are planned after the choice.
        let most = if file.program.blocks.iter().all(|b| b.pass.0 == 0) { total_s } else { taken.total_s.min(total_s) };
        hold("", "total_s of the candidate that was taken", taken.total_s, most, near(total_s));
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

/// Time for one block, s: a person takes 15 s where the machine file does not state it.
pub(super) fn load_s(way: LoadingWay, facts: &JobFacts) -> f64 {
    let stated = facts.machine.operator.load.map(|load| load.as_s());
    match way {
        LoadingWay::Person => stated.unwrap_or(15.0),
        LoadingWay::Run => stated.unwrap_or(0.0),
        LoadingWay::Card | LoadingWay::Ovf => 0.0,
    }
}

/// Holds who loads the blocks to what the machine file says, and what is stated as assumed.
fn loading(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
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
    marks: &Marks,
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
        let is_as_found = |i: usize| {
            marks.slopes.get(i).copied().flatten().is_some_and(|b| Stated::of(entries[i]).differs(&b).is_none())
        };
        parallel::map(count, |i| {
            if is_as_found(i) {
                return None;
            }
            slope_fault(entries[i], file, &blocks[i], facts, geometry, &mut Scratch::default())
        })
    } else {
        let mut scratch = Scratch::default();
        let mut turned: Option<Turned> = None;
        let mut at = |i: usize| {
            let is_turned = Turned::of(file, &blocks[i], facts, geometry, &mut turned);
            let geometry = turned.as_ref().filter(|_| is_turned).map_or(geometry, |t| &t.geometry);
            slope_fault(entries[i], file, &blocks[i], facts, geometry, &mut scratch)
        };
        (0..count).map(&mut at).collect()
    };
    for (id, fault) in file.ids.iter().zip(faults) {
        rule.checked += 1;
        if let Some(text) = fault {
            rule.broken(id, PLACE, text);
        }
    }
}

/// What is wrong with the slopes that the manifest states of a block.
fn slope_fault(
    entry: &BlockEntry,
    file: &ProgramFile,
    block: &Block,
    facts: &JobFacts,
    geometry: &Geometry,
    scratch: &mut Scratch,
) -> Option<String> {
    let stated = Stated::of(entry);
    // The marks themselves first; only where that does not explain the figures the facets next to them as well.
    let mut differs = None;
    for sides in [false, true] {
        let Some(bounds) = slopes::of(file, block, facts, geometry, sides, scratch) else { break };
        differs = stated.differs(&bounds);
        if differs.is_none() {
            break;
        }
    }
    let (name, [lo, hi]) = differs?;
    Some(format!("{name} of the block does not follow from its marks, which have a cosine or dose of {lo} to {hi}"))
}

/// What the manifest says of a block's slopes: mean and worst, as cosines and doses.
struct Stated {
    cos: [f64; 2],
    stretched: [f64; 2],
    dose: [f64; 2],
}

impl Stated {
    fn of(entry: &BlockEntry) -> Self {
        Self {
            cos: entry.incidence_deg.map(|deg| deg.to_radians().cos()),
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

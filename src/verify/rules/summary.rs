//! `summary`: the manifest's figures are the ones found again. A figure that a broken rule has already
//! spoilt is not reported a second time: what is skipped waits for `coverage`, overlaps for `once`.

use super::Findings;
use super::marks::Marks;
use super::pieces::Pieces;
use crate::program::Block;
use crate::verify::read::manifest::Manifest;
use crate::verify::read::program::ProgramFile;

/// Lengths agree to this, relative.
const LENGTH: f64 = 1e-9;

/// The worst defocus agrees to this and the tolerance of its height, nm.
const DEFOCUS: f64 = 2.0;

const PLACE: &str = "manifest.json";

/// Holds the rule.
pub(in crate::verify) fn check(
    manifest: &Manifest,
    file: &ProgramFile,
    marks: &Marks,
    pieces: &Pieces,
    findings: &mut Findings,
) {
    let s = &manifest.summary;
    let found = &pieces.lengths;
    let sound = |r: &super::Rule| r.violated == 0;
    let once = sound(&findings.once) && sound(&findings.source);
    let covered = once && sound(&findings.coverage) && sound(&findings.ground);
    let deep = sound(&findings.depth) && sound(&findings.ground);
    let rule = &mut findings.summary;
    rule.ran = true;
    let mut hold = |id: &str, name: &str, stated: f64, found: f64, tolerance: f64| {
        rule.checked += 1;
        let near = (stated - found).abs() <= tolerance; // never of a NaN
        if !near {
            rule.broken(id, PLACE, format!("{name} is stated as {stated}, found is {found}"));
        }
    };
    let tiny = LENGTH * found.texture_mm;
    hold("", "stops", s.stops as f64, file.program.blocks.len() as f64, 0.0);
    hold("", "setups", s.setups as f64, file.origins.len() as f64, 0.0);
    hold("", "fragments", s.fragments as f64, file.program.strokes.len() as f64, 0.0);
    hold("", "texture_mm", s.texture_mm, found.texture_mm, tiny);
    // Errors of the ends of marks on tilted parts are independent of each other.
    let turned = 20.0 * (pieces.turned as f64).sqrt() / crate::geom::NM_PER_MM;
    hold("", "mark_mm", s.mark_mm, found.mark_mm, tiny + turned);
    for ((entry, id), &mm) in manifest.blocks.iter().zip(&file.ids).zip(&marks.block_mm) {
        hold(id, "mark_mm of the block", entry.mark_mm, mm, LENGTH * mm);
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
        let doubt = tiny + pieces.doubt_mm;
        hold("", "skipped_off_part_mm", s.skipped_off_part_mm, found.skipped_off_part_mm, doubt);
        hold("", "skipped_steep_mm", s.skipped_steep_mm, found.skipped_steep_mm, doubt);
        hold("", "skipped_small_mm", s.skipped_small_mm, found.skipped_small_mm, doubt);
    }
    if deep {
        let tolerance = (DEFOCUS + marks.worst_tolerance) / 1e3;
        let found = marks.worst_defocus / 1e3;
        // A mark along the part's border may have no facet under it here, yet have its stated heights.
        let off = |b: &Block| (b.z_hi - b.stop.focus).max(b.stop.focus - b.z_lo) as f64 / 1e3;
        let stated = file.program.blocks.iter().map(off).fold(found, f64::max);
        let nearest = s.worst_defocus_um.clamp(found, stated);
        hold("", "worst_defocus_um", s.worst_defocus_um, nearest, tolerance);
    }
}

//! On-the-fly jobs proved from their files, and a mutant or more for each rule that this rule reports.

mod made;

use made::{BOWL, Bench, DOME};

use crate::fly::program::{Move, Program};
use crate::verify::{Proof, verify};

fn broken(proof: &Proof) -> Vec<&'static str> {
    proof.rules.iter().filter(|r| r.violated > 0).map(|r| r.code).collect()
}

fn assert_only(code: &str, proof: &Proof) {
    assert_eq!(broken(proof), [code], "{}", proof.to_text());
    assert!(!proof.ok);
}

/// What a sound job comes to, for the documents.
fn told(name: &str, bench: &Bench, proof: &Proof) {
    let folder = bench.written(bench.checked());
    let size = |f: &str| std::fs::metadata(folder.join(f)).map_or(0, |m| m.len());
    let f = *bench.checked().figures();
    eprintln!(
        "{name}: {} nodes, {} moves, {} marks, {:.3} s, {:.1} mm; position {:.4} um, focus {:.2} um, angle {:.3} deg, \
         displacement {:.3} mm, laser {:.4} mm, corner {:.1} mm/s; ngc {} B, pmc {} B; X {:?}",
        bench.motion.time.len(),
        bench.program.moves.len(),
        f.marks,
        f.time_s,
        proof.lengths.mark_mm,
        proof.worst_position_um.unwrap_or(f64::NAN),
        proof.worst_defocus_um,
        proof.worst_incidence_deg,
        f.displacement_mm,
        f.laser_error_mm,
        f.corner_mm_s,
        size("fly.ngc"),
        size("fly.pmc"),
        f.peaks[0],
    );
}

#[test]
fn five_axes_on_a_dome_are_proved() {
    let bench = Bench::new(DOME);
    let proof = verify(&bench.written(bench.checked()), None).unwrap_or_else(|e| panic!("{e}"));
    told("dome", &bench, &proof);
    assert!(proof.ok, "{}", proof.to_text());
    assert!(proof.rules.iter().all(|r| r.checked > 0), "{}", proof.to_text());
    assert!(proof.worst_position_um.is_some_and(|p| p < 0.1), "{}", proof.to_text());
    let l = proof.lengths;
    assert!((l.mark_mm - l.overlap_mm + l.skipped_mm - l.texture_mm).abs() < 1e-3, "{l:?}");
    assert!(l.mark_mm > 500.0 && l.overlap_mm < 0.01, "{l:?}");
}

#[test]
fn seven_axes_on_a_bowl_are_proved() {
    let bench = Bench::new(BOWL);
    let proof = verify(&bench.written(bench.checked()), None).unwrap_or_else(|e| panic!("{e}"));
    told("bowl", &bench, &proof);
    assert!(proof.ok, "{}", proof.to_text());
    assert!(proof.worst_position_um.is_some_and(|p| p < 0.2), "{}", proof.to_text());
    assert!(proof.worst_incidence_deg < 5.0, "the beam follows the normal");
}

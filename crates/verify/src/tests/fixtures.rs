//! Fixtures and the table beside the job made by hand: the head passes 55 mm around its axis, 140 mm above its focal
//! planes; from the second block to the third it lifts.

use super::made::Made;
use super::{assert_only, broken};
use terrace_core::units::Length;

/// A job with a box.
fn beside(fixture: [[f64; 3]; 2]) -> Made {
    Made { fixtures: vec![fixture], ..Made::new() }
}

/// Nearer than 55 mm to the way between the second and the third stop, 20 mm from each along it, and to no stop.
const BESIDE_THE_WAY: [[f64; 3]; 2] = [[39.9, 64.6, 0.0], [40.1, 70.0, 142.0]];

#[test]
fn a_clamp_beside_the_way_is_passed_with_a_lift_and_not_without() {
    let sound = beside(BESIDE_THE_WAY);
    let proof = sound.proof();
    assert!(proof.ok, "{}", proof.to_text());
    let mut flat = sound;
    flat.blocks[2].retract = false;
    flat.renew();
    let proof = flat.proof();
    assert_only("clearance", &proof);
    assert!(proof.to_text().contains("nearer to fixture \"clamp\" than"), "{}", proof.to_text());
    // Without the clamp nothing asks for the lift.
    flat.fixtures.clear();
    assert!(flat.proof().ok);
}

#[test]
fn clearance_reports_a_clamp_that_stands_in_the_way_of_the_head() {
    // 54.9 mm and 55.1 mm from the axis over the first stop.
    let clamp = |y: f64, top: f64| beside([[19.0, y, -5.0], [21.0, y + 5.0, top]]).proof();
    assert_only("clearance", &clamp(64.9, 141.0));
    assert!(clamp(65.1, 141.0).ok);
    assert!(clamp(64.9, 139.0).ok);
    // A sheet without a level facet.
    let wall = [[-900.0, 64.9, 0.0], [900.0, 64.9, 150.0]];
    assert_only("clearance", &beside(wall).proof());
}

#[test]
fn surface_reports_a_clamp_that_is_in_the_way_of_a_beam() {
    // Marks run along x at y = 2 to 18 mm. At 20 mm above the focal plane of a spot of 20 um at 355 nm the beam has a
    // radius of 0.226 mm.
    let clamp = |y: f64, z: [f64; 2]| beside([[5.0, y, z[0]], [15.0, y + 0.9, z[1]]]).proof();
    assert_only("surface", &clamp(18.3, [0.0, 20.0]));
    assert!(clamp(18.5, [0.0, 20.0]).ok);
    assert!(clamp(18.3, [0.0, 10.0]).ok);
    let over = clamp(9.5, [50.0, 60.0]);
    assert_only("surface", &over);
    assert!(over.to_text().contains("fixture \"clamp\" is in the way of the beam"), "{}", over.to_text());
    // Below all marks of the block it is in nobody's way.
    assert!(clamp(9.5, [-20.0, -0.5]).ok);
}

#[test]
fn clearance_reports_a_part_in_the_table_and_a_head_near_to_it() {
    let on_table = |mm: f64, origin_mm: i64| {
        let mut made = Made::new();
        made.facts.machine.stage.table = Some(Length::mm(mm));
        made.origin.0[2] = origin_mm * super::made::MM;
        made.renew();
        made.proof()
    };
    assert!(on_table(0.0, 0).ok);
    // Less deep than the depth range of 0.4 mm.
    assert!(on_table(0.39, 0).ok);
    let deep = on_table(0.41, 0);
    assert_only("clearance", &deep);
    assert_eq!(broken(&deep).len(), 1, "{}", deep.to_text());
    assert!(on_table(-30.0, -30).ok);
    assert_only("clearance", &on_table(-29.0, -30));
}

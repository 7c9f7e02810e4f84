//! Mutants of jobs of several set-ups.

use super::super::broken;
use super::*;
use terrace_core::program::SetupId;

/// The same job marked in three set-ups, though one would do.
fn placed() -> Bench {
    let tables = "setups = { columns = 3, registration = [[\"0 mm\", \"0 mm\"], [\"60 mm\", \"0 mm\"]] }";
    Bench::written("0 deg", "section = \"15 mm\"", tables, 1.0, "[\"dxf\", \"linuxcnc\", \"gcode\"]")
}

fn first_of(program: &Program, setup: u32) -> usize {
    program.blocks.iter().position(|b| b.setup == SetupId(setup)).expect("a set-up")
}

#[test]
fn set_ups_verify() {
    let bench = placed();
    assert_eq!(bench.plan.checked.origins().len(), 3);
    let proof = verified(&bench.write());
    assert!(proof.ok, "{}", proof.to_text());
}

#[test]
fn travel_reports_a_block_in_another_set_up() {
    // It is sent to where it would lie in its own.
    let proof = placed().mutant(|program, _| {
        let first = first_of(program, 1);
        program.blocks[first].setup = SetupId(0);
    });
    assert_only("travel", &proof);
    // A block of the first set-up after those of the second, where it is over its place.
    let proof = placed().mutant(|program, plan| {
        let last = first_of(program, 2) - 1;
        program.blocks[last].setup = SetupId(0);
        place(&mut program.blocks[last], plan);
    });
    assert_only("agreement", &proof);
}

#[test]
fn travel_reports_a_wrong_origin_of_a_set_up() {
    for by in [[100, 0, 0], [0, 1_000_000, 0], [0, 0, 100]] {
        let mut bench = placed();
        let mut origins = bench.plan.checked.origins().to_vec();
        (0..3).for_each(|k| origins[1][k] += by[k]);
        bench.plan.checked = Checked::unchecked_setups(bench.plan.checked.program().clone(), origins);
        assert_only("travel", &verified(&bench.write()));
    }
    // All agree, but at another height, or off the increment.
    for by in [[0, 0, 100], [50, 0, 0]] {
        let mut bench = placed();
        let mut origins = bench.plan.checked.origins().to_vec();
        (0..3).for_each(|k| origins[1][k] += by[k]);
        let mut program = bench.plan.checked.program().clone();
        bench.plan.checked = Checked::unchecked_setups(program.clone(), origins);
        program.blocks.iter_mut().filter(|b| b.setup == SetupId(1)).for_each(|b| place(b, &bench.plan));
        let origins = bench.plan.checked.origins().to_vec();
        bench.plan.checked = Checked::unchecked_setups(program, origins);
        assert_only("travel", &verified(&bench.write()));
    }
}

#[test]
fn laser_reports_a_set_up_without_its_stop() {
    let bench = placed();
    for name in ["stage.ngc", "stage_m0.nc"] {
        let proof = bench.damaged(name, |bytes| replace(bytes, "(SETUP 2", "\nM0\n", "\n"));
        assert!(broken(&proof).contains(&"laser"), "{}", proof.to_text());
        // Without a trace of it.
        let proof = bench.damaged(name, |bytes| {
            let text = String::from_utf8(std::mem::take(bytes)).expect("text");
            let (from, to) =
                (text.find("(SETUP 3").expect("a set-up"), text.find("set-up 3 of 3)\nM0\n").expect("its stop"));
            *bytes = (text[..from].to_owned() + &text[to + "set-up 3 of 3)\nM0\n".len()..]).into_bytes();
        });
        assert_only("agreement", &proof);
        // Not lifted.
        let proof = bench.damaged(name, |bytes| replace(bytes, "(SETUP 2", "G0 Z200.000000\n(MSG", "(MSG"));
        assert_only("agreement", &proof);
        // Another set-up's number.
        let proof = bench.damaged(name, |bytes| replace(bytes, "(SETUP 2", "(SETUP 2", "(SETUP 3"));
        assert!(broken(&proof).contains(&"agreement"), "{}", proof.to_text());
    }
    // START before the part lies.
    let proof = bench.damaged("stage.ngc", |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).expect("text");
        let (stop, start) = (text.find("(SETUP 2").expect("a set-up"), text.find("M64 P0").expect("a start"));
        let end = start + text[start..].find("o2 endif\n").expect("its end") + "o2 endif\n".len();
        let fires = text[start..end].replace("o1 ", "o9001 ").replace("o2 ", "o9002 ");
        let at = stop + text[stop..].find("M65 P0\n").expect("output off") + "M65 P0\n".len();
        *bytes = (text[..at].to_owned() + &fires + &text[at..]).into_bytes();
    });
    assert_only("laser", &proof);
}

#[test]
fn agreement_reports_registration_that_differs() {
    let bench = placed();
    for change in [
        (|m: &mut serde_json::Value| m["setups"][1]["registration"][0]["stage"][0] = 1.0.into())
            as fn(&mut serde_json::Value),
        |m| m["setups"][1]["registration"][0]["point_mm"][1] = 1.0.into(),
        |m| _ = m["setups"][2]["registration"].as_array_mut().expect("points").pop(),
        |m| m["setups"][0]["origin_mm"][0] = 7.0.into(),
        |m| m["blocks"][0]["setup"] = 2.into(),
        |m| _ = m["setups"].as_array_mut().expect("set-ups").pop(),
    ] {
        let target = bench.write();
        alter_manifest(&target, change);
        assert_only("agreement", &verified(&target));
    }
}

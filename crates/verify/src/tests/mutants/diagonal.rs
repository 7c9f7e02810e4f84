//! Mutants of jobs on a machine that moves z together with x and y and settles by axis.

use super::sheets::edited;
use super::*;

/// A machine file with both keys.
fn machine(text: Vec<u8>) -> Vec<u8> {
    let text = String::from_utf8(text).expect("text");
    let changed =
        text.replacen("settle = \"0.1 s\"", "diagonal = true\nsettle = { xy = \"0.2 s\", z = \"0.06 s\" }", 1);
    assert_ne!(changed, text);
    changed.into_bytes()
}

fn bench() -> Bench {
    let files = [("machine.toml", machine(head("xyz-galvo-40", "150 mm", "110 mm")))];
    Bench::edited_beside(1.0, &files, |text| text.replacen("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"", 1))
}

/// The first line of a stage program that moves all three axes.
fn diagonal(text: &str) -> &str {
    text.lines().find(|l| l.starts_with("G0 X") && l.contains(" Z")).expect("a diagonal")
}

#[test]
#[ignore = "slow: make test-all"]
fn diagonals_verify_in_every_format_and_passes_too() {
    for tables in ["", "passes = { count = 3, rotate = \"67 deg\", lower = \"8 um\" }"] {
        let files = [("machine.toml", machine(head("xyz-galvo-40", "150 mm", "110 mm")))];
        let bench = Bench::edited_beside(1.0, &files, |text| {
            let text = text.replacen("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"", 1);
            text.replacen("machine =", &format!("{tables}\n            machine ="), 1)
        });
        let folder = bench.write();
        for name in ["stage.ngc", "stage_m0.nc"] {
            diagonal(&std::fs::read_to_string(folder.join(name)).expect("a program"));
        }
        let proof = verified(&folder);
        assert!(proof.ok, "{}", proof.to_text());
    }
}

#[test]
fn agreement_reports_a_diagonal_in_two_lines_and_one_on_a_machine_without_them() {
    let split = |t: &str| {
        let line = diagonal(t);
        let (across, along) = line.split_once(" Z").expect("a diagonal");
        t.replacen(line, &format!("{across}\nG0 Z{along}"), 1)
    };
    let joined = |t: &str| {
        let at = t.find("(BLOCK B0002").expect("a block");
        let across = at + t[at..].find("G0 X").expect("a move");
        t[..across].to_owned() + &t[across..].replacen("\nG0 Z", " Z", 1)
    };
    for name in ["stage.ngc", "stage_m0.nc"] {
        assert_only("agreement", &edited(&bench(), name, split));
        assert_only(
            "agreement",
            &edited(&Bench::written("0 deg", "", "", 1.0, "[\"linuxcnc\", \"gcode\"]"), name, joined),
        );
    }
}

#[test]
fn agreement_reports_a_block_that_does_not_say_where_to_begin() {
    let gone = |t: &str| {
        let at = t.find("(ENTRY GO X").expect("a place to begin at");
        let end = at + t[at..].find('\n').expect("a line") + 1;
        t[..at].to_owned() + &t[end..]
    };
    // Elsewhere than over the block its own diagonal would begin.
    let other = |t: &str| {
        let at = t.find("(ENTRY GO X").expect("a place to begin at") + "(ENTRY GO X".len();
        t[..at].to_owned() + "1" + t[at..].trim_start_matches('-')
    };
    assert_only("agreement", &edited(&bench(), "stage.ngc", gone));
    assert_only("agreement", &edited(&bench(), "stage.ngc", other));
}

#[test]
fn laser_reports_a_dwell_that_is_too_short_for_the_axes_that_moved() {
    let short = |t: &str| t.replacen("G4 P0.200", "G4 P0.060", 1);
    let long = |t: &str| t.replacen("G4 P0.060", "G4 P0.200", 1);
    let text = std::fs::read_to_string(bench().write().join("stage.ngc")).expect("a program");
    assert!(text.contains("G4 P0.060\n") && text.contains("G4 P0.200\n"));
    assert_only("laser", &edited(&bench(), "stage.ngc", short));
    assert_only("laser", &edited(&bench(), "stage.ngc", long));
}

#[test]
fn clearance_reports_a_diagonal_where_only_a_lift_is_clear() {
    let formats = "[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]";
    let sound = Bench::near_on(machine(head("xyz-galvo-40", "12 mm", "10 mm")), formats);
    let proof = verified(&sound.write());
    assert!(proof.ok, "{}", proof.to_text());
    let proof = sound.mutant(|program, _| program.blocks.iter_mut().for_each(|b| b.retract = false));
    assert_only("clearance", &proof);
}

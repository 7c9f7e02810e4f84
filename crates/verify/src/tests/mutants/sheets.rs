//! Mutants of what the operator reads, of the way between blocks, and of the figures of the manifest.

use super::*;
use crate::tests::broken;

/// Changes the text of a file of the written folder, renews its hash, and verifies.
pub(super) fn edited(bench: &Bench, name: &str, change: impl FnOnce(&str) -> String) -> Proof {
    bench.damaged(name, |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).expect("text");
        let changed = change(&text);
        assert_ne!(changed, text, "the damage does nothing");
        *bytes = changed.into_bytes();
    })
}

/// The text with two of its lines exchanged: those that hold `a` and `b`, but for their first `keep` characters.
fn exchanged(text: &str, a: &str, b: &str, keep: usize) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let at = |what: &str| lines.iter().position(|l| l.contains(what)).expect("a line");
    let (i, j) = (at(a), at(b));
    let mut out: Vec<String> = lines.iter().map(|l| (*l).to_owned()).collect();
    out[i] = lines[i][..keep].to_owned() + &lines[j][keep..];
    out[j] = lines[j][..keep].to_owned() + &lines[i][keep..];
    out.join("\n") + "\n"
}

#[test]
fn agreement_reports_comments_that_name_another_block_or_drawing() {
    let bench = Bench::new();
    for name in ["stage.ngc", "stage_m0.nc"] {
        let proof = edited(&bench, name, |t| t.replacen("FILE blocks/B0003.dxf", "FILE blocks/B0004.dxf", 1));
        assert_only("agreement", &proof);
        let proof = edited(&bench, name, |t| {
            let t = t.replacen("FILE blocks/B0003.dxf", "FILE blocks/X.dxf", 1);
            let t = t.replacen("FILE blocks/B0004.dxf", "FILE blocks/B0003.dxf", 1);
            t.replacen("FILE blocks/X.dxf", "FILE blocks/B0004.dxf", 1)
        });
        assert_only("agreement", &proof);
    }
    assert_only("agreement", &edited(&bench, "stage_m0.nc", |t| t.replacen("M0 (mark B0003)", "M0 (mark B0004)", 1)));
    assert_only("agreement", &edited(&bench, "stage_m0.nc", |t| t.replacen("M0 (mark B0003)", "M0", 1)));
    let proof = edited(&bench, "stage.ngc", |t| t.replacen("no BUSY, block B0003", "no BUSY, block B0005", 1));
    assert_only("agreement", &proof);
}

#[test]
fn agreement_reports_a_line_number_of_another_block_and_an_entry_without_its_lift() {
    let bench = Bench::written("0 deg", "", "", 1.0, "[\"linuxcnc\"]");
    for (old, new) in [
        ("\nN3 M65 P0\n", "\nN4 M65 P0\n"),
        ("(ENTRY LIFT Z200.000000)\n", ""),
        ("(ENTRY LIFT Z200.000000)\n", "(ENTRY LIFT Z100.000000)\n"),
    ] {
        let proof = edited(&bench, "stage.ngc", |t| {
            assert!(t.contains(old), "{old}");
            t.replacen(old, new, 1)
        });
        assert_only("agreement", &proof);
    }
}

#[test]
fn agreement_reports_run_sheets_with_another_place_order_drawing_or_pen() {
    let bench = Bench::written("0 deg", "", "", 1.0, "[\"dxf\"]");
    assert!(verified(&bench.write()).ok);
    let block = &bench.plan.checked.program().blocks[2];
    let x = terrace_core::geom::mm_from_nm(block.stage[0]);
    let csv = |t: &str, old: &str, new: &str| {
        let at = t.find("\nB0003,").expect("a row");
        t[..at].to_owned() + &t[at..].replacen(old, new, 1)
    };
    let proof = edited(&bench, "runsheet.csv", |t| csv(t, &format!(",{x:.6},"), &format!(",{:.6},", x + 1.0)));
    assert_only("agreement", &proof);
    let proof = edited(&bench, "runsheet.csv", |t| csv(t, &format!(",{x:.6},"), &format!(",{:.6},", x + 0.000_1)));
    assert_only("agreement", &proof);
    assert_only("agreement", &edited(&bench, "runsheet.csv", |t| exchanged(t, "B0003,", "B0004,", 0)));
    assert_only("agreement", &edited(&bench, "runsheet.csv", |t| exchanged(t, "B0003,", "B0004,", 6)));
    assert_only("agreement", &edited(&bench, "runsheet.csv", |t| csv(t, "blocks/B0003.dxf", "blocks/B0004.dxf")));
    let txt = |t: &str, old: &str, new: &str| {
        let at = t.find("\n[ ] B0003 ").expect("a row");
        t[..at].to_owned() + &t[at..].replacen(old, new, 1)
    };
    let proof = edited(&bench, "runsheet.txt", |t| txt(t, &format!("{x:>11.4}"), &format!("{:>11.4}", x + 1.0)));
    assert_only("agreement", &proof);
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| exchanged(t, "[ ] B0003 ", "[ ] B0004 ", 0)));
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| exchanged(t, "[ ] B0003 ", "[ ] B0004 ", 10)));
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| txt(t, "blocks/B0003.dxf", "blocks/B0004.dxf")));
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| t.replacen("part zero  X", "part zero  X1", 1)));
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| t.replacen("8 W = 8 W", "8 W = 9 W", 1)));
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| t.replacen("        500  ", "        501  ", 1)));
}

#[test]
fn agreement_reports_a_further_column_of_a_run_sheet_and_checks_lifts() {
    let bench = Bench::near();
    let proof = edited(&bench, "runsheet.csv", |t| {
        let note = |i: usize| if i == 0 { "note" } else { "\"a, b\"" };
        t.lines().enumerate().map(|(i, l)| format!("{l},{}\n", note(i))).collect()
    });
    assert_only("agreement", &proof);
    // The last lift is missing, goes elsewhere, or is on the way to another block.
    let last = |t: &str, new: &dyn Fn(&str) -> String| -> String {
        let at = t.rfind("  LIFT to").expect("a lift");
        let end = at + t[at..].find('\n').expect("a line") + 1;
        t[..at].to_owned() + &new(&t[at..end]) + &t[end..]
    };
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| last(t, &|_| String::new())));
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| last(t, &|l| l.replace("Z2", "Z1"))));
    assert_only("agreement", &edited(&bench, "runsheet.txt", |t| last(t, &|l| l.replace("to B", "to B1"))));
    // The first lift of the table, which has the z of every lift in one column.
    let lift = ",200.000000,0.000000\n";
    assert_only("agreement", &edited(&bench, "runsheet.csv", |t| t.replacen(lift, ",,0.000000\n", 1)));
    assert_only("agreement", &edited(&bench, "runsheet.csv", |t| t.replacen(",,0.000000\n", lift, 1)));
}

#[test]
fn agreement_reports_a_first_move_that_does_not_lift() {
    let bench = Bench::new();
    for name in ["stage.ngc", "stage_m0.nc"] {
        let proof = edited(&bench, name, |t| {
            let at = t.find("(BLOCK B0001").expect("a block");
            let lift = at + t[at..].find("G0 Z").expect("a lift");
            let end = lift + t[lift..].find('\n').expect("a line") + 1;
            t[..lift].to_owned() + &t[end..]
        });
        assert_only("agreement", &proof);
    }
}

#[test]
fn clearance_reports_missing_lifts() {
    for formats in ["[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]", "[\"dxf\"]"] {
        let sound = Bench::near_with(formats);
        let proof = verified(&sound.write());
        assert!(proof.ok && proof.rule("clearance").is_some_and(|r| r.checked >= 12), "{}", proof.to_text());
        let proof = sound.mutant(|program, _| program.blocks.iter_mut().for_each(|b| b.retract = false));
        assert_only("clearance", &proof);
    }
}

#[test]
fn clearance_reports_lifts_missing_before_a_tilt() {
    let sound = Bench::tilted_near();
    let proof = verified(&sound.write());
    assert!(proof.ok, "{}", proof.to_text());
    let proof = sound.mutant(|program, _| program.blocks.iter_mut().for_each(|b| b.retract = false));
    assert!(proof.rule("clearance").is_some_and(|r| r.violated > 0), "{}", proof.to_text());
}

#[test]
fn agreement_reports_wrong_delays_and_machine_of_the_ovf() {
    let mut bench = Bench::new();
    let machine = bench.plan.machine.clone();
    let mut job = |change: &dyn Fn(&mut terrace_core::machine::Machine)| {
        change(&mut bench.plan.machine);
        let wrong = bench.write();
        let ovf = std::fs::read(wrong.join("job.ovf")).expect("an OVF");
        bench.plan.machine = machine.clone();
        bench.damaged("job.ovf", |bytes| {
            assert_ne!(*bytes, ovf, "the damage does nothing");
            *bytes = ovf;
        })
    };
    let late = terrace_core::units::Time::us(250.0);
    assert_only("agreement", &job(&|m| m.delays.laser_on = late));
    assert_only("agreement", &job(&|m| m.delays.laser_off = late));
    assert_only("agreement", &job(&|m| m.delays.polygon = late));
    assert_only("agreement", &job(&|m| m.scanner.jump_speed = terrace_core::units::Speed::mm_s(4000.0)));
    assert_only("agreement", &job(&|m| m.stage.x.carries = terrace_core::machine::Carries::Head));
}

#[test]
fn summary_reports_wrong_times_slopes_dose_and_bound() {
    let bench = Bench::new();
    let wrong = |change: &dyn Fn(&mut serde_json::Value)| {
        let target = bench.write();
        alter_manifest(&target, |m| change(m));
        verified(&target)
    };
    let scaled = |v: &mut serde_json::Value, by: f64| *v = (v.as_f64().expect("a number") * by).into();
    // The waits of the stage program follow from it.
    let slow = wrong(&|m| scaled(&mut m["blocks"][3]["time_s"], 3.0));
    assert_eq!(broken(&slow), ["laser", "summary"], "{}", slow.to_text());
    assert_only("summary", &wrong(&|m| scaled(&mut m["blocks"][3]["jump_mm"], 1.001)));
    for key in ["incidence_deg", "stretch", "dose"] {
        for k in 0..2 {
            assert_only("summary", &wrong(&|m| scaled(&mut m["blocks"][3][key][k], 1.02)));
        }
    }
    for key in ["stage", "settle", "mark", "jump", "delay", "total"] {
        assert_only("summary", &wrong(&|m| scaled(&mut m["summary"]["time_s"][key], 1.01)));
    }
    assert_only("summary", &wrong(&|m| m["summary"]["lower_bound_stops"] = 1_000_000.into()));
}

#[test]
fn agreement_reports_numbers_of_lines_where_no_block_begins() {
    let bench = Bench::new();
    // Who begins there fires where the stage stands, or skips its moves.
    let moved = |after: &'static str| {
        edited(&bench, "stage.ngc", move |t| {
            let at = t.find("N4 M65 P0").expect("block 4");
            let to = at + t[at..].find(after).expect("a line of it");
            t[..at].to_owned() + &t[at + 3..to] + "N4 " + &t[to..]
        })
    };
    assert_only("agreement", &moved("M64 P0"));
    assert_only("agreement", &moved("G0 Z"));
    assert_only("agreement", &edited(&bench, "stage.ngc", |t| t.replacen("N4 M65 P0", "N4 M65 P0\nN4 M65 P0", 1)));
}

#[test]
fn agreement_reports_files_that_nobody_has_read() {
    let bench = Bench::with("", "");
    for name in ["blocks/B0001.rtc", "blocks/B9999.dxf", "frames/B0001-frame.dxf"] {
        let target = bench.write();
        let path = target.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
        std::fs::write(&path, "burn").expect("a writable folder");
        alter_manifest(&target, |m| {
            let hash = blake3::hash(b"burn").to_hex();
            let entry = serde_json::json!({ "file": name, "bytes": 4, "blake3": hash.as_str() });
            m["files"].as_array_mut().expect("files").push(entry);
        });
        assert_only("agreement", &verified(&target));
    }
}

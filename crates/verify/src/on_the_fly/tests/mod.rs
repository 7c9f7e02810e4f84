//! On-the-fly jobs proved from their files, and a mutant or more for each rule that this rule reports.

mod made;

use made::{BOWL, Bench, DOME, Planned};

use crate::read::leaves::ON_THE_FLY;
use crate::tests::places::{unproved_leaves, unproved_words};
use crate::{Proof, verify};
use terrace_core::program::{PenId, PieceId, StrokeId};
use terrace_plan::on_the_fly::check::Checked;
use terrace_plan::on_the_fly::program::{Move, Program};

fn broken(proof: &Proof) -> Vec<&'static str> {
    proof.rules.iter().filter(|r| r.violated > 0).map(|r| r.code).collect()
}

fn assert_only(code: &str, proof: &Proof) {
    assert_eq!(broken(proof), [code], "{}", proof.to_text());
    assert!(!proof.ok);
}

/// Prints the figures of a sound job, for the documents.
fn print_figures(name: &str, bench: &Bench, proof: &Proof) {
    let folder = bench.written(bench.checked());
    let size = |f: &str| std::fs::metadata(folder.join(f)).map_or(0, |m| m.len());
    let f = *bench.checked().figures();
    eprintln!(
        "{name}: {} nodes, {} moves, {} marks, {:.3} s, {:.1} mm; position {:.4} um, focus {:.2} um, angle {:.3} deg, \
         displacement {:.3} mm, laser {:.4} mm, corner {:.1} mm/s; ngc {} B, pmc {} B; X {:?}",
        bench.motion.waypoints.len(),
        bench.program.moves.len(),
        f.marks,
        f.time_s,
        proof.lengths.mark_mm,
        proof.worst_position_um.unwrap_or(f64::NAN),
        proof.worst_defocus_um,
        proof.worst_incidence_deg,
        f.displacement_mm,
        f.laser_error_mm(1e-3),
        f.corner_mm_s,
        size("fly.ngc"),
        size("fly.pmc"),
        f.peaks[0],
    );
}

#[test]
fn five_axis_program_on_a_dome_verifies() {
    let bench = Bench::new(DOME);
    let proof = verify(&bench.written(bench.checked()), None).unwrap_or_else(|e| panic!("{e}"));
    print_figures("dome", &bench, &proof);
    assert!(proof.ok, "{}", proof.to_text());
    // There are no space curves.
    assert!(proof.rules.iter().all(|r| r.checked > 0 || r.code == "curves"), "{}", proof.to_text());
    assert!(proof.worst_position_um.is_some_and(|p| p < 0.1), "{}", proof.to_text());
    let l = proof.lengths;
    assert!((l.mark_mm - l.overlap_mm + l.skipped_mm - l.texture_mm).abs() < 1e-3, "{l:?}");
    assert!(l.mark_mm > 500.0 && l.overlap_mm < 0.01, "{l:?}");
}

#[test]
fn seven_axis_program_on_a_bowl_verifies() {
    let bench = Bench::new(BOWL);
    let proof = verify(&bench.written(bench.checked()), None).unwrap_or_else(|e| panic!("{e}"));
    print_figures("bowl", &bench, &proof);
    assert!(proof.ok, "{}", proof.to_text());
    assert!(proof.worst_position_um.is_some_and(|p| p < 0.2), "{}", proof.to_text());
    assert!(proof.worst_incidence_deg < 5.0, "the beam follows the normal");
}

/// One change of a leaf in `step` is tried.
fn assert_leaves_are_proved(step: usize) {
    for sort in [DOME, BOWL] {
        let bench = Bench::new(sort);
        let passed = unproved_leaves(&bench.written(bench.checked()), &ON_THE_FLY, step);
        assert!(passed.is_empty(), "{passed:#?}");
    }
}

#[test]
fn leaves_of_a_manifest_are_proved_one_in_twenty() {
    assert_leaves_are_proved(20);
}

#[test]
#[ignore = "slow: make test-all"]
fn every_leaf_of_a_manifest_is_proved_or_listed_as_not_proved() {
    assert_leaves_are_proved(1);
}

#[test]
#[ignore = "slow: make test-all"]
fn words_of_programs_are_proved_one_in_some_hundreds() {
    for sort in [DOME, BOWL] {
        let bench = Bench::new(sort);
        let passed = unproved_words(&bench.written(bench.checked()), 4001);
        assert!(passed.is_empty(), "{passed:#?}");
    }
}

/// Indices of the moves of the `n`-th mark.
fn mark(program: &Program, n: usize) -> std::ops::Range<usize> {
    let piece = |m: &Move| m.mark.map(|m| m.piece);
    let mut first = 0;
    let mut seen = 0;
    loop {
        let last =
            first + program.moves[first..].iter().take_while(|m| piece(m) == piece(&program.moves[first])).count();
        if piece(&program.moves[first]).is_some() {
            if seen == n {
                return first..last;
            }
            seen += 1;
        }
        first = last;
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn position_reports_marks_beside_their_stroke() {
    let bench = Bench::new(DOME);
    // Circles turn: 2 um to the side are 2 um off the stroke somewhere.
    let circle = |p: &Program| {
        let first = (0..).map(|n| mark(p, n)).find(|m| p.moves[m.start].mark.is_some_and(|m| m.pen == PenId(1)));
        first.expect("a circle")
    };
    let proof = bench.mutant(|p| circle(p).for_each(|i| p.moves[i].to[5] += 2_000));
    assert!(broken(&proof).contains(&"position"), "{}", proof.to_text());
    assert!(proof.worst_position_um.is_some_and(|w| (w - 2.0).abs() < 0.1), "{}", proof.to_text());
    // One sample unmatched, less than a micrometre and more.
    let middle = |p: &Program| (circle(p).start + circle(p).end) / 2;
    let proof = bench.mutant(|p| {
        let i = middle(p);
        p.moves[i].to[6] += 500;
    });
    assert!(proof.ok, "{}", proof.to_text());
    let proof = bench.mutant(|p| {
        let i = middle(p);
        p.moves[i].to[5] += 1_500;
        p.moves[i].to[6] += 1_500;
    });
    assert!(broken(&proof).contains(&"position"), "{}", proof.to_text());
    // The other pen, and another stroke.
    let other = |change: fn(&mut terrace_plan::on_the_fly::program::Mark)| {
        bench.mutant(|p| mark(p, 3).for_each(|i| p.moves[i].mark.iter_mut().for_each(change)))
    };
    assert_only("position", &other(|m| m.pen = PenId(1 - m.pen.0)));
    assert!(broken(&other(|m| m.source.0 += 1)).contains(&"position"));
    assert!(broken(&other(|m| m.source = StrokeId(9_999))).contains(&"position"));
}

#[test]
fn chord_error_between_samples_is_found() {
    let bench = Bench::new(BOWL);
    // Of a mark only every 40th sample: both ends of every move are right, C turns meanwhile.
    let proof = bench.mutant(|p| {
        let runs: Vec<_> = (0..3).map(|n| mark(p, n)).collect();
        let gone = |i: usize| runs.iter().any(|r| r.contains(&i) && i + 1 < r.end && (i - r.start) % 40 != 39);
        let mut i = 0;
        p.moves.retain(|_| {
            i += 1;
            !gone(i - 1)
        });
    });
    assert!(broken(&proof).contains(&"position"), "{}", proof.to_text());
}

#[test]
#[ignore = "slow: make test-all"]
fn focus_reports_a_stage_that_is_too_high() {
    for sort in [DOME, BOWL] {
        let bench = Bench::new(sort);
        let by = (sort.pdof * 1e6) as i64;
        let proof = bench.mutant(|p| {
            p.start[2] += by;
            // A spot that is farther from where axes turn runs faster: a little more time keeps the pen's speed.
            p.moves.iter_mut().for_each(|m| (m.to[2], m.us) = (m.to[2] + by, m.us + m.us / 1000));
        });
        assert!(broken(&proof).contains(&"focus") && !broken(&proof).contains(&"limits"), "{}", proof.to_text());
        assert!(sort.profile != DOME.profile || broken(&proof) == ["focus"], "{}", proof.to_text());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn limits_reports_travel_field_and_speed() {
    let bench = Bench::new(DOME);
    let jump = |p: &Program| mark(p, 4).end;
    // Beyond the field in a jump, and too fast on the way there.
    assert_only(
        "limits",
        &bench.mutant(|p| {
            let i = jump(p);
            p.moves[i].to[5] += 30_000_000;
        }),
    );
    // The same program on a part that lies elsewhere: only the travel is broken.
    assert_only(
        "limits",
        &bench.mutant(|p| {
            let by = 240_000_000;
            p.origin[0] += by;
            // The table carries the part.
            p.start[0] -= by;
            p.moves.iter_mut().for_each(|m| m.to[0] -= by);
        }),
    );
    // In half the time.
    let proof = bench.mutant(|p| p.moves.iter_mut().for_each(|m| m.us /= 2));
    assert_only("limits", &proof);
    // Stage and scanner shake against each other: marks stay, accelerations do not.
    assert_only(
        "limits",
        &bench.mutant(|p| {
            for (i, m) in p.moves.iter_mut().enumerate() {
                let by = if i / 8 % 2 == 0 { 20_000 } else { 0 };
                m.to[0] += by;
                m.to[5] += by;
            }
        }),
    );
    // A scanner of limits of its own is asked for too much with the laser off.
    let proof = Bench::new(BOWL).mutant(|p| {
        let from = mark(p, 4).end;
        let laser_off = p.moves[from..].iter().take_while(|m| m.mark.is_none()).count();
        p.moves[from..from + laser_off - 1].iter_mut().for_each(|m| m.to[5] += 1_000_000);
    });
    assert_only("limits", &proof);
    assert!(proof.to_text().contains("U has an acceleration of"), "{}", proof.to_text());
}

#[test]
fn once_and_coverage_report_doubled_and_missing_marks() {
    let bench = Bench::new(DOME);
    assert_only("coverage", &bench.mutant(|p| mark(p, 5).for_each(|i| p.moves[i].mark = None)));
    let part = |p: &Program| {
        let r = mark(p, 5);
        r.start..r.start + 3
    };
    assert_only("coverage", &bench.mutant(|p| part(p).for_each(|i| p.moves[i].mark = None)));
    // The last mark once more, backwards in the same times.
    let proof = bench.mutant(|p| {
        let last = (0..p.moves.len()).rev().find(|&i| p.moves[i].mark.is_some()).expect("a mark");
        let again = p.moves[last].mark;
        let first = (0..=last).rev().find(|&i| p.moves[i].mark != again).expect("a jump");
        p.moves.truncate(last + 1);
        let mut us = p.moves[last].us;
        for i in (first..last).rev() {
            us += p.moves[i + 1].us - p.moves[i].us;
            let mark = again.map(|m| terrace_plan::on_the_fly::program::Mark { piece: PieceId(m.piece.0 + 1), ..m });
            p.moves.push(Move { us, to: p.moves[i].to, mark });
        }
    });
    assert!(broken(&proof).contains(&"once") && !broken(&proof).contains(&"coverage"), "{}", proof.to_text());
    assert!(proof.lengths.overlap_mm > 1.0);
}

#[test]
fn surface_reports_beams_that_miss_the_part() {
    for sort in [DOME, BOWL] {
        let bench = Bench::new(sort);
        let proof = bench.mutant(|p| {
            let i = mark(p, 0).start;
            p.moves[i].to[5] += 100_000_000;
        });
        assert!(broken(&proof).contains(&"surface"), "{}", proof.to_text());
    }
}

#[test]
fn laser_reports_programs_that_could_fire_outside_marks() {
    let bench = Bench::new(DOME);
    let cases: [(&str, &str, &str); 6] = [
        ("fly.ngc", "G64 P0.0002 Q0\nM65 P0\n", "G64 P0.0002 Q0\n"),
        ("fly.ngc", "G64 P0.0002 Q0\n", "G64 P0.0002\n"),
        ("fly.ngc", "\nM2\n", "\n"),
        ("fly.ngc", "G93\n", "G93\nM3 S100\n"),
        ("fly.pmc", "open prog 1\nM1=0\n", "open prog 1\n"),
        ("fly.pmc", "\nclose\n", "\n"),
    ];
    for (name, from, to) in cases {
        let proof = bench.damaged(name, |t| t.replacen(from, to, 1));
        assert_only("laser", &proof);
    }
    // A program that ends on a mark is switched off at once; what waits for a move that never comes is not enough.
    let ending = || {
        let mut program = bench.program.clone();
        let last = program.moves.iter().rposition(|m| m.mark.is_some()).expect("a mark");
        program.moves.truncate(last + 1);
        Checked::unchecked(program, &bench.machine)
    };
    for (name, from, to) in [("fly.ngc", "M65 P0\nM68", "M63 P0\nM68"), ("fly.pmc", "M1==0\ndwell0\nM1=0\n", "M1==0\n")]
    {
        let proof = bench.damaged_of(ending(), name, |t| t.replacen(from, to, 1));
        assert_eq!(broken(&proof), ["limits", "laser"], "{}", proof.to_text());
    }
    let proof = verify(&bench.written(ending()), None).expect("a proof");
    assert_eq!(broken(&proof), ["limits"], "the stage stops at once: {}", proof.to_text());
    let proof = bench.damaged("fly.ngc", |t| t.replacen("M63 P0\n", "", 1));
    assert!(broken(&proof).contains(&"agreement"), "{}", proof.to_text());
    // Without its mode a program has no times either.
    let proof = bench.damaged("fly.ngc", |t| t.replacen("G93\n", "", 1));
    assert!(broken(&proof).contains(&"laser"), "{}", proof.to_text());
    let proof = bench.damaged("fly.pmc", |t| t.replacen(" TS0", " TS0.5", 1));
    assert!(broken(&proof).contains(&"laser"), "{}", proof.to_text());
    // A rapid before abs would be one by so much; a power set at once would change during a mark.
    let late = |t: &str| t.replacen("\nabs\n", "\n", 1).replacen("\nlinear TA", "\nabs\nlinear TA", 1);
    assert_only("laser", &bench.damaged("fly.pmc", late));
    for (name, synchronised, at_once) in [("fly.pmc", "\nM2==", "\nM2="), ("fly.ngc", "\nM67 E0 Q", "\nM68 E0 Q")] {
        let proof = bench.damaged(name, |t| t.replacen(synchronised, at_once, 1));
        assert!(broken(&proof).contains(&"laser"), "{name}: {}", proof.to_text());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn agreement_and_summary_report_a_change_of_one_file() {
    let bench = Bench::new(DOME);
    let at = |text: &str, mark: &str| text.find(mark).expect("there");
    // A digit of a coordinate, a time, a power, a mark's stroke: in one program.
    let digit = |text: &str, from: usize| {
        let i = from + text[from..].find(|c: char| c.is_ascii_digit()).expect("a digit");
        let other = if &text[i..=i] == "1" { "2" } else { "1" };
        format!("{}{other}{}", &text[..i], &text[i + 1..])
    };
    for (name, mark) in
        [("fly.pmc", "\nTM"), ("fly.pmc", " U"), ("fly.ngc", "MARK "), ("fly.pmc", "M2=="), ("fly.ngc", " F")]
    {
        let proof = bench.damaged(name, |t| {
            let from = at(t, "MARK ");
            digit(t, from + at(&t[from..], mark))
        });
        assert!(broken(&proof).contains(&"agreement"), "{name} {mark}: {}", proof.to_text());
    }
    for key in ["moves", "marks", "time_s", "mark_s", "worst_displacement_mm", "servo_period_s", "laser_error_mm"] {
        let proof = bench.damaged("manifest.json", |t| {
            let from = at(t, "\"summary\"");
            let from = from + at(&t[from..], &format!("\"{key}\": "));
            digit(t, from)
        });
        // Comments of the programs state some of them too.
        assert!(broken(&proof).contains(&"summary"), "{key}: {}", proof.to_text());
    }
    let proof = bench.damaged("manifest.json", |t| t.replacen("\"speed_mm_s\": 50", "\"speed_mm_s\": 51", 1));
    assert_only("agreement", &proof);
    let proof = bench.damaged("manifest.json", |t| t.replacen("\"XYZUV\"", "\"XYZACUV\"", 1));
    assert!(!proof.ok);
}

#[test]
fn hash_reports_changed_bytes_and_inputs() {
    let bench = Bench::new(DOME);
    let folder = bench.written(bench.checked());
    std::fs::write(folder.join("note.txt"), b"x").expect("write");
    assert_only("hash", &verify(&folder, None).expect("a proof"));
    let folder = bench.written(bench.checked());
    let path = folder.join("../job.toml");
    let text = std::fs::read_to_string(&path).expect("text");
    std::fs::write(&path, text + "\n").expect("write");
    let proof = verify(&folder, None).expect("a proof");
    assert_eq!(broken(&proof), ["hash"], "{}", proof.to_text());
    assert!(!proof.ok && proof.rule("position").is_some_and(|r| !r.ran));
}

#[test]
fn programs_are_the_same_bytes_each_time() {
    let files = |bench: &Bench| {
        let folder = bench.written(bench.checked());
        ["fly.pmc", "manifest.json"].map(|f| std::fs::read(folder.join(f)).expect("bytes"))
    };
    assert_eq!(files(&Bench::new(BOWL)), files(&Bench::of(BOWL, Planned::new(BOWL))));
}

#[test]
fn linuxcnc_reads_the_same_places_and_times() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let cnc = root.join(".venv/linuxcnc");
    let python = root.join(".venv/bin/python");
    let libraries = cnc.join("root/usr/lib");
    let run = |arguments: &[&std::ffi::OsStr]| {
        let path = format!("{0}:{0}/x86_64-linux-gnu", libraries.display());
        std::process::Command::new(&python).args(arguments).env("LD_LIBRARY_PATH", path).output()
    };
    let code =
        format!("import sys; sys.path.insert(0, {:?}); import gcode", cnc.join("root/usr/lib/python3/dist-packages"));
    let installed = run(&["-c".as_ref(), code.as_ref()]).is_ok_and(|o| o.status.success());
    assert!(installed, "the foreign readers are not installed: run tests/python/setup.sh");
    let bench = Bench::new(DOME);
    let folder = bench.written(bench.checked());
    let script = root.join("tests/python/check_fly.py");
    let out = run(&[script.as_ref(), folder.as_ref(), cnc.as_ref()]).expect("python starts");
    let said = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && said.starts_with("ok"), "{said}");
    eprintln!("{said}");
}

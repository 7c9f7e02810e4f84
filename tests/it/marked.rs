//! What is left of a job: planned anew for how the part lies now, with the marks where they were designed on it.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use terrace_core::geom::{NM_PER_MM, SpacePoint};
use terrace_core::math;
use terrace_plan::plan::SteppedPlan;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, manifest, number, planned, said, terrace, verify};

/// A part that is clamped somewhere: turned about z, leaning about x and y, rad, and shifted, mm.
#[derive(Clone, Copy)]
struct Clamped {
    turn: f64,
    lean: [f64; 2],
    shift: SpacePoint,
}

/// First, and again: 3 mm aside, turned by half a degree, leaning otherwise by 5 mrad.
const FIRST: Clamped = Clamped { turn: 0.002, lean: [0.003, -0.002], shift: [-40.123, -30.456, -3.25] };
const AGAIN: Clamped = Clamped { turn: -0.007, lean: [-0.002, 0.001], shift: [-37.0, -31.5, -2.75] };

impl Clamped {
    fn rows(&self) -> [SpacePoint; 3] {
        let [(sx, cx), (sy, cy), (sz, cz)] = [self.lean[0], self.lean[1], self.turn].map(math::sin_cos);
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    }

    /// Where a place of the part lies on the table.
    fn of(&self, p: SpacePoint) -> SpacePoint {
        let rows = self.rows();
        [0, 1, 2].map(|k| (0..3).map(|i| rows[k][i] * p[i]).sum::<f64>() + self.shift[k])
    }

    /// Which place of the part lies at one of the table.
    fn back(&self, p: SpacePoint) -> SpacePoint {
        let rows = self.rows();
        let d = [0, 1, 2].map(|k| p[k] - self.shift[k]);
        [0, 1, 2].map(|k| (0..3).map(|i| rows[i][k] * d[i]).sum())
    }

    /// The table of five features.
    fn table(&self) -> String {
        let mut text = "kind,stage_x,stage_y,stage_z,sigma_um,part_x,part_y,part_z\n".to_owned();
        for p in [[2.0, 3.0, 1.0], [77.0, 4.0, -2.0], [75.0, 58.0, 3.0], [4.0, 55.0, 0.5], [41.0, 28.0, 2.0]] {
            let [x, y, z] = self.of(p);
            let _ = writeln!(text, "optical,{:.9},{:.9},{z:.9},1,{},{},{}", -x, -y, p[0], p[1], p[2]);
        }
        text
    }
}

fn form(x: f64, y: f64) -> f64 {
    1.5 * math::sin(x / 15.0) + math::cos(y / 11.0)
}

/// The job on a wavy part of 80 x 60 mm; `more` are tables.
fn job(dir: &Path, name: &str, more: &str) -> PathBuf {
    let stl = dir.join("part.stl");
    if !stl.exists() {
        write_stl(&stl, &mesh(40, [0.0, 0.0, 80.0, 60.0], form));
    }
    let mut job = JobText::on(&stl)
        .texture("pattern = \"hatch\"\npitch = \"1 mm\"\narea = [\"4 mm\", \"4 mm\", \"76 mm\", \"56 mm\"]");
    job = job.texture(
        "pattern = \"circles\"\npitch = \"9 mm\"\ncell = \"4 mm\"\narea = [\"10 mm\", \"10 mm\", \"70 mm\", \"50 mm\"]",
    );
    job.more = more.to_owned();
    job.write(dir, name)
}

/// The tables of a job on a part that was measured.
fn measured(dir: &Path, name: &str, clamped: Clamped) -> String {
    std::fs::write(dir.join(name), clamped.table()).expect("writable");
    format!("[placement.measured]\nfile = \"{name}\"\n")
}

/// What of a job is left from a block on, as `terrace resume` writes it.
fn resumed(dir: &Path, from: &str) -> PathBuf {
    let rest = dir.join("rest.job");
    let out = terrace([
        Path::new("resume"),
        &dir.join("first.job"),
        Path::new("--from"),
        Path::new(from),
        Path::new("-o"),
        &rest,
    ]);
    assert!(out.status.success(), "{}", said(&out));
    rest
}

/// Points of the marks of some blocks every 20 um, on the part as designed, mm: where the head was sent, turned back by
/// how the part is clamped.
fn marked(plan: &SteppedPlan, clamped: Option<Clamped>, takes: impl Fn(usize) -> bool) -> Vec<[f64; 2]> {
    let program = plan.checked.program();
    let origin = plan.checked.origin().mm();
    let mut out = Vec::new();
    for (_, block) in program.blocks.iter().enumerate().filter(|(i, _)| takes(*i)) {
        let [cx, cy] = block.stop.centre.mm();
        for stroke in program.strokes_of(block) {
            for pair in program.points_of(stroke).windows(2) {
                let [a, b] =
                    [pair[0], pair[1]].map(|p| [f64::from(p.x) / NM_PER_MM + cx, f64::from(p.y) / NM_PER_MM + cy]);
                let count = (math::hypot(b[0] - a[0], b[1] - a[1]) / 0.02).ceil();
                for i in 0..=count as u32 {
                    let t = f64::from(i) / count;
                    let at = [0, 1].map(|k| a[k] + (b[k] - a[k]) * t);
                    let Some(clamped) = clamped else {
                        out.push(at);
                        continue;
                    };
                    // Under the beam lies what of the true part is there: found by a few steps.
                    let table = [at[0] + origin[0], at[1] + origin[1]];
                    let mut z = 0.0;
                    for _ in 0..12 {
                        let [x, y, own] = clamped.back([table[0], table[1], z]);
                        z += form(x, y) - own;
                    }
                    let [x, y, _] = clamped.back([table[0], table[1], z]);
                    out.push([x, y]);
                }
            }
        }
    }
    out
}

/// The pieces of 0.1 mm of the hatch that points of marks lie in: most of the five of each.
fn pieces(points: &[[f64; 2]]) -> usize {
    let mut seen = std::collections::HashMap::<(i64, i64), u32>::new();
    for [x, y] in points {
        let line = y - 4.0;
        if (line - line.round()).abs() < 4e-3 {
            *seen.entry((line.round() as i64, ((x - 4.0) / 0.1).floor() as i64)).or_default() += 1;
        }
    }
    seen.values().filter(|count| **count >= 3).count()
}

#[test]
fn what_is_left_of_a_part_as_designed_is_marked_once() {
    assert_left_is_marked_once(None);
}

#[test]
#[ignore = "slow: make test-all"]
fn what_is_left_is_marked_once_wherever_the_part_was_clamped_before_and_is_now() {
    assert_left_is_marked_once(Some([FIRST, AGAIN]));
}

/// Marks a job up to its eighth block, and the rest of it, on a part that was clamped again in between, if it was.
fn assert_left_is_marked_once(clamped: Option<[Clamped; 2]>) {
    let dir = folder();
    let tables = |name: &str, k: usize| clamped.map_or_else(String::new, |c| measured(dir.path(), name, c[k]));
    let first = job(dir.path(), "first.toml", &tables("first.csv", 0));
    let whole = compile(&first, &dir.path().join("first.job"));
    let rest = resumed(dir.path(), "B0008");
    let left = manifest(&rest)["subset"]["mark_mm"].as_f64().expect("mm");
    let marked_before = "[[marked]]\nfolder = \"first.job\"\nleft = \"rest.job\"\n";
    let again = job(dir.path(), "again.toml", &(tables("again.csv", 1) + marked_before));
    let target = dir.path().join("again.job");
    let summary = compile(&again, &target);
    let proof = verify(&target);
    let marked_rule =
        proof["rules"].as_array().expect("rules").iter().find(|r| r["code"] == "marked").expect("a rule").clone();
    assert!(marked_rule["checked"].as_u64().is_some_and(|n| n > 70), "{marked_rule}");
    // As much as was left, but for what other marks of the pen lie on, where lines touch at a small angle.
    let now = number(&summary, "mark_mm");
    assert!((now - left).abs() < 2e-4 * left, "{now} {left} of {}", number(&whole, "mark_mm"));
    // Where they lie on the part by the true pose: all of the hatch, each place once.
    let plans = [planned(&first), planned(&again)];
    let before = marked(&plans[0], clamped.map(|c| c[0]), |i| i < 7);
    let after = marked(&plans[1], clamped.map(|c| c[1]), |_| true);
    let of_whole = pieces(&marked(&plans[0], clamped.map(|c| c[0]), |_| true));
    let [a, b] = [pieces(&before), pieces(&after)];
    let both = pieces(&[before, after].concat());
    // The true part is smooth and its mesh is not: by where both differ, a place at an end of a line is missed.
    assert!(both.abs_diff(of_whole) * 500 <= of_whole, "all of it: {both} of {of_whole}");
    // A place is in both where a cut lies in it.
    assert!(a + b - both <= 80, "{a} + {b} - {both}");
}

#[test]
fn jobs_that_cannot_be_gone_on_with_are_refused() {
    let dir = folder();
    let first = job(dir.path(), "first.toml", "");
    compile(&first, &dir.path().join("first.job"));
    resumed(dir.path(), "B0008");
    let table = "[[marked]]\nfolder = \"first.job\"\n";
    let refused = |text: &dyn Fn(String) -> String, more: &str| -> String {
        let path = job(dir.path(), "again.toml", more);
        let changed = text(std::fs::read_to_string(&path).expect("a job"));
        std::fs::write(&path, changed).expect("writable");
        let out = terrace([Path::new("check"), &path]);
        assert!(!out.status.success(), "{more}");
        said(&out)
    };
    let same = |text: String| text;
    let holds = |said: String, words: &str| assert!(said.contains(words), "{words}: {said}");
    holds(refused(&same, table), "error[marked-all]");
    holds(refused(&same, "[[marked]]\nfolder = \"none.job\"\n"), "none.job");
    holds(
        refused(&same, "[[marked]]\nfolder = \"rest.job\"\nleft = \"first.job\"\n"),
        "holds a whole job, not what is left",
    );
    holds(refused(&|t| t.replace("name = \"fill\"", "name = \"other\""), table), "error[marked-pen]");
    holds(
        refused(
            &|t| {
                t.replace("pitch = \"1 mm\"", "pitch = \"1 mm\"\norigin = [\"0 mm\", \"0.5 mm\"]")
                    .replace("pattern = \"circles\"", "pattern = \"squares\"")
            },
            table,
        ),
        "error[",
    );
    holds(refused(&same, &format!("[placement]\nturn = \"10 deg\"\n{table}")), "error[marked-part]");
    holds(refused(&same, &format!("[passes]\ncount = 2\n{table}")), "error[marked-passes]");
    // A byte of the program.
    let program = dir.path().join("first.job/program.txt");
    let text = std::fs::read_to_string(&program).expect("a program");
    std::fs::write(&program, text.replacen('7', "8", 1)).expect("writable");
    let said = refused(&same, table);
    assert!(said.contains("marked-changed") || said.contains("program-text"), "{said}");
    std::fs::write(&program, text).expect("writable");
    // Another part.
    write_stl(&dir.path().join("part.stl"), &mesh(40, [0.0, 0.0, 80.0, 60.0], |x, y| form(x, y) + 0.1));
    holds(refused(&same, table), "its surface file is another");
}

#[test]
fn set_ups_that_are_each_measured_meet_where_they_were_cut() {
    let dir = folder();
    // In the first, what lies left of x = 40 mm; in the second, all else.
    let left = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"80mm\" height=\"60mm\" viewBox=\"0 0 80 60\"><rect width=\"40\" height=\"60\"/></svg>";
    std::fs::write(dir.path().join("left.svg"), left).expect("writable");
    let first = job(dir.path(), "first.toml", &measured(dir.path(), "first.csv", FIRST));
    let text = std::fs::read_to_string(&first).expect("a job");
    let masked = text
        .replace("area = [\"4 mm\"", "inside = \"left.svg\"\narea = [\"4 mm\"")
        .replace("area = [\"10 mm\"", "inside = \"left.svg\"\narea = [\"10 mm\"");
    assert_ne!(masked, text);
    std::fs::write(&first, masked).expect("writable");
    let one = number(&compile(&first, &dir.path().join("first.job")), "mark_mm");
    verify(&dir.path().join("first.job"));
    let second = job(
        dir.path(),
        "second.toml",
        &(measured(dir.path(), "second.csv", AGAIN) + "[[marked]]\nfolder = \"first.job\"\n"),
    );
    let two = number(&compile(&second, &dir.path().join("second.job")), "mark_mm");
    verify(&dir.path().join("second.job"));
    // By the points of the first it would lie as it did before it was moved.
    let told = |path: &Path| said(&terrace([Path::new("check"), path]));
    assert!(!told(&second).contains("[marked-same-table]"));
    let forgotten = "[placement.measured]\nfile = \"first.csv\"\n[[marked]]\nfolder = \"first.job\"\n";
    let forgotten = told(&job(dir.path(), "forgotten.toml", forgotten));
    assert!(forgotten.contains("[marked-same-table]"), "{forgotten}");
    let whole = number(&compile(&job(dir.path(), "whole.toml", ""), &dir.path().join("whole.job")), "mark_mm");
    assert!((one + two - whole).abs() < 1e-4 * whole, "{one} + {two}, {whole}");
    assert!(one > 0.4 * whole && two > 0.4 * whole);
}

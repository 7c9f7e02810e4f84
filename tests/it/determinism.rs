//! Same input, same bytes: on any number of threads, in a second run, and in a known way when the
//! input is moved.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, compile, files, folder, machine_file, number, said, terrace};

fn job(dir: &Path, method: &'static str) -> std::path::PathBuf {
    let stl = dir.join("dome.stl");
    write_stl(&stl, &mesh(60, [0.0, 0.0, 90.0, 75.0], |x, y| dome(5.0 * x, 6.0 * y)));
    JobText { more: "[emit]\nformats = [\"dxf\", \"linuxcnc\", \"gcode\", \"ovf\"]\n".into(), ..JobText::on(&stl) }
        .texture("pattern = \"hatch\"\npitch = \"1 mm\"\ndirection = \"20 deg\"")
        .texture("pattern = \"squares\"\npitch = \"3 mm\"\ncell = \"2 mm\"")
        .texture("pattern = \"hatch\"\npitch = \"3 mm\"\ndirection = \"contour\"")
        .method(method)
        .write(dir, "dome.toml")
}

#[test]
#[ignore = "slow: make test-all"]
fn bytes_do_not_depend_on_threads_or_repetition() {
    let dir = folder();
    let job = job(dir.path(), "auto");
    let run = |name: &str, threads: &str| {
        let out = dir.path().join(name);
        let made = terrace([Path::new("compile"), &job, Path::new("-o"), &out, Path::new("-j"), Path::new(threads)]);
        assert!(made.status.success(), "{}", said(&made));
        files(&out)
    };
    let one = run("one.job", "1");
    assert!(one.len() > 200, "{} files", one.len());
    for (name, threads) in [("seven.job", "7"), ("again.job", "1")] {
        let other = run(name, threads);
        assert_eq!(one.len(), other.len());
        for (a, b) in one.iter().zip(&other) {
            assert!(a == b, "{} differs with {threads} threads", a.0);
        }
    }
}

#[test]
fn translating_the_part_translates_only_the_stage() {
    let dir = folder();
    let z = |x: f64, y: f64| 0.02 * x + 0.3 * math::sin(y / 9.0);
    let compiled = |shift: f64, name: &str| {
        let stl = dir.path().join(format!("{name}.stl"));
        // A shift that f32 holds exactly.
        let facets = mesh(60, [0.0, 0.0, 60.0, 60.0], z);
        let moved: Vec<_> = facets.iter().map(|f| f.map(|[x, y, z]| [round(x) + shift, round(y), z])).collect();
        write_stl(&stl, &moved);
        let out = dir.path().join(format!("{name}.job"));
        let job = JobText::on(&stl)
            .texture("pattern = \"hatch\"\npitch = \"0.5 mm\"")
            .write(dir.path(), &format!("{name}.toml"));
        (compile(&job, &out), std::fs::read_to_string(out.join("stage.ngc")).expect("stage.ngc"))
    };
    let (a, stage_a) = compiled(0.0, "a");
    let (b, stage_b) = compiled(64.0, "b");
    for key in ["stops", "fragments", "mark_mm", "jump_mm", "worst_defocus_um"] {
        assert_eq!(a[key], b[key], "{key}");
    }
    let targets = |text: &str| text.lines().filter(|l| l.starts_with("G0")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(targets(&stage_a), targets(&stage_b), "the texture's centre lies at the centre of travel either way");
}

/// To 1/1024 mm, so that shifts by 64 mm lose no bit in f32.
fn round(v: f64) -> f64 {
    (v * 1024.0).round() / 1024.0
}

#[test]
#[ignore = "slow: make test-all"]
fn turning_the_part_by_a_quarter_keeps_every_length() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(60, [0.0, 0.0, 60.0, 40.0], |x, y| 0.02 * x + 0.3 * math::sin(y / 9.0)));
    let run = |turn: u32| {
        let hatch = "pattern = \"hatch\"\npitch = \"0.5 mm\"";
        let mut job = JobText::on(&stl).texture(hatch).partition("min_mark = \"0 mm\"");
        job.more = format!("[placement]\nturn = \"{turn} deg\"\n");
        let out = dir.path().join(format!("{turn}.job"));
        let summary = compile(&job.write(dir.path(), &format!("{turn}.toml")), &out);
        crate::support::assert_balance(&summary, &crate::support::verify(&out));
        summary
    };
    let straight = run(0);
    for turn in [90, 180, 270, 33] {
        let turned = run(turn);
        let (a, b) = (number(&straight, "texture_mm"), number(&turned, "texture_mm"));
        assert!((a - b).abs() < 1e-6 * a && number(&turned, "skipped_mm") < 1e-6 * a, "{turn}: {a} {b}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn scaling_part_texture_machine_and_depth_together_keeps_the_counts() {
    let dir = folder();
    let run = |k: f64| {
        let stl = dir.path().join(format!("{k}.stl"));
        let z = move |x: f64, y: f64| k * (0.02 * (x / k) + 0.3 * math::sin(y / k / 9.0));
        write_stl(&stl, &mesh(60, [0.0, 0.0, 60.0 * k, 60.0 * k], z));
        let machine = machine_file("xyz-galvo-40");
        let machine =
            machine.replace("field = [\"40 mm\", \"40 mm\"]", &format!("field = [\"{0} mm\", \"{0} mm\"]", 40.0 * k));
        let machine = machine.replace("spot = \"0.02 mm\"", &format!("spot = \"{} mm\"", 0.02 * k));
        std::fs::write(dir.path().join("machine.txt"), machine).expect("a writable folder");
        let mut job = JobText::on(&stl).texture(&format!("pattern = \"hatch\"\npitch = \"{} mm\"", 0.5 * k));
        job.focus = format!("pdof = \"{} mm\"", 0.07 * k);
        job.machine = "file = \"machine.txt\"".into();
        compile(&job.write(dir.path(), "job.toml"), &dir.path().join("out.job"))
    };
    let (one, two) = (run(1.0), run(2.0));
    for key in ["stops", "fragments"] {
        assert_eq!(one[key], two[key], "{key}");
    }
    assert!((2.0 * number(&one, "mark_mm") - number(&two, "mark_mm")).abs() < 1e-6 * number(&two, "mark_mm"));
}

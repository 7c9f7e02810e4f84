//! Mode times command: folders of stepped and of on-the-fly jobs of the same job file, by every command that
//! reads or writes one.

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, files, folder, said, terrace};

const MODES: [&str; 2] = ["stepped", "on-the-fly"];

fn run(dir: &Path, args: &[&str]) -> Output {
    let paths = args.iter().map(|a| if a.contains("job") || *a == "." { dir.join(a) } else { a.into() });
    terrace(paths)
}

fn done(dir: &Path, args: &[&str]) -> String {
    let out = run(dir, args);
    assert!(out.status.success(), "{args:?}: {}", said(&out));
    String::from_utf8(out.stdout).expect("UTF-8")
}

fn json(dir: &Path, args: &[&str]) -> Value {
    serde_json::from_str(&done(dir, &[args, &["--json"]].concat())).expect("one JSON object")
}

/// A job that can be marked in both modes, named job.toml.
fn job(dir: &Path, more: &str) {
    let stl = dir.join("part.stl");
    write_stl(&stl, &mesh(12, [-6.0, -5.0, 6.0, 5.0], |x, y| 0.004 * (x * x + y * y) + 0.02 * x));
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"4 mm\"").method("auto");
    job.machine = "profile = \"xyz-galvo-100\"".into();
    job.surface = format!("file = \"part.stl\"\nunit = \"mm\"\n{more}");
    job.write(dir, "job.toml");
}

/// Default folder of a mode.
fn target(mode: &str) -> &'static str {
    if mode == "stepped" { "job.job" } else { "job.fly.job" }
}

/// What every command says of the folder of a mode.
fn assert_read_right(dir: &Path, mode: &str) {
    let shown = json(dir, &["inspect", target(mode)]);
    assert_eq!(shown["mode"], mode);
    let [own, other] = if mode == "stepped" { ["stops", "moves"] } else { ["moves", "stops"] };
    assert!(shown["summary"][own].as_u64() > Some(0) && shown["summary"][other].is_null(), "{shown}");
    let text = done(dir, &["inspect", target(mode)]);
    assert!(text.contains(&format!("mode     {mode}")) && !text.contains("null"), "{text}");
    let proof = json(dir, &["verify", target(mode)]);
    assert_eq!(proof["ok"], true, "{mode}: {proof}");
}

fn states(report: &Value) -> Vec<&str> {
    report["jobs"].as_array().expect("jobs").iter().map(|j| j["state"].as_str().expect("a state")).collect()
}

#[test]
#[ignore = "slow: make test-all"]
fn commands_keep_folders_of_both_modes_apart_in_either_order() {
    for first in [0, 1] {
        let [a, b] = [MODES[first], MODES[1 - first]];
        let dir = folder();
        job(dir.path(), "");
        done(dir.path(), &["compile", "job.toml", "--mode", a]);
        assert_read_right(dir.path(), a);
        // A batch of the other mode is not done yet; of the same mode it is.
        assert_eq!(states(&json(dir.path(), &["batch", ".", "--mode", a])), ["unchanged"], "{a}");
        assert_eq!(states(&json(dir.path(), &["batch", ".", "--mode", b])), ["compiled"], "{b}");
        assert_eq!(states(&json(dir.path(), &["batch", ".", "--mode", b])), ["unchanged"], "{b}");
        // Without a word of the mode a batch goes by the job file: stepped.
        assert_eq!(states(&json(dir.path(), &["batch", "."])), ["unchanged"]);
        for mode in [a, b] {
            assert_read_right(dir.path(), mode);
        }
    }
}

#[test]
fn check_and_preview_respect_the_mode() {
    let dir = folder();
    job(dir.path(), "");
    assert!(json(dir.path(), &["check", "job.toml"])["stops"].as_u64() > Some(0));
    assert!(json(dir.path(), &["check", "job.toml", "--mode", "on-the-fly"])["moves"].as_u64() > Some(0));
    assert!(done(dir.path(), &["preview", "job.toml", "-o", "-"]).contains("<svg"));
    let fly = done(dir.path(), &["preview", "job.toml", "--mode", "on-the-fly", "-o", "-"]);
    assert!(fly.contains("layer-texture-marks") && !fly.contains("id=\"layer-blocks\""), "{fly}");
}

#[test]
fn a_folder_of_the_other_mode_is_not_replaced() {
    for first in [0, 1] {
        let [a, b] = [MODES[first], MODES[1 - first]];
        let dir = folder();
        job(dir.path(), "");
        done(dir.path(), &["compile", "job.toml", "--mode", a, "-o", "one.job"]);
        let before = files(&dir.path().join("one.job"));
        let refused = run(dir.path(), &["compile", "job.toml", "--mode", b, "-o", "one.job"]);
        assert!(said(&refused).contains("output-other-mode"), "{}", said(&refused));
        assert_eq!(refused.status.code(), Some(2));
        // A folder that stands where a batch would write.
        let there = target(b);
        std::fs::rename(dir.path().join("one.job"), dir.path().join(there)).expect("a free name");
        let out = run(dir.path(), &["batch", ".", "--mode", b]);
        assert!(said(&out).contains("output-other-mode"), "{}", said(&out));
        assert_eq!(out.status.code(), Some(2));
        assert_eq!(files(&dir.path().join(there)), before);
    }
}

#[test]
fn the_job_file_states_the_mode_and_the_command_line_overrides_it() {
    let dir = folder();
    job(dir.path(), "");
    let path = dir.path().join("job.toml");
    let text = std::fs::read_to_string(&path).expect("a job");
    std::fs::write(&path, format!("mode = \"on-the-fly\"\n{text}")).expect("a writable folder");
    done(dir.path(), &["compile", "job.toml"]);
    assert_read_right(dir.path(), "on-the-fly");
    done(dir.path(), &["compile", "job.toml", "--mode", "stepped"]);
    assert_read_right(dir.path(), "stepped");
    // Formats of the other mode are a fault of the file, and a warning where the command line sets the mode.
    std::fs::write(&path, format!("mode = \"on-the-fly\"\n{text}[emit]\nformats = [\"dxf\"]\n")).expect("written");
    let refused = run(dir.path(), &["check", "job.toml"]);
    assert!(said(&refused).contains("error[emit-mode]"), "{}", said(&refused));
    std::fs::write(&path, format!("{text}[emit]\nformats = [\"dxf\", \"linuxcnc\"]\n")).expect("written");
    let warned = run(dir.path(), &["check", "job.toml", "--mode", "on-the-fly"]);
    assert!(warned.status.success() && said(&warned).contains("warning[emit-mode]"), "{}", said(&warned));
}

#[test]
#[ignore = "slow: make test-all"]
fn on_the_fly_jobs_of_any_formats_verify_and_formats_without_the_axes_are_refused() {
    let dir = folder();
    let path = dir.path().join("job.toml");
    for (profile, formats, want) in [
        ("xyz-galvo-100", "\"linuxcnc\"", Ok(vec!["fly.ngc"])),
        ("xyz-galvo-100", "\"pmac\"", Ok(vec!["fly.pmc"])),
        ("xyz-galvo-100", "\"linuxcnc\", \"pmac\"", Ok(vec!["fly.ngc", "fly.pmc"])),
        ("xyzac-galvo-10", "\"linuxcnc\", \"pmac\"", Ok(vec!["fly.pmc"])),
        ("xyzac-galvo-10", "\"linuxcnc\"", Err("formats for these axes: \"pmac\"")),
    ] {
        job(dir.path(), "");
        let text = std::fs::read_to_string(&path).expect("a job").replace("xyz-galvo-100", profile);
        std::fs::write(&path, format!("mode = \"on-the-fly\"\n{text}[emit]\nformats = [{formats}]\n"))
            .expect("written");
        let out = run(dir.path(), &["compile", "job.toml"]);
        match want {
            Ok(want) => {
                assert!(out.status.success(), "{profile} {formats}: {}", said(&out));
                assert_eq!(said(&out).contains("warning[emit-mode]"), profile == "xyzac-galvo-10", "{}", said(&out));
                let written = files(&dir.path().join("job.fly.job")).into_iter().map(|(name, _)| name);
                let programs: Vec<String> = written.filter(|name| name.starts_with("fly.")).collect();
                assert_eq!(programs, want, "{profile} {formats}");
                assert_read_right(dir.path(), "on-the-fly");
            }
            Err(hint) => {
                assert_eq!(out.status.code(), Some(2), "{}", said(&out));
                assert!(said(&out).contains("error[emit-mode]") && said(&out).contains(hint), "{}", said(&out));
            }
        }
    }
}

#[test]
fn job_with_another_objective_is_recompiled() {
    let dir = folder();
    job(dir.path(), "");
    done(dir.path(), &["compile", "job.toml", "--objective", "stops"]);
    assert_eq!(states(&json(dir.path(), &["batch", ".", "--objective", "stops"])), ["unchanged"]);
    assert_eq!(states(&json(dir.path(), &["batch", "."])), ["compiled"]);
}

#[test]
fn a_job_file_is_a_batch_of_one() {
    let dir = folder();
    job(dir.path(), "");
    assert_eq!(states(&json(dir.path(), &["batch", "job.toml"])), ["compiled"]);
}

//! The program as its users meet it: commands, streams, exit codes, and what becomes of a folder that
//! is there already.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::support::{JobText, files, folder, said, verify};
use serde_json::Value;
use tempfile::TempDir;

const HATCH: &str = "pattern = \"hatch\"\npitch = \"1 mm\"";
pub(crate) const DRAWING: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"8mm\" height=\"8mm\" viewBox=\"0 0 8 8\">\
                       <path d=\"M1 1 L7 7 L1 7 Z\"/></svg>";

/// Runs the program in a folder, with a text on its standard input.
fn run_with(dir: &Path, args: &[&str], input: &[u8]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.current_dir(dir).args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    // A program that ends without reading closes the pipe: no fault here.
    let _ = child.stdin.take().expect("a pipe").write_all(input);
    child.wait_with_output().expect("it ends")
}

pub(crate) fn run(dir: &Path, args: &[&str]) -> Output {
    run_with(dir, args, b"")
}

fn out(o: &Output) -> String {
    String::from_utf8(o.stdout.clone()).expect("text")
}

fn err(o: &Output) -> String {
    String::from_utf8(o.stderr.clone()).expect("text")
}

/// The output of a run that must succeed.
pub(crate) fn done(dir: &Path, args: &[&str]) -> String {
    let o = run(dir, args);
    assert_eq!(o.status.code(), Some(0), "{args:?}: {}", said(&o));
    out(&o)
}

/// Panics unless the run is refused with this exit code and error, and prints no result.
pub(crate) fn refused(o: &Output, exit: i32, code: &str) {
    assert_eq!(o.status.code(), Some(exit), "{}", said(o));
    assert!(err(o).contains(&format!("error[{code}]: ")), "{code} expected: {}", said(o));
    assert!(o.stdout.is_empty(), "{}", said(o));
}

pub(crate) fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn keys(v: &Value) -> BTreeSet<&str> {
    v.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn read(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(path).expect("readable")
}

pub(crate) fn write(path: impl AsRef<Path>, text: impl AsRef<[u8]>) {
    std::fs::write(path, text).expect("a writable folder");
}

/// A folder with a plate of 8 x 8 mm and a job `a.toml` on it that has nothing to warn of.
pub(crate) fn job_folder_fixture() -> TempDir {
    let dir = folder();
    write(dir.path().join("plate.obj"), "v 0 0 0\nv 8 0 0\nv 8 8 0\nv 0 8 0\nf 1 2 3 4\n");
    JobText::on(Path::new("plate.obj")).texture(HATCH).write(dir.path(), "a.toml");
    dir
}

/// The job with another pitch, and one that cannot be compiled.
fn edit_job(dir: &Path) {
    write(dir.join("a.toml"), read(dir.join("a.toml")).replace("1 mm", "2 mm"));
}
fn break_job(dir: &Path) {
    write(dir.join("a.toml"), read(dir.join("a.toml")).replace("plate.obj", "absent.obj"));
}

fn names(dir: &Path) -> BTreeSet<String> {
    let all = std::fs::read_dir(dir).expect("readable");
    all.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn help_version_and_bad_use() {
    let dir = folder();
    let help = done(dir.path(), &["--help"]);
    for command in [
        "init",
        "check",
        "compile",
        "verify",
        "preview",
        "batch",
        "inspect",
        "machines",
        "completions",
        "man",
        "--json",
        "--seed",
    ] {
        assert!(help.contains(command), "{command}: {help}");
    }
    assert_eq!(done(dir.path(), &["--version"]), concat!("terrace ", env!("CARGO_PKG_VERSION"), "\n"));
    assert!(done(dir.path(), &["compile", "--help"]).contains("--output"));
    for args in [
        &[][..],
        &["compile"],
        &["burn", "a.toml"],
        &["compile", "a.toml", "--fast"],
        &["-j", "0", "machines"],
        &["-j", "many", "machines"],
        &["--seed", "-1", "machines"],
        &["completions", "tcl"],
        &["inspect", "x.stl", "--unit", "yard"],
    ] {
        let o = run(dir.path(), args);
        assert_eq!((o.status.code(), o.stdout.is_empty()), (Some(2), true), "{args:?}: {}", said(&o));
        assert!(!o.stderr.is_empty());
    }
}

#[test]
fn the_summary_has_the_promised_keys_and_stands_in_the_manifest() {
    let dir = job_folder_fixture();
    let summary = json(&done(dir.path(), &["compile", "a.toml", "--json"]));
    let promised = "part_mm stops stops_merged blocks passes sub_blocks method lower_bound_stops texture_mm mark_mm overlap_mm skipped_mm \
                    skipped_off_part_mm skipped_steep_mm skipped_small_mm dots fragments strokes_cut \
                    figures_whole figures_cut seam_mm setups jump_mm worst_defocus_um worst_defocus_mean_um \
                    worst_incidence_deg off_axis_mm budget time_s loading candidates warnings";
    assert_eq!(keys(&summary), promised.split_whitespace().collect());
    assert_eq!(keys(&summary["time_s"]), ["stage", "settle", "zoom", "mark", "jump", "delay", "total"].into());
    let parts: f64 = ["stage", "settle", "zoom", "mark", "jump", "delay"]
        .iter()
        .map(|k| summary["time_s"][k].as_f64().expect("a number"))
        .sum();
    assert!((parts - summary["time_s"]["total"].as_f64().expect("a number")).abs() < 1e-9);
    assert_eq!(json(&read(dir.path().join("a.job/manifest.json")))["summary"], summary);
    // check says the same, and writes nothing.
    let before = names(dir.path());
    assert_eq!(json(&done(dir.path(), &["check", "a.toml", "--json"])), summary);
    assert_eq!(names(dir.path()), before);
    let proof = json(&done(dir.path(), &["verify", "a.job", "--json"]));
    assert_eq!(proof["ok"], true);
    for rule in proof["rules"].as_array().expect("a list") {
        // Without a hatch along contours, a drawing, space curves, a job before or a measured part there is nothing to hold their rules against.
        let is_absent = ["fill", "drawing", "bitmap", "mask", "curves", "marked", "measured", "draped"]
            .iter()
            .any(|code| rule["code"] == *code);
        let checked = rule["checked"].as_u64() > Some(0) || is_absent;
        assert!(rule["code"].is_string() && checked && rule["violations"].is_array(), "{rule}");
    }
    for key in ["texture_mm", "mark_mm", "overlap_mm", "skipped_mm"] {
        assert!(
            (proof[key].as_f64().expect("a number") - summary[key].as_f64().expect("a number")).abs() < 1e-6,
            "{key}"
        );
    }
}

#[test]
fn results_go_to_stdout_and_messages_to_stderr() {
    let dir = job_folder_fixture();
    // Nothing to warn of: stderr, which is not a terminal here, has nothing but a line for each job of a batch.
    for args in [
        &["compile", "a.toml"][..],
        &["check", "a.toml"],
        &["verify", "a.job"],
        &["preview", "a.toml"],
        &["batch", "."],
    ] {
        let o = run(dir.path(), args);
        let printed = err(&o);
        let is_warned = |line: &&str| args[0] != "batch" || !line.starts_with("unchanged  ");
        assert_eq!((o.status.code(), printed.lines().find(is_warned)), (Some(0), None), "{args:?}");
        assert!(!o.stdout.is_empty() && !out(&o).contains('\u{1b}'), "{args:?}");
    }
    let over = format!("{HATCH}\narea = [\"-2 mm\", \"0 mm\", \"8 mm\", \"8 mm\"]");
    let mut over = JobText::on(Path::new("plate.obj")).texture(&over);
    over.more = "[limits]\nmax_off_part = \"20 %\"\n".into();
    over.write(dir.path(), "over.toml");
    let loud = run(dir.path(), &["check", "over.toml"]);
    assert!(err(&loud).starts_with("warning[off-part]: ") && !out(&loud).contains("warning"), "{}", said(&loud));
    let quiet = run(dir.path(), &["check", "over.toml", "--quiet"]);
    assert_eq!((err(&quiet).as_str(), out(&quiet)), ("", out(&loud)));
    // Quiet is for what is well: a fault is printed.
    refused(&run(dir.path(), &["check", "absent.toml", "-q"]), 2, "file-unreadable");
}

#[test]
fn dash_is_standard_input_and_output() {
    let dir = job_folder_fixture();
    let job = read(dir.path().join("a.toml"));
    let from_stdin = |args: &[&str]| run_with(dir.path(), args, job.as_bytes());
    let summary = json(&done(dir.path(), &["check", "a.toml", "--json"]));
    assert_eq!(json(&out(&from_stdin(&["check", "-", "--json"]))), summary);

    let o = from_stdin(&["compile", "-", "--json"]);
    assert_eq!(json(&out(&o)), summary, "{}", said(&o));
    // verify reads the job again: it must be kept, and the message says so.
    assert!(err(&o).contains("keep it as stdin.toml"), "{}", err(&o));
    assert_eq!(run(dir.path(), &["verify", "stdin.job"]).status.code(), Some(1));
    write(dir.path().join("stdin.toml"), &job);
    verify(&dir.path().join("stdin.job"));

    let svg = from_stdin(&["preview", "-", "-o", "-"]);
    assert!(out(&svg).contains("<svg") && out(&svg).ends_with("</svg>\n"), "{}", said(&svg));
    assert_eq!(out(&from_stdin(&["preview", "-"])), out(&svg), "from a pipe into a pipe");
    assert_eq!(done(dir.path(), &["preview", "stdin.toml", "-o", "-"]), out(&svg));

    for (text, code) in
        [(&b"[surface"[..], "toml"), (b"\xff\xfe", "job-utf8"), (&vec![b'#'; (4 << 20) + 1], "file-unreadable")]
    {
        refused(&run_with(dir.path(), &["check", "-"], text), 2, code);
    }
}

#[test]
fn preview_writes_a_drawing_and_never_over_an_input() {
    let dir = job_folder_fixture();
    write(dir.path().join("a.svg"), DRAWING);
    JobText::on(Path::new("plate.obj"))
        .texture("file = \"a.svg\"\norigin = [\"0 mm\", \"0 mm\"]")
        .write(dir.path(), "a.toml");
    assert_eq!(done(dir.path(), &["preview", "a.toml"]), "a.layout.svg\n");
    assert_eq!(
        json(&done(dir.path(), &["preview", "a.toml", "--json", "-o", "b.svg"])),
        serde_json::json!({"files": ["b.svg"]})
    );
    assert_eq!(read(dir.path().join("a.layout.svg")), read(dir.path().join("b.svg")));
    for input in ["a.svg", "./a.toml", "plate.obj"] {
        let before = read(dir.path().join(input));
        refused(&run(dir.path(), &["preview", "a.toml", "-o", input]), 2, "output-is-input");
        assert_eq!(read(dir.path().join(input)), before);
    }
    refused(&run(dir.path(), &["preview", "a.toml", "-o", "no/such/place.svg"]), 2, "output-unwritable");
    for name in ["x.gif", "x.EPS", "x"] {
        refused(&run(dir.path(), &["preview", "a.toml", "-o", name]), 2, "preview-format");
        assert!(!dir.path().join(name).exists(), "{name}");
    }
}

#[test]
fn with_json_an_error_is_one_object_on_stdout() {
    let dir = job_folder_fixture();
    let of = |args: &[&str]| {
        let o = run(dir.path(), args);
        let found = json(&out(&o));
        assert_eq!(found["exit_code"], o.status.code().expect("a code"), "{args:?}: {found}");
        assert!(!err(&o).is_empty(), "{args:?}: stderr has the same as text");
        for e in found["errors"].as_array().expect("a list") {
            let wanted = ["code", "column", "file", "help", "line", "message", "place", "severity"];
            assert_eq!(keys(e), wanted.into(), "{e}");
        }
        found
    };
    let place = |e: &Value| (e["file"].clone(), e["line"].as_u64(), e["column"].as_u64());
    // A key: file, line and column.
    let text = read(dir.path().join("a.toml"));
    write(dir.path().join("b.toml"), text.replace("0.07 mm", "0.07 parsec"));
    let line = 1 + text.lines().position(|l| l.starts_with("pdof")).expect("a key") as u64;
    let found = of(&["check", "b.toml", "--json"]);
    let e = &found["errors"][0];
    assert_eq!((&e["code"], &e["severity"]), (&"toml".into(), &"error".into()));
    assert_eq!(place(e), ("b.toml".into(), Some(line), Some(8)));
    assert!(e["message"].as_str().is_some_and(|m| m.contains("parsec")), "{e}");
    assert!(e["help"].as_str().is_some_and(|m| m.contains("known units")), "{e}");
    // A limit of the machine, without a place in a file.
    write(dir.path().join("c.toml"), text.clone() + "\n[placement]\norigin = [\"1 m\", \"0 mm\", \"0 mm\"]\n");
    let found = of(&["--json", "compile", "c.toml"]);
    assert_eq!((&found["exit_code"], &found["errors"][0]["code"]), (&1.into(), &"travel".into()));
    assert_eq!(found["errors"][0]["place"], "block B0001");
    // Several errors, and every one is listed.
    write(
        dir.path().join("d.toml"),
        text.replace("speed = \"1000 mm/s\"\npower = \"60 %\"", "speed = \"9 m/s\"\npower = \"60 W\""),
    );
    let found = of(&["check", "d.toml", "--json"]);
    let codes: Vec<&Value> = found["errors"].as_array().expect("a list").iter().map(|e| &e["code"]).collect();
    assert_eq!(codes, ["pen-speed", "pen-power"]);
    assert!(found["errors"].as_array().expect("a list").iter().all(|e| e["line"].is_u64()), "{found}");
    // What was typed, and a folder that is not a job folder.
    assert_eq!(of(&["--json", "compile"])["errors"][0]["code"], "usage");
    let unknown = run(dir.path(), &["check", "-o", "x", "job.toml"]);
    assert!(unknown.status.code() == Some(2) && said(&unknown).contains("'-o'"), "{}", said(&unknown));
    assert!(!said(&unknown).contains("-- -o"), "{}", said(&unknown));
    assert_eq!(of(&["verify", "absent", "--json"])["errors"][0]["message"], "there is no such folder");
    // Without it nothing is on stdout.
    refused(&run(dir.path(), &["check", "b.toml"]), 2, "toml");
}

#[test]
#[ignore = "slow: make test-all"]
fn init_writes_a_job_that_compiles_as_it_is_and_overwrites_nothing() {
    let dir = folder();
    assert_eq!(done(dir.path(), &["init", "new/shop"]).lines().count(), 4);
    done(dir.path(), &["compile", "new/shop/job.toml", "--json"]);
    verify(&dir.path().join("new/shop/job.job"));
    // Editors find the schema by the first line.
    let text = read(dir.path().join("new/shop/job.toml"));
    assert!(text.starts_with("#:schema ./job.schema.json\n"), "{text}");
    assert_eq!(read(dir.path().join("new/shop/job.schema.json")), done(dir.path(), &["init", "--schema"]));
    // The texture of the drawing, uncommented.
    let at = text.find("# [[texture]]").expect("an example");
    let (block, rest) = text[at..].split_once("\n\n").expect("a block");
    let block = block.lines().map(|l| l.strip_prefix("# ").expect("a comment")).collect::<Vec<_>>().join("\n");
    write(dir.path().join("new/shop/leaf.toml"), format!("{}{block}\n\n{rest}", &text[..at]));
    let leaf = json(&done(dir.path(), &["compile", "new/shop/leaf.toml", "--json"]));
    let hatch = json(&done(dir.path(), &["check", "new/shop/job.toml", "--json"]));
    let mark = |v: &Value| v["mark_mm"].as_f64().expect("a length");
    assert!(mark(&leaf) > mark(&hatch) + 100.0, "{leaf}");
    assert_eq!(leaf["warnings"], Value::Array(Vec::new()), "{leaf}");
    verify(&dir.path().join("new/shop/leaf.job"));
    let before = files(&dir.path().join("new"));
    refused(&run(dir.path(), &["init", "new/shop"]), 2, "init-exists");
    std::fs::remove_file(dir.path().join("new/shop/job.toml")).expect("removed");
    refused(&run(dir.path(), &["init", "new/shop"]), 2, "init-exists");
    assert_eq!(files(&dir.path().join("new")).len(), before.len() - 1, "neither file is written where one exists");
    let listed = json(&done(dir.path(), &["init", "--json", "other"]));
    assert_eq!(listed["files"].as_array().map(Vec::len), Some(4));
    write(dir.path().join("file"), "");
    refused(&run(dir.path(), &["init", "file"]), 2, "output-unwritable");

    let schema = json(&done(dir.path(), &["init", "--schema"]));
    let tables = keys(&schema["properties"]);
    assert_eq!(
        tables,
        [
            "mode",
            "surface",
            "placement",
            "setups",
            "dose",
            "texture",
            "focus",
            "partition",
            "order",
            "passes",
            "limits",
            "machine",
            "marked",
            "pen",
            "emit",
            "fixture"
        ]
        .into()
    );
    let sample = read(dir.path().join("other/job.toml"));
    for table in tables {
        let shown = [format!("[{table}]"), format!("# {table} = ")].iter().any(|s| sample.contains(s.as_str()));
        assert!(shown, "the sample shows {table}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn every_built_in_machine_is_listed_and_its_file_compiles() {
    let dir = job_folder_fixture();
    let list = done(dir.path(), &["machines"]);
    let names: Vec<&str> = list.lines().map(|l| l.split_whitespace().next().expect("a name")).collect();
    let built_in = [
        "xyz-galvo-40",
        "xyz-galvo-100",
        "xyz-tilt-galvo-40",
        "xyz-headtilt-galvo-40",
        "xyz-zoom-40",
        "xyzac-galvo-10",
    ];
    assert_eq!(names, built_in);
    assert_eq!(json(&done(dir.path(), &["machines", "--json"])), serde_json::json!(names));
    for name in names {
        write(dir.path().join("machine.toml"), done(dir.path(), &["machines", name]));
        assert_eq!(json(&done(dir.path(), &["machines", name, "--json"]))["name"], name);
        let mut job = JobText::on(Path::new("plate.obj")).texture(HATCH);
        // Plausible for the optics of each.
        job.focus = "pdof = \"0.15 mm\"".into();
        job.machine = "file = \"machine.toml\"".into();
        job.write(dir.path(), "by-file.toml");
        job.machine = format!("profile = \"{name}\"");
        job.write(dir.path(), "by-name.toml");
        let by_file = json(&done(dir.path(), &["compile", "by-file.toml", "--json"]));
        let mut by_name = json(&done(dir.path(), &["check", "by-name.toml", "--json"]));
        // A file states what a built-in machine assumes.
        assert_eq!([&by_file, &by_name].map(|s| s["loading"]["assumed"] == true), [false, true], "{name}");
        by_name["loading"]["assumed"] = false.into();
        assert_eq!(by_file, by_name, "{name}");
        verify(&dir.path().join("by-file.job"));
    }
    refused(&run(dir.path(), &["machines", "laser-o-matic"]), 2, "machine-unknown");
}

#[test]
fn completions_are_scripts_of_their_shell() {
    let dir = folder();
    for (shell, begins) in [("bash", "_terrace()"), ("zsh", "#compdef terrace"), ("fish", "function __fish_terrace")] {
        let script = done(dir.path(), &["completions", shell]);
        assert!(
            script.contains(begins) && script.contains("machines") && script.contains("batch"),
            "{shell}: {script}"
        );
        write(dir.path().join("script"), &script);
        // Where the shell is at hand it reads the script without complaint.
        if let Ok(o) = Command::new(shell).arg("-n").arg(dir.path().join("script")).output() {
            assert!(o.status.success(), "{shell}: {}", said(&o));
        }
    }
}

#[test]
fn manual_pages_have_every_command_and_its_options() {
    let dir = folder();
    let whole = done(dir.path(), &["man"]);
    assert!(whole.contains(".TH terrace 1") && whole.contains("terrace\\-compile(1)"), "{whole}");
    let page = done(dir.path(), &["man", "compile"]);
    assert!(page.contains(".TH terrace-compile 1") && page.contains("\\-\\-output"), "{page}");
    refused(&run(dir.path(), &["man", "burn"]), 2, "command-unknown");
}

#[test]
fn closed_stdout_exits_0() {
    let dir = job_folder_fixture();
    for args in [
        &["init", "--schema"][..],
        &["preview", "a.toml", "-o", "-"],
        &["completions", "bash"],
        &["--help"],
        &["machines"],
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        let mut child = command
            .current_dir(dir.path())
            .args(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        drop(child.stdout.take());
        let o = child.wait_with_output().expect("it ends");
        assert_eq!((o.status.code(), err(&o).as_str()), (Some(0), ""), "{args:?}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn full_disk_exits_2() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux has /dev/full");
    let o = Command::new(env!("CARGO_BIN_EXE_terrace"))
        .args(["init", "--schema"])
        .stdout(full)
        .stderr(Stdio::piped())
        .output()
        .expect("it runs");
    refused(&o, 2, "output-unwritable");
}

#[test]
fn verify_exits_1_on_a_damaged_folder_and_2_on_anything_else() {
    let dir = job_folder_fixture();
    done(dir.path(), &["compile", "a.toml"]);
    let drawing = dir.path().join("a.job/blocks/B0001.dxf");
    let whole = std::fs::read(&drawing).expect("readable");
    write(&drawing, &whole[..whole.len() - 10]);
    let o = run(dir.path(), &["verify", "a.job"]);
    assert_eq!((o.status.code(), err(&o).as_str()), (Some(1), ""));
    assert!(out(&o).ends_with("NOT verified\n") && out(&o).contains("B0001.dxf"), "{}", out(&o));
    assert_eq!(json(&out(&run(dir.path(), &["verify", "a.job", "--json"])))["ok"], false);
    write(&drawing, &whole);
    assert!(done(dir.path(), &["verify", "a.job/"]).ends_with("\nverified\n"));
    // The inputs have moved.
    std::fs::create_dir(dir.path().join("moved")).expect("made");
    for file in ["a.toml", "plate.obj"] {
        std::fs::rename(dir.path().join(file), dir.path().join("moved").join(file)).expect("moved");
    }
    assert_eq!(run(dir.path(), &["verify", "a.job"]).status.code(), Some(1));
    done(dir.path(), &["verify", "a.job", "--inputs", "moved"]);
    for what in [".", "absent", "moved/a.toml"] {
        refused(&run(dir.path(), &["verify", what]), 2, "job-folder");
    }
    write(dir.path().join("a.job/manifest.json"), "{");
    refused(&run(dir.path(), &["verify", "a.job"]), 2, "manifest");
}

#[test]
fn output_folder_is_replaced_whole_or_kept() {
    let dir = job_folder_fixture();
    let target = dir.path().join("a.job");
    done(dir.path(), &["compile", "a.toml"]);
    let before = files(&target);
    write(target.join("stray.txt"), "of an older version");
    done(dir.path(), &["compile", "a.toml", "-o", "a.job/"]);
    assert_eq!(files(&target), before, "nothing of the old folder stays");
    edit_job(dir.path());
    done(dir.path(), &["compile", "a.toml", "-o", "./a.job"]);
    let after = files(&target);
    assert_ne!(before, after);
    break_job(dir.path());
    refused(&run(dir.path(), &["compile", "a.toml"]), 2, "file-unreadable");
    assert_eq!(files(&target), after, "the old folder is kept where compiling fails");
    assert_eq!(names(dir.path()), ["a.job", "a.toml", "plate.obj"].map(String::from).into());
}

#[test]
fn compile_never_replaces_a_folder_that_is_not_a_job() {
    let dir = job_folder_fixture();
    let at = dir.path();
    std::fs::create_dir(at.join("photos")).expect("made");
    write(at.join("photos/part.jpg"), "light");
    // A manifest.json of another program.
    std::fs::create_dir(at.join("site")).expect("made");
    write(at.join("site/manifest.json"), "{\"name\": \"shop\", \"icons\": []}");
    write(at.join("notes.txt"), "words");
    let before = files(at);
    for target in ["photos", "photos/", "site", "notes.txt", "a.toml", "plate.obj"] {
        refused(&run(at, &["compile", "a.toml", "-o", target]), 2, "output-not-a-job");
    }
    for target in [".", "..", "/"] {
        refused(&run(at, &["compile", "a.toml", "-o", target]), 2, "output-name");
    }
    refused(&run(at, &["compile", "a.toml", "-o", "notes.txt/x.job"]), 2, "output-unwritable");
    assert_eq!(files(at), before);
    // A job that lives inside the folder it would replace.
    done(at, &["compile", "a.toml", "-o", "new/deep/a.job", "--json"]);
    verify(&at.join("new/deep/a.job"));
    for file in ["a.toml", "plate.obj"] {
        std::fs::copy(at.join(file), at.join("new/deep/a.job").join(file)).expect("copied");
    }
    let before = files(at);
    refused(&run(at, &["compile", "new/deep/a.job/a.toml", "-o", "new/deep/a.job"]), 2, "output-holds-input");
    assert_eq!(files(at), before);
}

#[test]
#[cfg(unix)]
fn symbolic_links_to_the_output_folder_are_kept() {
    use std::os::unix::fs::symlink;
    let dir = job_folder_fixture();
    let at = dir.path();
    std::fs::create_dir_all(at.join("disk/jobs")).expect("made");
    done(at, &["compile", "a.toml", "-o", "disk/jobs/real.job"]);
    symlink("disk/jobs/real.job", at.join("link.job")).expect("linked");
    symlink("disk/jobs", at.join("jobs")).expect("linked");
    edit_job(at);
    done(at, &["compile", "a.toml", "-o", "link.job"]);
    done(at, &["compile", "a.toml", "-o", "jobs/other.job/"]);
    assert!(std::fs::symlink_metadata(at.join("link.job")).expect("there").is_symlink());
    // The manifest names the job file as it is seen from where the folder really lies.
    for folder in ["link.job", "disk/jobs/real.job", "jobs/other.job", "disk/jobs/other.job"] {
        verify(&at.join(folder));
    }
    assert_eq!(names(&at.join("disk/jobs")), ["real.job", "other.job"].map(String::from).into());
    symlink("nowhere", at.join("lost.job")).expect("linked");
    refused(&run(at, &["compile", "a.toml", "-o", "lost.job"]), 2, "output-unwritable");
    assert!(std::fs::symlink_metadata(at.join("lost.job")).expect("there").is_symlink());
    // A job file that is a link: its inputs lie next to the link.
    std::fs::rename(at.join("a.toml"), at.join("disk/kept.toml")).expect("moved");
    symlink("disk/kept.toml", at.join("a.toml")).expect("linked");
    done(at, &["compile", "a.toml"]);
    verify(&at.join("a.job"));
}

/// The states in which a killed run can leave the neighbourhood of a target, and what the next run
/// makes of them, even one that fails.
#[test]
fn interrupted_folder_exchange_is_finished_or_undone() {
    let dir = job_folder_fixture();
    let at = |name: &str| -> PathBuf { dir.path().join(name) };
    // The names of a process of this computer that has ended; no process has so high a number.
    let owner = format!("{}-{}-4294967295", std::env::consts::OS, terrace_core::host::name());
    let [new, old] = ["new", "old"].map(|ending| at(&format!(".a.job.{owner}.{ending}")));
    let stopped = || write(at(".a.job.lock"), "");
    let clean = || assert!(names(dir.path()).iter().all(|n| !n.starts_with('.')), "{:?}", names(dir.path()));
    let compile = || run(dir.path(), &["compile", "a.toml"]).status.code();
    assert_eq!(compile(), Some(0));
    let first = files(&at("a.job"));
    let job = read(at("a.toml"));
    break_job(dir.path());

    // Between the two renames: the old folder comes back.
    std::fs::rename(at("a.job"), &old).expect("moved");
    std::fs::create_dir(&new).expect("made");
    write(new.join("program.txt"), "half");
    stopped();
    assert_eq!(compile(), Some(2));
    assert_eq!(files(&at("a.job")), first);
    clean();

    // After the second rename: the old one goes.
    std::fs::create_dir(&old).expect("made");
    write(old.join("manifest.json"), read(at("a.job/manifest.json")));
    stopped();
    assert_eq!(compile(), Some(2));
    assert_eq!(files(&at("a.job")), first);
    clean();

    // While the old one was being removed, and then someone took the new one away: no half folder.
    std::fs::rename(at("a.job"), &old).expect("moved");
    std::fs::remove_file(old.join("manifest.json")).expect("removed");
    stopped();
    assert_eq!(compile(), Some(2));
    assert!(!at("a.job").exists());
    clean();

    // While the first folder was being written.
    std::fs::create_dir_all(new.join("blocks")).expect("made");
    write(at("a.toml"), job);
    stopped();
    assert_eq!(compile(), Some(0));
    assert_eq!(files(&at("a.job")), first);
    clean();
}

#[test]
fn a_second_run_on_the_same_target_waits_for_the_first() {
    let dir = job_folder_fixture();
    let lock = std::fs::File::create(dir.path().join(".a.job.lock")).expect("made");
    lock.lock().expect("locked");
    let mut child = Command::new(env!("CARGO_BIN_EXE_terrace"))
        .current_dir(dir.path())
        .args(["compile", "a.toml"])
        .stdout(Stdio::null())
        .spawn()
        .expect("it starts");
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(child.try_wait().expect("asked").is_none(), "it waits");
    assert!(!dir.path().join("a.job").exists());
    drop(lock);
    assert!(child.wait().expect("ended").success());
    verify(&dir.path().join("a.job"));
    assert!(!dir.path().join(".a.job.lock").exists());
}

/// Nobody may make a folder in /sys, the superuser included.
#[test]
#[cfg(target_os = "linux")]
fn unwritable_output_is_an_error_that_names_it() {
    let dir = job_folder_fixture();
    let o = run(dir.path(), &["compile", "a.toml", "-o", "/sys/a.job"]);
    refused(&o, 2, "output-unwritable");
    assert!(err(&o).contains("/sys"), "{}", err(&o));
}

#[test]
fn machine_files_have_a_schema() {
    let out = crate::support::terrace(["machines", "--schema"]);
    assert!(out.status.success(), "{}", said(&out));
    let schema: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
    for key in ["lens", "scanner", "stage", "laser", "delays", "controller"] {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
}

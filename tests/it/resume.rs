//! A job folder of what is left: verified as part of the whole job, blocks with their own bytes, entered by lifts.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use terrace_core::math;

use serde_json::Value;

use crate::foreign;
use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, fixture, folder, machine_file, manifest, said, terrace, verify};

const FORMATS: &str = "[\"dxf\", \"csv\", \"lightburn\", \"lmc\", \"rtc\", \"linuxcnc\", \"gcode\", \"ovf\"]";

/// A wave in two passes, in all formats.
fn wave(dir: &Path) -> PathBuf {
    let stl = dir.join("wave.stl");
    write_stl(&stl, &mesh(20, [0.0, 0.0, 60.0, 50.0], |x, y| 0.2 * math::sin(x / 9.0) * math::cos(y / 8.0)));
    let cards = "\n[lmc]\nunits_per_mm = 1500\n[rtc]\nboard = \"rtc5\"\nbits_per_mm = 20000\n";
    std::fs::write(dir.join("machine.toml"), machine_file("xyz-galvo-40") + cards).expect("a writable folder");
    let job = JobText {
        machine: "file = \"machine.toml\"".into(),
        more: format!("[passes]\ncount = 2\nrotate = \"90 deg\"\n\n[emit]\nformats = {FORMATS}\n"),
        ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"").partition("min_mark = \"3 um\"")
    };
    let out = dir.join("wave.job");
    compile(&job.write(dir, "wave.toml"), &out);
    out
}

/// Resumes with these arguments, and verifies what was written.
fn resumed(whole: &Path, args: &[&str], tail: &Path) -> Value {
    let paths = [whole, Path::new("-o"), tail].map(|p| p.to_str().expect("text"));
    let out = terrace(["resume", "--json"].iter().chain(args).chain(&paths));
    assert!(out.status.success(), "{}", said(&out));
    verify(tail);
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// The code of the error with which resuming ends.
fn refused(whole: &Path, args: &[&str], tail: &Path) -> String {
    let paths = [whole, Path::new("-o"), tail].map(|p| p.to_str().expect("text"));
    let out = terrace(["resume", "--json"].iter().chain(args).chain(&paths));
    assert!(!out.status.success() && !tail.exists(), "{}", said(&out));
    let failure: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    failure["errors"][0]["code"].as_str().expect("a code").to_owned()
}

fn blocks(found: &Value) -> Vec<String> {
    let names = found["subset"]["blocks"].as_array().expect("a list").iter();
    names.map(|name| name.as_str().expect("a name").to_owned()).collect()
}

fn files_of_blocks(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder.join("blocks")).expect("files of blocks");
    entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect()
}

/// All files of a folder, with those of the folders in it.
fn files_below(folder: &Path) -> BTreeSet<String> {
    let names = |at: &Path| -> Vec<PathBuf> {
        std::fs::read_dir(at).expect("a folder").map(|e| e.expect("readable").path()).collect()
    };
    let all = names(folder).into_iter().flat_map(|p| if p.is_dir() { names(&p) } else { vec![p] });
    all.map(|p| p.strip_prefix(folder).expect("inside").to_string_lossy().into_owned()).collect()
}

/// The files of the blocks are those of the whole job, byte for byte, and there are no others; the first move of each
/// stage program lifts.
fn assert_is_of(tail: &Path, whole: &Path, names: &[String]) {
    let wanted: BTreeSet<String> = files_of_blocks(whole)
        .into_iter()
        .filter(|file| names.iter().any(|name| file.starts_with(&format!("{name}."))))
        .collect();
    assert_eq!(files_of_blocks(tail), wanted);
    for file in &wanted {
        let [here, there] = [tail, whole].map(|f| std::fs::read(f.join("blocks").join(file)).expect("a file"));
        assert!(here == there, "{file}");
    }
    for program in ["stage.ngc", "stage_m0.nc"] {
        let Ok(text) = std::fs::read_to_string(tail.join(program)) else { continue };
        let first = text.lines().find(|l| l.starts_with("G0 ")).expect("a move");
        assert_eq!(first, "G0 Z200.000000", "{program}");
        let named: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("(BLOCK ")?.split(' ').next()).collect();
        assert_eq!(named, names, "{program}");
    }
}

#[test]
fn the_rest_of_a_job_is_a_verified_folder_with_the_same_bytes() {
    let dir = folder();
    let whole = wave(dir.path());
    let all = manifest(&whole)["blocks"].as_array().expect("blocks").len();
    assert!(all > 20, "{all}");
    let name = |n: usize| format!("B{n:04}");
    let done = dir.path().join("done.txt");
    std::fs::write(&done, "\u{feff}B0001, B0002\r\n# by hand\nB0004\n").expect("written");
    let middle = name(all / 2);
    let cases: [(Vec<&str>, Vec<usize>); 4] = [
        (vec!["--from", &middle], (all / 2..=all).collect()),
        (vec!["--only", "B0003,B0005-B0007"], vec![3, 5, 6, 7]),
        (vec!["--done", done.to_str().expect("text")], [3].into_iter().chain(5..=all).collect()),
        (vec!["--from", "B0001"], (1..=all).collect()),
    ];
    for (i, (args, wanted)) in cases.iter().enumerate() {
        let tail = dir.path().join(format!("tail{i}.job"));
        let found = resumed(&whole, args, &tail);
        let names: Vec<String> = wanted.iter().map(|&n| name(n)).collect();
        assert_eq!((blocks(&found), found["of"].as_u64()), (names.clone(), Some(all as u64)), "{args:?}");
        assert_is_of(&tail, &whole, &names);
        let sheet = std::fs::read_to_string(tail.join("runsheet.txt")).expect("a sheet");
        assert_eq!(sheet.lines().filter(|l| l.starts_with("[ ] B")).count(), names.len());
        let svg = std::fs::read_to_string(tail.join("layout.svg")).expect("a picture");
        assert!(svg.contains(&format!("{} of {all} blocks are left", names.len())));
        assert_eq!(svg.contains("#block-B0001"), wanted[0] != 1);
        let report = std::fs::read_to_string(tail.join("report.html")).expect("a report");
        assert_eq!(report.matches(&format!("{} of {all} blocks are left: ", names.len())).count(), 1);
        // Besides the files of the blocks that are not left the folder has all that the whole one has.
        let is_left =
            |file: &String| file.split_once("/B").is_none_or(|(_, id)| names.iter().any(|n| n[1..] == id[..4]));
        let wanted: BTreeSet<String> = files_below(&whole).into_iter().filter(is_left).collect();
        assert_eq!(files_below(&tail), wanted, "{args:?}");
    }
    // A rest of a rest holds what both leave.
    let again = dir.path().join("again.job");
    let found = resumed(&dir.path().join("tail1.job"), &["--from", "B0006"], &again);
    assert_eq!(blocks(&found), ["B0006", "B0007"]);
    let svg = std::fs::read_to_string(again.join("layout.svg")).expect("a picture");
    assert_eq!(svg.matches("blocks are left").count(), 2, "in the title and below");
    let report = std::fs::read_to_string(again.join("report.html")).expect("a report");
    assert_eq!(report.matches("blocks are left: ").count(), 1, "those of the last rest");
    let view = std::fs::read_to_string(again.join("view.html")).expect("a view");
    assert!(
        view.contains("type=\"application/json\">{\"left\":[\"B0006\",\"B0007\"],\"schema\""),
        "those of the last rest"
    );
    assert_eq!(
        refused(&dir.path().join("tail1.job"), &["--only", "B0001,B0006"], &dir.path().join("no.job")),
        "resume-block"
    );
    assert_is_of(&again, &whole, &blocks(&found));
    foreign::check_folder(&again, &["check_dxf.py", "check_csv.py", "check_ovf.py", "check_gcode.py"]);
}

#[test]
fn what_cannot_be_resumed_is_refused() {
    let dir = folder();
    let whole = wave(dir.path());
    let tail = dir.path().join("tail.job");
    assert_eq!(refused(&whole, &["--from", "B9999"], &tail), "resume-block");
    assert_eq!(refused(&whole, &["--only", "B0003", "--from", "B0004"], &tail), "resume-empty");
    let done = dir.path().join("done.txt");
    std::fs::write(&done, "B0001\n133\n").expect("written");
    assert_eq!(refused(&whole, &["--done", done.to_str().expect("text")], &tail), "resume-done");
    for args in [["--from", "133"], ["--only", "B0003-B0002"]] {
        assert_eq!(refused(&whole, &args, &tail), "usage", "{args:?}");
    }
    let out = terrace(["resume", "--from", "B0002", "-o"].map(Path::new).into_iter().chain([&*whole, &*whole]));
    assert!(!out.status.success() && said(&out).contains("output-is-input"), "{}", said(&out));
    // A folder whose files have changed is not gone on with.
    let block = whole.join("blocks/B0005.dxf");
    let text = std::fs::read_to_string(&block).expect("a drawing");
    std::fs::write(&block, text.replacen('1', "2", 1)).expect("written");
    assert_eq!(refused(&whole, &["--from", "B0002"], &tail), "resume-changed");
}

#[test]
fn verify_reports_a_rest_that_is_not_what_it_says() {
    let dir = folder();
    let whole = wave(dir.path());
    let tail = dir.path().join("tail.job");
    resumed(&whole, &["--only", "B0003,B0005-B0007"], &tail);
    let path = tail.join("manifest.json");
    let sound = std::fs::read_to_string(&path).expect("a manifest");
    let alter = |edit: &dyn Fn(&mut Value)| {
        let mut document: Value = serde_json::from_str(&sound).expect("JSON");
        edit(&mut document);
        std::fs::write(&path, document.to_string()).expect("written");
        let out = terrace([Path::new("verify"), &tail, Path::new("--json")]);
        let proof: Value = serde_json::from_slice(&out.stdout).expect("JSON");
        let rules = proof["rules"].as_array().expect("rules").iter();
        let broken = rules.filter(|r| r["violated"] != 0).map(|r| r["code"].as_str().expect("a name").to_owned());
        broken.collect::<Vec<_>>()
    };
    assert_eq!(alter(&|_| {}), [""; 0]);
    for edit in [
        // Another order, a block twice, none, one that no job has, and one without files.
        &|m: &mut Value| m["subset"]["blocks"] = ["B0005", "B0003", "B0006", "B0007"].into(),
        &|m| m["subset"]["blocks"] = ["B0003", "B0003", "B0006", "B0007"].into(),
        &|m| m["subset"]["blocks"] = Value::Array(Vec::new()),
        &|m| m["subset"]["blocks"] = ["B0003", "B9005"].into(),
        &|m| m["subset"]["blocks"] = ["B0003", "B0004", "B0005", "B0006", "B0007"].into(),
        &|m| m["blocks"][4]["lift_z_mm"] = Value::Null,
    ] as [&dyn Fn(&mut Value); 6]
    {
        assert!(alter(edit).contains(&"agreement".to_owned()));
    }
    for key in ["stops", "mark_mm", "time_s", "total_s"] {
        // The run sheet has the time in all, too.
        let rules: &[&str] = if key == "total_s" { &["agreement", "summary"] } else { &["summary"] };
        assert_eq!(alter(&|m| m["subset"][key] = 1.into()), rules, "{key}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn the_demo_is_resumed_at_fifty_blocks_in_every_format() {
    let dir = folder();
    let text = std::fs::read_to_string(fixture("hood.toml")).expect("the demo");
    let cards = "\n[lmc]\nunits_per_mm = 1500\n[rtc]\nboard = \"rtc5\"\nbits_per_mm = 20000\n";
    std::fs::write(dir.path().join("machine.toml"), machine_file("xyz-galvo-40") + cards).expect("written");
    let whole = dir.path().join("hood.job");
    let job = text
        .replace("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"")
        .replace("method = \"auto\"", "method = \"auto\"\nmin_mark = \"3 um\"")
        .replace("[\"dxf\", \"linuxcnc\", \"gcode\", \"ovf\"]", FORMATS);
    for name in ["hood.stl", "leather.svg"] {
        std::fs::copy(fixture(name), dir.path().join(name)).expect("copied");
    }
    let path = dir.path().join("hood.toml");
    std::fs::write(&path, job).expect("written");
    compile(&path, &whole);
    let all = manifest(&whole)["blocks"].as_array().expect("blocks").len() as u64;
    let mut state = 42u64;
    for _ in 0..50 {
        // Any of its blocks, by a linear congruence.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let from = format!("B{:04}", (state >> 33) % all + 1);
        let tail = dir.path().join("tail.job");
        let found = resumed(&whole, &["--from", &from], &tail);
        assert_is_of(&tail, &whole, &blocks(&found));
        foreign::check_folder(&tail, &["check_gcode.py"]);
    }
}

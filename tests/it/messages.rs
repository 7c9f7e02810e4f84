//! Mistakes of the first day: what the command line says of them, and what it offers instead.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use terrace_input::job::SAMPLE_JOB;

use crate::support::{folder, said};

fn run(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.current_dir(dir).args(args).env_remove("NO_COLOR").output().expect("the program starts")
}

/// What is said of a command that fails with exit code 2: each message with its help.
fn refusals(dir: &Path, args: &[&str]) -> Vec<[String; 2]> {
    let out = run(dir, &[args, &["--json"]].concat());
    assert_eq!(out.status.code(), Some(2), "{args:?}: {}", said(&out));
    let failure: Value = serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&out)));
    let errors = failure["errors"].as_array().expect("errors");
    let text = |v: &Value| v.as_str().unwrap_or_default().to_owned();
    errors.iter().map(|e| [text(&e["message"]), text(&e["help"])]).collect()
}

/// The sample job in a folder of its own, as `terrace init` writes it.
fn sample() -> tempfile::TempDir {
    let dir = folder();
    let out = run(dir.path(), &["init", "."]);
    assert!(out.status.success(), "{}", said(&out));
    dir
}

/// What `check` says of the sample job with one text replaced.
fn of_job(from: &str, to: &str) -> Vec<[String; 2]> {
    let dir = sample();
    assert!(SAMPLE_JOB.contains(from), "{from}");
    std::fs::write(dir.path().join("job.toml"), SAMPLE_JOB.replacen(from, to, 1)).expect("written");
    refusals(dir.path(), &["check", "job.toml"])
}

#[test]
fn single_tables_for_lists_and_lists_for_tables_are_reported_with_what_to_write() {
    for (from, to, hint) in [
        ("[[texture]]", "[texture]", "write [[texture]]"),
        ("[[pen]]", "[pen]", "write [[pen]]"),
        ("[surface]", "[[surface]]", "write [surface]"),
        ("[focus]", "[[focus]]", "write [focus]"),
        ("[limits]", "[[limits]]", "write [limits]"),
        ("[emit]", "[[emit]]", "write [emit]"),
    ] {
        let found = of_job(from, to);
        assert!(matches!(&found[..], [[_, help]] if help == hint), "{to}: {found:?}");
    }
    let dir = sample();
    let out = run(dir.path(), &["machines", "xyzac-galvo-10", "-o", "m.toml"]);
    assert!(out.status.success(), "{}", said(&out));
    let machine = std::fs::read_to_string(dir.path().join("m.toml")).expect("a file");
    let job = SAMPLE_JOB.replace("profile = \"xyz-galvo-40\"", "file = \"m.toml\"");
    std::fs::write(dir.path().join("job.toml"), job).expect("written");
    for (from, to, hint) in [("[lens]", "[[lens]]", "write [lens]"), ("[stage.x]", "[[stage.x]]", "write [stage.x]")] {
        std::fs::write(dir.path().join("m.toml"), machine.replacen(from, to, 1)).expect("written");
        let found = refusals(dir.path(), &["check", "job.toml"]);
        assert!(matches!(&found[..], [[_, help]] if help == hint), "{to}: {found:?}");
    }
    // One axis alone cannot be a table of its own: the second has nothing to be added to.
    let one = machine.replacen("[[tilt.axes]]", "[tilt.axes]", 1);
    let second = one.find("[[tilt.axes]]").expect("a second axis");
    std::fs::write(dir.path().join("m.toml"), &one[..second]).expect("written");
    let found = refusals(dir.path(), &["check", "job.toml"]);
    assert!(found.iter().any(|[_, help]| help == "write [[tilt.axes]]"), "{found:?}");
}

#[test]
fn tables_that_are_missing_are_reported_all_at_once() {
    let dir = sample();
    let without = |heads: &[&str]| {
        let mut keep = true;
        let text: String = SAMPLE_JOB
            .lines()
            .filter(|line| {
                if line.starts_with('[') {
                    keep = !heads.iter().any(|head| line.starts_with(head));
                }
                keep
            })
            .map(|line| format!("{line}\n"))
            .collect();
        std::fs::write(dir.path().join("job.toml"), text).expect("written");
        refusals(dir.path(), &["check", "job.toml"])
    };
    for (head, help) in [
        ("[[pen]]", "add a [[pen]] at the end of the file"),
        ("[[texture]]", "add a [[texture]] with pattern"),
        ("[focus]", "add [focus] with pdof"),
        ("[machine]", "add [machine] with profile"),
        ("[surface]", "add [surface] with the file"),
    ] {
        let found = without(&[head]);
        let [[message, hint]] = &found[..] else { panic!("{head}: {found:?}") };
        assert_eq!(*message, format!("the job file has no {head}"));
        assert!(hint.starts_with(help), "{hint}");
    }
    let found = of_job("[[pen]]", "[[pens]]");
    assert_eq!(found, [["a job file has no pens", "did you mean [[pen]]?"]]);
    let found = of_job("[focus]", "[fokus]");
    assert_eq!(found, [["a job file has no fokus", "did you mean [focus]?"]]);
    let found = without(&["[[pen]]", "[focus]"]);
    assert_eq!(found.len(), 2, "{found:?}");
}

#[test]
fn a_value_that_is_at_fault_causes_no_second_error() {
    const PDOF: &str = "pdof = \"0.07 mm\"";
    for pdof in ["0 mm", "-0.07 mm", "5 m"] {
        let found = of_job(PDOF, &format!("pdof = \"{pdof}\""));
        assert!(
            matches!(&found[..], [[message, _]] if message.starts_with("the depth of focus comes to")),
            "{found:?}"
        );
        let found = of_job(PDOF, &format!("pdof = \"{pdof}\"\nreserve = \"0.01 mm\""));
        assert_eq!(found.len(), 1, "{found:?}");
    }
    for dof in ["dof = \"0.06 mm\"\nfactor = 0", "dof = \"0.06 mm\"\nfactor = -1", "dof = \"0 mm\""] {
        assert_eq!(of_job(PDOF, dof).len(), 1, "{dof}");
    }
}

#[test]
fn mirror_says_what_it_takes() {
    let file = |mirror: &str| format!("file = \"sample.svg\"\nmirror = {mirror}");
    for mirror in ["true", "false", "\"left\"", "1"] {
        let found = of_job("pattern = \"hatch\"", &file(mirror));
        assert!(matches!(&found[..], [[_, help]] if help.contains("\"x\"") && help.contains("\"y\"")), "{found:?}");
    }
}

#[test]
fn typographic_quotes_are_named() {
    for (open, close) in [('\u{201c}', '\u{201d}'), ('\u{201e}', '\u{201c}'), ('\u{2018}', '\u{2019}')] {
        let found = of_job("unit = \"mm\"", &format!("unit = {open}mm{close}"));
        assert!(
            matches!(&found[..], [[message, _]] if message.starts_with("these are typographic quotes")),
            "{found:?}"
        );
    }
}

#[test]
fn files_of_other_encodings_are_reported_with_line_and_remedy() {
    let dir = sample();
    let at = |name: &str| dir.path().join(name);
    let utf16 = |text: &str| -> Vec<u8> {
        std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
    };
    // Windows PowerShell 5 writes such files with `>`.
    std::fs::write(at("wide.toml"), utf16(SAMPLE_JOB)).expect("written");
    let found = refusals(dir.path(), &["check", "wide.toml"]);
    assert!(found[0][0].ends_with("not UTF-8 text: it is UTF-16") && found[0][1].contains("-o FILE"), "{found:?}");
    let machine = terrace_core::machine::PROFILES[0].1;
    let job = SAMPLE_JOB.replace("profile = \"xyz-galvo-40\"", "file = \"m.toml\"");
    std::fs::write(at("job.toml"), job).expect("written");
    std::fs::write(at("m.toml"), utf16(machine)).expect("written");
    let found = refusals(dir.path(), &["check", "job.toml"]);
    assert!(found[0][0].starts_with("the machine file is not UTF-8 text: it is UTF-16"), "{found:?}");
    let latin: Vec<u8> = format!("# spot of 20 \u{b5}m\n{machine}").chars().map(|c| c as u32 as u8).collect();
    std::fs::write(at("m.toml"), latin).expect("written");
    let out = run(dir.path(), &["check", "job.toml"]);
    assert!(said(&out).contains("m.toml:1") && said(&out).contains("Latin-1"), "{}", said(&out));
    let latin: Vec<u8> =
        SAMPLE_JOB.replace("×", "x").replacen("A terrace job", "\u{e4}", 1).chars().map(|c| c as u32 as u8).collect();
    std::fs::write(at("latin.toml"), latin).expect("written");
    let out = run(dir.path(), &["check", "latin.toml"]);
    assert!(said(&out).contains("latin.toml:2") && said(&out).contains("0xe4 is '\u{e4}'"), "{}", said(&out));
}

#[test]
fn a_surface_or_folder_in_place_of_the_job_file_is_reported_with_what_was_meant() {
    let dir = sample();
    std::fs::create_dir(dir.path().join("sub")).expect("made");
    for command in ["check", "compile", "preview", "orient", "compare"] {
        let found = refusals(dir.path(), &[command, "sample.stl"]);
        assert_eq!(found, [["this is an STL file, not a job file", "did you mean job.toml?"]], "{command}");
        let found = refusals(dir.path(), &[command, "sample.svg"]);
        assert_eq!(found[0][0], "this is an SVG drawing, not a job file", "{command}");
        let found = refusals(dir.path(), &[command, "."]);
        assert_eq!(found, [["this is a folder, not a job file", "did you mean job.toml?"]], "{command}");
        assert!(refusals(dir.path(), &[command, "sub"])[0][1].starts_with("name a job file"), "{command}");
    }
    let found = refusals(dir.path(), &["sweep", "sample.stl", "--set", "focus.pdof=50um,70um"]);
    assert_eq!(found[0][1], "did you mean job.toml?");
    let out = run(dir.path(), &["machines", "xyz-galvo-40", "-o", "mill.toml"]);
    assert!(out.status.success(), "{}", said(&out));
    assert_eq!(refusals(dir.path(), &["check", "mill.toml"])[0][0], "this is a machine file, not a job file");
}

#[test]
fn a_job_file_in_place_of_its_folder_is_reported_with_the_folder() {
    let dir = sample();
    let made = refusals(dir.path(), &["verify", "job.toml"]);
    assert_eq!(
        made,
        [["this is a job file, not a job folder", "make its folder first: terrace compile job.toml --verify"]]
    );
    let out = run(dir.path(), &["compile", "job.toml"]);
    assert!(out.status.success(), "{}", said(&out));
    for args in [
        &["verify", "job.toml"][..],
        &["run", "job.toml", "--with", "run.toml"],
        &["resume", "job.toml", "--from", "B0002", "-o", "rest.job"],
        &["verify", "job"],
        &["verify", "."],
        &["verify", "job.jbo"],
        &["verify", "job.job/manifest.json"],
    ] {
        let found = refusals(dir.path(), args);
        assert!(matches!(&found[..], [[_, help]] if help == "did you mean job.job?"), "{args:?}: {found:?}");
    }
    assert_eq!(
        refusals(dir.path(), &["check", "job.job"])[0],
        ["this is a job folder, not a job file", "did you mean job.toml?"]
    );
}

#[test]
fn a_run_file_that_is_missing_has_the_help_of_a_command_line() {
    let dir = sample();
    assert!(run(dir.path(), &["compile", "job.toml"]).status.success());
    let found = refusals(dir.path(), &["run", "job.job", "--with", "shop.toml"]);
    assert!(!found[0][1].contains("job file") && found[0][1].contains("shop.toml"), "{found:?}");
    // What a job names is relative to it.
    let found = of_job("sample.stl", "part.stl");
    assert!(found[0][1].ends_with("paths in a job file are relative to the job file"), "{found:?}");
}

#[test]
fn a_key_without_its_table_is_reported_with_it() {
    let dir = sample();
    let found = refusals(dir.path(), &["sweep", "job.toml", "--set", "pdof=50um,70um"]);
    assert_eq!(found[0][1], "did you mean focus.pdof?");
    let found = refusals(dir.path(), &["sweep", "job.toml", "--set", "pitch=50um,70um"]);
    assert_eq!(found[0][1], "did you mean texture.0.pitch?");
}

/// Whether a command colours its messages.
fn is_coloured(dir: &Path, args: &[&str], environment: &[(&str, &str)]) -> bool {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.current_dir(dir).args(args).env_remove("NO_COLOR").envs(environment.iter().copied());
    String::from_utf8_lossy(&command.output().expect("the program starts").stderr).contains("\u{1b}[")
}

#[test]
fn colours_are_given_always_and_never_as_asked() {
    let dir = folder();
    // An error of the program, an error of usage, a warning.
    for args in [&["check", "no.toml"][..], &["check", "--nonsense"]] {
        let with = |color: &str| is_coloured(dir.path(), &[args, &[color]].concat(), &[]);
        assert_eq!(["--color=always", "--color=never", "--color=auto"].map(with), [true, false, false], "{args:?}");
    }
}

/// On a terminal, which `script` makes.
#[test]
#[cfg(target_os = "linux")]
fn colours_on_a_terminal_follow_the_environment() {
    let dir = folder();
    let seen = |args: &str, environment: &[(&str, &str)]| {
        let line = format!("{} {args}", env!("CARGO_BIN_EXE_terrace"));
        let mut command = Command::new("script");
        command.args(["-qec", &line, "/dev/null"]).current_dir(dir.path()).env_remove("NO_COLOR");
        command.env("TERM", "xterm").envs(environment.iter().copied());
        let out = command.output().expect("script is installed");
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(text.contains("error"), "{text}");
        text.contains("\u{1b}[1m")
    };
    for args in ["check no.toml", "check --nonsense"] {
        assert!(seen(args, &[]), "{args}");
        assert!(!seen(args, &[("NO_COLOR", "1")]), "{args}");
        assert!(!seen(args, &[("TERM", "dumb")]), "{args}");
        assert!(seen(&format!("--color always {args}"), &[("NO_COLOR", "1")]), "{args}");
        assert!(!seen(&format!("--color never {args}"), &[]), "{args}");
        assert!(seen(args, &[("NO_COLOR", "")]), "an empty NO_COLOR counts as unset: {args}");
    }
}

#[test]
fn files_to_start_from_are_written_in_utf8_without_a_shell() {
    let dir = folder();
    for (args, name) in [
        (&["machines", "xyz-galvo-40"][..], "our.toml"),
        (&["machines", "--schema"], "machine.schema.json"),
        (&["init", "--schema"], "job.schema.json"),
    ] {
        let printed = run(dir.path(), args);
        let out = run(dir.path(), &[args, &["-o", name]].concat());
        assert!(out.status.success(), "{args:?}: {}", said(&out));
        assert_eq!(std::fs::read(dir.path().join(name)).expect("a file"), printed.stdout, "{args:?}");
        // What lies there may be the machine of a shop.
        let again = refusals(dir.path(), &[args, &["-o", name]].concat());
        assert_eq!(again[0][0], "the file exists already", "{args:?}");
    }
    assert!(refusals(dir.path(), &["machines", "-o", "x.toml"])[0][0].contains("needs the name"));
}

#[test]
fn machines_are_listed_in_columns_with_their_depth_of_focus() {
    let out = run(&std::env::temp_dir(), &["machines"]);
    let text = String::from_utf8(out.stdout).expect("text");
    assert_eq!(text.lines().count(), terrace_core::machine::PROFILES.len());
    for column in ["  field ", " mm, depth of focus ", " mm, travel "] {
        let places: Vec<Option<usize>> = text.lines().map(|line| line.find(column)).collect();
        assert!(places.iter().all(|at| at.is_some() && *at == places[0]), "{column}: {text}");
    }
    assert!(text.lines().next().is_some_and(|line| line.contains("depth of focus 1.770 mm")), "{text}");
}

#[test]
fn help_is_wrapped_to_the_terminal() {
    for width in [60, 80, 100] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        let out = command.args(["run", "--help"]).env("COLUMNS", width.to_string()).output().expect("it starts");
        let text = String::from_utf8(out.stdout).expect("text");
        // Examples are commands, which are not broken.
        let help = text.split("\nExamples:").next().unwrap_or_default();
        let longest = help.lines().map(|line| line.chars().count()).max().unwrap_or(0);
        assert!(longest <= width && longest > width / 2, "{width}: {longest}\n{help}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn what_was_verified_is_said_and_not_asked_for_again() {
    let dir = sample();
    let text = |args: &[&str]| {
        let out = run(dir.path(), args);
        assert!(out.status.success(), "{args:?}: {}", said(&out));
        String::from_utf8(out.stdout).expect("text")
    };
    let plain = text(&["compile", "job.toml"]);
    assert!(plain.contains("\nthen run       terrace verify job.job\n") && !plain.contains("\nverified "), "{plain}");
    let report = || std::fs::read_to_string(dir.path().join("job.job/report.html")).expect("a report");
    // A page cannot know what is done after it was written.
    assert!(!report().contains("Not verified") && report().contains("terrace verify reads"), "{}", report());
    let verified = text(&["compile", "job.toml", "--verify"]);
    let line = verified.lines().find(|line| line.starts_with("verified ")).expect("a line of it");
    assert!(line.contains("rules (") && !verified.contains("then run"), "{verified}");
    assert!(report().contains("Verified: its files were read back"), "{}", report());
    let json: Value = serde_json::from_str(&text(&["compile", "job.toml", "--verify", "--json"])).expect("JSON");
    assert!(json["verified"]["checks"].as_u64().is_some_and(|n| n > 100), "{json}");
    // A path that a shell would take apart is quoted.
    let spaced = text(&["compile", "job.toml", "-o", "my part's.job"]);
    if cfg!(unix) {
        assert!(spaced.contains("terrace verify 'my part'\\''s.job'"), "{spaced}");
    }
}

#[test]
fn candidates_show_what_they_were_compared_by() {
    let dir = sample();
    let text = |job: &str| {
        std::fs::write(dir.path().join("job.toml"), job).expect("written");
        let out = run(dir.path(), &["check", "job.toml"]);
        assert!(out.status.success(), "{}", said(&out));
        String::from_utf8(out.stdout).expect("text")
    };
    let candidates =
        |text: &str| text.lines().filter(|l| l.starts_with("candidate")).map(str::to_owned).collect::<Vec<_>>();
    let whole = text(SAMPLE_JOB);
    assert!(candidates(&whole).len() > 1 && candidates(&whole).iter().all(|l| !l.contains("loading")), "{whole}");
    let machine = run(dir.path(), &["machines", "xyz-galvo-40"]).stdout;
    let machine = String::from_utf8(machine).expect("text").replace("way = \"run\"", "way = \"person\"");
    std::fs::write(dir.path().join("machine.toml"), machine).expect("written");
    let by_hand = text(&SAMPLE_JOB.replace("profile = \"xyz-galvo-40\"", "file = \"machine.toml\""));
    assert!(candidates(&by_hand).iter().all(|l| l.ends_with(" with loading")), "{by_hand}");
    assert!(
        by_hand
            .contains("\noptics         depth of focus 1.770 mm (spot 0.02 mm, 355 nm, M2 1); PDOF is 0.040 of it\n"),
        "{by_hand}"
    );
}

#[test]
fn keys_without_effect_are_reported_once() {
    let dir = sample();
    let job = SAMPLE_JOB.replacen("pdof = \"0.07 mm\"", "pdof = \"0.07 mm\"\nfactor = 5", 1);
    std::fs::write(dir.path().join("job.toml"), job).expect("written");
    let out = run(dir.path(), &["check", "job.toml"]);
    assert!(out.status.success(), "{}", said(&out));
    assert_eq!(said(&out).matches("warning[key-unused]").count(), 1, "{}", said(&out));
    assert!(said(&out).contains("factor = 5"), "{}", said(&out));
}

#[test]
fn lenses_are_ranked_by_a_sweep_of_profiles() {
    let dir = sample();
    let set = "machine.profile=xyz-galvo-40,xyz-galvo-100,xyz-zoom-40";
    let out = run(dir.path(), &["sweep", "job.toml", "--set", set, "--json"]);
    assert!(out.status.success(), "{}", said(&out));
    let found: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    let stops: Vec<u64> = found["sweep"].as_array().expect("rows").iter().filter_map(|r| r["stops"].as_u64()).collect();
    assert_eq!(stops.len(), 3, "{found}");
    assert!(stops[1] < stops[0] && stops[2] < stops[0], "a larger field and a zoom optic need fewer stops: {stops:?}");
}

/// Names that a file system takes and a terminal acts on.
#[test]
#[cfg(unix)]
fn names_reach_neither_the_terminal_nor_the_run_sheet_as_they_are() {
    let dir = sample();
    let evil = "a\u{1b}]0;title\u{7}\u{202e}b";
    let machine =
        terrace_core::machine::PROFILES[0].1.replacen("name = \"xyz-galvo-40\"", "name = \"m\\u001b[31m\\u202e\"", 1);
    std::fs::write(dir.path().join("m.toml"), machine).expect("written");
    let job = SAMPLE_JOB.replace("profile = \"xyz-galvo-40\"", "file = \"m.toml\"");
    std::fs::write(dir.path().join(format!("{evil}.toml")), job).expect("written");
    let is_clean = |text: &str| !text.contains(['\u{1b}', '\u{7}', '\u{202e}']);
    for args in
        [["compile", "X.toml"], ["inspect", "X.job"], ["verify", "X.job"], ["batch", "X.toml"], ["check", "X.toml"]]
    {
        let args = args.map(|word| word.replacen('X', evil, 1));
        let out = run(dir.path(), &[&args[0], &args[1]]);
        assert!(is_clean(&said(&out)), "{args:?}: {:?}", said(&out));
    }
    let sheet = std::fs::read_to_string(dir.path().join(format!("{evil}.job/runsheet.txt"))).expect("a run sheet");
    assert!(is_clean(&sheet) && sheet.contains("\\u001b[31m"), "{sheet:?}");
}

#[test]
#[cfg(unix)]
fn names_with_a_backslash_compile_and_verify() {
    let dir = sample();
    let at = |name: &str| dir.path().join(name);
    std::fs::rename(at("sample.stl"), at("a\\b.stl")).expect("moved");
    std::fs::write(at("m\\n.toml"), terrace_core::machine::PROFILES[0].1).expect("written");
    let job =
        SAMPLE_JOB.replace("\"sample.stl\"", "'a\\b.stl'").replace("profile = \"xyz-galvo-40\"", "file = 'm\\n.toml'");
    std::fs::write(at("j\\k.toml"), job).expect("written");
    let out = run(dir.path(), &["compile", "j\\k.toml", "-o", "out.job"]);
    assert!(out.status.success(), "{}", said(&out));
    crate::support::verify(&at("out.job"));
}

#[test]
#[cfg(unix)]
fn pipes_in_place_of_files_are_refused_and_not_waited_for() {
    let dir = sample();
    assert!(run(dir.path(), &["compile", "job.toml"]).status.success());
    let pipe = |name: &str| {
        let _ = std::fs::remove_file(dir.path().join(name));
        assert!(Command::new("mkfifo").arg(dir.path().join(name)).status().expect("mkfifo").success());
    };
    pipe("job.job/blocks/B0002.dxf");
    let found = refusals(dir.path(), &["resume", "job.job", "--from", "B0002", "-o", "rest.job"]);
    assert_eq!(found[0][0], "this is not a regular file");
    std::fs::remove_dir_all(dir.path().join("job.job")).expect("removed");
    pipe(".job.job.lock");
    assert!(refusals(dir.path(), &["compile", "job.toml"])[0][0].starts_with("cannot lock the output"));
    std::fs::remove_file(dir.path().join(".job.job.lock")).expect("removed");
    // The claim of a batch is not needed to compile, and is not opened.
    pipe(".job.job.claim");
    assert!(run(dir.path(), &["compile", "job.toml"]).status.success());
}

#[test]
#[cfg(target_os = "linux")]
fn memory_is_asked_for_before_strokes_are_traced_and_sections_laid() {
    let dir = sample();
    let limited = |job: &str| {
        std::fs::write(dir.path().join("job.toml"), job).expect("written");
        let line = format!("ulimit -v 600000; exec {} -j 1 check job.toml", env!("CARGO_BIN_EXE_terrace"));
        let out = Command::new("sh").args(["-c", &line]).current_dir(dir.path()).output().expect("sh starts");
        assert_eq!(out.status.code(), Some(1), "{}", said(&out));
        said(&out)
    };
    let hilbert = SAMPLE_JOB
        .replace("pattern = \"hatch\"", "pattern = \"hilbert\"\norder = 13")
        .replace("pitch = \"0.5 mm\"", "")
        .replace("direction = \"0 deg\"", "")
        .replace("[limits]", "[limits]\nimplausible = \"allow\"");
    let text = limited(&hilbert);
    assert!(text.contains("error[memory]: the longest stroke of the texture needs about 2048 MB"), "{text}");
    let machine = terrace_core::machine::PROFILES[0]
        .1
        .replace("field = [\"40 mm\", \"40 mm\"]", "field = [\"50 um\", \"50 um\"]");
    std::fs::write(dir.path().join("m.toml"), machine).expect("written");
    let fine = SAMPLE_JOB.replace("profile = \"xyz-galvo-40\"", "file = \"m.toml\"");
    let text = limited(&fine.replace("pitch = \"0.5 mm\"", "pitch = \"0.05 mm\""));
    assert!(text.contains("error[memory]: what lies in the sections needs about "), "{text}");
}

//! What a terminal asks of the program: explanations of codes, manual pages, completions, errors as JSON of every
//! command.

use std::path::Path;
use std::process::{Command, Output};
use terrace_core::math;

use std::sync::Mutex;

use serde_json::Value;
use terrace_compare::compare;
use terrace_input::job::{Job, Mode, Overrides};
use terrace_plan::plan::{self, Phase};
use terrace_report::job_folder;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, folder, said};

fn run(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.current_dir(dir).args(args).output().expect("the program starts")
}

fn done(dir: &Path, args: &[&str]) -> String {
    let o = run(dir, args);
    assert_eq!(o.status.code(), Some(0), "{args:?}: {}", said(&o));
    String::from_utf8(o.stdout).expect("text")
}

const COMMANDS: [&str; 21] = [
    "init",
    "check",
    "compile",
    "verify",
    "run",
    "preview",
    "orient",
    "probe",
    "register",
    "compare",
    "sweep",
    "resume",
    "batch",
    "diff",
    "doctor",
    "inspect",
    "import",
    "machines",
    "explain",
    "completions",
    "man",
];

#[test]
fn explain_prints_the_section_of_a_code() {
    let dir = folder();
    let text = done(dir.path(), &["explain", "travel"]);
    assert!(text.starts_with("travel: limit, exit code 1\n\nStops lie beyond the travel of an axis"), "{text}");
    assert!(!text.contains("registration"), "the next section is left out: {text}");
    // As it stands in a message.
    assert_eq!(done(dir.path(), &["explain", "error[travel]"]), text);
    let json: Value = serde_json::from_str(&done(dir.path(), &["explain", "pdof-large", "--json"])).expect("JSON");
    assert_eq!((&json["code"], &json["kinds"]), (&"pdof-large".into(), &serde_json::json!(["limit", "warning"])));
    assert!(json["text"].as_str().is_some_and(|text| text.starts_with("Blocks would be deeper")), "{json}");
    let o = run(dir.path(), &["explain", "travle"]);
    assert_eq!(o.status.code(), Some(2));
    assert!(said(&o).contains("error[code-unknown]") && said(&o).contains("travel"), "{}", said(&o));
}

#[test]
fn manual_pages_of_all_commands_are_written_with_their_examples() {
    let dir = folder();
    let named = done(dir.path(), &["man", "-o", "man1"]);
    assert_eq!(named.lines().count(), 1 + COMMANDS.len(), "{named}");
    for name in COMMANDS {
        let page = std::fs::read_to_string(dir.path().join(format!("man1/terrace-{name}.1"))).expect("a page");
        assert!(page.contains(".SH NAME") && page.contains("Examples:") && page.contains("json"), "{name}: {page}");
        assert_eq!(done(dir.path(), &["man", name]), page);
    }
    let page = std::fs::read_to_string(dir.path().join("man1/terrace.1")).expect("a page");
    assert!(page.contains("terrace\\-compile(1)") && page.contains("terrace init try"), "{page}");
    assert_eq!(done(dir.path(), &["man"]), page);
    let o = run(dir.path(), &["man", "cmpile"]);
    assert!(o.status.code() == Some(2) && said(&o).contains("command-unknown"), "{}", said(&o));
}

#[test]
fn completions_of_every_shell_know_the_values() {
    let dir = folder();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = done(dir.path(), &["completions", shell]);
        for name in COMMANDS {
            assert!(script.contains(name), "{shell}: {name}");
        }
        // Elvish and PowerShell complete commands and options; fish the values of options too, but not of arguments.
        let values: &[&str] = match shell {
            "bash" | "zsh" => {
                &["on-the-fly", "saturate", "zoom", "partition.method=window", "xyz-galvo-40", "svg-text"]
            }
            "fish" => &["on-the-fly", "saturate", "zoom", "partition.method=window"],
            _ => &[],
        };
        for value in values {
            assert!(script.contains(value), "{shell}: {value}");
        }
    }
}

/// The keys that bash completes behind `--set`.
#[test]
fn bash_completes_the_keys_of_a_setting() {
    let dir = folder();
    let script = done(dir.path(), &["completions", "bash"]);
    std::fs::write(dir.path().join("terrace.bash"), script).expect("a script");
    let completed = |typed: &str| {
        let asked = format!(
            "source terrace.bash; COMP_WORDS=(terrace sweep job.toml --set '{typed}'); COMP_CWORD=4; \
             _terrace_with_settings terrace '{typed}' --set; echo \"${{COMPREPLY[@]}}\""
        );
        let o =
            Command::new("bash").current_dir(dir.path()).args(["--norc", "-c", &asked]).output().expect("bash runs");
        assert!(o.status.success() && o.stderr.is_empty(), "{}", String::from_utf8_lossy(&o.stderr));
        String::from_utf8(o.stdout).expect("text").trim().to_owned()
    };
    assert_eq!(completed("focus.pd"), "focus.pdof=");
    assert_eq!(completed("partition.obj"), "partition.objective=time partition.objective=stops");
    assert_eq!(completed("texture.0.dp"), "texture.0.dpi=file texture.0.dpi=");
}

/// What each command says as JSON where it cannot do what it is asked to.
#[test]
fn every_command_gives_its_errors_as_one_json_object() {
    let dir = folder();
    let cases: [(&[&str], &str); 24] = [
        (&["init", "/dev/null/x"], "output-unwritable"),
        (&["check", "no.toml"], "file-unreadable"),
        (&["compile", "no.toml"], "file-unreadable"),
        (&["verify", "no.job"], "job-folder"),
        (&["run", "no.job", "--with", "no.toml"], ""),
        (&["preview", "no.toml"], "file-unreadable"),
        (&["orient", "no.toml"], "file-unreadable"),
        (&["compare", "no.toml"], "file-unreadable"),
        (&["sweep", "no.toml", "--set", "focus.pdof=1mm,2mm"], "file-unreadable"),
        (&["resume", "no.job", "--from", "B0002", "-o", "x.job"], ""),
        (&["batch", "no"], ""),
        (&["inspect", "no.stl"], ""),
        (&["import", "no.step"], "file-unreadable"),
        (&["machines", "no"], ""),
        (&["explain", "no-such-code"], "code-unknown"),
        (&["man", "no"], "command-unknown"),
        // What clap finds wrong.
        (&["completions", "tcl"], "usage"),
        (&["compile"], "usage"),
        (&["burn"], "usage"),
        (&[], "usage"),
        (&["check", "a.toml", "--mode", "walk"], "usage"),
        (&["compare", "a.toml", "--systems", "flat,no"], "usage"),
        (&["sweep", "a.toml", "--set", "focus.pdof"], "usage"),
        (&["resume", "a.job", "-o", "b.job"], "usage"),
    ];
    for (args, code) in cases {
        for args in [[&["--json"], args].concat(), [args, &["--json"]].concat()] {
            let o = run(dir.path(), &args);
            let found: Value =
                serde_json::from_slice(&o.stdout).unwrap_or_else(|e| panic!("{args:?}: {e}: {}", said(&o)));
            let first = &found["errors"][0];
            assert_eq!(found["exit_code"], o.status.code().expect("a code"), "{args:?}: {found}");
            assert!(first["code"].is_string() && (code.is_empty() || first["code"] == code), "{args:?}: {found}");
            let text = first["message"].as_str().expect("a text");
            assert!(!text.is_empty() && !text.contains('\n') && !text.contains('\u{1b}'), "{args:?}: {found}");
            assert_eq!(o.status.code(), Some(2), "{args:?}");
            assert!(!o.stderr.is_empty(), "{args:?}: stderr has the same as text");
        }
    }
}

/// A gentle bulge under a hatch.
fn bulge(dir: &Path, pitch: &str, more: &str, mode: Option<Mode>) -> Job {
    let stl = dir.join("bulge.stl");
    write_stl(&stl, &mesh(30, [0.0, 0.0, 60.0, 50.0], |x, y| math::sin(x / 20.0) * math::cos(y / 17.0)));
    let mut job = JobText::on(&stl).texture(&format!("pattern = \"hatch\"\npitch = {pitch:?}")).method("auto");
    job.focus = "pdof = \"0.2 mm\"".into();
    job.more = more.into();
    Job::load(&job.write(dir, "bulge.toml"), &Overrides { mode, ..Overrides::default() })
        .unwrap_or_else(|e| panic!("{e}"))
}

/// Holds that what was reported goes through the phases in order, in each from 0 to 100 percent and never back.
fn assert_rises<P: Copy + PartialEq + std::fmt::Debug>(reported: Mutex<Vec<(P, u8)>>, phases: &[P]) {
    let reported = reported.into_inner().expect("nothing broke");
    let mut order: Vec<P> = reported.iter().map(|t| t.0).collect();
    order.dedup();
    assert_eq!(order, phases);
    for &phase in phases {
        let percents: Vec<u8> = reported.iter().filter(|t| t.0 == phase).map(|t| t.1).collect();
        assert!(percents.windows(2).all(|w| w[0] < w[1]), "{phase:?}: {percents:?}");
        assert_eq!((percents[0], percents[percents.len() - 1]), (0, 100), "{phase:?}: {percents:?}");
    }
}

/// How many percents were reported of a phase.
fn steps_of<P: PartialEq>(reported: &Mutex<Vec<(P, u8)>>, phase: &P) -> usize {
    reported.lock().expect("nothing broke").iter().filter(|t| t.0 == *phase).count()
}

#[test]
fn percent_rises_from_0_to_100_in_every_phase_of_a_stepped_job_and_its_verification() {
    let dir = folder();
    let job = bulge(dir.path(), "0.5 mm", "[passes]\ncount = 3\nrotate = \"30 deg\"\n", None);
    let phases = [plan::phases(&job), plan::phases_of_writing(&job)].concat();
    assert!(phases.contains(&Phase::Passes) && phases.contains(&Phase::Draw), "{phases:?}");
    let reported = Mutex::new(Vec::new());
    let hear = |phase: Phase, percent: u8| reported.lock().expect("nothing broke").push((phase, percent));
    let plan = plan::plan(job, &hear).unwrap_or_else(|e| panic!("{e}"));
    let target = dir.path().join("bulge.job");
    let unsynced = job_folder::Durability::Unsynced;
    job_folder::write_with(&plan, &target, unsynced, &hear).unwrap_or_else(|e| panic!("{e}"));
    for phase in [Phase::Footprint, Phase::Split, Phase::Order, Phase::Passes, Phase::Write] {
        let steps = steps_of(&reported, &phase);
        assert!(steps >= 10, "{phase:?} tells {steps} percents");
    }
    assert_rises(reported, &phases);
    let reported = Mutex::new(Vec::new());
    let hear = |phase, percent| reported.lock().expect("nothing broke").push((phase, percent));
    assert!(terrace_verify::verify_with_progress(&target, None, &hear).unwrap_or_else(|e| panic!("{e}")).ok);
    assert!(steps_of(&reported, &terrace_verify::Phase::Marks) >= 10);
    assert_rises(reported, &terrace_verify::Phase::ALL);
}

#[test]
#[ignore = "slow: make test-all"]
fn percent_rises_from_0_to_100_in_every_phase_of_an_on_the_fly_job_and_its_verification() {
    let dir = folder();
    let job = bulge(dir.path(), "10 mm", "", Some(Mode::OnTheFly));
    let phases = [plan::phases(&job), plan::phases_of_writing(&job)].concat();
    let reported = Mutex::new(Vec::new());
    let hear = |phase: Phase, percent: u8| reported.lock().expect("nothing broke").push((phase, percent));
    let plan = plan::plan(job, &hear).unwrap_or_else(|e| panic!("{e}"));
    let target = dir.path().join("bulge.fly.job");
    let unsynced = job_folder::Durability::Unsynced;
    job_folder::write_with(&plan, &target, unsynced, &hear).unwrap_or_else(|e| panic!("{e}"));
    assert_rises(reported, &phases);
    let reported = Mutex::new(Vec::new());
    let hear = |phase, percent| reported.lock().expect("nothing broke").push((phase, percent));
    assert!(terrace_verify::verify_with_progress(&target, None, &hear).unwrap_or_else(|e| panic!("{e}")).ok);
    assert_rises(reported, &terrace_verify::Phase::ALL);
}

#[test]
#[ignore = "slow: make test-all"]
fn orient_and_compare_tell_their_progress() {
    let dir = folder();
    let job = bulge(dir.path(), "10 mm", "", None);
    let reported = Mutex::new(Vec::new());
    let hear = |phase, percent| reported.lock().expect("nothing broke").push((phase, percent));
    plan::orient::orient(&job, &hear).unwrap_or_else(|e| panic!("{e}"));
    assert_rises(reported, &plan::orient::PHASES);
    let (reported, names) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let progress = compare::Progress {
        begins: &|name| names.lock().expect("nothing broke").push(name),
        percent: &|percent| reported.lock().expect("nothing broke").push(((), percent)),
    };
    let asked: Vec<_> = compare::SYSTEMS.iter().copied().filter(|s| ["flat", "z-range"].contains(&s.name)).collect();
    let protection = terrace_plan::on_the_fly::axes::following_error::Protection::ALL[0];
    compare::compare(&job, &asked, protection, None, progress).unwrap_or_else(|e| panic!("{e}"));
    assert!(steps_of(&reported, &()) >= 10);
    assert_rises(reported, &[()]);
    assert_eq!(names.into_inner().expect("nothing broke"), ["reading surface and texture", "flat", "z-range"]);
}

#[test]
fn a_short_run_that_is_not_watched_says_nothing_of_its_progress() {
    let dir = folder();
    bulge(dir.path(), "5 mm", "", None);
    for args in [&["check", "bulge.toml"][..], &["compile", "bulge.toml"], &["verify", "bulge.job"]] {
        let o = run(dir.path(), args);
        assert_eq!(o.status.code(), Some(0), "{}", said(&o));
        let text = String::from_utf8_lossy(&o.stderr);
        assert!(!text.contains("step ") && !text.contains('\u{1b}') && !text.contains('\r'), "{args:?}: {text:?}");
    }
}

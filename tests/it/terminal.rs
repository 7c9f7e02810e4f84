//! What a terminal asks of the program: explanations of codes, manual pages, completions, errors as JSON of every
//! command.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::support::{folder, said};

fn run(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.current_dir(dir).args(args).output().expect("the program starts")
}

fn done(dir: &Path, args: &[&str]) -> String {
    let o = run(dir, args);
    assert_eq!(o.status.code(), Some(0), "{args:?}: {}", said(&o));
    String::from_utf8(o.stdout).expect("text")
}

const COMMANDS: [&str; 17] = [
    "init",
    "check",
    "compile",
    "verify",
    "run",
    "preview",
    "orient",
    "compare",
    "sweep",
    "resume",
    "batch",
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
            "bash" | "zsh" => &["on-the-fly", "saturate", "zoom", "xyz-galvo-40", "svg-text"],
            "fish" => &["on-the-fly", "saturate", "zoom"],
            _ => &[],
        };
        for value in values {
            assert!(script.contains(value), "{shell}: {value}");
        }
    }
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

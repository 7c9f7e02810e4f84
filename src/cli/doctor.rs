//! `terrace doctor`: which optional parts of the program, drivers and converters are there on this computer.

use serde::Serialize;

use super::args::Args;
use super::{print, show};
use terrace_core::diag::Error;
use terrace_core::parallel;
use terrace_core::python::Package;
use terrace_input::surface::CAD_PACKAGE;

/// What was found of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    /// It can be used.
    Ready,
    /// It is not there; nothing else needs it.
    Absent,
    /// It is there, or should be, and cannot be used.
    #[cfg(feature = "run")]
    Faulty,
}

/// A part, and what to do where it is not ready.
#[derive(Debug, Serialize)]
struct Finding {
    part: &'static str,
    serves: &'static str,
    state: State,
    found: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<String>,
}

/// Looks at everything and prints what is there. That a part is absent is no fault.
pub(super) fn run(args: &Args) -> Result<(), Error> {
    let mut all = vec![package("Open CASCADE", "STEP and IGES files", &CAD_PACKAGE)];
    all.extend(fleet());
    all.extend(machine());
    if args.json {
        return print(&show::json(&serde_json::json!({
            "terrace": env!("CARGO_PKG_VERSION"), "system": std::env::consts::OS, "processor": std::env::consts::ARCH,
            "threads": parallel::threads(), "parts": all,
        })));
    }
    print(&text(&all))
}

fn package(part: &'static str, serves: &'static str, package: &Package) -> Finding {
    match package.installed() {
        Ok(found) => Finding {
            part,
            serves,
            state: State::Ready,
            found: format!("{} by {}", or_unknown(&found.version), found.interpreter),
            help: None,
        },
        Err(answers) => Finding {
            part,
            serves,
            state: State::Absent,
            found: answers.join("; "),
            help: Some(package.install_line()),
        },
    }
}

fn or_unknown(version: &str) -> String {
    if version.is_empty() { "of a version that it does not state,".into() } else { format!("version {version}") }
}

#[cfg(feature = "fleet")]
fn fleet() -> Vec<Finding> {
    vec![package("Dask", "batch --engine dask", &crate::batch::engine::PACKAGE)]
}

#[cfg(not(feature = "fleet"))]
fn fleet() -> Vec<Finding> {
    vec![left_out("Dask", "batch --engine dask")]
}

/// What `terrace run` drives on this computer. LinuxCNC and LightBurn answer over the network at the addresses of a run
/// file, which only a run asks.
#[cfg(feature = "run")]
fn machine() -> Vec<Finding> {
    use crate::run::{self, laser::lmc, stage::grbl};
    let connected = |part, serves, looked: Result<Vec<String>, String>, help: &str| match looked {
        Ok(names) if names.is_empty() => {
            Finding { part, serves, state: State::Absent, found: "none".into(), help: Some(help.into()) }
        }
        Ok(names) => Finding { part, serves, state: State::Ready, found: names.join(", "), help: None },
        Err(found) => Finding { part, serves, state: State::Faulty, found, help: None },
    };
    let (part, serves) = ("journals", "run");
    let journals = match run::notes_writable() {
        Ok(folder) => {
            let found = format!("noted in {}", folder.display());
            Finding { part, serves, state: State::Ready, found, help: None }
        }
        Err(found) => {
            let help = "make the folder writable, or set XDG_STATE_HOME to one that is".to_owned();
            Finding { part, serves, state: State::Faulty, found, help: Some(help) }
        }
    };
    vec![
        connected("serial port", "run, GRBL", grbl::ports(), "connect and switch on the control of the stage"),
        connected("BJJCZ card", "run, lmc", lmc::cards(), "connect and switch on the card"),
        journals,
    ]
}

#[cfg(not(feature = "run"))]
fn machine() -> Vec<Finding> {
    vec![left_out("drivers", "run")]
}

/// A part that this build does not have.
#[cfg(not(all(feature = "run", feature = "fleet")))]
fn left_out(part: &'static str, serves: &'static str) -> Finding {
    let found = "not in this build".to_owned();
    Finding { part, serves, state: State::Absent, found, help: Some("build it with its default features".into()) }
}

fn text(all: &[Finding]) -> String {
    let head = format!(
        "terrace {}, {} {}, {} threads\n\n",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH,
        parallel::threads()
    );
    let wide = |of: fn(&Finding) -> &'static str| all.iter().map(|f| of(f).len()).max().unwrap_or(0);
    let (parts, serves) = (wide(|f| f.part), wide(|f| f.serves));
    let mut out = head;
    for f in all {
        let state = match f.state {
            State::Ready => "ready",
            State::Absent => "absent",
            #[cfg(feature = "run")]
            State::Faulty => "FAULTY",
        };
        out += &format!("{:<parts$}  {:<serves$}  {state:<6}  {}\n", f.part, f.serves, f.found);
        if let Some(help) = &f.help {
            out += &format!("{:<parts$}  {:<serves$}  help:   {help}\n", "", "");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_below_each_other_and_help_below_what_is_absent() {
        let finding = |part, state, help: Option<&str>| Finding {
            part,
            serves: "run",
            state,
            found: "none".into(),
            help: help.map(str::to_owned),
        };
        let all = [finding("card", State::Absent, Some("connect it")), finding("serial port", State::Ready, None)];
        let lines: Vec<String> = text(&all).lines().skip(2).map(str::to_owned).collect();
        assert_eq!(
            lines,
            [
                "card         run  absent  none",
                "                  help:   connect it",
                "serial port  run  ready   none",
            ]
        );
    }
}

//! Units in a process of their own, with a limit of memory: where that process dies, its unit has failed and the
//! others continue.
//!
//! The limit is one of address space (`ulimit -v` of the shell), the only one that every Unix enforces without rights
//! and that the program itself knows beforehand ([`terrace_core::diag::memory`]). It counts what is reserved, not what
//! is used, so glibc's allocator is given a single arena: every further one reserves 64 MB, and whether that fits under
//! the limit would depend on the timing of threads. Engines watch the memory of their own processes only.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{ChildStderr, Command, ExitStatus, Stdio};

use super::fragment::Fragment;
use super::unit::{Task, Unit};
use super::work::{End, WorkResult};
use terrace_core::diag::{Diag, Error, Fault, Place};
use terrace_report::job_folder::{self, Durability};

/// Sets a limit of address space, KiB, and becomes the command behind it. A lower limit that is set already, and that
/// nobody may raise, stays.
const LIMITED: &str = r#"limit=$1
shift
hard=$(ulimit -H -v)
if [ "$hard" != unlimited ] && [ "$hard" -lt "$limit" ]; then limit=$hard; fi
ulimit -v "$limit" && exec "$@""#;

/// Bytes of a process's last messages that are kept.
const MESSAGES: usize = 4096;

/// How the process of a unit is made.
pub struct Isolation<'a> {
    /// The command that works on the units of these numbers, one after another, and prints a fragment as each ends.
    pub command: &'a dyn Fn(&[usize]) -> Command,
    /// Limit of memory, bytes; 0: none.
    pub memory: u64,
    /// The folder of reports.
    pub reports: &'a Path,
    /// Whether reports are flushed to the disk.
    pub durability: Durability,
}

/// Works on units one after another; `on_fragment` hears of each as it ends.
///
/// # Errors
/// `unit-process` where no process can be started.
pub fn run(units: &[&Unit], isolation: &Isolation<'_>, on_fragment: &mut dyn FnMut(&Fragment)) -> Result<(), Error> {
    let mut left = units.to_vec();
    while !left.is_empty() {
        let ids: Vec<usize> = left.iter().map(|unit| unit.id).collect();
        let command = limited((isolation.command)(&ids), isolation.memory);
        let (status, messages) = attempt(command, &mut |fragment| {
            left.retain(|unit| unit.id != fragment.unit);
            on_fragment(&fragment);
        })?;
        // The process ended without a fragment of its next unit.
        let Some(unit) = left.first().copied() else { break };
        if let Task::Compile(compile) = &unit.task {
            job_folder::recover(&compile.folder)?;
        }
        let fault = fault(unit, status, &messages, isolation.memory);
        let result = WorkResult { hash: unit.hash.clone(), end: End::failed(unit, &fault) };
        let fragment = Fragment::new(unit, result, 0.0);
        fragment.write(isolation.reports, isolation.durability)?;
        on_fragment(&fragment);
        left.remove(0);
    }
    Ok(())
}

/// The command with a limit of address space.
fn limited(command: Command, bytes: u64) -> Command {
    if bytes == 0 {
        return command;
    }
    let mut shell = Command::new("sh");
    shell.args(["-c", LIMITED, "sh"]);
    shell.arg((bytes >> 10).to_string()).arg(command.get_program()).args(command.get_args());
    shell.env("MALLOC_ARENA_MAX", "1");
    shell
}

/// Runs the command to its end; returns its status and its last messages.
fn attempt(mut command: Command, on_fragment: &mut dyn FnMut(Fragment)) -> Result<(ExitStatus, String), Error> {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let program = command.get_program().to_string_lossy().into_owned();
    let mut child = command.spawn().map_err(|e| cannot_run(&program, &e))?;
    let stderr = child.stderr.take().map(|stderr| std::thread::spawn(move || last_words(stderr)));
    for line in child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines()).map_while(Result::ok) {
        if let Ok(fragment) = serde_json::from_str(&line) {
            on_fragment(fragment);
        }
    }
    let status = child.wait();
    let messages = stderr.and_then(|thread| thread.join().ok()).unwrap_or_default();
    Ok((status.map_err(|e| cannot_run(&program, &e))?, messages))
}

/// The fault of a command that the system does not run.
fn cannot_run(program: &str, e: &std::io::Error) -> Error {
    let text = format!("cannot run {program}: {e}");
    Diag::input("unit-process", text).hint("a limit of memory needs a Unix with the shell sh").into()
}

/// The last bytes of what a process writes, as text.
fn last_words(mut from: ChildStderr) -> String {
    let mut kept = Vec::new();
    let mut chunk = [0; 1024];
    while let Ok(n @ 1..) = from.read(&mut chunk) {
        kept.extend_from_slice(&chunk[..n]);
        kept.drain(..kept.len().saturating_sub(MESSAGES));
    }
    String::from_utf8_lossy(&kept).into_owned()
}

/// The line of a process's last messages that says why it ended: its error, without the hints that follow; else the
/// last line.
pub(super) fn reason(messages: &str) -> &str {
    let mut lines = messages.lines().rev().filter(|line| !line.trim().is_empty());
    let last = lines.clone().next().unwrap_or("no message");
    lines.find(|line| line.starts_with("error")).unwrap_or(last)
}

/// Why a process ended without a word of its unit.
fn fault(unit: &Unit, status: ExitStatus, messages: &str, memory: u64) -> Fault {
    let place = Place::file(unit.job.display().to_string());
    let last = reason(messages);
    // The standard library says so before it aborts.
    if memory > 0 && messages.contains("memory allocation of") {
        let text = format!("memory limit exceeded: the unit needs more than {} MB ({last})", memory >> 20);
        let d = Diag::limit("unit-memory", text).at(place);
        return d.hint("give it more with --memory, on workers that have it").into();
    }
    let text = format!("the process of the unit ended without a report ({status}): {last}");
    let d = Diag::limit("unit-ended", text).at(place);
    d.hint("a system that is short of memory kills processes (signal 9): set a limit with --memory").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reason_is_the_error_and_not_the_hint_behind_it() {
        let messages =
            "warning: slow\nerror[units-folder]: cannot work: there is no folder /srv\n  = help: start it there\n";
        assert_eq!(reason(messages), "error[units-folder]: cannot work: there is no folder /srv");
        assert_eq!(reason("Killed\n\n"), "Killed");
        assert_eq!(reason(""), "no message");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_limit_of_memory_is_set_and_a_lower_one_that_nobody_may_raise_stays() {
        let limit_under = |hard: &str| {
            let mut asked = Command::new("sh");
            asked.args(["-c", "ulimit -v"]);
            let limited = limited(asked, 512 << 20);
            let script = format!("ulimit -v {hard}; exec \"$@\"");
            let mut outer = Command::new("sh");
            outer.args(["-c", &script, "sh"]).arg(limited.get_program()).args(limited.get_args());
            let out = outer.output().expect("a shell");
            String::from_utf8_lossy(&out.stdout).trim().to_owned()
        };
        assert_eq!(limit_under("unlimited"), (512 << 10).to_string());
        assert_eq!(limit_under("300000"), "300000");
    }
}

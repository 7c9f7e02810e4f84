//! The converter as a process: which interpreter runs it, how long, with what memory, and what its end means.
//!
//! The interpreter is started without a shell and isolated (`-I`: no environment variables and no folders of the user
//! change what it loads); the program goes to its standard input, the path is an argument. Its output is read by
//! threads of their own, bounded, so that neither side waits for the other; whatever happens the process is waited for.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::ops::Range;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::answer::{Header, MAX_LINE, greeting, header, refused};
use super::{AGAIN, Tessellation};
use crate::surface::lines::place;
use terrace_core::diag::{Diag, memory};
use terrace_core::python::{self, Package};

/// The program that converts.
pub(super) const SCRIPT: &str = include_str!("convert.py");

/// The bindings of Open CASCADE, in the version that the tests are run with.
pub const PACKAGE: Package = Package { pinned: "cadquery-ocp-novtk==8.0.1.1.0", module: "OCP" };

/// Bytes of the converter's messages that are kept.
const MESSAGES: usize = 4096;

/// Limits of the converter: time, and memory (Linux).
struct Limits {
    seconds: u64,
    megabytes: u64,
}

impl Limits {
    /// The usual ones, or those of the environment.
    fn from_environment() -> Result<Self, Diag> {
        Ok(Self { seconds: limit("TERRACE_CONVERTER_SECONDS", 300)?, megabytes: limit("TERRACE_CONVERTER_MB", 4096)? })
    }
}

/// A limit of the environment, or the usual one.
fn limit(name: &str, usual: u64) -> Result<u64, Diag> {
    let Ok(text) = std::env::var(name) else { return Ok(usual) };
    text.parse().ok().filter(|n| (1..=1_000_000).contains(n)).ok_or_else(|| {
        let text = format!("{name} is {text:?}, which is not a whole number from 1 to 1000000");
        Diag::input("cad-converter", text).hint(format!("leave it unset for the usual limit of {usual}"))
    })
}

/// How a run of the converter ended, where it gave no answer.
enum End {
    /// The interpreter cannot convert: why.
    Absent(String),
    /// The file, or the converter, is at fault.
    Fault(Diag),
}

/// Converts a file, and returns the bytes of the mesh.
pub(super) fn run(path: &Path, format: &str, fine: Tessellation) -> Result<Vec<u8>, Diag> {
    let limits = Limits::from_environment()?;
    let mut tried = Vec::new();
    for interpreter in python::interpreters() {
        match run_with(&interpreter, path, format, fine, &limits) {
            Ok(bytes) => return Ok(bytes),
            Err(End::Fault(d)) => return Err(d.at(place(path))),
            Err(End::Absent(why)) => tried.push(format!("{}: {why}", interpreter.to_string_lossy())),
        }
    }
    let tried = if tried.is_empty() { "no Python was found".into() } else { tried.join("; ") };
    let text = format!("STEP and IGES are read through Open CASCADE, which is not installed ({tried})");
    Err(Diag::input("cad-converter", text).at(place(path)).hint(format!("install it with: {}", PACKAGE.install_line())))
}

fn run_with(
    interpreter: &OsString,
    path: &Path,
    format: &str,
    fine: Tessellation,
    limits: &Limits,
) -> Result<Vec<u8>, End> {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let numbers = [fine.chord_mm.to_string(), fine.angle_rad.to_string()];
    let limit = [limits.seconds.to_string(), limits.megabytes.to_string()];
    let mut command = Command::new(interpreter);
    command.args(["-I", "-"]).arg(absolute).arg(format).args(numbers).args(limit);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|e| End::Absent(format!("cannot be started: {e}")))?;
    let begun = Instant::now();
    let answer = mpsc::channel();
    let said = mpsc::channel();
    if let (Some(stdin), Some(stdout), Some(stderr)) = (child.stdin.take(), child.stdout.take(), child.stderr.take()) {
        std::thread::spawn(move || give(stdin));
        std::thread::spawn(move || answer.0.send(listen(stdout)));
        std::thread::spawn(move || said.0.send(last_words(stderr)));
    }
    let longest = Duration::from_secs(limits.seconds);
    let heard = answer.1.recv_timeout(longest);
    if heard == Err(RecvTimeoutError::Timeout) {
        end(&mut child);
        return Err(End::Fault(out_of_time(Clock::Wall, limits)));
    }
    let status = wait(&mut child, longest.saturating_sub(begun.elapsed()));
    // Its messages end with it, unless something that it started keeps them open.
    let said = said.1.recv_timeout(Duration::from_secs(1)).unwrap_or_default();
    match (heard, status) {
        (_, None) => Err(End::Fault(out_of_time(Clock::Wall, limits))),
        (Ok(ConverterAnswer::Mesh(bytes)), Some(status)) if status.success() => Ok(bytes),
        (Ok(ConverterAnswer::Absent(why)), _) => Err(End::Absent(why)),
        (Ok(ConverterAnswer::Refused { error, text }), _) => Err(End::Fault(refused(path, &error, &text))),
        (Ok(ConverterAnswer::TooMuch(d)), _) => Err(End::Fault(d)),
        (Ok(ConverterAnswer::Nothing), Some(status)) if status.code().is_some() => {
            // No word before the bindings were loaded: this is no Python that has them.
            Err(End::Absent(format!("it ended with {status}{}", quoted(&said))))
        }
        // Its pipe was closed before it had written all of that.
        (Ok(ConverterAnswer::Garbage(why)), _) => Err(End::Fault(garbage(path, &why))),
        (Ok(ConverterAnswer::Short(why)), Some(status)) if status.success() => Err(End::Fault(garbage(path, &why))),
        (_, Some(status)) => Err(End::Fault(crashed(status, limits, &said))),
    }
}

/// Hands the program to the interpreter; one that does not take it ends without an answer.
fn give(mut stdin: ChildStdin) {
    let _ = stdin.write_all(SCRIPT.as_bytes());
}

/// What came from the converter.
#[derive(PartialEq)]
enum ConverterAnswer {
    /// A mesh, with its two lines before it.
    Mesh(Vec<u8>),
    /// The bindings are not there.
    Absent(String),
    /// The file cannot be converted.
    Refused { error: String, text: String },
    /// More than there is memory for.
    TooMuch(Diag),
    /// Nothing at all.
    Nothing,
    /// An answer that ends too early: what is missing.
    Short(String),
    /// Something else: what is wrong with it.
    Garbage(String),
}

/// Reads what the converter writes, no more than its header says.
fn listen(stdout: ChildStdout) -> ConverterAnswer {
    let mut input = BufReader::with_capacity(1 << 16, stdout);
    let mut all = Vec::new();
    let first = append_line(&mut input, &mut all);
    if first.is_empty() {
        return ConverterAnswer::Nothing;
    }
    match greeting(&all[first]).map(|greeting| greeting.absent) {
        Ok(None) => {}
        Ok(Some(why)) => return ConverterAnswer::Absent(why),
        Err(why) => return ConverterAnswer::Garbage(why),
    }
    let second = append_line(&mut input, &mut all);
    if second.is_empty() || (all.last() != Some(&b'\n') && second.len() < MAX_LINE) {
        return ConverterAnswer::Short("it ends within its header".into());
    }
    let about = match header(&all[second]) {
        Ok(Header::Mesh(about)) => about,
        Ok(Header::Error { error, text }) => return ConverterAnswer::Refused { error, text },
        Err(why) => return ConverterAnswer::Garbage(why),
    };
    let Some(body) = about.body() else { return ConverterAnswer::Garbage("its counts are beyond all memory".into()) };
    // The bytes, and the mesh that is made of them.
    if let Err(d) = memory::ask("the mesh of the file", body.saturating_mul(2)) {
        return ConverterAnswer::TooMuch(d);
    }
    match input.take(body.saturating_add(1)).read_to_end(&mut all) {
        Ok(read) if read as u64 == body => ConverterAnswer::Mesh(all),
        Ok(read) if (read as u64) < body => ConverterAnswer::Short(format!("{read} of {body} bytes follow its header")),
        Ok(_) => ConverterAnswer::Garbage("more follows than its header says".into()),
        Err(e) => ConverterAnswer::Garbage(format!("it cannot be read: {e}")),
    }
}

/// Appends a line to what was read; returns where it stands there without its end, or nothing where it cannot be read.
fn append_line(input: &mut impl BufRead, all: &mut Vec<u8>) -> Range<usize> {
    let from = all.len();
    let read = input.take(MAX_LINE as u64).read_until(b'\n', all);
    let end = if all.last() == Some(&b'\n') { all.len() - 1 } else { all.len() };
    read.map(|_| from..end).unwrap_or(from..from)
}

/// The end of what the converter prints; all of it is taken, so that it can continue.
fn last_words(mut stderr: ChildStderr) -> String {
    let mut kept = Vec::new();
    let mut chunk = [0; 4096];
    while let Ok(read @ 1..) = stderr.read(&mut chunk) {
        kept.extend_from_slice(&chunk[..read]);
        let more = kept.len().saturating_sub(MESSAGES);
        kept.drain(..more);
    }
    let text = String::from_utf8_lossy(&kept).into_owned();
    let plain = |line: &&str| line.chars().all(|c| !c.is_control()) && !line.trim().is_empty();
    text.lines().rfind(plain).unwrap_or_default().trim().to_owned()
}

/// Ends the converter.
fn end(child: &mut Child) {
    let _ = child.kill();
    let _ = child.wait();
}

/// Waits for its end; ends it after `longest`.
fn wait(child: &mut Child, longest: Duration) -> Option<ExitStatus> {
    let begun = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if begun.elapsed() < longest => std::thread::sleep(Duration::from_millis(2)),
            _ => {
                end(child);
                return None;
            }
        }
    }
}

fn quoted(said: &str) -> String {
    if said.is_empty() { String::new() } else { format!(", saying {said:?}") }
}

/// Which time of the converter reached the limit. The operating system counts that of the processor, which comes first
/// where it uses several.
enum Clock {
    Wall,
    #[cfg(unix)]
    Processor,
}

fn out_of_time(clock: Clock, limits: &Limits) -> Diag {
    let text = match clock {
        Clock::Wall => format!("the converter had not ended after {} s and was stopped", limits.seconds),
        #[cfg(unix)]
        Clock::Processor => format!(
            "the converter reached its limit of processor time ({} s, or the system's own where that is lower) and was \
             stopped",
            limits.seconds
        ),
    };
    Diag::limit("cad-timeout", text)
        .hint("use a larger chord tolerance, or allow more with TERRACE_CONVERTER_SECONDS (default 300)")
}

/// The diagnostic for a converter that ended by itself without an answer to use; `said` is the last that it printed.
fn crashed(status: ExitStatus, limits: &Limits, said: &str) -> Diag {
    #[cfg(unix)]
    if std::os::unix::process::ExitStatusExt::signal(&status) == Some(SIGXCPU) {
        return out_of_time(Clock::Processor, limits);
    }
    let text = format!("the converter crashed on the file ({status}){}", quoted(said));
    let remedy = format!("{AGAIN}; if it needs more than {} MB, set TERRACE_CONVERTER_MB", limits.megabytes);
    Diag::input("cad-crashed", text).hint(remedy)
}

/// The signal, on Linux and macOS, that ends a process beyond its limit of processor time: `convert.py` sets that limit
/// to the seconds that it may take.
#[cfg(unix)]
const SIGXCPU: i32 = 24;

/// The diagnostic for an answer that cannot be read.
pub(super) fn garbage(path: &Path, why: &str) -> Diag {
    Diag::input("cad-answer", format!("the answer of the converter cannot be used: {why}"))
        .at(place(path))
        .hint("check TERRACE_PYTHON, and that the installed Open CASCADE is the one of the install line")
}

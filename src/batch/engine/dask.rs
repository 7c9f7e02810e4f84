//! Dask (`distributed`, from PyPI): a scheduler and a worker a machine, each one command, nothing else to install and
//! no administrator; alone on a few computers or inside allocations of a batch system.
//!
//! Its client is Python, so a small program (`dask.py`) runs beside this one, which gives it tasks on standard input
//! and hears of them on standard output, a JSON object a line. It is isolated (`-I`) and in a process group of its own:
//! Ctrl-C is for this program to act on.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use terrace_core::diag::{Diag, Error};
use terrace_core::python::{self, Package};

/// The program that speaks to the scheduler.
const SCRIPT: &str = include_str!("dask.py");

/// The package, in the version that the tests are run with.
pub const PACKAGE: Package = Package { pinned: "distributed==2026.8.0", module: "distributed" };

/// A worker that is connected.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Worker {
    pub(super) address: String,
    /// The name that it was started with; else its address.
    pub(super) name: String,
    pub(super) threads: usize,
    /// Bytes; 0: no limit.
    pub(super) memory: u64,
    /// Bytes that it gives out, where it was started with `--resources memory=…`.
    pub(super) declared: Option<f64>,
}

/// A task to be given.
#[derive(Serialize)]
pub(super) struct Submission {
    pub(super) task: usize,
    pub(super) argv: Vec<String>,
    pub(super) cwd: PathBuf,
    /// Bytes of a worker's declared memory; None: it takes none.
    pub(super) memory: Option<u64>,
    /// The workers that are not to have it.
    pub(super) not: Vec<String>,
}

/// What a worker needs, to work on units.
#[derive(Serialize)]
pub(super) struct Need {
    /// This program; a worker may have another place for it.
    pub(super) program: PathBuf,
    /// What `terrace --version` prints.
    pub(super) version: String,
    pub(super) cwd: PathBuf,
    /// The file of units, with its size; reports are written beside it.
    pub(super) file: PathBuf,
    pub(super) bytes: u64,
    /// Bytes of a unit; 0: as the worker has.
    pub(super) memory: u64,
}

/// A worker that is to have no more tasks.
#[derive(Serialize)]
struct SetAside<'a> {
    aside: &'a str,
    why: &'a str,
}

/// What the scheduler reports.
#[derive(Debug)]
pub(super) enum Event {
    /// A task has ended, with what it printed.
    Ended { task: usize, code: i32, out: String, err: String, worker: String },
    /// The engine has given a task up.
    Lost { task: usize, why: String },
    /// A worker is given no more tasks: why.
    Aside { worker: String, why: String },
    /// A worker that was silent is heard of, and given tasks again.
    Back { worker: String },
    /// There are so many workers now.
    Workers(usize),
    /// The scheduler is gone.
    SchedulerLost,
    /// The scheduler is back, and has all tasks again.
    SchedulerBack,
    /// No more events follow: why.
    Closed(String),
}

/// A line of the program.
#[derive(Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
enum Line {
    Absent { why: String },
    Unreachable { why: String },
    Connected { workers: Vec<Worker>, aside: BTreeMap<String, String> },
    Aside { worker: String, why: String },
    Back { worker: String },
    Ended { task: usize, code: i32, out: String, err: String, worker: String },
    Lost { task: usize, why: String },
    Workers { count: usize },
    SchedulerLost,
    SchedulerBack,
}

/// A connection to a scheduler. What has not begun is cancelled when it is dropped.
pub(super) struct Session {
    child: Child,
    /// None once it is closed.
    stdin: Option<ChildStdin>,
    lines: Receiver<Line>,
    messages: Receiver<String>,
    workers: Vec<Worker>,
    /// Workers that have no tasks, and why.
    aside: BTreeMap<String, String>,
}

impl Session {
    /// Connects; a scheduler that is gone later is waited for as long as `patience_s` says.
    ///
    /// # Errors
    /// `engine-absent` where no Python has Dask, `engine-unreachable` where there is no scheduler.
    pub(super) fn start(scheduler: &str, patience_s: u64, need: &Need) -> Result<Self, Error> {
        let need = to_line(need)?;
        let mut tried = Vec::new();
        for interpreter in python::interpreters() {
            match Self::with(&interpreter, scheduler, patience_s, &need) {
                Ok(Ok(session)) => return Ok(session),
                Ok(Err(why)) => {
                    let text = format!("there is no Dask scheduler at {scheduler} ({why})");
                    return Err(Diag::input("engine-unreachable", text).hint(start_lines(scheduler)).into());
                }
                Err(why) => tried.push(format!("{}: {why}", interpreter.to_string_lossy())),
            }
        }
        let text = format!("the engine is reached through Dask, which is not installed ({})", tried.join("; "));
        Err(Diag::input("engine-absent", text).hint(format!("install it with: {}", PACKAGE.install_line())).into())
    }

    /// With this interpreter: Err where it has no Dask, Ok(Err) where it reaches no scheduler.
    fn with(
        interpreter: &OsString,
        scheduler: &str,
        patience_s: u64,
        need: &str,
    ) -> Result<Result<Self, String>, String> {
        let mut command = Command::new(interpreter);
        command.args(["-I", "-c", SCRIPT, scheduler, &patience_s.to_string(), need]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|e| format!("cannot be started: {e}"))?;
        let (line, lines) = channel();
        let (message, messages) = channel();
        let stdin = child.stdin.take();
        let out = child.stdout.take();
        let err = child.stderr.take();
        std::thread::spawn(move || {
            let read = out.into_iter().flat_map(|out| BufReader::new(out).lines()).map_while(Result::ok);
            read.filter_map(|text| serde_json::from_str(&text).ok()).try_for_each(|one: Line| line.send(one))
        });
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let _ = err.into_iter().try_for_each(|mut err| err.read_to_end(&mut text).map(|_| ()));
            message.send(String::from_utf8_lossy(&text).into_owned())
        });
        let mut session = Self { child, stdin, lines, messages, workers: Vec::new(), aside: BTreeMap::new() };
        loop {
            match session.lines.recv() {
                // Named again when all have been asked.
                Ok(Line::Aside { .. }) => {}
                Ok(Line::Connected { workers, aside }) => {
                    session.workers = workers;
                    session.aside = aside;
                    return Ok(Ok(session));
                }
                Ok(Line::Unreachable { why }) => return Ok(Err(why)),
                Ok(Line::Absent { why }) => return Err(why),
                _ => return Err(session.last_words()),
            }
        }
    }

    /// The workers that have tasks, of those that were connected at the beginning.
    pub(super) fn fit(&self) -> impl Iterator<Item = &Worker> {
        self.workers.iter().filter(|worker| !self.aside.contains_key(&worker.address))
    }

    /// The workers that have no tasks, and why.
    pub(super) fn aside(&self) -> &BTreeMap<String, String> {
        &self.aside
    }

    /// A worker as it is shown: the name that it was started with, and where it is.
    pub(super) fn shown(&self, address: &str) -> String {
        let name = self.workers.iter().find(|worker| worker.address == address).map(|worker| worker.name.as_str());
        name.filter(|name| *name != address).map_or_else(|| address.to_owned(), |name| format!("{name} ({address})"))
    }

    /// Gives a worker no more tasks.
    ///
    /// # Errors
    /// Where the program that speaks to the scheduler has ended.
    pub(super) fn set_aside(&mut self, worker: &str, why: &str) -> Result<(), Error> {
        self.send(&to_line(&SetAside { aside: worker, why })?)
    }

    /// Gives a task.
    ///
    /// # Errors
    /// Where the program that speaks to the scheduler has ended.
    pub(super) fn submit(&mut self, task: &Submission) -> Result<(), Error> {
        self.send(&to_line(task)?)
    }

    fn send(&mut self, line: &str) -> Result<(), Error> {
        let given =
            self.stdin.as_mut().map(|to| to.write_all(format!("{line}\n").as_bytes()).and_then(|()| to.flush()));
        match given {
            Some(Ok(())) => Ok(()),
            _ => {
                Err(Diag::input("engine-unreachable", format!("the client of Dask ended: {}", self.last_words()))
                    .into())
            }
        }
    }

    /// The next event; None where there is none for so long.
    pub(super) fn next(&mut self, longest: Duration) -> Option<Event> {
        match self.lines.recv_timeout(longest) {
            Ok(Line::Ended { task, code, out, err, worker }) => Some(Event::Ended { task, code, out, err, worker }),
            Ok(Line::Lost { task, why }) => Some(Event::Lost { task, why }),
            Ok(Line::Aside { worker, why }) => {
                self.aside.insert(worker.clone(), why.clone());
                Some(Event::Aside { worker, why })
            }
            Ok(Line::Back { worker }) => {
                self.aside.remove(&worker);
                Some(Event::Back { worker })
            }
            Ok(Line::Workers { count }) => Some(Event::Workers(count)),
            Ok(Line::SchedulerLost) => Some(Event::SchedulerLost),
            Ok(Line::SchedulerBack) => Some(Event::SchedulerBack),
            Ok(Line::Absent { why } | Line::Unreachable { why }) => Some(Event::Closed(why)),
            Ok(Line::Connected { .. }) | Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                Some(Event::Closed(format!("the client of Dask ended: {}", self.last_words())))
            }
        }
    }

    /// The last line that the program wrote to its stderr when it ended.
    fn last_words(&mut self) -> String {
        let said = self.messages.recv_timeout(Duration::from_secs(1)).unwrap_or_default();
        said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("no message").to_owned()
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.stdin.take();
        // It cancels what has not begun; where it does not end by itself it is ended.
        for _ in 0..50 {
            if matches!(self.child.try_wait(), Ok(Some(_)) | Err(_)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A line of the program's input.
fn to_line(value: &impl Serialize) -> Result<String, Error> {
    serde_json::to_string(value).map_err(|e| {
        let text = format!("a path cannot be given to the engine: {e}");
        Diag::input("unit-path", text).hint("use file names that are UTF-8 text").into()
    })
}

/// How a scheduler and workers are started.
fn start_lines(scheduler: &str) -> String {
    if scheduler.starts_with("tls://") {
        return "give your certificate in the environment: DASK_DISTRIBUTED__COMM__TLS__CA_FILE, \
                DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT, DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY; see Security in \
                docs/how-to/fleet.md"
            .into();
    }
    let port = scheduler.rsplit_once(':').map_or("8786", |(_, port)| port);
    format!("start it, then one worker on each machine: dask scheduler --port {port}; dask worker {scheduler}")
}

//! A real fleet on this machine: a Dask scheduler and workers, as docs/how-to/fleet.md starts them.

use std::net::TcpListener;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::folder;
use tempfile::TempDir;

/// The environment in which `tests/python/setup.sh` has installed Dask.
fn venv() -> PathBuf {
    let venv = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv");
    assert!(venv.join("bin/dask").exists(), "Dask is not installed for the tests: run tests/python/setup.sh");
    venv
}

/// The Python that has Dask.
pub fn python() -> PathBuf {
    venv().join("bin/python")
}

/// A process and all that it starts; killed when it is dropped.
pub struct Tree(Child);

impl Tree {
    pub fn start(command: &mut Command) -> Self {
        Self(command.process_group(0).spawn().expect("it starts"))
    }

    /// A signal to all of it.
    fn signal(&self, name: &str) {
        let group = format!("-{}", self.0.id());
        let sent = Command::new("kill").args([&format!("-{name}"), "--", &group]).status().expect("kill starts");
        assert!(sent.success());
    }

    /// SIGKILL to all of it.
    pub fn kill(&mut self) {
        // The group's number cannot be another's: its first process has not been waited for.
        let _ = Command::new("kill").args(["-KILL", "--", &format!("-{}", self.0.id())]).stderr(Stdio::null()).status();
        let _ = self.0.wait();
    }
}

impl Drop for Tree {
    /// Politely first: what is killed leaves its semaphores.
    fn drop(&mut self) {
        let group = self.0.id().to_string();
        let _ = Command::new("kill").args(["-TERM", "--", &format!("-{group}")]).stderr(Stdio::null()).status();
        let begin = Instant::now();
        let is_left =
            || Command::new("pgrep").args(["-r", "R,S,D", "-g", &group]).output().is_ok_and(|o| o.status.success());
        while begin.elapsed() < Duration::from_secs(3) && is_left() {
            std::thread::sleep(Duration::from_millis(50));
        }
        self.kill();
    }
}

/// A scheduler, its workers, and their folder.
pub struct Fleet {
    port: u16,
    scheduler: Tree,
    workers: Vec<Tree>,
    dir: TempDir,
}

impl Fleet {
    /// With workers of one thread each.
    pub fn of(workers: usize) -> Self {
        let mut fleet = Self::without_workers();
        (0..workers).for_each(|_| fleet.worker(&[]));
        fleet.wait(workers);
        fleet
    }

    pub fn without_workers() -> Self {
        let port = TcpListener::bind(("127.0.0.1", 0)).and_then(|l| l.local_addr()).expect("a free port").port();
        let dir = folder();
        let scheduler = Self::scheduler(port, dir.path());
        Self { port, scheduler, workers: Vec::new(), dir }
    }

    fn scheduler(port: u16, dir: &Path) -> Tree {
        let mut command = Command::new(venv().join("bin/dask"));
        command.args(["scheduler", "--host", "127.0.0.1", "--no-dashboard", "--port", &port.to_string()]);
        command.env("DASK_TEMPORARY_DIRECTORY", dir);
        Tree::start(logged(&mut command, dir, "scheduler"))
    }

    pub fn address(&self) -> String {
        format!("tcp://127.0.0.1:{}", self.port)
    }

    /// One more worker, started again when it ends as docs/how-to/fleet.md says; the words before the command, such as
    /// `unshare`, are `around` it.
    pub fn worker(&mut self, around: &[&str]) {
        let name = format!("worker{}", self.workers.len());
        let again = format!(
            "while :; do '{}' worker {} --name {name} --nthreads 1 --no-dashboard --host 127.0.0.1 --local-directory '{}'; sleep 1; done",
            venv().join("bin/dask").display(),
            self.address(),
            self.dir.path().join(&name).display()
        );
        let words: Vec<&str> = around.iter().copied().chain(["sh", "-c", &again]).collect();
        let mut command = Command::new(words[0]);
        command.args(&words[1..]);
        self.workers.push(Tree::start(logged(&mut command, self.dir.path(), &name)));
    }

    /// Waits until so many workers have registered.
    pub fn wait(&self, workers: usize) {
        let script = format!(
            "from distributed import Client\nClient('{}', timeout=60).wait_for_workers({workers}, timeout=60)",
            self.address()
        );
        let ready = Command::new(python()).args(["-I", "-c", &script]).output().expect("Python starts");
        assert!(ready.status.success(), "no fleet: {}", String::from_utf8_lossy(&ready.stderr));
    }

    /// SIGKILL to a worker's own process, which holds its tasks; what started it starts another.
    pub fn kill_worker(&self, number: usize) {
        let worker = self.process(number).expect("a worker").to_string();
        assert!(Command::new("kill").args(["-KILL", &worker]).status().expect("kill starts").success());
    }

    /// Whether a worker has a process at work.
    pub fn is_busy(&self, number: usize) -> bool {
        self.process(number).is_some_and(|worker| !children(worker).is_empty())
    }

    /// The shell's child is the nanny, the nanny's last child the worker.
    fn process(&self, number: usize) -> Option<u32> {
        let nanny = children(self.workers[number].0.id()).pop()?;
        children(nanny).pop()
    }

    /// Stops all processes of a worker, as a computer that sleeps.
    pub fn freeze_worker(&self, number: usize) {
        self.workers[number].signal("STOP");
    }

    /// Lets a frozen worker go on.
    pub fn thaw_worker(&self, number: usize) {
        self.workers[number].signal("CONT");
    }

    /// Ends a worker for good, with all that it has started.
    pub fn end_worker(&mut self, number: usize) {
        drop(self.workers.remove(number));
    }

    /// SIGKILL to the scheduler.
    pub fn kill_scheduler(&mut self) {
        self.scheduler.kill();
    }

    /// Another scheduler at the same address.
    pub fn start_scheduler(&mut self) {
        self.scheduler = Self::scheduler(self.port, self.dir.path());
    }

    /// The program with the engine of this fleet; `-q` is left to the caller.
    pub fn terrace<I: AsRef<std::ffi::OsStr>>(&self, args: impl IntoIterator<Item = I>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        command.args(args).args(["--engine", "dask", "--scheduler", &self.address(), "--no-sync"]);
        command.env("TERRACE_PYTHON", python()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// What the workers and the scheduler have said.
    pub fn said(&self) -> String {
        let files = std::fs::read_dir(self.dir.path()).expect("readable").flatten();
        let logs = files.filter(|file| file.path().extension().is_some_and(|e| e == "log"));
        logs.map(|log| std::fs::read_to_string(log.path()).unwrap_or_default()).collect()
    }
}

fn logged<'a>(command: &'a mut Command, dir: &Path, name: &str) -> &'a mut Command {
    let log = std::fs::File::options().create(true).append(true).open(dir.join(format!("{name}.log")));
    let log = log.expect("a log");
    command.stdin(Stdio::null()).stdout(log.try_clone().expect("a log")).stderr(log)
}

/// The children of a process.
fn children(parent: u32) -> Vec<u32> {
    let out = Command::new("pgrep").args(["-P", &parent.to_string()]).output().expect("pgrep of procps is installed");
    String::from_utf8_lossy(&out.stdout).lines().filter_map(|line| line.trim().parse().ok()).collect()
}

/// Waits until `done`; panics where that takes too long.
pub fn until(what: &str, longest: Duration, mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < longest, "{what}: not after {longest:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

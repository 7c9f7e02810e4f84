//! The whole controller of LinuxCNC in simulation, with a scan card made of its own components: `stage.ngc`, and
//! `terrace run` through the network shell. `python/linuxcnc_sim.py` starts it.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::run::{Bench, assert_ended, blocks};
use crate::support::{folder, said};

/// One controller at a time on a computer.
static ONE: Mutex<()> = Mutex::new(());

/// A controller that runs, its stage homed.
pub struct Simulation {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
    port: u16,
    pub dir: TempDir,
    shell: Option<BufReader<TcpStream>>,
    _one: MutexGuard<'static, ()>,
}

/// A sample: x, y, z, START, laser.
type Sample = ([f64; 3], bool, bool);

impl Simulation {
    pub fn new() -> Self {
        let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let unpacked = root.join(".venv/linuxcnc");
        assert!(unpacked.join("controller.stamp").exists(), "LinuxCNC is not installed: make setup-all");
        let dir = folder();
        let port = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port").port();
        let mut child = Command::new("python3")
            .arg(root.join("tests/python/linuxcnc_sim.py"))
            .args([unpacked.join("root").canonicalize().expect("unpacked").as_path(), dir.path()])
            .arg(port.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python3");
        let stdin = child.stdin.take();
        let stdout = BufReader::new(child.stdout.take().expect("piped"));
        let mut new = Self { child, stdin, stdout, port, dir, shell: None, _one: one };
        assert_eq!(new.line(), "ready");
        new.connect();
        new.switch_on();
        for line in ["mode manual", "home -1"] {
            new.set(line);
        }
        let begun = Instant::now();
        while !new.get("joint_homed").starts_with("YES YES YES") {
            assert!(begun.elapsed() < Duration::from_secs(10), "not homed");
            std::thread::sleep(Duration::from_millis(50));
        }
        new
    }

    /// A connection of this test's to the shell, which takes control.
    fn connect(&mut self) {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).expect("linuxcncrsh");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("set");
        self.shell = Some(BufReader::new(stream));
        assert!(self.ask("hello EMC test 1.0", "HELLO").starts_with("ACK"));
        self.shell.as_mut().expect("open").get_mut().write_all(b"set echo off\n").expect("sent");
        assert_eq!(self.ask("set verbose on", "SET VERBOSE"), "ACK");
        self.set("enable EMCTOO");
    }

    /// Out of emergency stop and on; each is acknowledged before it has happened.
    fn switch_on(&mut self) {
        let begun = Instant::now();
        while self.get("machine") != "ON" {
            assert!(begun.elapsed() < Duration::from_secs(10), "it cannot be switched on");
            let next = if self.get("estop") == "ON" { "estop off" } else { "machine on" };
            self.set(next);
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).expect("the simulation says something");
        line.trim().to_owned()
    }

    fn ask(&mut self, line: &str, word: &str) -> String {
        let shell = self.shell.as_mut().expect("open");
        shell.get_mut().write_all(format!("{line}\n").as_bytes()).expect("sent");
        loop {
            let mut text = String::new();
            assert!(shell.read_line(&mut text).expect("an answer") > 0, "closed");
            if let Some(rest) = text.trim().strip_prefix(word) {
                return rest.trim().to_owned();
            }
        }
    }

    fn get(&mut self, what: &str) -> String {
        self.ask(&format!("get {what}"), &what.to_uppercase())
    }

    fn set(&mut self, what: &str) {
        let word = format!("SET {}", what.split(' ').next().unwrap_or_default().to_uppercase());
        // What was set before shows in its status a little later.
        let begun = Instant::now();
        while self.ask(&format!("set {what}"), &word) != "ACK" {
            assert!(begun.elapsed() < Duration::from_secs(5), "{what} is refused");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Sets when the laser is on after START and for how long, s; START and the laser as they are then. BUSY is high with
    /// it.
    fn card(&mut self, delay: f64, width: f64) -> String {
        self.tell(&format!("card {delay} {width}"))
    }

    /// The same with BUSY `inverted` or `bouncing`.
    fn bad_card(&mut self, delay: f64, width: f64, kind: &str) -> String {
        self.tell(&format!("card {delay} {width} {kind}"))
    }

    pub fn tell(&mut self, line: &str) -> String {
        writeln!(self.stdin.as_mut().expect("open"), "{line}").expect("taken");
        self.line()
    }

    /// Enters a line of MDI and waits for its end.
    fn enter(&mut self, line: &str) {
        self.set("mode mdi");
        self.set("set_wait done");
        self.set(&format!("mdi {line}"));
        self.set("set_wait received");
        std::thread::sleep(Duration::from_millis(300));
    }

    /// Starts a stage program.
    pub fn start(&mut self, program: &Path) {
        let copy = self.dir.path().join("stage.ngc");
        std::fs::copy(program, &copy).expect("copied");
        self.set("mode auto");
        self.set(&format!("open {}", copy.display()));
        self.set("run");
    }

    /// Waits for the end of the program; answers with what it shows the operator.
    pub fn until_idle(&mut self) -> String {
        let begun = Instant::now();
        std::thread::sleep(Duration::from_millis(500));
        while self.get("program_status") != "IDLE" {
            assert!(begun.elapsed() < Duration::from_secs(120), "the program does not end");
            std::thread::sleep(Duration::from_millis(50));
        }
        assert_eq!(self.get("error"), "OK");
        self.get("operator_display")
    }

    /// Ends the controller, and answers with its samples.
    fn samples(mut self) -> Vec<Sample> {
        // What is sampled last is still in a buffer.
        std::thread::sleep(Duration::from_secs(1));
        self.end();
        let text = std::fs::read_to_string(self.dir.path().join("samples.txt")).expect("samples");
        let lines = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>()).filter(|w| w.len() == 6);
        let samples: Vec<Sample> = lines
            .map(|w| {
                let at = [w[1], w[2], w[3]].map(|v| v.parse().expect("mm"));
                (at, w[4] == "1", w[5] == "1")
            })
            .collect();
        assert!(!text.contains("overrun") && samples.len() > 1000, "{}", samples.len());
        samples
    }

    fn end(&mut self) {
        self.stdin.take();
        assert!(self.child.wait().expect("a child").success());
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        // Its standard input ends, and with it the controller.
        self.stdin.take();
        let _ = self.child.wait();
    }
}

/// How often START and the laser rise; the stage never moves while one of them is on.
#[track_caller]
fn rises(samples: &[Sample]) -> [usize; 2] {
    let mut rises = [0; 2];
    for pair in samples.windows(2) {
        let [before, now] = [pair[0], pair[1]];
        assert!(!(now.1 || now.2) || before.0 == now.0, "the stage moves: {before:?} {now:?}");
        rises[0] += usize::from(now.1 && !before.1);
        rises[1] += usize::from(now.2 && !before.2);
    }
    assert!(!samples.last().expect("samples").1, "START is on at the end");
    rises
}

#[test]
#[ignore = "slow: make test-all"]
fn stage_program_never_moves_while_the_card_is_started_or_busy() {
    let bench = Bench::new(15);
    let mut control = Simulation::new();
    control.start(&bench.job.join("stage.ngc"));
    assert_eq!(control.until_idle(), "OK");
    assert_eq!(rises(&control.samples()), [30, 30]);

    let few = Bench::new(2);
    let mut slow = Simulation::new();
    slow.card(1.5, 0.5);
    slow.start(&few.job.join("stage.ngc"));
    assert_eq!(slow.until_idle(), "OK");
    assert_eq!(rises(&slow.samples()), [4, 4]);
}

#[test]
#[ignore = "slow: make test-all"]
fn stage_program_stops_with_the_output_off_and_names_the_block_where_the_card_does_not_answer() {
    let bench = Bench::new(15);
    // The card dies in the middle: BUSY rises later than the program waits.
    let mut dead = Simulation::new();
    dead.start(&bench.job.join("stage.ngc"));
    std::thread::sleep(Duration::from_secs(5));
    dead.card(100.0, 0.05);
    let shown = dead.until_idle();
    assert!(dead.tell("pins").starts_with("FALSE"));
    let samples = dead.samples();
    let [starts, busy] = rises(&samples);
    // Where it died with BUSY high the control may not have seen that.
    assert!(busy > 0 && busy < 29 && (starts == busy + 1 || starts == busy), "{starts} {busy}: {shown}");
    assert_eq!(shown, format!("no BUSY, block B{starts:04}"));

    let mut stuck = Simulation::new();
    stuck.card(0.02, 1000.0);
    stuck.start(&bench.job.join("stage.ngc"));
    assert_eq!(stuck.until_idle(), "still BUSY, block B0001");
    assert_eq!(stuck.tell("pins"), "FALSE TRUE");
    assert_eq!(rises(&stuck.samples()), [1, 1]);
}

#[test]
#[ignore = "slow: make test-all"]
fn an_inverted_or_bouncing_busy_never_lets_the_stage_move_with_the_laser_on() {
    let bench = Bench::new(2);
    let program = bench.job.join("stage.ngc");
    let mut inverted = Simulation::new();
    inverted.bad_card(0.02, 0.3, "inverted");
    inverted.start(&program);
    assert_eq!(inverted.until_idle(), "BUSY before START, block B0001");
    bench.run_file(&stage_of(&inverted), "driver = \"handshake\"");
    assert_ended(&bench.run(&["--arm"]), 1, &["run-busy", "before START", "no other block was begun"]);
    assert_eq!(rises(&inverted.samples()), [0, 0]);

    let mut bouncing = Simulation::new();
    bouncing.bad_card(0.02, 0.3, "bouncing");
    bouncing.start(&program);
    assert_eq!(bouncing.until_idle(), "OK");
    assert_eq!(rises(&bouncing.samples()), [4, 4]);

    // A run asks over the network, which takes tenths of a second on a busy computer.
    let mut by_run = Simulation::new();
    by_run.bad_card(0.02, 1.5, "bouncing");
    bench.run_file(&stage_of(&by_run), "driver = \"handshake\"");
    assert_ended(&bench.run(&["--arm"]), 0, &[]);
    assert_eq!(rises(&by_run.samples()), [4, 4]);
}

#[test]
#[ignore = "slow: make test-all"]
fn an_offset_ends_the_program_in_the_controller_before_it_moves() {
    let bench = Bench::new(1);
    let mut control = Simulation::new();
    for (line, message, undo) in [
        ("G92 X5", "G92 is active", "G92.1"),
        ("G10 L2 P1 Y3", "G54 has an offset in Y", "G10 L2 P1 Y0"),
        ("G10 L2 P1 R30", "G54 is rotated", "G10 L2 P1 R0"),
    ] {
        control.enter(line);
        control.start(&bench.job.join("stage.ngc"));
        assert_eq!(control.until_idle(), message);
        control.enter(undo);
    }
    for line in ["G43.1 Z10", "G10 L2 P2 X7\nG55"] {
        line.lines().for_each(|line| control.enter(line));
        control.start(&bench.job.join("stage.ngc"));
        assert_eq!(control.until_idle(), "OK", "{line}");
    }
    let samples = control.samples();
    assert_eq!(rises(&samples), [4, 4]);
    // Twice through the same places.
    let places: Vec<[f64; 3]> = samples.windows(2).filter(|w| w[1].2 && !w[0].2).map(|w| w[1].0).collect();
    assert_eq!(places[..2], places[2..]);
}

fn stage_of(control: &Simulation) -> String {
    format!("driver = \"linuxcnc\"\naddress = \"127.0.0.1:{}\"\nidentity = \"terrace-test\"", control.port)
}

#[test]
#[ignore = "slow: make test-all"]
fn a_run_starts_the_card_when_the_stage_stands_and_stops_where_it_does_not_answer() {
    let bench = Bench::new(15);
    let mut control = Simulation::new();
    // Without a realtime kernel the control can miss a pulse of 20 ms.
    control.card(0.02, 0.2);
    bench.run_file(&stage_of(&control), "driver = \"handshake\"");
    assert_ended(&bench.run(&["--arm"]), 0, &["30 of 30 done"]);
    let again = |bench: &Bench| std::fs::remove_file(bench.path("part.run.jsonl")).expect("removed");
    again(&bench);
    control.card(100.0, 0.05);
    assert_ended(&bench.run(&["--arm"]), 1, &["run-busy", "not risen", "block B0001 was begun"]);
    assert_eq!(control.tell("pins"), "FALSE FALSE");
    again(&bench);
    control.card(0.02, 1000.0);
    assert_ended(&bench.run(&["--arm"]), 1, &["run-busy", "not fallen", "block B0001 was begun"]);
    assert_eq!(control.tell("pins"), "FALSE TRUE");
    assert_ended(&bench.run(&["--arm", "--go-on", "--redo", "B0001"]), 1, &["run-busy", "before START"]);
    assert_eq!(rises(&control.samples()), [32, 31]);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_run_that_loses_the_control_in_the_middle_stops_and_says_where() {
    let bench = Bench::new(2);
    let mut control = Simulation::new();
    bench.run_file(&stage_of(&control), &bench.command_laser("0.5"));
    let child = bench.command(&["--arm"]).stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("started");
    until_in_work(&bench, 2);
    // A person presses the emergency stop while block 2 is marked.
    control.connect();
    control.set("estop on");
    let out = child.wait_with_output().expect("ended");
    assert_ended(&out, 1, &["run-linuxcnc", "emergency stop", "no other block was begun"]);
    let done = bench.marked().len();
    assert!(said(&out).contains(&format!("{done} of 4 blocks are done")), "{}", said(&out));
    // It is not switched on by the run.
    assert_ended(&bench.run(&["--arm", "--go-on"]), 1, &["emergency stop"]);
    control.connect();
    control.switch_on();
    assert_ended(&bench.run(&["--arm", "--go-on"]), 0, &["4 of 4 done"]);
    assert_eq!(bench.marked(), blocks(4));
}

/// Waits until so many blocks have been begun.
fn until_in_work(bench: &Bench, count: usize) {
    let begun = Instant::now();
    while bench.journal().iter().filter(|l| l.0 == "begin").count() < count {
        assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", bench.journal());
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn a_run_killed_at_30_random_moments_marks_every_block_once_but_those_it_names() {
    let bench = Bench::new(15);
    let control = Simulation::new();
    bench.run_file(&stage_of(&control), &bench.command_laser("0.2"));
    bench.assert_survives_kills(30, 4_000);
    assert_eq!(rises(&control.samples()), [0, 0]);
}

#[test]
#[ignore = "slow: make test-all"]
fn blocks_of_the_tutorial_are_marked_by_the_simulated_controller() {
    let dir = folder();
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python");
    let done = |args: &[&str], code: i32, words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        command.current_dir(dir.path()).env("TERRACE_PYTHON", &python).env("XDG_CACHE_HOME", dir.path());
        command.env("XDG_STATE_HOME", dir.path());
        assert_ended(&command.args(args).output().expect("the program starts"), code, words);
    };
    done(&["init", "insert", "--tutorial"], 0, &[]);
    done(&["compile", "insert/job.toml", "--verify"], 0, &["verified"]);
    done(&["resume", "insert/job.job", "--only", "B0001-B0003", "-o", "insert/first.job"], 0, &["3 of"]);
    done(&["verify", "insert/first.job"], 0, &["verified"]);
    let mut control = Simulation::new();
    control.card(0.02, 0.3);
    let stage = stage_of(&control);
    let text = format!("machine = \"shop-mill\"\n\n[stage]\n{stage}\n\n[laser]\ndriver = \"handshake\"\n");
    std::fs::write(dir.path().join("insert/linuxcnc.toml"), text).expect("written");
    let run = ["run", "insert/first.job", "--with", "insert/linuxcnc.toml"];
    done(&run, 0, &[]);
    done(&[&run[..], &["--arm"]].concat(), 0, &["3 of 3 done"]);
    assert_eq!(rises(&control.samples()), [3, 3]);
}

//! `terrace run` with the GRBL driver against a simulator of GRBL 1.1 on a pseudo-terminal
//! (`python/grbl_simulator.py`). The faults of the control are tested with the driver itself, in `src/run/stage/grbl`.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::run::{Bench, assert_ended, blocks};
use crate::support::card::until;

/// A simulator that runs; it ends when its standard input does.
pub struct Simulator {
    child: Child,
    pub port: String,
    log: PathBuf,
}

impl Simulator {
    fn new(bench: &Bench) -> Self {
        Self::at(&bench.path("grbl.log"))
    }

    /// One that logs into this file.
    pub fn at(log: &Path) -> Self {
        Self::with(log, &[])
    }

    /// One with options of its own.
    pub fn with(log: &Path, options: &[&str]) -> Self {
        // It is there before the simulator has opened it.
        std::fs::File::options().create(true).append(true).open(log).expect("a log");
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/grbl_simulator.py");
        let rates = ["110", "111", "112"].map(|n| format!("--set={n}=120000"));
        let mut child = Command::new("python3")
            .arg(script)
            .args(["--wco=-300,-300,-300", "--name", "stage 7", "--log"])
            .arg(log)
            .args(rates)
            .args(options)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python3");
        let mut port = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut port).expect("the name of the terminal");
        Self { child, port: port.trim().to_owned(), log: log.to_owned() }
    }

    /// The keys of a run file's stage.
    pub fn keys(&self) -> String {
        format!("driver = \"grbl\"\nport = {:?}\nidentity = \"stage 7\"", self.port)
    }

    /// Empties its log.
    pub fn forget(&self) {
        std::fs::File::options().write(true).open(&self.log).and_then(|file| file.set_len(0)).expect("a log");
    }

    /// Resets the control and homes the stage, as a person does in a terminal.
    pub fn home(&self) {
        let port = || std::fs::File::options().read(true).write(true).open(&self.port).expect("a port");
        port().write_all(b"\x18").expect("written");
        std::thread::sleep(Duration::from_millis(200));
        let homed = || std::fs::read_to_string(&self.log).expect("a log").matches("line $H").count();
        let before = homed();
        port().write_all(b"$H\n").expect("written");
        until("the stage is not homed", Duration::from_secs(10), || homed() > before);
    }

    /// Waits until it stands still; from when to when it moved, s since 1970.
    pub fn moves(&self) -> Vec<[f64; 2]> {
        let (mut moves, mut begun) = (Vec::new(), None);
        until("the stage does not stand still", Duration::from_secs(10), || {
            (moves, begun) = (Vec::new(), None);
            let text = std::fs::read_to_string(&self.log).expect("a log");
            for (at, what) in text.lines().filter_map(|line| line.split_once(' ')) {
                let at: f64 = at.parse().expect("s");
                if what.starts_with("line ") && what.contains("G0") {
                    begun = Some(at);
                } else if let Some(from) = begun.take_if(|_| what.starts_with("at ") || what == "reset") {
                    moves.push([from, at]);
                }
            }
            begun.is_none()
        });
        moves
    }

    /// Ends the simulator; answers with its log. It ends with an error where its receive buffer ran over.
    pub fn end(mut self) -> String {
        self.child.stdin.take();
        assert!(self.child.wait().expect("a child").success(), "the receive buffer ran over");
        std::fs::read_to_string(&self.log).expect("a log")
    }
}

/// Every line that was sent fits the receive buffer of 127 characters.
fn assert_short(log: &str) {
    let sent: Vec<&str> = log.lines().filter_map(|l| l.split_once(" line ").map(|(_, line)| line)).collect();
    assert!(sent.len() > 4 && sent.iter().all(|line| line.len() < 80), "{sent:?}");
}

#[test]
fn every_block_is_marked_once_with_grbl() {
    let bench = Bench::new(1);
    let simulator = Simulator::new(&bench);
    bench.run_file(&simulator.keys(), &bench.command_laser("0"));
    assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    assert_eq!(bench.marked(), blocks(2));
    assert_short(&simulator.end());
}

#[test]
#[ignore = "slow: make test-all"]
fn a_run_with_grbl_killed_at_30_random_moments_marks_every_block_once_but_those_it_names() {
    let bench = Bench::new(15);
    let simulator = Simulator::new(&bench);
    bench.run_file(&simulator.keys(), &bench.command_laser("0.2"));
    bench.assert_survives_kills(30, 4_000);
    assert_short(&simulator.end());
}

//! `terrace run` with the GRBL driver against a simulator of GRBL 1.1 on a pseudo-terminal
//! (`python/grbl_simulator.py`). The faults of the control are tested with the driver itself, in `src/run/stage/grbl`.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::run::{Bench, assert_ended, blocks};

/// A simulator that runs; it ends when its standard input does.
struct Simulator {
    child: Child,
    port: String,
    log: PathBuf,
}

impl Simulator {
    fn new(bench: &Bench) -> Self {
        let log = bench.path("grbl.log");
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/grbl_simulator.py");
        let rates = ["110", "111", "112"].map(|n| format!("--set={n}=120000"));
        let mut child = Command::new("python3")
            .arg(script)
            .args(["--wco=-300,-300,-300", "--name", "stage 7", "--log"])
            .arg(&log)
            .args(rates)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python3");
        let mut port = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut port).expect("the name of the terminal");
        Self { child, port: port.trim().to_owned(), log }
    }

    /// Ends the simulator; answers with its log. It ends with an error where its receive buffer ran over.
    fn end(mut self) -> String {
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

fn stage_of(simulator: &Simulator) -> String {
    format!("driver = \"grbl\"\nport = {:?}\nidentity = \"stage 7\"", simulator.port)
}

#[test]
fn every_block_is_marked_once_with_grbl() {
    let bench = Bench::new(1);
    let simulator = Simulator::new(&bench);
    bench.run_file(&stage_of(&simulator), &bench.command_laser("0"));
    assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    assert_eq!(bench.marked(), blocks(2));
    assert_short(&simulator.end());
}

#[test]
#[ignore = "slow: make test-all"]
fn a_run_with_grbl_killed_at_30_random_moments_marks_every_block_once_but_those_it_names() {
    let bench = Bench::new(15);
    let simulator = Simulator::new(&bench);
    bench.run_file(&stage_of(&simulator), &bench.command_laser("0.2"));
    bench.assert_survives_kills(30, 4_000);
    assert_short(&simulator.end());
}

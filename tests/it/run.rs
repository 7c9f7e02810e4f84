//! `terrace run` against a stand-in for LinuxCNC's network shell, with the person on standard input, and with a command
//! as laser. `run_linuxcnc` has LinuxCNC itself.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::linuxcncrsh::{Card, Marks, Shell, Trip};
use crate::support::surfaces::{Random, mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, said};

/// A compiled job of some blocks, with its folder and a shell for its stage.
pub struct Bench {
    pub dir: TempDir,
    pub job: PathBuf,
}

impl Bench {
    /// A job of `columns` by 2 blocks of 5 mm on a slope.
    pub fn new(columns: u32) -> Self {
        Self::with(columns, "")
    }

    fn with(columns: u32, more: &str) -> Self {
        Self::made(columns, "\"dxf\", \"linuxcnc\"", more)
    }

    /// The same in other formats.
    pub fn in_formats(columns: u32, formats: &str) -> Self {
        Self::made(columns, formats, "")
    }

    /// With frames, two registration points and both stage programs.
    pub fn framed() -> Self {
        let pilot = "[[pen]]\nname = \"pilot\"\nspeed = \"500 mm/s\"\npower = \"1 %\"\nfrequency = \"60 kHz\"";
        let points = "[setups]\nregistration = [[\"0 mm\", \"0 mm\"], [\"5 mm\", \"10 mm\"]]";
        Self::made(1, "\"dxf\", \"linuxcnc\", \"gcode\"", &format!("frames = \"pilot\"\n{pilot}\n{points}"))
    }

    fn made(columns: u32, formats: &str, more: &str) -> Self {
        let dir = folder();
        let machine = machine_file("xyz-galvo-40").replace("\"40 mm\"", "\"5 mm\"").replace("\"0.1 s\"", "\"50 ms\"");
        std::fs::write(dir.path().join("machine.txt"), machine).expect("written");
        let stl = dir.path().join("part.stl");
        let size = [f64::from(columns) * 5.0, 10.0];
        write_stl(&stl, &mesh(10, [0.0, 0.0, size[0], size[1]], |x, y| 0.02 * x / 5.0 + 0.001 * y));
        let text = JobText {
            machine: "file = \"machine.txt\"".into(),
            focus: "pdof = \"0.2 mm\"".into(),
            more: format!("[emit]\nformats = [{formats}]\n{more}"),
            ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2.5 mm\"").method("window")
        };
        let job = dir.path().join("part.job");
        compile(&text.write(dir.path(), "part.toml"), &job);
        Self { dir, job }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// Writes a run file with these drivers.
    pub fn run_file(&self, stage: &str, laser: &str) {
        let text = format!("machine = \"xyz-galvo-40\"\n\n[stage]\n{stage}\n\n[laser]\n{laser}\n");
        std::fs::write(self.path("run.toml"), text).expect("written");
    }

    /// The command that appends the name of each block to `marked.txt` and takes so many s.
    pub fn command_laser(&self, seconds: &str) -> String {
        let [marked, off] = ["marked.txt", "off.txt"].map(|name| self.path(name).display().to_string());
        format!(
            "driver = \"command\"\nmark = ['sh', '-c', 'echo $0 >> \"{marked}\"; sleep {seconds}', '{{block}}']\n\
             off = ['sh', '-c', 'echo off >> \"{off}\"']"
        )
    }

    /// A stage behind the shell, and a command as laser.
    fn shell_and_command(&self, shell: &Shell) {
        self.run_file(&stage_of(shell), &self.command_laser("0"));
    }

    pub fn command(&self, more: &[&str]) -> Command {
        let mut command = self.terrace();
        command.arg("run").arg(&self.job).arg("--with").arg(self.path("run.toml")).args(more);
        command
    }

    /// The program, whose locks and notes are those of this bench: tests run at the same time on machines of one name.
    pub fn terrace(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        command.env("TERRACE_LOCKS", self.path("locks")).env("XDG_STATE_HOME", self.path("state"));
        command.env("LOCALAPPDATA", self.path("state"));
        command
    }

    pub fn run(&self, more: &[&str]) -> Output {
        self.command(more).stdin(Stdio::null()).output().expect("the program starts")
    }

    /// The same, once the command of a run that was killed has ended.
    pub fn run_when_free(&self, more: &[&str]) -> Output {
        let begun = Instant::now();
        loop {
            let out = self.run(more);
            if !said(&out).contains("run-locked") {
                return out;
            }
            assert!(begun.elapsed() < Duration::from_secs(30), "{}", said(&out));
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    pub fn marked(&self) -> Vec<String> {
        let text = std::fs::read_to_string(self.path("marked.txt")).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    /// Lines of the journal: event and block.
    pub fn journal(&self) -> Vec<(String, String)> {
        let text = std::fs::read_to_string(self.path("part.run.jsonl")).unwrap_or_default();
        let word = |line: &Value, key: &str| line[key].as_str().unwrap_or_default().to_owned();
        let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        let lines = whole.map(|line| serde_json::from_str::<Value>(line).expect("a line of JSON"));
        lines.map(|line| (word(&line, "event"), word(&line, "block"))).collect()
    }

    /// Kills an armed run so many times, each within so many ms of its start, and lets it continue: every block is
    /// marked once, but for those that were named as in doubt.
    pub fn assert_survives_kills(&self, count: usize, longest_ms: usize) {
        let all = std::fs::read_dir(self.job.join("blocks")).expect("blocks").count();
        let mut random = Random::new(7);
        let mut more: Vec<String> = Vec::new();
        let (mut named, mut kills, mut parts): (Vec<String>, usize, usize) = (Vec::new(), 0, 0);
        while kills < count {
            let mut child = self
                .command(&["--arm"])
                .args(&more)
                .stdin(Stdio::null())
                .stderr(Stdio::null())
                .stdout(Stdio::null())
                .spawn()
                .expect("started");
            std::thread::sleep(Duration::from_millis(random.below(longest_ms) as u64));
            child.kill().expect("killed");
            child.wait().expect("ended");
            kills += 1;
            // The command that marks the last block may still be at it.
            std::thread::sleep(Duration::from_millis(250));
            let journal = self.journal();
            let in_work = journal.last().filter(|l| l.0 == "begin").map(|l| l.1.clone());
            let done = journal.iter().filter(|l| l.0 == "end").count();
            if done == all {
                // The part is finished: the next kills are for another.
                self.assert_marked_once(all, &named);
                for name in ["part.run.jsonl", "marked.txt"] {
                    std::fs::remove_file(self.path(name)).expect("removed");
                }
                (more, named, parts) = (Vec::new(), Vec::new(), parts + 1);
                continue;
            }
            more = match &in_work {
                Some(block) => {
                    let out = self.run_when_free(&["--arm"]);
                    let count = if done == 1 { "1 block is done".into() } else { format!("{done} blocks are done") };
                    assert_ended(&out, 2, &["run-in-doubt", &format!("block {block} was begun"), &count]);
                    named.push(block.clone());
                    ["--go-on", "--redo", block].map(str::to_owned).to_vec()
                }
                None if done > 0 => vec!["--go-on".into()],
                None => Vec::new(),
            };
        }
        let words: Vec<&str> = std::iter::once("--arm").chain(more.iter().map(String::as_str)).collect();
        assert_ended(&self.run_when_free(&words), 0, &[&format!("{all} of {all} done")]);
        self.assert_marked_once(all, &named);
        assert!(parts < count / 3, "most kills hit a run: {parts} parts were finished by {kills} kills");
        println!("{kills} kills, {parts} parts before the last, of which {} blocks were named", named.len());
    }

    /// Every block is marked once, in the order of the job, but for those that were named.
    fn assert_marked_once(&self, all: usize, named: &[String]) {
        for block in blocks(all) {
            let times = self.marked().iter().filter(|b| **b == block).count();
            let most = 1 + named.iter().filter(|b| **b == block).count();
            assert!((1..=most).contains(&times), "{block} {times} times, named {named:?}");
            assert_eq!(self.journal().iter().filter(|l| l.0 == "end" && l.1 == block).count(), 1);
        }
        // Those that were redone are in their place.
        let mut order = self.marked();
        order.dedup();
        assert_eq!(order, blocks(all));
    }
}

pub fn stage_of(shell: &Shell) -> String {
    format!("driver = \"linuxcnc\"\naddress = \"{}\"", shell.address)
}

/// Names of the first blocks.
pub fn blocks(count: usize) -> Vec<String> {
    (1..=count).map(|n| format!("B{n:04}")).collect()
}

#[track_caller]
pub fn assert_ended(out: &Output, code: i32, words: &[&str]) {
    assert_eq!(out.status.code(), Some(code), "{}", said(out));
    for word in words {
        assert!(said(out).contains(word), "{word}: {}", said(out));
    }
}

/// The moves of a stage program, as `X.. Y..`.
fn moves_of(program: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(program).expect("a stage program");
    text.lines().filter_map(|line| line.strip_prefix("G0 ")).map(str::to_owned).collect()
}

#[test]
fn every_block_is_marked_once_and_the_stage_moves_as_in_the_stage_program() {
    let bench = Bench::new(3);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    // The dry run: all moves, no laser, no journal.
    let to_mark = format!("to mark        terrace run {}", bench.job.display());
    assert_ended(&bench.run(&[]), 0, &["6 of 6 blocks, nothing marked", &to_mark]);
    assert!(bench.marked().is_empty() && !bench.path("part.run.jsonl").exists());
    let moves = |shell: &Shell| -> Vec<String> {
        let mdi = std::mem::take(&mut shell.control().mdi);
        mdi.iter().filter_map(|line| line.strip_prefix("G21 G90 G53 G0 ")).map(str::to_owned).collect()
    };
    let programmed = moves_of(&bench.job.join("stage.ngc"));
    assert_eq!(moves(&shell), programmed);

    let log = bench.path("log.jsonl");
    let out = bench.run(&["--arm", "--json", "--log", log.to_str().expect("UTF-8")]);
    assert_ended(&out, 0, &[]);
    let outcome: Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
    assert_eq!((&outcome["marked"], &outcome["finished"], &outcome["in_work"]), (&6.into(), &6.into(), &Value::Null));
    assert_eq!((bench.marked(), moves(&shell)), (blocks(6), programmed));
    assert!(!shell.control().start);
    let journal = bench.journal();
    let marks: Vec<(String, String)> =
        blocks(6).into_iter().flat_map(|b| ["begin", "end"].map(|e| (e.to_owned(), b.clone()))).collect();
    assert_eq!((journal[0].0.as_str(), &journal[1..13], journal[13].0.as_str()), ("run", &marks[..], "stop"));
    let log = std::fs::read_to_string(log).expect("a log");
    assert!(log.lines().count() > 20 && log.lines().all(|l| serde_json::from_str::<Value>(l).is_ok()), "{log}");

    // What is done is not done again, and a journal is of one job.
    let [job, run_file] = [&bench.job, &bench.path("run.toml")].map(|path| path.display().to_string());
    let again = format!("terrace run {job} --with {run_file} --arm --again");
    assert_ended(&bench.run(&["--arm", "--go-on"]), 2, &["run-finished", "all 6 blocks", &again]);
    compile(&bench.path("part.toml"), &bench.job);
    let text = std::fs::read_to_string(bench.path("part.toml")).expect("read").replace("60 %", "61 %");
    std::fs::write(bench.path("part.toml"), text).expect("written");
    compile(&bench.path("part.toml"), &bench.job);
    assert_ended(&bench.run(&["--arm", "--go-on"]), 2, &["run-journal-other", "--journal"]);
    assert_eq!(bench.marked().len(), 6);
}

/// Starts a run and waits until so many lines are in the journal.
fn until_lines(bench: &Bench, more: &[&str], lines: usize) -> Child {
    let mut child =
        bench.command(more).stdin(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts");
    let begun = Instant::now();
    while bench.journal().len() < lines {
        assert!(child.try_wait().expect("a child").is_none(), "it has ended: {:?}", bench.journal());
        assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", bench.journal());
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

#[test]
fn a_run_that_was_killed_goes_on_and_names_the_block_in_doubt() {
    let bench = Bench::new(3);
    let shell = Shell::new();
    bench.run_file(&stage_of(&shell), &bench.command_laser("0.1"));
    let mut lines = 0;
    let mut more: Vec<String> = vec!["--arm".into()];
    let mut redone = Vec::new();
    // After the first line, inside a block, after its end, inside another.
    for further in [1, 2, 3, 4] {
        let words: Vec<&str> = more.iter().map(String::as_str).collect();
        lines = bench.journal().len().max(lines) + further + usize::from(words.contains(&"--redo"));
        let mut child = until_lines(&bench, &words, lines);
        child.kill().expect("killed");
        child.wait().expect("ended");
        let begun: Vec<String> = bench.journal().into_iter().filter(|l| l.0 == "begin").map(|l| l.1).collect();
        // The command of the block may still be at it.
        let out = bench.run_when_free(&["--arm"]);
        more = vec!["--arm".into(), "--go-on".into()];
        let is_in_doubt = bench.journal().last().is_some_and(|l| l.0 == "begin");
        if is_in_doubt {
            let block = begun.last().expect("a block");
            assert_ended(&out, 2, &["run-in-doubt", &format!("block {block} was begun"), &format!("--redo {block}")]);
            assert_ended(&bench.run(&["--arm", "--go-on"]), 2, &["run-in-doubt"]);
            assert_ended(&bench.run(&["--arm", "--go-on", "--skip", "B0006"]), 2, &["run-in-doubt"]);
            more.extend(["--redo".into(), block.clone()]);
            redone.push(block.clone());
        } else if begun.is_empty() {
            // It has begun nothing, and this run does all of it: end it there.
            assert_ended(&out, 0, &[]);
            std::fs::remove_file(bench.path("part.run.jsonl")).expect("removed");
            std::fs::remove_file(bench.path("marked.txt")).expect("removed");
            (lines, more) = (0, vec!["--arm".into()]);
        } else {
            assert_ended(&out, 2, &["run-go-on"]);
        }
    }
    assert!(!redone.is_empty());
    let words: Vec<&str> = more.iter().map(String::as_str).collect();
    assert_ended(&bench.run(&words), 0, &["6 of 6 done"]);
    for block in blocks(6) {
        let times = bench.marked().iter().filter(|b| **b == block).count();
        let most = 1 + redone.iter().filter(|b| **b == block).count();
        assert!((1..=most).contains(&times), "{block} {times} times, redone {redone:?}");
    }
    // Every run begins with a lift.
    let mdi = &shell.control().mdi;
    for (i, _) in mdi.iter().enumerate().filter(|(_, line)| line.starts_with("G21 G90 G94")) {
        let first = mdi[i..].iter().find(|line| line.starts_with("G21 G90 G53")).expect("a move");
        assert_eq!(first, "G21 G90 G53 G0 Z200.000000");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn no_run_begins_while_the_command_of_a_killed_one_still_marks() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.run_file(&stage_of(&shell), &bench.command_laser("20"));
    let mut child = until_lines(&bench, &["--arm"], 2);
    child.kill().expect("killed");
    child.wait().expect("ended");
    let moved = shell.control().mdi.len();
    assert_ended(&bench.run(&["--arm"]), 2, &["run-locked", "command of a killed one"]);
    assert_eq!(shell.control().mdi.len(), moved, "nothing moves");
    assert_ended(&bench.run_when_free(&["--arm"]), 2, &["run-in-doubt", "block B0001 was begun"]);
}

#[test]
fn faults_of_the_control_stop_the_run_with_the_output_off() {
    let bench = Bench::new(2);
    let journal = bench.path("part.run.jsonl");
    // Moves: lift, to B0001, z; to B0002, z; ...
    for (trip, words) in [
        (Trip::EmergencyStop, ["run-linuxcnc", "emergency stop", "block B0002"]),
        (Trip::Error, ["run-linuxcnc", "following error", "block B0002"]),
        (Trip::Close, ["run-linuxcnc-link", "no connection", "block B0002"]),
    ] {
        let shell = Shell::new();
        bench.shell_and_command(&shell);
        shell.control().trip = Some((4, trip));
        let _ = std::fs::remove_file(&journal);
        let out = bench.run(&["--arm"]);
        assert_ended(&out, 1, &words);
        assert_ended(&out, 1, &["1 of 4 blocks are done; no other block was begun", "--go-on"]);
        assert!(!shell.control().start, "{trip:?}");
        assert_eq!(bench.journal().last().expect("a line").0, "stop");
        let (mut control, count) = (shell.control(), bench.marked().len());
        (control.machine_on, control.trip) = (true, None);
        drop(control);
        assert_ended(&bench.run(&["--arm", "--go-on"]), 0, &["4 of 4 done"]);
        assert_eq!(bench.marked().len(), count + 3, "{trip:?}");
    }
}

#[test]
fn a_control_that_is_not_ready_or_another_is_refused_without_a_move() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    let refused = |more: &str, words: &[&str]| {
        bench.run_file(&format!("{}\n{more}", stage_of(&shell)), &bench.command_laser("0"));
        assert_ended(&bench.run(&[]), 1, words);
        assert!(!shell.control().mdi.iter().any(|line| line.starts_with("G21 G90 G53")), "{words:?}");
    };
    refused("identity = \"other\"", &["run-identity", "EMCNETSVR"]);
    refused("password = \"x\"", &["run-linuxcnc-password", "connection"]);
    refused("enable = \"x\"", &["run-linuxcnc-password", "enable"]);
    shell.control().homed = false;
    refused("", &["run-linuxcnc", "not homed"]);
    shell.control().homed = true;
    shell.control().machine_on = false;
    refused("", &["run-linuxcnc", "emergency stop"]);
    shell.control().machine_on = true;
    shell.control().offset = 1.5;
    refused("", &["run-offset", "1.5"]);
    bench.run_file("driver = \"linuxcnc\"\naddress = \"127.0.0.1:1\"", &bench.command_laser("0"));
    assert_ended(&bench.run(&[]), 1, &["run-linuxcnc-link"]);
}

#[test]
fn a_scan_card_is_started_and_watched_and_one_that_does_not_answer_stops_the_run() {
    let bench = Bench::new(1);
    let journal = bench.path("part.run.jsonl");
    let shell = Shell::new();
    bench.run_file(&stage_of(&shell), "driver = \"handshake\"");
    assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    let starts = |shell: &Shell| shell.control().mdi.iter().filter(|line| *line == "M64 P0").count();
    let moves = |shell: &Shell| shell.control().mdi.iter().filter(|line| line.starts_with("G21 G90 G53 G0")).count();
    assert_eq!(starts(&shell), 2);
    for (card, words) in [
        (Card::Dead, ["run-busy", "not risen", "block B0001 was begun, and may be marked not at all"]),
        (Card::Stuck, ["run-busy", "not fallen", "block B0001 was begun, and may be marked not at all"]),
        // A card that marks already: nothing moves.
        (Card::Busy, ["run-busy", "before START", "no other block was begun"]),
        (Card::Inverted, ["run-busy", "before START", "no other block was begun"]),
    ] {
        let is_high = matches!(card, Card::Busy | Card::Inverted);
        std::fs::remove_file(&journal).expect("removed");
        let [before, moved] = [starts(&shell), moves(&shell)];
        (shell.control().card, shell.control().marks) = (card, Marks::default());
        assert_ended(&bench.run(&["--arm"]), 1, &words);
        assert_eq!(moves(&shell) > moved, !is_high, "{card:?}");
        assert!(!shell.control().start);
        assert_eq!(starts(&shell), before + usize::from(!is_high), "{card:?}");
    }
    // A control that reads the input late: the contact has bounced, or the mark has ended, when it looks.
    for (card, read_delay) in [(Card::Bouncing, 0.004), (Card::Works, 0.03)] {
        std::fs::remove_file(&journal).expect("removed");
        (shell.control().card, shell.control().marks) = (card, Marks::default());
        shell.control().read_delay = read_delay;
        assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    }
    // One that a run has started which was then killed: it is about to mark.
    std::fs::remove_file(&journal).expect("removed");
    shell.control().card = Card::Works;
    let now = shell.control().clock.now();
    shell.control().marks = Marks { on: vec![[now + 2.0, now + 4.0]], ..Marks::default() };
    let moved = moves(&shell);
    assert_ended(&bench.run(&["--arm"]), 1, &["run-busy", "before START"]);
    assert_eq!(moves(&shell), moved);
    bench.run_file("driver = \"manual\"", "driver = \"handshake\"");
    assert_ended(&bench.run(&[]), 2, &["run-handshake"]);
}

/// Runs with these lines as the person's answers.
fn with_answers(bench: &Bench, more: &[&str], answers: &str) -> Output {
    let mut child = bench
        .command(more)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    child.stdin.take().expect("piped").write_all(answers.as_bytes()).expect("taken");
    child.wait_with_output().expect("ended")
}

#[test]
fn a_person_moves_marks_and_can_stop() {
    let bench = Bench::new(1);
    bench.run_file("driver = \"manual\"", "driver = \"manual\"");
    // Lift, x and y, z, mark; y, z where it changes, mark; lift.
    let out = with_answers(&bench, &[], &"\n".repeat(9));
    let first = "[ready?] block B0001: move the stage to Z200";
    assert_ended(&out, 0, &[first, "block B0002: move the stage to X0", "pilot laser: block B0001", "do not fire"]);
    // The last lift goes to no block.
    assert_ended(&out, 0, &["[ready?] move the stage to Z200"]);
    let out = with_answers(&bench, &["--arm"], "\n\n\n\nstop\n");
    assert_ended(&out, 1, &["run-person", "1 of 2 blocks are done; no other block was begun"]);
    let out = with_answers(&bench, &["--arm", "--go-on"], "\n\n\n");
    assert_ended(&out, 1, &["no answer", "block B0002 was begun", "blocks/B0002.dxf"]);
    let out = with_answers(&bench, &["--arm", "--go-on", "--skip", "B0001"], "");
    assert_ended(&out, 2, &["run-in-doubt", "--skip B0002"]);
    assert_ended(&with_answers(&bench, &["--arm", "--go-on", "--redo", "B0002"], "\n\n\n\n\n"), 0, &["2 of 2 done"]);
}

#[test]
fn frames_are_shown_at_the_outermost_blocks_until_the_person_goes_on() {
    let pilot = "[[pen]]\nname = \"pilot\"\nspeed = \"500 mm/s\"\npower = \"1 %\"\nfrequency = \"60 kHz\"";
    let points = "[setups]\nregistration = [[\"0 mm\", \"0 mm\"], [\"15 mm\", \"10 mm\"]]";
    let bench = Bench::with(3, &format!("frames = \"pilot\"\n{pilot}\n{points}"));
    let shell = Shell::new();
    let shown = bench.path("shown.txt");
    let pilot = format!("\npilot = ['sh', '-c', 'echo $0 >> \"{}\"', '{{file}}']", shown.display());
    bench.run_file(&stage_of(&shell), &(bench.command_laser("0") + &pilot));
    let moves = || -> Vec<String> {
        let mdi = std::mem::take(&mut shell.control().mdi);
        mdi.iter().filter_map(|line| line.strip_prefix("G21 G90 G53 G0 ")).map(str::to_owned).collect()
    };
    // Two registration points, the four corners of three by two blocks; as the program of frames goes.
    let out = with_answers(&bench, &["--frames"], &"\n".repeat(6));
    assert_ended(&out, 0, &["registration point 2 (X 15 Y 10 mm of the part)", "frames         4 of 4 shown"]);
    assert_eq!(moves(), moves_of(&bench.job.join("frames/stage-frame.ngc")));
    let files = std::fs::read_to_string(&shown).expect("frames were shown");
    assert!(files.lines().all(|file| file.contains("/frames/B") && file.ends_with("-frame.dxf")), "{files}");
    assert!(files.lines().count() >= 4 && bench.marked().is_empty(), "{files}");
    // One block, with its pen; nothing is journalled.
    assert_ended(&with_answers(&bench, &["--frames", "B0002", "--arm"], "\n"), 0, &["1 of 1 shown"]);
    assert!(bench.marked().contains(&"B0002".to_owned()) && bench.journal().is_empty());
    assert_ended(&bench.run(&["--frames", "B0009"]), 2, &["run-frames", "B0009"]);
    // A card that is started marks what it has loaded.
    bench.run_file(&stage_of(&shell), "driver = \"handshake\"");
    assert_ended(&bench.run(&["--frames", "--arm"]), 1, &["run-frames", "loads no files"]);
    let other = Bench::new(1);
    other.shell_and_command(&shell);
    assert_ended(&other.run(&["--frames"]), 2, &["run-frames", "emit.frames"]);
}

#[test]
fn jobs_that_may_not_be_run_are_refused() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    let with = |from: &str, to: &str| {
        let text = std::fs::read_to_string(bench.path("run.toml")).expect("read");
        std::fs::write(bench.path("run.toml"), text.replace(from, to)).expect("written");
    };
    with("xyz-galvo-40", "other");
    assert_ended(&bench.run(&[]), 1, &["run-machine", "xyz-galvo-40"]);
    with("other", "xyz-galvo-40");
    with("off = ", "format = \"csv\"\noff = ");
    assert_ended(&bench.run(&[]), 2, &["run-format", "the job holds dxf", "emit.formats"]);
    with("format = \"csv\"", "format = \"xyz\"");
    assert_ended(&bench.run(&[]), 2, &["run-command", "xyz"]);
    with("format = \"xyz\"", "colour = 1");
    assert_ended(&bench.run(&[]), 2, &["toml", "colour"]);
    with("colour = 1", "");
    // A drawing that is not the one of the manifest.
    let drawing = bench.job.join("blocks/B0002.dxf");
    let text = std::fs::read_to_string(&drawing).expect("read");
    std::fs::write(&drawing, text.replace("2.5", "2.4")).expect("written");
    assert_ended(&bench.run(&["--arm"]), 1, &["run-unverified", "terrace verify"]);
    assert!(shell.control().mdi.is_empty() && bench.journal().is_empty());
    std::fs::write(&drawing, &text).expect("written");
    // The same while the run continues: a block before it damages it.
    bench.run_file(
        &stage_of(&shell),
        &format!("driver = \"command\"\nformat = \"dxf\"\nmark = ['sh', '-c', 'echo >> {:?}']", drawing.display()),
    );
    assert_ended(&bench.run(&["--arm"]), 1, &["run-file-changed", "B0002.dxf", "1 of 2 blocks are done; no other"]);
}

#[test]
fn a_command_that_fails_or_cannot_be_started_leaves_its_block_in_doubt() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.run_file(&stage_of(&shell), "driver = \"command\"\nmark = ['sh', '-c', 'exit 7']");
    let out = bench.run(&["--arm"]);
    assert_ended(&out, 1, &["run-laser-command", "exit status: 7", "run-laser-off", "block B0001 was begun"]);
    bench.run_file(&stage_of(&shell), "driver = \"command\"\nmark = ['no-such-program-here', '{file}']");
    assert_ended(&bench.run(&["--arm", "--go-on", "--redo", "B0001"]), 1, &["run-laser-command", "cannot start"]);
    bench.run_file(&stage_of(&shell), "driver = \"command\"\nmark = ['true']\noff = ['false']");
    assert_ended(&bench.run(&[]), 1, &["run-laser-off", "switch it off by hand"]);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_after_the_block_and_twice_at_once() {
    let bench = Bench::new(2);
    let shell = Shell::new();
    bench.run_file(&stage_of(&shell), &bench.command_laser("0.4"));
    let interrupt = |child: &Child| {
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
        assert!(sent.success());
    };
    let child = until_lines(&bench, &["--arm"], 2);
    interrupt(&child);
    let out = child.wait_with_output().expect("ended");
    assert_ended(&out, 1, &["run-interrupted", "1 of 4 blocks are done; no other block was begun"]);
    assert_eq!(
        shell.control().mdi.iter().filter(|l| *l == "G21 G90 G53 G0 Z200.000000").count(),
        2,
        "lifted at the end"
    );

    bench.run_file(&stage_of(&shell), &bench.command_laser("30"));
    let child = until_lines(&bench, &["--arm", "--go-on"], bench.journal().len() + 1);
    // A second run on the machine is kept out, a dry one too; and one of the same job, by whatever path.
    assert_ended(&bench.run(&["--arm", "--go-on"]), 2, &["run-locked"]);
    assert_ended(&bench.run(&[]), 2, &["run-locked", "in progress"]);
    std::fs::copy(bench.path("run.toml"), bench.path("other.toml")).expect("copied");
    std::os::unix::fs::symlink(&bench.job, bench.path("link")).expect("a link");
    let other = |command: &mut Command| {
        command.arg("run").arg(bench.path("link")).arg("--with").arg(bench.path("other.toml"));
        command.args(["--arm", "--go-on"]).output().expect("the program starts")
    };
    assert_ended(&other(&mut bench.terrace()), 2, &["run-locked", "machine xyz-galvo-40 is driven by another run"]);
    // Locks are those of a computer: on another the journal is locked.
    let elsewhere = bench.path("locks of another computer");
    assert_ended(&other(bench.terrace().env("TERRACE_LOCKS", &elsewhere)), 2, &["run-journal-locked"]);
    let begun = Instant::now();
    interrupt(&child);
    std::thread::sleep(Duration::from_millis(100));
    interrupt(&child);
    let out = child.wait_with_output().expect("ended");
    assert_ended(&out, 1, &["run-aborted", "block B0002 was begun"]);
    assert!(begun.elapsed() < Duration::from_secs(10));
    let off = std::fs::read_to_string(bench.path("off.txt")).expect("switched off");
    assert_eq!(off.lines().count(), 4, "before and after each run");
}

#[test]
fn the_part_is_placed_before_each_set_up() {
    let bench = Bench::with(2, "[setups]\ncolumns = 2\nregistration = [[\"1 mm\", \"1 mm\"], [\"9 mm\", \"9 mm\"]]\n");
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    let out = with_answers(&bench, &["--arm"], "\n\n");
    assert_ended(&out, 0, &["[ready?] set-up 1 of 2", "[ready?] set-up 2 of 2", "4 of 4 done"]);
    let out = with_answers(&bench, &[], "\n");
    assert_ended(&out, 1, &["no answer", "set-up 2 of 2"]);
}

#[test]
fn example_of_the_document_is_a_run_file() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reference/run-file.md"))
        .expect("a document");
    let example = text.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("an example");
    let dir = folder();
    let path = dir.path().join("run.toml");
    std::fs::write(&path, example).expect("written");
    let keys = terrace::run::settings::RunFile::read(&path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(keys.machine, "xyz-galvo-40");
}

#[test]
fn a_resumed_job_is_run_from_its_own_folder() {
    let mut bench = Bench::new(2);
    let rest = bench.path("rest.job");
    let args = [Path::new("resume"), &bench.job, Path::new("--from"), Path::new("B0003"), Path::new("-o"), &rest];
    assert_ended(&crate::support::terrace(args), 0, &[]);
    bench.job = rest;
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    assert_eq!(bench.marked(), blocks(4)[2..]);
    let mdi = &shell.control().mdi;
    let moves: Vec<&str> = mdi.iter().filter_map(|line| line.strip_prefix("G21 G90 G53 G0 ")).collect();
    assert_eq!(moves, moves_of(&bench.job.join("stage.ngc")));
    assert!(bench.path("rest.run.jsonl").exists());
}

#[test]
fn a_rest_never_holds_blocks_that_a_run_has_marked_unless_it_is_for_another_part() {
    let bench = Bench::new(2);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    assert_ended(&bench.run(&["--arm"]), 0, &["4 of 4 done"]);
    let rest = bench.path("rest.job");
    let resumed = |more: &[&str]| {
        let args = [Path::new("resume"), &bench.job, Path::new("--from"), Path::new("B0003"), Path::new("-o"), &rest];
        bench.terrace().args(args).args(more).output().expect("the program starts")
    };
    let words = ["resume-marked", "2 of these blocks, B0003 to B0004, are marked already", "part.run.jsonl", "--again"];
    assert_ended(&resumed(&[]), 2, &words);
    assert!(!rest.exists());
    assert_ended(&resumed(&["--again"]), 0, &["B0003 to B0004"]);
}

#[test]
fn no_block_of_a_part_is_marked_from_both_the_whole_job_and_its_rest() {
    let mut bench = Bench::new(2);
    let whole = bench.job.clone();
    let rest = bench.path("rest.job");
    let args = [Path::new("resume"), &whole, Path::new("--from"), Path::new("B0003"), Path::new("-o"), &rest];
    assert_ended(&bench.terrace().args(args).output().expect("the program starts"), 0, &[]);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    bench.job.clone_from(&rest);
    assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    // The folder of the whole job has no journal yet.
    bench.job.clone_from(&whole);
    let words = ["run-marked", "2 of the blocks that are left, B0003 to B0004", "rest.run.jsonl", "--arm --again"];
    assert_ended(&bench.run(&["--arm"]), 2, &words);
    assert_ended(&bench.run(&["--arm", "--go-on"]), 2, &words);
    assert_eq!(bench.marked(), blocks(4)[2..]);
    // A rest of the rest of the part is what is left.
    let first = bench.path("first.job");
    let args = [Path::new("resume"), &whole, Path::new("--only"), Path::new("B0001-B0003"), Path::new("-o"), &first];
    let words = ["resume-marked", "1 of these blocks, B0003 to B0003", "rest.run.jsonl"];
    assert_ended(&bench.terrace().args(args).output().expect("the program starts"), 2, &words);
    // The next part is marked with the whole, and has no part in what was marked before.
    assert_ended(&bench.run(&["--arm", "--again"]), 0, &["4 of 4 done"]);
    bench.job.clone_from(&rest);
    let words = ["run-marked", "2 of the blocks that are left, B0003 to B0004", "part.run.jsonl"];
    std::fs::remove_file(bench.path("rest.run.jsonl")).expect("a journal");
    assert_ended(&bench.run(&["--arm"]), 2, &words);
    assert_ended(&bench.run(&["--arm", "--again"]), 0, &["2 of 2 done"]);
}

#[test]
fn a_line_that_was_not_completed_is_removed_and_a_wrong_one_refused() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    assert_ended(&bench.run(&["--arm"]), 0, &[]);
    let journal = bench.path("part.run.jsonl");
    let text = std::fs::read_to_string(&journal).expect("a journal");
    // Up to the middle of the last block's end: it was marked, and nothing says so.
    let cut = text.rfind("\"end\",\"block\"").expect("a line");
    std::fs::write(&journal, &text[..cut]).expect("written");
    assert_ended(&bench.run(&["--arm"]), 2, &["run-in-doubt", "--redo B0002"]);
    assert_ended(&bench.run(&["--arm", "--go-on", "--skip", "B0002"]), 0, &["0 blocks, 2 of 2 done"]);
    assert_eq!(bench.marked(), blocks(2));
    for wrong in ["no JSON\n", "{\"time_s\":1,\"event\":\"end\",\"block\":\"B0001\"}\n"] {
        std::fs::write(&journal, wrong).expect("written");
        assert_ended(&bench.run(&["--arm"]), 2, &["run-journal", "part.run.jsonl:1"]);
    }
}

impl Bench {
    /// The same for a folder of another name, with another run file.
    fn run_as(&self, folder: &str, run_file: &str, more: &[&str]) -> Output {
        let mut command = self.terrace();
        command.arg("run").arg(self.path(folder)).arg("--with").arg(self.path(run_file));
        // The job file lies where it was.
        command.arg("--inputs").arg(self.dir.path()).args(more);
        command.stdin(Stdio::null()).output().expect("the program starts")
    }

    fn copied(&self, to: &str) {
        for (name, bytes) in crate::support::files(&self.job) {
            let path = self.path(to).join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(path, bytes).expect("written");
        }
    }
}

#[test]
fn a_folder_that_was_renamed_or_copied_has_the_journal_with_which_it_was_begun() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    // Beside it, and where nothing stands beside it.
    std::fs::rename(&bench.job, bench.path("other.job")).expect("renamed");
    let refused = |folder: &str, words: &[&str]| {
        let out = bench.run_as(folder, "run.toml", &["--arm"]);
        assert_ended(&out, 2, &["run-finished", "part.run.jsonl", "--arm --again"]);
        assert_ended(&out, 2, words);
    };
    refused("other.job", &["other.job"]);
    std::fs::rename(bench.path("other.job"), &bench.job).expect("renamed");
    bench.copied("far/away/part.job");
    refused("far/away/part.job", &["far/away/part.job"]);
    assert!(!bench.path("other.run.jsonl").exists() && !bench.path("far/away/part.run.jsonl").exists());
    assert_eq!(bench.marked(), blocks(2));
    // Another journal is no way around it; one that was copied may be older than what it was copied from.
    let other = bench.path("new.jsonl");
    let named = ["--arm", "--journal", other.to_str().expect("UTF-8")];
    let words = ["run-journal-elsewhere", "2 blocks are begun or done", "--arm --go-on", "--arm --again"];
    assert_ended(&bench.run_as("part.job", "run.toml", &named), 2, &words);
    let text = std::fs::read_to_string(bench.path("part.run.jsonl")).expect("a journal");
    let begun = text.split_inclusive('\n').take(3).collect::<String>();
    std::fs::write(bench.path("far/away/part.run.jsonl"), begun).expect("written");
    assert_ended(&bench.run_as("far/away/part.job", "run.toml", &["--arm", "--go-on"]), 2, &["run-journal-elsewhere"]);
    assert_eq!(bench.marked(), blocks(2));
    std::fs::remove_file(bench.path("far/away/part.run.jsonl")).expect("removed");
    // Another part is counted where the first was.
    assert_ended(&bench.run_as("far/away/part.job", "run.toml", &["--arm", "--again"]), 0, &["2 of 2 done, part 2"]);
    refused("part.job", &["part.job"]);
    assert_eq!(bench.marked().len(), 4);
    let journal = bench.journal();
    assert_eq!(journal.iter().filter(|line| line.0 == "part").count(), 1, "{journal:?}");
    // A job whose part is gone has none, wherever it was noted.
    std::fs::remove_file(bench.path("part.run.jsonl")).expect("removed");
    assert_ended(&bench.run_as("far/away/part.job", "run.toml", &["--arm"]), 0, &["2 of 2 done"]);
}

#[test]
fn a_run_that_was_interrupted_goes_on_from_a_folder_of_another_name() {
    let bench = Bench::new(2);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    shell.control().trip = Some((4, Trip::Error));
    assert_ended(&bench.run(&["--arm"]), 1, &["1 of 4 blocks are done", "--arm --go-on"]);
    std::fs::rename(&bench.job, bench.path("other.job")).expect("renamed");
    assert_ended(&bench.run_as("other.job", "run.toml", &["--arm"]), 2, &["run-go-on", "part.run.jsonl"]);
    assert_ended(&bench.run_as("other.job", "run.toml", &["--arm", "--go-on"]), 0, &["4 of 4 done"]);
    assert_eq!(bench.marked(), blocks(4));
    // A dry run asks for nothing.
    assert_ended(&bench.run_as("other.job", "run.toml", &[]), 0, &["4 of 4 blocks, nothing marked"]);
}

#[test]
#[ignore = "slow: make test-all"]
fn parts_of_a_series_are_counted_and_each_is_marked_whole() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    assert_ended(&bench.run(&["--arm", "--again"]), 0, &["2 of 2 done"]);
    assert_ended(&bench.run(&["--arm", "--again"]), 0, &["2 of 2 done, part 2"]);
    // The third stops after its first block, and continues.
    let moves = shell.control().mdi.iter().filter(|line| line.starts_with("G21 G90 G53")).count();
    // Lift, to B0001, down, to B0002.
    shell.control().trip = Some((moves + 4, Trip::Error));
    assert_ended(&bench.run(&["--arm", "--again"]), 1, &["1 of 2 blocks are done; no other block was begun"]);
    shell.control().trip = None;
    assert_ended(&bench.run(&["--arm"]), 2, &["run-go-on", "1 block is done"]);
    let out = bench.run(&["--arm", "--go-on", "--json"]);
    let outcome: Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
    assert_eq!((&outcome["part"], &outcome["finished"], &outcome["marked"]), (&3.into(), &2.into(), &1.into()));
    assert_eq!(bench.marked(), [blocks(2), blocks(2), blocks(2)].concat());
    assert_ended(&bench.run(&["--again"]), 2, &["--arm"]);
}

#[test]
fn two_run_files_of_one_machine_or_one_address_are_never_run_at_once() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.run_file(&stage_of(&shell), &bench.command_laser("3"));
    let text = std::fs::read_to_string(bench.path("run.toml")).expect("read");
    std::fs::write(bench.path("same.toml"), &text).expect("written");
    // Another machine by its name, behind the same address by another name.
    let port = shell.address.rsplit(':').next().expect("a port").to_owned();
    let other = text.replace(&shell.address, &format!("localhost:{port}")).replace("xyz-galvo-40", "other");
    std::fs::write(bench.path("other.toml"), other).expect("written");
    bench.copied("copy.job");
    let mut child = until_lines(&bench, &["--arm"], 2);
    for (run_file, held) in [("same.toml", "machine xyz-galvo-40"), ("other.toml", "linuxcncrsh at 127.0.0.1:")] {
        for more in [&["--arm", "--again"][..], &[]] {
            let out = bench.run_as("copy.job", run_file, more);
            assert_ended(&out, 2, &["run-locked", held, "is driven by another run"]);
        }
    }
    child.kill().expect("killed");
    child.wait().expect("ended");
    // Where it cannot be locked it is not run.
    std::fs::write(bench.path("no folder"), "").expect("written");
    let mut command = bench.command(&["--arm"]);
    let out = command.env("TERRACE_LOCKS", bench.path("no folder")).output().expect("the program starts");
    assert_ended(&out, 2, &["run-lock", "TERRACE_LOCKS"]);
}

#[cfg(unix)]
#[test]
fn a_journal_is_a_regular_file() {
    let bench = Bench::new(1);
    let shell = Shell::new();
    bench.shell_and_command(&shell);
    let pipe = bench.path("pipe.run.jsonl");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    for path in [Path::new("/dev/full"), Path::new("/dev/zero"), &pipe] {
        let out = bench.run(&["--arm", "--journal", path.to_str().expect("UTF-8")]);
        assert_ended(&out, 2, &["run-journal", "regular file"]);
    }
    assert!(shell.control().mdi.is_empty());
    // Beside the folder it is passed over.
    assert_ended(&bench.run(&["--arm"]), 0, &["2 of 2 done"]);
    // Nothing is begun that could not be found again.
    std::fs::write(bench.path("no folder"), "").expect("written");
    let mut command = bench.command(&["--arm", "--again"]);
    std::fs::remove_dir_all(bench.path("state")).expect("removed");
    let out = command.env("XDG_STATE_HOME", bench.path("no folder")).output().expect("the program starts");
    assert_ended(&out, 2, &["run-journal-note", "XDG_STATE_HOME"]);
}

/// A peer of TCP that sends these bytes again and again, with so long between them.
fn babbler(bytes: &'static [u8], pause: Duration) -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound").to_string();
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            std::thread::spawn(move || {
                while stream.write_all(bytes).is_ok() {
                    std::thread::sleep(pause);
                }
            });
        }
    });
    address
}

#[test]
fn a_control_that_never_ends_a_line_or_never_answers_is_left() {
    let bench = Bench::new(1);
    let ms = Duration::from_millis;
    for (bytes, pause, words) in [
        (&[b'A'; 1000][..], ms(0), "a line of more than 4096 bytes"),
        (b"A", ms(50), "within 5 s"),
        (b"XX 1\r\n", ms(0), "among 100 lines"),
    ] {
        bench.run_file(
            &format!("driver = \"linuxcnc\"\naddress = \"{}\"", babbler(bytes, pause)),
            &bench.command_laser("0"),
        );
        assert_ended(&bench.run(&["--arm"]), 1, &["run-linuxcnc-link", words]);
    }
    assert!(bench.marked().is_empty());
}

#[cfg(unix)]
#[test]
fn a_second_ctrl_c_ends_the_wait_for_an_answer_and_for_a_person() {
    let bench = Bench::new(1);
    let silent = babbler(b"A", Duration::from_millis(50));
    for (stage, seen) in [
        (format!("driver = \"linuxcnc\"\naddress = \"{silent}\""), "off.txt"),
        ("driver = \"manual\"".to_owned(), "part.run.jsonl"),
    ] {
        let _ = std::fs::remove_file(bench.path("off.txt"));
        bench.run_file(&stage, &bench.command_laser("0"));
        // Its standard input stays open, and nothing comes.
        let child = bench.command(&["--arm"]).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let child = child.expect("the program starts");
        crate::support::card::until(seen, Duration::from_secs(20), || {
            bench.path(seen).exists() && bench.path("off.txt").exists()
        });
        // The laser is open: now the stage is, or is asked for.
        std::thread::sleep(Duration::from_millis(300));
        for _ in 0..2 {
            let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
            assert!(sent.success());
            std::thread::sleep(Duration::from_millis(100));
        }
        let out = child.wait_with_output().expect("ended");
        assert_ended(&out, 1, &["run-aborted"]);
        assert!(!said(&out).contains("within 5 s"), "{}", said(&out));
    }
}

#[test]
fn names_in_the_path_of_a_folder_are_not_replaced() {
    let mut bench = Bench::new(1);
    let shell = Shell::new();
    bench.copied("{block}{shift}/{file}.job");
    bench.job = bench.path("{block}{shift}/{file}.job");
    let marked = bench.path("marked.txt").display().to_string();
    // Its standard input is at its end.
    let mark = format!("mark = ['sh', '-c', 'cat && echo \"$0\" >> \"{marked}\"', '{{file}}']\nformat = 'dxf'");
    bench.run_file(&stage_of(&shell), &format!("driver = \"command\"\n{mark}"));
    let inputs = bench.dir.path().to_str().expect("UTF-8").to_owned();
    assert_ended(&bench.run(&["--arm", "--inputs", &inputs]), 0, &["2 of 2 done"]);
    let file = |id: String| bench.job.join(format!("blocks/{id}.dxf")).display().to_string();
    assert_eq!(bench.marked(), blocks(2).into_iter().map(file).collect::<Vec<_>>());
}

#[test]
fn a_block_is_in_doubt_again_where_lightburn_is_busy_after_it() {
    let bench = Bench::in_formats(1, "\"dxf\", \"linuxcnc\", \"lightburn\"");
    let (shell, lightburn) = (Shell::new(), crate::support::lightburn::LightBurn::faultless());
    shell.control().move_time = Duration::from_millis(50);
    let keys = format!("address = \"127.0.0.1\"\nport = {}\nanswers = {}", lightburn.port, lightburn.answers);
    bench.run_file(&stage_of(&shell), &format!("driver = \"lightburn\"\n{keys}"));
    // Run, begin, end.
    let mut child = until_lines(&bench, &["--arm"], 3);
    // Somebody else starts it, again and again.
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").expect("a port");
    crate::support::card::until("the run does not end", Duration::from_secs(60), || {
        let _ = socket.send_to(b"START", ("127.0.0.1", lightburn.port));
        child.try_wait().expect("a child").is_some()
    });
    let out = child.wait_with_output().expect("ended");
    assert_ended(&out, 1, &["run-laser-busy", "0 of 2 blocks are done; block B0001 was begun", "--redo B0001"]);
    assert_eq!(bench.journal()[3], ("doubt".to_owned(), "B0001".to_owned()));
    lightburn.marks();
    assert_ended(&bench.run(&["--arm"]), 2, &["run-in-doubt", "block B0001 was begun"]);
    assert_ended(&bench.run(&["--arm", "--go-on", "--skip", "B0001"]), 0, &["2 of 2 done"]);
}

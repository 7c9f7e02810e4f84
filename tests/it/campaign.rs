//! Many random schedules of faults against `terrace run --arm`: LightBurn with datagrams that are surplus, late, doubled
//! or another's, and runs that are killed at random moments with each kind of stage and laser.
//!
//! After every stop the run is gone on with as its journal says. Whatever happens, the stage never moves while the laser
//! is on, no block is marked twice but those that were named, none is missing, and every run ends.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::run::{Bench, stage_of};
use crate::run_grbl::Simulator;
use crate::support::card::{overlap, until};
use crate::support::lightburn::LightBurn;
use crate::support::linuxcncrsh::Shell;
use crate::support::seeds;
use crate::support::surfaces::Random;

/// Schedules that run at the same time; most of their time they wait.
const AT_ONCE: usize = 24;

/// The longest that a run may take: LightBurn waits 5 s at most for anything that these peers do.
const LONGEST: Duration = Duration::from_secs(120);

/// What happened at a machine, s since 1970.
#[derive(Default)]
struct Seen {
    moves: Vec<[f64; 2]>,
    /// Blocks, where the laser tells which.
    marks: Vec<(Option<String>, [f64; 2])>,
}

/// A stage and a laser.
trait Machine {
    /// The tables of the run file.
    fn keys(&self) -> [String; 2];
    /// A new schedule.
    fn begin(&mut self, seed: u64);
    /// Waits until nothing moves or marks; then what happened since the schedule began.
    fn seen(&mut self) -> Seen;
    /// Homes the stage, as a message asks the person to.
    fn home(&mut self) {}
}

/// What the journal says: blocks that are done, the one in doubt, and how often each was marked again or skipped.
#[derive(Default)]
struct Journal {
    done: Vec<String>,
    in_doubt: Option<String>,
    redone: BTreeMap<String, usize>,
    skipped: Vec<String>,
}

impl Journal {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        let mut journal = Self::default();
        for line in whole.map(|line| serde_json::from_str::<Value>(line).expect("a line of JSON")) {
            let block = line["block"].as_str().unwrap_or_default().to_owned();
            match line["event"].as_str().expect("an event") {
                "begin" => journal.in_doubt = Some(block),
                "end" => {
                    journal.in_doubt = None;
                    journal.done.push(block);
                }
                "skip" => {
                    journal.in_doubt = None;
                    journal.skipped.push(block.clone());
                    journal.done.push(block);
                }
                "redo" => {
                    journal.in_doubt = None;
                    *journal.redone.entry(block).or_default() += 1;
                }
                "doubt" => {
                    journal.done.retain(|done| *done != block);
                    journal.in_doubt = Some(block);
                }
                _ => {}
            }
        }
        journal
    }
}

/// The job that all schedules mark, and its blocks.
struct Part {
    bench: Bench,
    blocks: Vec<String>,
}

impl Part {
    fn new() -> Self {
        let bench = Bench::in_formats(1, "\"dxf\", \"linuxcnc\", \"lightburn\"");
        let blocks = crate::run::blocks(2);
        Self { bench, blocks }
    }
}

/// One schedule in a folder of its own: a run that is killed so many times and gone on with until the part is done.
/// Answers with how often it stopped by itself.
fn schedule(part: &Part, dir: &Path, machine: &mut dyn Machine, seed: u64, kills: usize, within_ms: usize) -> usize {
    let mut random = Random::new(seed);
    let journal = dir.join("part.run.jsonl");
    let _ = std::fs::remove_file(&journal);
    let [stage, laser] = machine.keys();
    let text = format!("machine = \"xyz-galvo-40\"\n\n[stage]\n{stage}\n\n[laser]\n{laser}\n");
    std::fs::write(dir.join("run.toml"), text).expect("written");
    machine.begin(seed);
    let (mut more, mut stops) = (Vec::<String>::new(), 0);
    for attempt in 0.. {
        assert!(attempt < 40, "seed {seed}: the part is not done after {attempt} runs");
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        command.env("TERRACE_LOCKS", dir.join("locks")).env("XDG_STATE_HOME", dir.join("state"));
        command.args(["run", "-j", "1"]).arg(&part.bench.job).arg("--with").arg(dir.join("run.toml"));
        command.args(["--arm", "--journal"]).arg(&journal).args(&more);
        let said = dir.join(format!("{seed}.{attempt}.txt"));
        let err = std::fs::File::create(&said).expect("a file");
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(err).spawn().expect("started");
        let is_killed = attempt < kills;
        let code = ended(child, is_killed.then(|| Duration::from_millis(random.below(within_ms) as u64)), seed);
        stops += usize::from(!is_killed && code != Some(0));
        let found = Journal::read(&journal);
        if found.done.len() == part.blocks.len() {
            break;
        }
        if std::fs::read_to_string(&said).expect("messages").contains("home the stage") {
            machine.home();
        }
        // Those of the last run are at an end when the next begins, or it is refused.
        if random.below(2) == 0 {
            machine.seen();
        }
        more = match found.in_doubt {
            Some(block) => {
                let settled = if random.below(3) == 0 { "--skip" } else { "--redo" };
                vec!["--go-on".into(), settled.into(), block]
            }
            None if !found.done.is_empty() => vec!["--go-on".into()],
            None => Vec::new(),
        };
    }
    let found = Journal::read(&journal);
    assert_eq!(found.done, part.blocks, "seed {seed}");
    check(&machine.seen(), &found, part, seed);
    stops
}

/// Waits for the end of a run, or kills it after a time; its exit code.
fn ended(mut child: Child, kill_after: Option<Duration>, seed: u64) -> Option<i32> {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child") {
            return status.code();
        }
        if kill_after.is_some_and(|after| begun.elapsed() >= after) {
            child.kill().expect("killed");
            return child.wait().expect("ended").code();
        }
        if begun.elapsed() > LONGEST {
            let _ = child.kill();
            panic!("seed {seed}: the run does not end");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn check(seen: &Seen, journal: &Journal, part: &Part, seed: u64) {
    for (block, on) in &seen.marks {
        let moved = seen.moves.iter().find(|m| overlap(**m, *on));
        assert!(moved.is_none(), "seed {seed}: the stage moves at {moved:?} while {block:?} is marked at {on:?}");
    }
    let allowed = |block: &String| 1 + journal.redone.get(block).copied().unwrap_or_default();
    let skipped = |block: &String| journal.skipped.contains(block);
    if seen.marks.iter().any(|(block, _)| block.is_none()) {
        // A card that tells no blocks: all together.
        let most: usize = part.blocks.iter().map(allowed).sum();
        let least = part.blocks.iter().filter(|b| !skipped(b)).count();
        assert!((least..=most).contains(&seen.marks.len()), "seed {seed}: {} of {least}..{most}", seen.marks.len());
        return;
    }
    for block in &part.blocks {
        let times = seen.marks.iter().filter(|(b, _)| b.as_ref() == Some(block)).count();
        let least = usize::from(!skipped(block));
        assert!((least..=allowed(block)).contains(&times), "seed {seed}: {block} is marked {times} times");
    }
}

/// Runs the schedules of these seeds on several machines at once; answers with how many never stopped by themselves.
fn campaign<M: Machine>(
    seeds: std::ops::Range<u64>,
    [kills, within_ms]: [usize; 2],
    machine: impl Fn(&Path) -> M + Sync,
) -> usize {
    let part = Part::new();
    let (next, whole) = (AtomicU64::new(seeds.start), AtomicUsize::new(0));
    let first_fault = Mutex::new(None);
    std::thread::scope(|scope| {
        for worker in 0..AT_ONCE {
            let (part, seeds, next, whole, machine) = (&part, &seeds, &next, &whole, &machine);
            let first_fault = &first_fault;
            scope.spawn(move || {
                let dir = part.bench.path(&format!("worker {worker}"));
                std::fs::create_dir_all(&dir).expect("made");
                let mut machine = machine(&dir);
                loop {
                    let seed = next.fetch_add(1, Ordering::SeqCst);
                    if seed >= seeds.end || first_fault.lock().expect("no panic inside").is_some() {
                        return;
                    }
                    // One kill, or several in a row.
                    let kills = if kills == 0 { 0 } else { 1 + seed as usize % kills };
                    let run =
                        std::panic::AssertUnwindSafe(|| schedule(part, &dir, &mut machine, seed, kills, within_ms));
                    match std::panic::catch_unwind(run) {
                        Ok(stops) => drop(whole.fetch_add(usize::from(stops == 0), Ordering::SeqCst)),
                        Err(e) => {
                            let text = e.downcast_ref::<String>().cloned().unwrap_or_default();
                            let said = (0..40).map(|i| dir.join(format!("{seed}.{i}.txt")));
                            let said: String = said.filter_map(|p| std::fs::read_to_string(p).ok()).collect();
                            let journal = std::fs::read_to_string(dir.join("part.run.jsonl")).unwrap_or_default();
                            *first_fault.lock().expect("no panic inside") = Some(format!("{text}\n{said}\n{journal}"));
                        }
                    }
                    for i in 0..40 {
                        let _ = std::fs::remove_file(dir.join(format!("{seed}.{i}.txt")));
                    }
                }
            });
        }
    });
    if let Some(fault) = first_fault.into_inner().expect("no panic inside") {
        panic!("{fault}");
    }
    let whole = whole.into_inner();
    println!("{} schedules, of which {whole} never stopped by themselves", seeds.end - seeds.start);
    whole
}

/// A stage behind linuxcncrsh, and the scan card at it.
struct Handshake(Shell);

impl Machine for Handshake {
    fn keys(&self) -> [String; 2] {
        [stage_of(&self.0), "driver = \"handshake\"".into()]
    }
    fn begin(&mut self, seed: u64) {
        let mut control = self.0.control();
        control.moves.clear();
        control.marks.on.clear();
        control.move_time = Duration::from_millis(8);
        control.marks.times = [0.002 + (seed % 5) as f64 / 100.0, 0.06 + (seed % 7) as f64 / 50.0];
    }
    fn seen(&mut self) -> Seen {
        until("the control does not come to rest", LONGEST, || self.0.control().is_at_rest());
        let control = self.0.control();
        Seen { moves: control.moves.clone(), marks: control.marks.on.iter().map(|on| (None, *on)).collect() }
    }
}

/// Marks of a command, which appends a line when its laser is on and one when it is off.
struct Marked {
    path: PathBuf,
}

impl Marked {
    fn new(dir: &Path) -> Self {
        Self { path: dir.join("marks.txt") }
    }
    fn keys(&self) -> String {
        let path = self.path.display();
        let mark =
            format!("echo $(date +%s%N) on $0 >> \"{path}\"; sleep 0.05; echo $(date +%s%N) off $0 >> \"{path}\"");
        format!("driver = \"command\"\nmark = ['sh', '-c', '{mark}', '{{block}}']\noff = ['true']")
    }
    fn begin(&self) {
        std::fs::write(&self.path, "").expect("written");
    }
    fn seen(&self) -> Vec<(Option<String>, [f64; 2])> {
        let lines = || -> Vec<(f64, bool, String)> {
            let text = std::fs::read_to_string(&self.path).expect("marks");
            let words = text.lines().map(|line| line.split(' ').collect::<Vec<_>>());
            words.map(|w| (w[0].parse::<f64>().expect("ns") / 1e9, w[1] == "on", w[2].to_owned())).collect()
        };
        // A command of a run that was killed marks to its end, and may be about to begin.
        std::thread::sleep(Duration::from_millis(60));
        until("a command does not end", LONGEST, || {
            let lines = lines();
            lines.iter().filter(|l| l.1).count() == lines.iter().filter(|l| !l.1).count()
        });
        let lines = lines();
        let pairs = lines.chunks(2).map(|pair| {
            assert!(pair[0].1 && !pair[1].1 && pair[0].2 == pair[1].2, "two blocks at once: {lines:?}");
            (Some(pair[0].2.clone()), [pair[0].0, pair[1].0])
        });
        pairs.collect()
    }
}

/// A stage behind linuxcncrsh, and a command as laser.
struct WithCommand(Shell, Marked);

impl Machine for WithCommand {
    fn keys(&self) -> [String; 2] {
        [stage_of(&self.0), self.1.keys()]
    }
    fn begin(&mut self, _: u64) {
        let mut control = self.0.control();
        control.moves.clear();
        control.move_time = Duration::from_millis(8);
        self.1.begin();
    }
    fn seen(&mut self) -> Seen {
        until("the control does not come to rest", LONGEST, || self.0.control().is_at_rest());
        Seen { marks: self.1.seen(), moves: self.0.control().moves.clone() }
    }
}

/// A stage with GRBL, and a command as laser.
struct WithGrbl(Simulator, Marked);

impl Machine for WithGrbl {
    fn keys(&self) -> [String; 2] {
        [self.0.keys(), self.1.keys()]
    }
    fn begin(&mut self, _: u64) {
        self.0.forget();
        self.1.begin();
    }
    fn seen(&mut self) -> Seen {
        Seen { marks: self.1.seen(), moves: self.0.moves() }
    }
    fn home(&mut self) {
        self.0.home();
    }
}

/// A stage behind linuxcncrsh, and LightBurn with a fault now and then.
struct WithLightBurn(Shell, LightBurn);

impl Machine for WithLightBurn {
    fn keys(&self) -> [String; 2] {
        let (port, answers) = (self.1.port, self.1.answers);
        let keys = format!("address = \"127.0.0.1\"\nport = {port}\nanswers = {answers}");
        [stage_of(&self.0), format!("driver = \"lightburn\"\n{keys}")]
    }
    fn begin(&mut self, seed: u64) {
        let mut control = self.0.control();
        control.moves.clear();
        control.move_time = Duration::from_millis(8);
        self.1.begin(seed);
    }
    fn seen(&mut self) -> Seen {
        until("the control does not come to rest", LONGEST, || self.0.control().is_at_rest());
        Seen { marks: self.1.marks(), moves: self.0.control().moves.clone() }
    }
}

fn lightburn(seeds: std::ops::Range<u64>) {
    let count = (seeds.end - seeds.start) as usize;
    let whole = campaign(seeds, [0, 0], |_| WithLightBurn(Shell::new(), LightBurn::new()));
    assert!(whole > count / 2, "most runs come to their end in one: {whole} of {count}");
}

fn handshake(seeds: std::ops::Range<u64>) {
    campaign(seeds, [3, 3500], |_| Handshake(Shell::new()));
}

fn command(seeds: std::ops::Range<u64>) {
    campaign(seeds, [3, 1500], |dir| WithCommand(Shell::new(), Marked::new(dir)));
}

fn grbl(seeds: std::ops::Range<u64>) {
    campaign(seeds, [3, 3000], |dir| WithGrbl(Simulator::at(&dir.join("grbl.log")), Marked::new(dir)));
}

#[test]
fn surplus_late_doubled_and_foreign_datagrams_never_let_the_stage_move_while_lightburn_marks() {
    lightburn(0..3);
}

#[test]
#[ignore = "slow: make test-all"]
fn surplus_late_doubled_and_foreign_datagrams_never_let_the_stage_move_in_500_schedules() {
    lightburn(seeds(0..500));
}

#[test]
fn killed_runs_with_linuxcnc_and_its_card_mark_every_block_once() {
    handshake(0..3);
}

#[test]
#[ignore = "slow: make test-all"]
fn killed_runs_with_linuxcnc_and_its_card_mark_every_block_once_in_500_schedules() {
    handshake(seeds(0..500));
}

#[test]
fn killed_runs_with_a_command_mark_every_block_once() {
    command(0..3);
}

#[test]
#[ignore = "slow: make test-all"]
fn killed_runs_with_a_command_mark_every_block_once_in_500_schedules() {
    command(seeds(0..500));
}

#[test]
#[ignore = "slow: make test-all"]
fn killed_runs_with_grbl_mark_every_block_once() {
    grbl(0..3);
}

#[test]
#[ignore = "slow: make test-all"]
fn killed_runs_with_grbl_mark_every_block_once_in_500_schedules() {
    grbl(seeds(0..500));
}

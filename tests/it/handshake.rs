//! The handshake of START and BUSY against scan cards that answer well and badly: `terrace run`, and a model of LinuxCNC
//! that executes `stage.ngc`. The stage never moves while the laser is on, or the program ends with a message.

use std::collections::BTreeMap;
use std::path::Path;

use crate::run::{Bench, assert_ended, stage_of};
use crate::support::card::{Card, Marks, overlap};
use crate::support::linuxcncrsh::Shell;
use crate::support::said;
use crate::support::surfaces::Random;

/// What a program did.
struct Done {
    /// The message with which it ended before its end.
    message: Option<String>,
    /// From when to when the stage moved, s.
    moves: Vec<[f64; 2]>,
    /// Digital output 0 at the end.
    start: bool,
}

/// A move lasts so long, s.
const MOVE: f64 = 0.03;

/// Executes the words of `stage.ngc` as LinuxCNC does, with a card at its output 0 and input 0.
fn execute(program: &str, card: Card, marks: &mut Marks, parameters: &BTreeMap<u32, f64>) -> Done {
    let mut parameters = parameters.clone();
    let mut done = Done { message: None, moves: Vec::new(), start: false };
    let (mut now, mut message, mut skipped_to) = (0.0, None, None::<String>);
    for line in program.lines() {
        let line = line.strip_prefix('N').map_or(line, |l| l.trim_start_matches(|c: char| c.is_ascii_digit()).trim());
        if let Some(end) = &skipped_to {
            if line == end {
                skipped_to = None;
            }
            continue;
        }
        if let Some(text) = line.strip_prefix("(MSG, ") {
            message = text.strip_suffix(')').map(str::to_owned);
        } else if line.starts_with('(') || line.ends_with("endif") {
        } else if line.starts_with("G0 ") {
            done.moves.push([now, now + MOVE]);
            now += MOVE;
        } else if let Some(seconds) = line.strip_prefix("G4 P") {
            now += seconds.parse::<f64>().expect("s");
        } else if line == "M64 P0" {
            if !done.start {
                marks.start(now);
            }
            done.start = true;
        } else if line == "M65 P0" {
            done.start = false;
        } else if let Some((level, longest)) = line.strip_prefix("M66 P0 L").and_then(|l| l.split_once(" Q")) {
            let (high, longest): (bool, f64) = (level == "3", longest.parse().expect("s"));
            let found = card.reaches(marks, high, now, longest);
            now += found.unwrap_or(longest);
            parameters.insert(5399, if found.is_none() { -1.0 } else { f64::from(u8::from(high)) });
        } else if let Some((label, condition)) = line.split_once(" if [#") {
            let (number, test) = condition.split_once(' ').expect("a test");
            let value = parameters.get(&number.parse().expect("a parameter")).copied().unwrap_or(0.0);
            let holds = match test {
                "LT 0]" => value < 0.0,
                // It calls numbers equal that differ by less.
                "NE 0]" => value.abs() > 1e-4,
                other => panic!("{other}"),
            };
            skipped_to = (!holds).then(|| format!("{label} endif"));
        } else if line == "M2" {
            done.message = message;
            return done;
        } else {
            assert!(line.starts_with("G21 "), "{line}");
        }
    }
    panic!("the program has no end");
}

/// Whether the stage moved while the laser was on.
fn burns(moves: &[[f64; 2]], marks: &Marks) -> bool {
    moves.iter().any(|m| marks.on.iter().any(|on| overlap(*m, *on)))
}

fn program(job: &Path) -> String {
    std::fs::read_to_string(job.join("stage.ngc")).expect("a stage program")
}

/// Cards, how soon after START their laser is on and for how long, and with what a program for them ends.
const CARDS: [(Card, [f64; 2], Option<&str>); 12] = [
    (Card::Works, [0.004, 0.02], None),
    (Card::Works, [4.9, 3.0], None),
    (Card::Works, [5.5, 1.0], Some("no BUSY, block B0001")),
    (Card::Inverted, [0.004, 0.5], Some("BUSY before START, block B0001")),
    (Card::Busy, [0.004, 0.5], Some("BUSY before START, block B0001")),
    (Card::Dead, [0.004, 0.5], Some("no BUSY, block B0001")),
    (Card::Stuck, [0.004, 0.5], Some("still BUSY, block B0001")),
    (Card::Bouncing, [0.004, 0.5], None),
    (Card::Bouncing, [0.004, 0.03], None),
    (Card::Dropout, [0.004, 0.5], None),
    (Card::Late(1.5), [0.004, 3.0], None),
    (Card::Late(5.5), [0.004, 9.0], Some("no BUSY, block B0001")),
];

#[test]
fn stage_program_never_moves_with_the_laser_on_whatever_busy_does() {
    let bench = Bench::new(2);
    let program = program(&bench.job);
    for (card, times, message) in CARDS {
        let mut marks = Marks { times, ..Marks::default() };
        let done = execute(&program, card, &mut marks, &BTreeMap::new());
        assert_eq!(done.message.as_deref(), message, "{card:?} {times:?}");
        assert!(!burns(&done.moves, &marks) && !done.start, "{card:?} {times:?}: {:?} {:?}", done.moves, marks.on);
        if message.is_none() {
            assert_eq!(marks.on.len(), 4, "{card:?}: every block once");
        }
    }
    // The model sees what it looks for: BUSY is asked once only, or not before START.
    let mut bouncing = Marks { times: [0.004, 0.5], ..Marks::default() };
    let once = program.replace("G4 P0.050\n", "");
    let done = execute(&once, Card::Bouncing, &mut bouncing, &BTreeMap::new());
    assert!(burns(&done.moves, &bouncing));
    let mut inverted = Marks { times: [0.004, 0.5], ..Marks::default() };
    let done = execute(&program.replace("L4 Q2\n", "L3 Q2\n"), Card::Inverted, &mut inverted, &BTreeMap::new());
    assert!(burns(&done.moves, &inverted));
}

#[test]
fn stage_program_ends_with_a_message_before_it_moves_where_an_offset_is_active() {
    let bench = Bench::new(1);
    let program = program(&bench.job);
    for (parameter, message) in [
        (5210, "G92 is active"),
        (5221, "G54 has an offset in X"),
        (5222, "G54 has an offset in Y"),
        (5223, "G54 has an offset in Z"),
        (5230, "G54 is rotated"),
    ] {
        for value in [1.0, -0.001] {
            let done = execute(&program, Card::Works, &mut Marks::default(), &BTreeMap::from([(parameter, value)]));
            assert_eq!((done.message.as_deref(), done.moves.len()), (Some(message), 0));
        }
    }
    // Those of other work offsets are not active.
    let others = BTreeMap::from([(5211, 3.0), (5241, 5.0), (5250, 30.0)]);
    assert_eq!(execute(&program, Card::Works, &mut Marks::default(), &others).message, None);
}

/// A card with random times, in its limits and out of them.
fn random_card(random: &mut Random) -> (Card, [f64; 2]) {
    let mut s = |longest_ms: usize| random.below(longest_ms) as f64 / 1e3;
    let (delay, width, late) = (s(7000), 0.02 + s(4000), s(7000));
    let card = match random.below(9) {
        0 => Card::Dead,
        1 => Card::Stuck,
        2 => Card::Busy,
        3 => Card::Inverted,
        4 => Card::Bouncing,
        5 => Card::Dropout,
        6 => Card::Late(late),
        _ => Card::Works,
    };
    (card, [delay, width])
}

#[test]
fn stage_program_never_moves_with_the_laser_on_with_a_thousand_random_cards() {
    let bench = Bench::new(2);
    let program = program(&bench.job);
    let mut random = Random::new(11);
    let mut ended = [0; 2];
    for _ in 0..1000 {
        let (card, times) = random_card(&mut random);
        let mut marks = Marks { times, ..Marks::default() };
        let done = execute(&program, card, &mut marks, &BTreeMap::new());
        assert!(!burns(&done.moves, &marks) && !done.start, "{card:?} {times:?}");
        // It stops, or each block was marked.
        assert!(done.message.is_some() || marks.on.len() == 4, "{card:?} {times:?}: {}", marks.on.len());
        ended[usize::from(done.message.is_some())] += 1;
    }
    assert!(ended[0] > 100 && ended[1] > 100, "{ended:?}");
}

#[test]
fn a_run_never_moves_with_the_laser_on_whatever_busy_does() {
    // Each run waits for its card most of the time.
    std::thread::scope(|all| {
        for (card, times, message) in CARDS {
            // Times in which nothing happens are skipped, others pass.
            if times[0] <= 1.0 || message.is_some() {
                all.spawn(move || assert_run_is_safe(card, times, message));
            }
        }
    });
}

/// Marks a job with such a card, and holds that the stage never moved while the laser was on, and how the run ended.
fn assert_run_is_safe(card: Card, times: [f64; 2], message: Option<&str>) {
    let bench = Bench::new(1);
    let shell = Shell::new();
    (shell.control().card, shell.control().marks.times) = (card, times);
    bench.run_file(&stage_of(&shell), "driver = \"handshake\"");
    let out = bench.run(&["--arm"]);
    let code = i32::from(message.is_some());
    let words: &[&str] = match message.map(|m| m.split(',').next().unwrap_or_default()) {
        None => &["2 of 2 done"],
        Some("BUSY before START") => &["run-busy", "before START", "no other block was begun"],
        Some("no BUSY") => &["run-busy", "not risen", "block B0001 was begun"],
        Some(_) => &["run-busy", "not fallen", "block B0001 was begun"],
    };
    assert_ended(&out, code, words);
    let control = shell.control();
    assert!(!burns(&control.moves, &control.marks), "{card:?}: {:?} {:?}", control.moves, control.marks.on);
    assert!(!control.start && (code == 1 || control.marks.on.len() == 2), "{card:?}: {}", said(&out));
}

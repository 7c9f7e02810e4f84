//! Offsets that are active before a stage program is started: LinuxCNC's interpreter and the simulator of GRBL. The
//! program ends with a message, or cancels them, before the first move.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Output};

use crate::foreign::readers;
use crate::run::Bench;
use crate::run_grbl::Simulator;
use crate::support::{folder, said};

/// What the interpreter makes of a program: its messages, and its moves as they are printed, each with what is active.
#[derive(Debug, Default, PartialEq)]
struct Interpreted {
    messages: Vec<String>,
    moves: Vec<(String, Active)>,
}

/// What turns positions of a program into those of the machine.
#[derive(Clone, Debug, PartialEq)]
struct Active {
    /// Work offset with its number, 1 for G54.
    work: String,
    g92: String,
    rotation: String,
    tool: String,
}

const ZERO: &str = "0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000";

impl Active {
    fn none() -> Self {
        let tool = "0.0000 0.0000 0.0000, 0.0000 0.0000 0.0000, 0.0000 0.0000 0.0000".into();
        Self { work: format!("1, {ZERO}"), g92: ZERO.into(), rotation: "0.0000".into(), tool }
    }
}

/// Runs the interpreter once. It is killed (SIGBUS) at times where another one begins: all share the file of their
/// tools.
pub fn run_interpreter(before: &str, program: &str) -> Output {
    let (venv, dir) = (readers(), folder());
    let path = dir.path().join("program.ngc");
    std::fs::write(&path, format!("{before}\n{program}")).expect("written");
    let mut command = Command::new(venv.join("linuxcnc/rs274"));
    command.arg("-t").arg(venv.join("linuxcnc/tool.tbl")).arg("-v").arg(dir.path().join("fresh.var"));
    command.arg("-g").arg(&path).output().expect("rs274 starts")
}

/// Runs a program after some lines that an operator has entered.
fn interpret(before: &str, program: &str) -> Interpreted {
    let out = (0..20).map(|_| run_interpreter(before, program)).find(|out| out.status.code().is_some());
    let out = out.expect("rs274 ends");
    assert!(out.status.success(), "{}", said(&out));
    let (mut found, mut active) = (Interpreted::default(), Active::none());
    for line in String::from_utf8_lossy(&out.stdout).lines() {
        let Some((word, rest)) = line.split_once('(') else { continue };
        let (word, values) =
            (word.split_whitespace().last().unwrap_or_default(), rest.trim_end_matches(')').to_owned());
        match word {
            "SET_G5X_OFFSET" => active.work = values,
            "SET_G92_OFFSET" => active.g92 = values,
            "SET_XY_ROTATION" => active.rotation = values,
            "USE_TOOL_LENGTH_OFFSET" => active.tool = values,
            "MESSAGE" => found.messages.push(values.trim_matches(['"', ' ']).to_owned()),
            "STRAIGHT_TRAVERSE" => found.moves.push((values, active.clone())),
            _ => {}
        }
    }
    found
}

/// What an operator may have entered, and what LinuxCNC's program ends with; None where it cancels it.
const ENTERED: [(&str, Option<&str>); 12] = [
    ("", None),
    ("G21 G92 X5 Y5", Some("G92 is active")),
    ("G21 G92 Z-0.5", Some("G92 is active")),
    ("G21 G52 X4", Some("G92 is active")),
    ("G21 G92 X5\nG92.2", None),
    ("G21 G10 L2 P1 X3", Some("G54 has an offset in X")),
    ("G21 G10 L2 P1 Y-3", Some("G54 has an offset in Y")),
    ("G21 G10 L20 P1 Z0.01", Some("G54 has an offset in Z")),
    ("G10 L2 P1 R30", Some("G54 is rotated")),
    ("G21 G10 L2 P2 X7 Y7 Z7\nG55", None),
    ("G21 G10 L2 P2 X7 R10\nG55", None),
    ("G21 G43.1 Z10", None),
];

#[test]
fn stage_program_of_linuxcnc_ends_or_cancels_what_is_active_before_it_moves() {
    let bench = Bench::framed();
    for name in ["stage.ngc", "frames/stage-frame.ngc"] {
        let program = std::fs::read_to_string(bench.job.join(name)).expect("a program");
        let clean = interpret("", &program);
        assert!(clean.moves.len() > 3 && clean.moves.iter().all(|m| m.1 == Active::none()), "{name}: {clean:?}");
        for (before, message) in ENTERED {
            let found = interpret(before, &program);
            match message {
                None => assert_eq!(found, clean, "{name}: {before}"),
                Some(message) => {
                    assert!(found.moves.is_empty(), "{name}: {before}: {found:?}");
                    assert_eq!(found.messages, [message], "{name}: {before}");
                }
            }
        }
    }
}

#[test]
fn stage_program_with_stops_moves_in_g54_without_other_offsets() {
    let bench = Bench::framed();
    for name in ["stage_m0.nc", "frames/stage_m0-frame.nc"] {
        let program = std::fs::read_to_string(bench.job.join(name)).expect("a program");
        let clean = interpret("", &program);
        assert!(clean.moves.len() > 5, "{name}: {clean:?}");
        for (before, message) in ENTERED {
            // Of G54 the head of the program speaks: it is its zero.
            if message.is_some_and(|m| m.contains("G54")) {
                continue;
            }
            assert_eq!(interpret(before, &program), clean, "{name}: {before}");
        }
        let zero = interpret("G21 G10 L2 P1 X3", &program);
        let work = format!("1, {}", ZERO.replacen("0.0000", "3.0000", 1));
        let wanted = Active { work, ..Active::none() };
        assert!(zero.moves.len() == clean.moves.len() && zero.moves.iter().all(|m| m.1 == wanted), "{zero:?}");
        let words: String = program.lines().take_while(|l| l.starts_with('(')).collect();
        let words = words.replace(")(... ", " ");
        assert!(words.contains("positions are from the zero of G54, which must be the zero of the table frame"));
    }
}

/// Sends lines to a control one by one, each after the answer to the one before; answers with all that it said.
pub fn send<'a>(port: &Path, lines: impl Iterator<Item = &'a str>) -> String {
    let mut all = String::new();
    let mut port = std::fs::File::options().read(true).write(true).open(port).expect("a terminal");
    let mut answers = BufReader::new(port.try_clone().expect("a handle"));
    for line in lines {
        port.write_all(format!("{line}\n").as_bytes()).expect("sent");
        loop {
            let mut answer = String::new();
            answers.read_line(&mut answer).expect("an answer");
            assert!(!answer.starts_with("error") && !answer.starts_with("ALARM"), "{line}: {answer}");
            all += &answer;
            if answer.trim() == "ok" {
                break;
            }
        }
    }
    all
}

#[test]
#[ignore = "slow: make test-all"]
fn stage_program_with_stops_goes_to_the_same_places_with_grbl_whatever_was_active() {
    let bench = Bench::framed();
    for name in ["stage_m0.nc", "frames/stage_m0-frame.nc"] {
        let program = std::fs::read_to_string(bench.job.join(name)).expect("a program");
        let places = |entered: &str| {
            let dir = folder();
            let simulator = Simulator::at(&dir.path().join("grbl.log"));
            send(Path::new(&simulator.port), entered.lines().chain(program.lines()));
            let log = simulator.end();
            let places = log.lines().filter_map(|line| Some(line.split_once(" machine ")?.1.to_owned()));
            places.collect::<Vec<String>>()
        };
        let clean = places("");
        assert!(clean.len() > 5, "{name}: {clean:?}");
        for entered in ["G92 X5 Y5", "G10 L2 P2 X-7 Y-7 Z-7\nG55", "G43.1 Z-10", "G43.1 Z-10\nG92 Z3\nG55"] {
            assert_eq!(places(entered), clean, "{name}: {entered}");
        }
        // The simulator does what the program says: without the line that cancels it, it goes elsewhere.
        let damaged = program.replace("G92.1\n", "");
        let dir = folder();
        let simulator = Simulator::at(&dir.path().join("grbl.log"));
        send(Path::new(&simulator.port), "G92 X5 Y5".lines().chain(damaged.lines()));
        assert_ne!(
            simulator.end().lines().filter_map(|l| Some(l.split_once(" machine ")?.1)).collect::<Vec<_>>(),
            clean
        );
    }
}

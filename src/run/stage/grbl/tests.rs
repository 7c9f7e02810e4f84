//! The driver against the simulator of `tests/python`, over a pseudo-terminal.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};

use super::*;

/// The process of one or more simulators.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // They end with their standard input.
        let _ = self.0.wait();
    }
}

/// A running simulator.
struct Simulator {
    process: Arc<Mutex<Process>>,
    port: String,
    log: PathBuf,
    _folder: Arc<tempfile::TempDir>,
}

impl Simulator {
    fn start(arguments: &[&str]) -> Self {
        Self::start_all(arguments, &[]).remove(0)
    }

    /// One simulator for each fault.
    fn start_all(arguments: &[&str], faults: &[String]) -> Vec<Self> {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/grbl_simulator.py");
        let folder = Arc::new(tempfile::tempdir().expect("a folder"));
        let log = folder.path().join("log");
        let mut child = Command::new("python3")
            .args(["-I", "-S", script, "--log"])
            .arg(&log)
            .args(["--wco=-300,-300,-200", "--name", "stage 7"])
            .args(arguments)
            .args(faults.iter().flat_map(|fault| ["--fault", fault]))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("python3 starts");
        let ports = BufReader::new(child.stdout.take().expect("piped")).lines();
        let process = Arc::new(Mutex::new(Process(child)));
        let all = ports.take(faults.len().max(1)).enumerate().map(|(i, port)| Self {
            process: process.clone(),
            port: port.expect("the name of a terminal"),
            log: if faults.len() > 1 { folder.path().join(format!("log.{i}")) } else { log.clone() },
            _folder: folder.clone(),
        });
        all.collect()
    }

    /// A driver that waits less long than for a board.
    fn driver(&self) -> Grbl {
        let mut grbl = Grbl::new(&self.port, None, Some("stage 7".into()));
        let ms = Duration::from_millis;
        let answer = ms(800);
        let repeat = ms(200);
        let boot = ms(800);
        let motion = ms(3000);
        grbl.timeouts = Timeouts { answer, repeat, boot, motion, hold: ms(800), begin: ms(200), spare: ms(500) };
        grbl
    }

    fn opened(&self) -> Grbl {
        let mut grbl = self.driver();
        let mut tries = 40;
        loop {
            match grbl.open(&Interrupt::default()) {
                Ok(_) => return grbl,
                // See `link`.
                Err(e) if e.code == "grbl-port" && tries > 0 => std::thread::sleep(Duration::from_millis(50)),
                Err(e) => panic!("it is ready: {e}"),
            }
            tries -= 1;
        }
    }

    /// The port, once nobody holds it. A driver that was dropped may for a moment longer: a process that another test
    /// starts meanwhile has the lock, too, until it runs a program of its own.
    fn link(&self) -> Link {
        let open =
            |_| Link::open(&self.port, DEFAULT_BAUD).inspect_err(|_| std::thread::sleep(Duration::from_millis(50)));
        (0..40).map(open).find_map(Result::ok).expect("a port")
    }

    /// Stores a setting, as a terminal does.
    fn set(&self, setting: &str) {
        let mut link = self.link();
        link.send(setting).expect("sent");
        assert_eq!(link.next(Instant::now() + Duration::from_secs(1)), Ok(Some(Reply::Ok)));
    }

    /// What it has logged, without times.
    fn log(&self) -> Vec<String> {
        let text = std::fs::read_to_string(&self.log).unwrap_or_default();
        text.lines().filter_map(|line| line.split_once(' ')).map(|(_, event)| event.to_owned()).collect()
    }
}

fn to(words: &[(char, i64)]) -> Move {
    Move(words.to_vec())
}

fn go(grbl: &mut Grbl, words: &[(char, i64)]) -> Result<(), Diag> {
    grbl.go(&to(words), &Interrupt::default())
}

#[test]
fn moves_arrive_and_lines_are_those_of_the_stage_program() {
    let simulator = Simulator::start(&[]);
    let mut grbl = simulator.driver();
    let opened = grbl.open(&Interrupt::default()).expect("it is ready");
    assert!(opened.contains("VER:1.1h.20190825:stage 7") && opened.ends_with("X300.000 Y300.000 Z200.000"), "{opened}");
    go(&mut grbl, &[('Z', 150_000_000)]).expect("there");
    go(&mut grbl, &[('X', 250_001_000), ('Y', 280_123_457)]).expect("there");
    assert_eq!(simulator.log().last().map(String::as_str), Some("at 250.0000 280.1225 150.0000"), "rounded to steps");
    // No motion at all.
    go(&mut grbl, &[('Z', 150_000_000)]).expect("there");
    grbl.halt().expect("off");
    let lines: Vec<String> = simulator.log().into_iter().filter(|l| l.starts_with("line ")).collect();
    let wanted = ["$I", "$$", "G21G90G94G17G40G80", "M5", "$#", "G90G21G0Z150.000000"].map(|l| format!("line {l}"));
    assert_eq!(lines[..6], wanted);
    assert_eq!(lines[6], "line G90G21G0X250.001000Y280.123457");
    assert_eq!(lines.last().map(String::as_str), Some("line M5"));
    assert!(!simulator.log().iter().any(|l| l == "reset"), "an idle control is not reset");
    drop(grbl);
    // Reports in work coordinates.
    simulator.set("$10=2");
    go(&mut simulator.opened(), &[('X', 299_000_000)]).expect("there");
    assert_eq!(simulator.log().last().map(String::as_str), Some("at 299.0000 280.1225 150.0000"));
}

#[test]
fn every_fault_in_a_move_stops_the_stage_and_says_what_is_certain() {
    let kept = "the stage is halted and its output off; its position is kept";
    let lost = "the stage is halted and its output off; its position is not certain: home it";
    let unknown = "it is not certain that the stage has stopped, nor where it is";
    let cases = [
        ("alarm", "grbl-alarm", lost),
        ("door", "grbl-state", kept),
        ("hold", "grbl-state", kept),
        ("reset", "grbl-reset", lost),
        ("silent", "grbl-answer", unknown),
        ("drop-ok", "grbl-answer", kept),
        ("drop-end", "grbl-answer", kept),
        ("drop-digit", "grbl-position", kept),
        ("stuck", "grbl-time", kept),
    ];
    let quick = ["--set", "120=50000", "--set", "121=50000"];
    let faults = cases.map(|(fault, ..)| format!("{fault}@2"));
    let case = |(simulator, (fault, code, certain)): (Simulator, (&str, &str, &str))| {
        let mut grbl = simulator.opened();
        go(&mut grbl, &[('X', 299_000_000), ('Y', 299_000_000)]).expect("there");
        let e = go(&mut grbl, &[('X', 289_000_000), ('Y', 289_000_000)]).expect_err(fault);
        assert_eq!(e.code, code, "{fault}: {e}");
        assert!(e.message.contains(certain) && !e.hint.is_empty(), "{fault}: {e}");
        let log = simulator.log();
        let moved = log.iter().filter(|l| l.starts_with("at ")).count();
        // GRBL ends a move that arrives elsewhere, and one that it does not answer to before the driver gives up.
        let is_whole = ["drop-digit", "drop-ok", "silent"].contains(&fault);
        assert_eq!(moved, 1 + usize::from(is_whole), "{fault}: {log:?}");
        assert_eq!(log.iter().any(|l| l == "reset"), fault != "drop-digit", "{fault}: {log:?}");
        assert_eq!(grbl.halt().is_err(), fault == "silent", "{fault}");
    };
    let simulators = Simulator::start_all(&quick, &faults);
    assert_eq!(simulators.len(), cases.len());
    std::thread::scope(|scope| {
        let running: Vec<_> = simulators.into_iter().zip(cases).map(|one| scope.spawn(move || case(one))).collect();
        running.into_iter().for_each(|one| one.join().expect("as wanted"));
    });
}

/// A moment for a port to be free again; false.
fn pause() -> bool {
    std::thread::sleep(Duration::from_millis(50));
    false
}

#[test]
fn a_control_that_is_not_ready_or_another_one_is_refused() {
    for (arguments, code) in [
        (["--start", "alarm"], "grbl-homing"),
        (["--g92", "1,0,0"], "grbl-zero"),
        (["--fault", "silent@0"], "grbl-answer"),
    ] {
        let e = Simulator::start(&arguments).driver().open(&Interrupt::default()).expect_err(code);
        assert_eq!(e.code, code, "{arguments:?}: {e}");
    }
    let simulator = Simulator::start(&[]);
    let mut other = simulator.driver();
    other.identity = Some("stage 8".into());
    assert_eq!(other.open(&Interrupt::default()).expect_err("another stage").code, "grbl-identity");
    drop(other);
    for [wrong, right] in [["$22=0", "$22=1"], ["$13=1", "$13=0"], ["$110=0", "$110=60000"]] {
        simulator.set(wrong);
        // A process that another test starts holds the port, locked, until it runs.
        let refused = || simulator.driver().open(&Interrupt::default()).expect_err(wrong);
        let e = (0..20).map(|_| refused()).find(|e| e.code != "grbl-port" || pause()).unwrap_or_else(refused);
        assert_eq!(e.code, "grbl-setting", "{wrong}: {e}");
        simulator.set(right);
    }
    simulator.opened();
    assert!(!simulator.log().iter().any(|l| l.starts_with("line G0") || l.starts_with("at ")), "it never moves");
    let e = Grbl::new("/dev/no-such-port", None, None).open(&Interrupt::default()).expect_err("no port");
    assert_eq!(e.code, "grbl-port");
}

#[test]
fn abort_holds_and_keeps_the_position() {
    let simulator = Simulator::start(&["--set", "110=600"]);
    let mut grbl = simulator.opened();
    let interrupt = Interrupt::default();
    let e = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(100));
            interrupt.request();
            std::thread::sleep(Duration::from_millis(50));
            interrupt.request();
        });
        grbl.go(&to(&[('X', 200_000_000)]), &interrupt).expect_err("aborted")
    });
    assert!(e.code == "grbl-aborted" && e.message.ends_with("its position is kept"), "{e}");
    assert!(!simulator.log().iter().any(|l| l.starts_with("at ")), "not arrived");
}

#[test]
fn a_broken_line_is_reported_and_nothing_is_certain() {
    let simulator = Simulator::start(&["--fault", "hang-up@1"]);
    let mut grbl = simulator.opened();
    let e = go(&mut grbl, &[('X', 200_000_000)]).expect_err("hung up");
    assert!(["grbl-link", "grbl-answer"].contains(&e.code) && e.message.contains("not certain"), "{e}");
    assert_eq!(grbl.halt().expect_err("no line").code, "grbl-off");
}

#[test]
fn a_new_run_waits_for_the_move_of_a_killed_one_and_never_ends_its_line() {
    let simulator = Simulator::start(&["--set", "110=6000"]);
    let mut first = simulator.opened();
    let link = first.link.as_mut().expect("open");
    link.send("G90 G21 G0 X270.000000").expect("sent");
    assert_eq!(link.next(Instant::now() + Duration::from_secs(1)), Ok(Some(Reply::Ok)));
    drop(first);
    let mut second = simulator.opened();
    assert_eq!(simulator.log().iter().filter(|l| *l == "at 270.0000 300.0000 200.0000").count(), 1);
    go(&mut second, &[('X', 271_000_000)]).expect("there");
    let link = second.link.as_mut().expect("open");
    b"G0 X27".iter().for_each(|byte| link.real_time(*byte).expect("sent"));
    drop(second);
    simulator.opened();
    assert_eq!(simulator.log().iter().filter(|l| l.starts_with("at ")).count(), 2, "{:?}", simulator.log());
}

#[test]
fn lines_that_do_not_fit_are_refused_before_they_are_sent() {
    let simulator = Simulator::start(&[]);
    let mut grbl = simulator.opened();
    for words in [&[('A', 0), ('X', 0)][..], &[('X', i64::MIN); 8], &[]] {
        assert_eq!(go(&mut grbl, words).expect_err("refused").code, "grbl-axes");
    }
    let link = grbl.link.as_mut().expect("open");
    link.send(&"x".repeat(79)).expect("80 bytes");
    assert_eq!(link.send(&"x".repeat(47)).expect_err("128 bytes").code, "grbl-buffer");
    link.send(&"x".repeat(46)).expect("127 bytes");
}

#[test]
fn simulator_ends_when_its_receive_buffer_is_overrun() {
    let simulator = Simulator::start(&[]);
    let mut port = serialport::new(&simulator.port, 115_200).open().expect("a port");
    port.write_all(&b"G0 X1\n".repeat(30)).expect("written");
    let mut process = simulator.process.lock().expect("one test");
    // The end of its input would end it as well.
    let _input = process.0.stdin.take();
    assert_eq!(process.0.wait().expect("it ends").code(), Some(3));
}

#[cfg(unix)]
#[test]
fn a_port_that_never_ends_a_line_or_says_nothing_of_use_is_left() {
    use serialport::{SerialPort, TTYPort};
    for bytes in [&[b'A'; 200][..], &b"junk\r\n".repeat(30)] {
        let (mut master, slave) = TTYPort::pair().expect("a terminal");
        let port = slave.name().expect("a name");
        drop(slave);
        let is_done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !is_done.load(std::sync::atomic::Ordering::SeqCst) {
                    let _ = master.write(bytes);
                }
            });
            let mut grbl = Grbl::new(port, None, None);
            let ms = Duration::from_millis;
            grbl.timeouts = Timeouts { repeat: ms(100), boot: ms(300), answer: ms(300), ..TIMEOUTS };
            let e = grbl.open(&Interrupt::default()).expect_err("no GRBL");
            is_done.store(true, std::sync::atomic::Ordering::SeqCst);
            assert_eq!(e.code, "grbl-answer", "{e}");
        });
    }
}

//! The driver against a responder on a port of this computer.

use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};

use super::*;
use crate::run::laser::tests::UntouchedStage;

/// What the responder does wrong.
#[derive(Clone, Copy, Debug, Default)]
struct Faults {
    /// Requests and answers are lost again and again, the first load among them.
    lossy: bool,
    /// Nothing is answered from this command on.
    silent_from: Option<&'static str>,
    /// This command is answered with `!`.
    refuses: Option<&'static str>,
    /// The answer to this command is lost.
    mute: Option<&'static str>,
    /// Every other answer to STATUS comes so late, after START.
    late_ms: u64,
    /// START is ignored, though the answer is OK.
    never_starts: bool,
}

const MARKING: Duration = Duration::from_millis(150);

/// A LightBurn that marks for [`MARKING`], and four times as long where answers are lost.
struct Responder {
    port: u16,
    received: Mutex<Receiver<String>>,
}

impl Responder {
    fn start(faults: Faults) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
        let port = socket.local_addr().expect("bound").port();
        let (log, received) = channel();
        std::thread::spawn(move || respond(&socket, faults, &log));
        Self { port, received: Mutex::new(received) }
    }

    fn driver(&self, folder: Option<&str>) -> LightBurn {
        // Any free port for the answers; the responder answers to where a request comes from.
        let mut laser = LightBurn::new(Some("127.0.0.1".into()), folder.map(Into::into), Some(self.port), Some(0));
        let ms = Duration::from_millis;
        laser.timeouts = Timeouts { answer: ms(60), load: ms(60), silence: ms(300), begin: ms(500), agree: ms(5000) };
        laser
    }

    fn received(&self) -> Vec<String> {
        self.received.lock().expect("one test").try_iter().filter(|c| c != "STATUS").collect()
    }
}

fn respond(socket: &UdpSocket, faults: Faults, log: &Sender<String>) {
    let mut is_silent = false;
    let mut has_started = false;
    let mut has_lost = false;
    let mut busy_until = Instant::now();
    let mut buffer = [0; 512];
    for number in 1.. {
        let Ok((count, from)) = socket.recv_from(&mut buffer) else { return };
        let command = String::from_utf8_lossy(&buffer[..count]).into_owned();
        let name = command.split(':').next().unwrap_or_default();
        is_silent |= faults.silent_from == Some(name);
        if is_silent || faults.lossy && name != "START" && (number % 6 == 0 || name == "FORCELOAD" && !has_lost) {
            has_lost |= name == "FORCELOAD";
            continue;
        }
        if log.send(command.clone()).is_err() {
            return;
        }
        let is_busy = Instant::now() < busy_until;
        let answer = match name {
            _ if faults.refuses == Some(name) => "!",
            "STATUS" if is_busy => "!",
            "PING" | "STATUS" | "FORCELOAD" => "OK",
            "START" => {
                has_started = true;
                if !faults.never_starts {
                    busy_until =
                        Instant::now() + if faults.lossy || faults.mute.is_some() { 4 * MARKING } else { MARKING };
                }
                "OK"
            }
            _ => "?",
        };
        if faults.mute == Some(name) || faults.lossy && number % 7 == 0 {
            continue;
        }
        if name == "STATUS" && faults.late_ms > 0 && has_started && number % 2 == 0 {
            let socket = socket.try_clone().expect("a socket");
            std::thread::spawn(move || {
                std::thread::sleep(Duration::from_millis(faults.late_ms));
                socket.send_to(answer.as_bytes(), from)
            });
        } else {
            let _ = socket.send_to(answer.as_bytes(), from);
        }
    }
}

fn work(estimate: Duration) -> Work {
    let file = Some("/jobs/a.job/blocks/B0007.lbrn2".into());
    Work { block: "B0007".into(), file, focus_shift: 0, estimate }
}

fn mark(laser: &mut LightBurn, interrupt: &Interrupt) -> Result<(), Diag> {
    laser.mark(&work(Duration::ZERO), Beam::Fire, &mut UntouchedStage, interrupt)
}

/// Opens, marks one block, and switches off.
fn run(faults: Faults) -> (Responder, Duration, Result<(), Diag>, Result<(), Diag>) {
    let responder = Responder::start(faults);
    let mut laser = responder.driver(None);
    laser.open(&Interrupt::default()).expect("it answers");
    let begin = Instant::now();
    let marked = mark(&mut laser, &Interrupt::default());
    let time = begin.elapsed();
    let off = laser.off();
    (responder, time, marked, off)
}

#[test]
fn block_is_loaded_started_once_and_awaited() {
    let (responder, time, marked, off) = run(Faults::default());
    assert_eq!((marked, off), (Ok(()), Ok(())));
    assert!(time >= MARKING, "{time:?}");
    assert_eq!(responder.received(), ["PING", "FORCELOAD:/jobs/a.job/blocks/B0007.lbrn2", "START"]);
}

#[test]
fn lost_packets_are_repeated_but_start_is_not() {
    let (responder, time, marked, off) = run(Faults { lossy: true, ..Faults::default() });
    assert_eq!((marked, off), (Ok(()), Ok(())));
    assert!(time >= 4 * MARKING, "{time:?}");
    assert_eq!(responder.received().iter().filter(|c| *c == "START").count(), 1);
}

#[test]
fn late_answers_never_end_a_block_early() {
    // Each answer comes after its request counts as lost, when the next one is awaited.
    let (_, time, marked, off) = run(Faults { late_ms: 90, ..Faults::default() });
    assert!(time >= MARKING, "{time:?}");
    assert!(marked.is_ok() || marked.as_ref().is_err_and(|e| e.message.contains("not certain")), "{marked:?}");
    drop(off);
}

#[test]
fn silence_and_error_answers_stop_the_run_and_say_what_is_certain() {
    let cases = [
        (Faults { silent_from: Some("FORCELOAD"), ..Faults::default() }, "lightburn-answer", "not answered", 0),
        (Faults { refuses: Some("FORCELOAD"), ..Faults::default() }, "lightburn-load", "B0007 is not marked", 0),
        (Faults { refuses: Some("START"), ..Faults::default() }, "lightburn-start", "B0007 is not marked", 1),
        (Faults { silent_from: Some("START"), ..Faults::default() }, "lightburn-answer", "the beam may be on", 0),
        (Faults { never_starts: true, ..Faults::default() }, "lightburn-unseen", "is marked is not certain", 1),
    ];
    let case = |(faults, code, words, starts): (Faults, &str, &str, usize)| {
        let (responder, _, marked, off) = run(faults);
        let e = marked.expect_err(code);
        assert!(e.code == code && e.message.contains(words) && !e.hint.is_empty(), "{faults:?}: {e}");
        assert_eq!(responder.received().iter().filter(|c| *c == "START").count(), starts);
        assert_eq!(off.is_err(), faults.silent_from.is_some(), "{faults:?}");
    };
    std::thread::scope(|scope| {
        cases.map(|fault| scope.spawn(move || case(fault))).map(|t| t.join().expect("as wanted"))
    });
}

#[test]
fn a_start_whose_answer_is_lost_is_seen_from_the_state() {
    let (responder, time, marked, _) = run(Faults { mute: Some("START"), ..Faults::default() });
    assert_eq!(marked, Ok(()));
    assert!(time >= MARKING, "{time:?}");
    assert_eq!(responder.received().iter().filter(|c| *c == "START").count(), 1);
}

#[test]
fn a_refusal_of_start_that_comes_late_is_not_taken_for_busy() {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let port = socket.local_addr().expect("bound").port();
    std::thread::spawn(move || {
        let mut buffer = [0; 512];
        let mut held = None;
        while let Ok((count, from)) = socket.recv_from(&mut buffer) {
            match &buffer[..count] {
                b"START" => held = Some("!"),
                b"STATUS" if held.is_some() => {
                    let _ = socket.send_to(held.take().unwrap_or_default().as_bytes(), from);
                }
                _ => drop(socket.send_to(b"OK", from)),
            }
        }
    });
    let (_log, received) = channel();
    let mut laser = Responder { port, received: Mutex::new(received) }.driver(None);
    laser.open(&Interrupt::default()).expect("it answers");
    let e = mark(&mut laser, &Interrupt::default()).expect_err("nothing was marked");
    assert_eq!(e.code, "lightburn-unseen", "{e}");
}

#[test]
fn a_late_answer_is_not_taken_for_that_of_a_load_that_fails() {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let port = socket.local_addr().expect("bound").port();
    let (log, received) = channel();
    std::thread::spawn(move || {
        let mut buffer = [0; 512];
        let mut number = 0;
        while let Ok((count, from)) = socket.recv_from(&mut buffer) {
            let command = String::from_utf8_lossy(&buffer[..count]).into_owned();
            number += 1;
            // The third request is the first STATUS of the block.
            let (answer, late_ms) = match command.split(':').next() {
                _ if number == 3 => ("OK", 100),
                Some("FORCELOAD") => ("!", 50),
                _ => ("OK", 0),
            };
            let _ = log.send(command);
            let socket = socket.try_clone().expect("a socket");
            std::thread::spawn(move || {
                std::thread::sleep(Duration::from_millis(late_ms));
                socket.send_to(answer.as_bytes(), from)
            });
        }
    });
    let responder = Responder { port, received: Mutex::new(received) };
    let mut laser = responder.driver(None);
    laser.open(&Interrupt::default()).expect("it answers");
    assert_eq!(mark(&mut laser, &Interrupt::default()).expect_err("not loaded").code, "lightburn-load");
    assert!(!responder.received().contains(&"START".to_owned()), "another file would be marked");
}

#[test]
fn block_that_does_not_end_times_out_and_an_abort_says_that_the_beam_may_be_on() {
    // Busy for as long as the test runs.
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let port = socket.local_addr().expect("bound").port();
    let (tell, started) = channel();
    std::thread::spawn(move || {
        let mut buffer = [0; 512];
        let mut is_busy = false;
        while let Ok((count, from)) = socket.recv_from(&mut buffer) {
            if &buffer[..count] == b"START" {
                is_busy = true;
                let _ = tell.send(());
            }
            let is_status = &buffer[..count] == b"STATUS";
            let _ = socket.send_to(if is_status && is_busy { b"!" } else { b"OK" }, from);
        }
    });
    let (_log, received) = channel();
    let mut laser = Responder { port, received: Mutex::new(received) }.driver(None);
    laser.open(&Interrupt::default()).expect("it answers");
    let interrupt = Interrupt::default();
    let asked = interrupt.clone();
    let e = std::thread::scope(|scope| {
        scope.spawn(move || {
            started.recv().expect("it is started");
            std::thread::sleep(Duration::from_millis(60));
            asked.request();
            asked.request();
        });
        mark(&mut laser, &interrupt).expect_err("aborted")
    });
    assert!(e.code == "lightburn-aborted" && e.message.contains("the beam may be on"), "{e}");
    let e = laser.off().expect_err("busy");
    assert!(e.code == "lightburn-off" && e.hint.contains("stop it in LightBurn"), "{e}");
    assert_eq!(mark(&mut laser, &Interrupt::default()).expect_err("busy").code, "lightburn-busy");
    assert_eq!(laser.is_free(&Interrupt::default()), Ok(false));
}

#[test]
fn answers_come_to_their_own_port_and_from_any_port_of_the_host() {
    let listener = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let free = UdpSocket::bind("127.0.0.1:0").and_then(|s| s.local_addr()).expect("a port").port();
    let port = listener.local_addr().expect("bound").port();
    std::thread::spawn(move || {
        let sender = UdpSocket::bind("127.0.0.1:0").expect("a port");
        let mut buffer = [0; 512];
        while listener.recv_from(&mut buffer).is_ok() {
            let _ = sender.send_to(b"OK", ("127.0.0.1", free));
        }
    });
    let mut laser = LightBurn::new(Some("127.0.0.1".into()), None, Some(port), Some(free));
    assert_eq!(laser.open(&Interrupt::default()), Ok(format!("LightBurn at 127.0.0.1:{port}, idle")));
    let second = LightBurn::new(Some("127.0.0.1".into()), None, Some(port), Some(free)).open(&Interrupt::default());
    assert_eq!(second.expect_err("the port is taken").code, "lightburn-port");
}

#[test]
fn lightburn_that_is_not_there_is_reported_at_once() {
    let responder = Responder::start(Faults { silent_from: Some("PING"), ..Faults::default() });
    assert_eq!(responder.driver(None).open(&Interrupt::default()).expect_err("silent").code, "lightburn-answer");
    let mut laser = LightBurn::new(Some("no host".into()), None, None, Some(0));
    assert_eq!(laser.open(&Interrupt::default()).expect_err("no such name").code, "lightburn-address");
    assert_eq!(laser.off(), Ok(()));
}

#[test]
fn files_are_named_as_the_other_computer_sees_them() {
    let path = |folder: &str| {
        LightBurn::new(None, Some(folder.into()), None, None).path_there(Path::new("out/a.job/blocks/B0001.lbrn2"))
    };
    assert_eq!(path("C:\\jobs\\a.job"), "C:\\jobs\\a.job\\blocks\\B0001.lbrn2");
    assert_eq!(path("C:/jobs/a.job/"), "C:/jobs/a.job\\blocks\\B0001.lbrn2");
    assert_eq!(path("/mnt/a.job/"), "/mnt/a.job/blocks/B0001.lbrn2");
    let here = LightBurn::new(None, None, None, None).path_there(Path::new("blocks/B0001.lbrn2"));
    assert!(Path::new(&here).is_absolute() && here.ends_with("B0001.lbrn2"), "{here}");
}

/// A LightBurn that answers each command as `answer` says, with what it is to send besides: texts, each so many ms
/// later, from its own port or another's.
fn scripted(answer: impl Fn(&str) -> (&'static str, Vec<(u64, &'static str, bool)>) + Send + 'static) -> Responder {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let other = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let port = socket.local_addr().expect("bound").port();
    let (log, received) = channel();
    std::thread::spawn(move || {
        let mut buffer = [0; 512];
        while let Ok((count, from)) = socket.recv_from(&mut buffer) {
            let command = String::from_utf8_lossy(&buffer[..count]).into_owned();
            let (text, more) = answer(command.split(':').next().unwrap_or_default());
            let _ = log.send(command);
            let _ = socket.send_to(text.as_bytes(), from);
            for (ms, text, is_other) in more {
                let socket = if is_other { &other } else { &socket }.try_clone().expect("a socket");
                std::thread::spawn(move || {
                    std::thread::sleep(Duration::from_millis(ms));
                    socket.send_to(text.as_bytes(), from)
                });
            }
        }
    });
    Responder { port, received: Mutex::new(received) }
}

/// One that marks from so many ms after START, for so long, with what it sends besides.
fn marks_after(ms: u64, marking: Duration, more: Vec<(u64, &'static str, bool)>) -> Responder {
    let begun = Mutex::new(None::<Instant>);
    scripted(move |command| {
        let mut begun = begun.lock().expect("one thread");
        let delay = Duration::from_millis(ms);
        let is_busy = begun.is_some_and(|at| (delay..delay + marking).contains(&at.elapsed()));
        match command {
            "START" => {
                *begun = Some(Instant::now());
                ("OK", more.clone())
            }
            "STATUS" if is_busy => ("!", vec![]),
            _ => ("OK", vec![]),
        }
    })
}

#[test]
fn up_to_three_surplus_answers_never_end_a_block() {
    std::thread::scope(|scope| {
        for count in 0..=SURPLUS {
            for (spacing, is_other) in [(1, false), (30, false), (30, true), (45, true)] {
                scope.spawn(move || {
                    let more = (0..count as u64).map(|i| (20 + spacing * i, "OK", is_other)).collect();
                    let mut laser = marks_after(0, MARKING, more).driver(None);
                    laser.open(&Interrupt::default()).expect("it answers");
                    let begin = Instant::now();
                    let marked = mark(&mut laser, &Interrupt::default());
                    // It was marked for all of its time, or nobody claims that it is.
                    assert!(marked.is_err() || begin.elapsed() >= MARKING, "{count} {spacing}: {marked:?}");
                    assert!(marked.is_ok() || count > 0, "{marked:?}");
                });
            }
        }
    });
}

#[test]
fn up_to_three_busy_answers_of_others_are_no_beginning_of_a_block() {
    // It begins 400 ms after START: what comes before is not it.
    let mut laser = marks_after(400, MARKING, (0..3).map(|i| (10 + 20 * i, "!", true)).collect()).driver(None);
    laser.open(&Interrupt::default()).expect("it answers");
    laser.timeouts.begin = Duration::from_secs(2);
    let begin = Instant::now();
    assert_eq!(mark(&mut laser, &Interrupt::default()), Ok(()));
    assert!(begin.elapsed() >= Duration::from_millis(400) + MARKING, "{:?}", begin.elapsed());
}

#[test]
fn surplus_answers_never_stand_for_a_load() {
    // The load fails, 40 ms after it was asked for; before that others say that it is done.
    for count in 1..=SURPLUS as u64 {
        let responder = scripted(move |command| match command {
            "FORCELOAD" => {
                std::thread::sleep(Duration::from_millis(40));
                ("!", vec![])
            }
            _ => ("OK", vec![]),
        });
        let mut laser = responder.driver(None);
        laser.open(&Interrupt::default()).expect("it answers");
        let port = laser.link.as_ref().expect("open").socket.local_addr().expect("bound").port();
        let done = std::sync::atomic::AtomicBool::new(false);
        let loaded = std::thread::scope(|scope| {
            scope.spawn(|| {
                // Whenever they come.
                let other = UdpSocket::bind("127.0.0.1:0").expect("a port");
                while !done.load(std::sync::atomic::Ordering::SeqCst) {
                    for _ in 0..count {
                        let _ = other.send_to(b"OK", ("127.0.0.1", port));
                        std::thread::sleep(Duration::from_millis(3));
                    }
                    std::thread::sleep(Duration::from_millis(300));
                }
            });
            let loaded = laser.load(&work(Duration::ZERO), &Interrupt::default());
            done.store(true, std::sync::atomic::Ordering::SeqCst);
            loaded
        });
        assert_eq!(loaded.expect_err("it was not loaded").code, "lightburn-load");
    }
}

#[test]
fn lightburn_that_somebody_else_starts_is_not_free() {
    let responder = marks_after(0, Duration::from_secs(3), vec![]);
    let mut laser = responder.driver(None);
    laser.open(&Interrupt::default()).expect("it answers");
    assert_eq!(laser.is_free(&Interrupt::default()), Ok(true));
    // Somebody else starts it.
    let other = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let _ = other.send_to(b"START", ("127.0.0.1", responder.port));
    std::thread::sleep(Duration::from_millis(10));
    assert_eq!(laser.is_free(&Interrupt::default()), Ok(false));
}

#[test]
fn answers_without_end_are_reported() {
    let number = std::sync::atomic::AtomicUsize::new(0);
    let mut laser = scripted(move |command| match command {
        "STATUS" if number.fetch_add(1, std::sync::atomic::Ordering::SeqCst).is_multiple_of(2) => ("!", vec![]),
        _ => ("OK", vec![]),
    })
    .driver(None);
    laser.timeouts.agree = Duration::from_millis(300);
    let e = laser.open(&Interrupt::default()).expect_err("they contradict each other");
    assert!(e.code == "lightburn-answer" && e.message.contains("contradict"), "{e}");
}

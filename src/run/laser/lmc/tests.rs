//! The driver against a stand-in for the card, and against the words of galvoplotter's controller.

use std::path::Path;
use std::process::Command;
use std::sync::{Arc, Mutex};
use terrace_core::math;

use super::*;
use crate::run::laser::tests::UntouchedStage;

/// A card that executes a list for some requests.
#[derive(Debug, Default)]
struct Card {
    /// All that was written.
    written: Vec<Vec<u8>>,
    /// Requests for which it is still busy.
    busy: usize,
    /// Requests for which a list keeps it busy.
    length: usize,
    /// Requests for which it is not ready after each packet.
    full: usize,
    not_ready: usize,
    /// Writes after which the connection fails.
    fails_after: Option<usize>,
    /// The card keeps marking when it is sent the command to stop.
    is_deaf: bool,
    packets: usize,
}

/// The transport to a card that the test can look at.
struct Pipe(Arc<Mutex<Card>>);

impl Transport for Pipe {
    fn write(&mut self, packet: &[u8]) -> std::io::Result<()> {
        let mut card = self.0.lock().expect("one test");
        if card.fails_after.is_some_and(|n| card.written.len() >= n) {
            return Err(std::io::ErrorKind::BrokenPipe.into());
        }
        card.written.push(packet.to_vec());
        if packet.len() == list::PACKET {
            assert_eq!(card.not_ready, 0, "it was not ready");
            card.packets += 1;
            card.not_ready = card.full;
        }
        match u16::from_le_bytes([packet[0], packet[1]]) {
            EXECUTE_LIST => card.busy = card.length,
            STOP_EXECUTE if !card.is_deaf => (card.busy, card.length) = (0, 0),
            _ => {}
        }
        Ok(())
    }

    fn read(&mut self) -> std::io::Result<[u8; 8]> {
        let mut card = self.0.lock().expect("one test");
        let status = if card.busy > 0 { BUSY } else { 0 } | if card.not_ready > 0 { 0 } else { READY };
        if card.written.last().is_some_and(|packet| packet[0] == GET_VERSION as u8) {
            card.busy = card.busy.saturating_sub(1);
            card.not_ready = card.not_ready.saturating_sub(1);
        }
        let [low, high] = status.to_le_bytes();
        Ok([0x34, 0x12, 0, 0, 0, 0, low, high])
    }
}

fn driver(card: Card, laser: LmcLaser) -> (Lmc, Arc<Mutex<Card>>) {
    let card = Arc::new(Mutex::new(card));
    let mut lmc = Lmc::new(None, None, laser);
    lmc.transport = Some(Box::new(Pipe(card.clone())));
    let ms = Duration::from_millis;
    lmc.timeouts = Timeouts { begin: ms(50), stop: ms(100), settle: ms(0) };
    (lmc, card)
}

/// The list of a block with so many strokes of two points, as terrace writes it.
fn list(strokes: u16) -> Vec<u8> {
    let mut words: Vec<[u16; 6]> = vec![
        [0x8051, 0, 0, 0, 0, 0],
        [0x8004, 800, 0, 0, 0, 0],
        [0x8011, 1, 0, 0, 0, 0],
        [0x8006, 2500, 0, 0, 0, 0],
        [0x8012, 2457, 0, 0, 0, 0],
        [0x801B, 333, 0, 0, 0, 0],
        [0x800C, 500, 0, 0, 0, 0],
        [0x8007, 50, 0, 0, 0, 0],
        [0x8008, 80, 0, 0, 0, 0],
        [0x800F, 30, 0, 0, 0, 0],
        [0x800D, 200, 0, 0, 0, 0],
    ];
    let mut at = [0x8000_u16; 2];
    let mut go = |command: u16, to: [u16; 2]| {
        let way = math::hypot(f64::from(to[0]) - f64::from(at[0]), f64::from(to[1]) - f64::from(at[1])) as u16;
        at = to;
        words.push([command, to[0], to[1], 0, way, 0]);
    };
    for stroke in 0..strokes {
        go(0x8001, [0x7000, 0x7000 + 10 * stroke]);
        go(0x8005, [0x9000, 0x7000 + 10 * stroke]);
    }
    words.push([0x8004, 10, 0, 0, 0, 0]);
    let mut bytes: Vec<u8> = words.iter().flatten().flat_map(|word| word.to_le_bytes()).collect();
    let end = [0x02, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    bytes.extend_from_slice(&end);
    while !bytes.len().is_multiple_of(list::PACKET) {
        bytes.extend_from_slice(&end);
    }
    bytes
}

struct File {
    work: Work,
    _folder: tempfile::TempDir,
}

fn file(bytes: &[u8]) -> File {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("B0007.lmc");
    std::fs::write(&path, bytes).expect("written");
    let work = Work { block: "B0007".into(), file: Some(path), focus_shift: 0, estimate: Duration::ZERO };
    File { work, _folder: folder }
}

fn mark(lmc: &mut Lmc, work: &Work, beam: Beam) -> Result<(), Diag> {
    lmc.mark(work, beam, &mut UntouchedStage, &Interrupt::default())
}

/// What was written, in hex, without the requests for the status.
fn written(card: &Mutex<Card>) -> Vec<String> {
    let mut card = card.lock().expect("one test");
    let is_poll = |packet: &Vec<u8>| packet.starts_with(&GET_VERSION.to_le_bytes());
    let hex = |packet: Vec<u8>| packet.iter().map(|byte| format!("{byte:02x}")).collect();
    std::mem::take(&mut card.written).into_iter().filter(|packet| !is_poll(packet)).map(hex).collect()
}

/// What galvoplotter's controller writes for some orders.
fn of_galvoplotter(laser: &str, orders: &[String]) -> Vec<Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = root.join(".venv/bin/python");
    assert!(python.exists(), "galvoplotter is not installed: run tests/python/setup.sh");
    let out = Command::new(python).arg(root.join("tests/python/lmc_words.py")).arg(laser).args(orders).output();
    let out = out.expect("python starts");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).expect("hex");
    let packets = |order: &str| order.lines().map(Into::into).collect();
    text.split_terminator("\n\n").map(packets).collect()
}

#[test]
fn words_are_those_of_galvoplotter_for_opening_marking_pilot_and_abort() {
    for (laser, source) in [(LmcLaser::Fiber, "fiber"), (LmcLaser::Co2, "co2")] {
        let (mut lmc, card) = driver(Card { length: 4, ..Card::default() }, laser);
        // One packet; and four, of which the last begins after the start.
        let blocks = [3, 450].map(|strokes| file(&list(strokes)));
        let mut orders = vec!["open".to_owned()];
        let mut sent = Vec::new();
        lmc.open(&Interrupt::default()).expect("open");
        sent.push(written(&card));
        for block in &blocks {
            for (order, beam) in [("mark", Beam::Fire), ("light", Beam::Pilot)] {
                orders.push(format!("{order}={}", block.work.file.as_ref().expect("a file").display()));
                assert_eq!(mark(&mut lmc, &block.work, beam), Ok(()));
                sent.push(written(&card));
            }
        }
        orders.push("abort".into());
        lmc.abort().expect("stopped");
        sent.push(written(&card));
        let wanted = of_galvoplotter(source, &orders);
        assert_eq!(wanted.len(), orders.len());
        for ((order, sent), wanted) in orders.iter().zip(&sent).zip(&wanted) {
            assert!(sent == wanted && sent.len() > 5, "{source} {order}: {} and {} packets", sent.len(), wanted.len());
        }
    }
}

#[test]
fn field_correction_is_sent_as_galvoplotter_sends_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let value = |i: usize| (i as f64 - 4000.0) * 0.75;
    let mut bytes: Vec<u8> = "LMC1COR_1.0".encode_utf16().flat_map(u16::to_le_bytes).collect();
    bytes.extend([0; 506]);
    bytes.extend((0..2 * 65 * 65).flat_map(|i| value(i).to_le_bytes()));
    let mut whole: Vec<u8> = "JCZ_COR_2_1".encode_utf16().flat_map(u16::to_le_bytes).collect();
    whole.extend([0; 14]);
    whole.extend((0..2 * 65 * 65).flat_map(|i| (value(i) as i32).to_le_bytes()));
    let opened = |content: &[u8], name: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("written");
        let (mut lmc, card) = driver(Card::default(), LmcLaser::Fiber);
        lmc.correction = Some(path.clone());
        (format!("open={}", path.display()), lmc.open(&Interrupt::default()), written(&card))
    };
    let [double, integer] = [(&bytes, "a.cor"), (&whole, "b.cor")].map(|(content, name)| opened(content, name));
    let wanted = of_galvoplotter("fiber", &[double.0, integer.0]);
    assert!(wanted[0].len() > 65 * 65 && wanted == [double.2, integer.2]);
    for damaged in [&bytes[..bytes.len() - 1], &whole[..30], b""] {
        let (_, said, sent) = opened(damaged, "damaged.cor");
        assert_eq!(said.expect_err("damaged").code, "lmc-correction");
        assert_eq!(sent.len(), 1, "nothing but the request for its number");
    }
}

#[test]
fn packets_wait_until_the_card_is_ready() {
    // The stand-in refuses a packet before that.
    let (mut lmc, card) = driver(Card { length: 30, full: 5, ..Card::default() }, LmcLaser::Fiber);
    lmc.open(&Interrupt::default()).expect("open");
    assert_eq!(mark(&mut lmc, &file(&list(450)).work, Beam::Fire), Ok(()));
    let card = card.lock().expect("one test");
    assert_eq!((card.packets, card.busy), (4, 0));
}

#[test]
fn card_that_was_never_busy_has_not_marked() {
    let (mut lmc, card) = driver(Card { length: 0, ..Card::default() }, LmcLaser::Fiber);
    lmc.open(&Interrupt::default()).expect("open");
    let e = mark(&mut lmc, &file(&list(3)).work, Beam::Fire).expect_err("never busy");
    assert!(e.code == "lmc-unseen" && e.message.contains("is not certain") && !e.hint.is_empty(), "{e}");
    let last = written(&card).pop().unwrap_or_default();
    assert!(last.starts_with("21000000"), "the output is off at the end: {last}");
}

#[test]
fn a_list_that_does_not_end_and_an_abort_stop_the_card() {
    let interrupt = Interrupt::default();
    for (is_deaf, certain) in [(false, "the card was stopped and its laser is off"), (true, "could not be stopped")] {
        let (mut lmc, card) = driver(Card { length: usize::MAX, is_deaf, ..Card::default() }, LmcLaser::Fiber);
        lmc.open(&Interrupt::default()).expect("open");
        let block = list(3);
        let commands = List::read(&block, Path::new("B0007.lmc")).expect("a list");
        let e = lmc.run(&commands, Beam::Fire, Duration::from_millis(40), &interrupt).expect_err("too long");
        assert_eq!(e.code, "lmc-time");
        let e = lmc.stopped(e, "B0007");
        assert!(e.message.contains(certain) && e.message.contains("B0007 is marked, in part"), "{e}");
        assert!(
            written(&card).iter().any(|packet| packet.starts_with("1f00")),
            "the card was sent the command to stop"
        );
        assert_eq!(lmc.off().is_err(), is_deaf);
    }
    let (mut lmc, card) = driver(Card { length: usize::MAX, ..Card::default() }, LmcLaser::Fiber);
    lmc.open(&Interrupt::default()).expect("open");
    let e = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(30));
            interrupt.request();
            interrupt.request();
        });
        lmc.mark(&file(&list(3)).work, Beam::Fire, &mut UntouchedStage, &interrupt).expect_err("aborted")
    });
    assert!(e.code == "lmc-aborted" && e.message.contains("the card was stopped and its laser is off"), "{e}");
    assert!(card.lock().expect("one test").busy == 0);
}

#[test]
fn a_broken_connection_says_what_is_certain_at_every_write() {
    let block = file(&list(450));
    let (mut lmc, card) = driver(Card { length: 4, ..Card::default() }, LmcLaser::Fiber);
    lmc.open(&Interrupt::default()).expect("open");
    let opened = card.lock().expect("one test").written.len();
    mark(&mut lmc, &block.work, Beam::Fire).expect("marked");
    let all = card.lock().expect("one test").written.len();
    let mut seen = [0, 0];
    for n in opened..all {
        let (mut lmc, card) = driver(Card { length: 4, fails_after: Some(n), ..Card::default() }, LmcLaser::Fiber);
        lmc.open(&Interrupt::default()).expect("open");
        let e = mark(&mut lmc, &block.work, Beam::Fire).expect_err("broken");
        assert!(e.code == "lmc-link" && e.message.contains("the beam may be on"), "{n}: {e}");
        let was_started = card.lock().expect("one test").written.iter().any(|p| p[..2] == EXECUTE_LIST.to_le_bytes());
        let is_open = e.message.contains("is marked, in part or not at all, is not certain");
        // The start itself may or may not have come through.
        assert!(is_open || !was_started && e.message.ends_with("block B0007 is not marked"), "{n}: {e}");
        seen[usize::from(is_open)] += 1;
        assert_eq!(lmc.off().expect_err("broken").code, "lmc-off");
    }
    assert!(seen[0] > 5 && seen[1] > 5, "{seen:?}");
}

#[test]
fn lists_that_terrace_does_not_write_are_refused_before_anything_is_sent() {
    let (mut lmc, card) = driver(Card { length: 4, ..Card::default() }, LmcLaser::Fiber);
    lmc.open(&Interrupt::default()).expect("open");
    written(&card);
    let whole = list(3);
    let changed = |at: usize, word: u16| {
        let mut bytes = whole.clone();
        bytes[at..at + 2].copy_from_slice(&word.to_le_bytes());
        bytes
    };
    let damaged = [
        vec![],
        whole[..3071].to_vec(),
        changed(0, 0x8001),
        changed(26, 3),
        changed(12, 0x8003),
        changed(3060, 0x8001),
    ];
    for bytes in damaged {
        assert_eq!(mark(&mut lmc, &file(&bytes).work, Beam::Fire).expect_err("damaged").code, "lmc-list");
    }
    assert!(written(&card).is_empty());
}

#[test]
fn pilot_list_holds_nothing_of_the_laser_and_waits_as_long_as_it_takes() {
    let (list, longest) = List::read(&list(450), Path::new("B0007.lmc")).expect("a list").pilot();
    let words: Vec<u16> = list
        .packets()
        .flatten()
        .copied()
        .collect::<Vec<u8>>()
        .chunks(12)
        .map(|c| u16::from_le_bytes([c[0], c[1]]))
        .collect();
    assert!(words.iter().all(|w| [0x8051, 0x8011, 0x8006, 0x800D, 0x8001, 0x8002].contains(w)));
    assert_eq!(words.iter().filter(|w| **w == 0x8001).count(), 900);
    // 900 ways of 8192 units at 500 units per ms, and the delays.
    assert!(longest > Duration::from_secs(10 + 2 * 14) && longest < Duration::from_secs(200), "{longest:?}");
}

#[test]
fn busy_card_is_not_taken_over_and_no_card_is_reported() {
    let (mut lmc, card) = driver(Card { busy: 100, ..Card::default() }, LmcLaser::Fiber);
    assert_eq!(lmc.open(&Interrupt::default()).expect_err("busy").code, "lmc-busy");
    assert!(written(&card).len() == 1, "nothing but the request for its number");
    let mut lmc = Lmc::new(Some("no such card".into()), None, LmcLaser::Fiber);
    assert_eq!(lmc.open(&Interrupt::default()).expect_err("no card").code, "lmc-usb");
    assert_eq!(lmc.off(), Ok(()));
}

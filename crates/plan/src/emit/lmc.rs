//! One list of commands per block for BJJCZ (LMC) cards, as they take it over USB.
//!
//! Packets of 3072 bytes, each 256 commands of six 16-bit words, little endian: the command and five values. Points are
//! card units: 0x8000 is the optical axis, `lmc.units_per_mm` of the machine file the scale, controller coordinates the
//! axes. A stroke is a JumpTo to its first point and a MarkTo to every other, a dot a JumpTo and a LaserOnPoint with its
//! dwell in 10 us; either is repeated as often as its pen has passes. Settings are sent where they change. The last packet is filled up with EndOfList.
//!
//! The card is documented by its users alone: commands and units are those of the free controllers galvoplotter and
//! balor. Opening the laser, sending packets and waiting is left to whoever sends them.

use super::cards;
use super::known::{JobPens, Key, KnownFault};
use crate::check::Checked;
use terrace_core::diag::Diag;
use terrace_core::geom::{ControllerPoint, FieldPoint, NM_PER_MM};
use terrace_core::machine::{Lmc, LmcLaser, Machine};
use terrace_core::program::{Pen, Program};
use terrace_core::units::Time;

const JUMP_TO: u16 = 0x8001;
const END_OF_LIST: u16 = 0x8002;
const LASER_ON_POINT: u16 = 0x8003;
const DELAY_TIME: u16 = 0x8004;
const MARK_TO: u16 = 0x8005;
const JUMP_SPEED: u16 = 0x8006;
const LASER_ON_DELAY: u16 = 0x8007;
const LASER_OFF_DELAY: u16 = 0x8008;
const MARK_FREQUENCY: u16 = 0x800A;
const MARK_POWER_RATIO: u16 = 0x800B;
const MARK_SPEED: u16 = 0x800C;
const JUMP_DELAY: u16 = 0x800D;
const POLYGON_DELAY: u16 = 0x800F;
const WRITE_PORT: u16 = 0x8011;
const MARK_CURRENT: u16 = 0x8012;
const Q_SWITCH_PERIOD: u16 = 0x801B;
const READY_MARK: u16 = 0x8051;

/// Bytes of a packet.
const PACKET: usize = 3072;

/// Units of the optical axis.
const CENTRE: i64 = 0x8000;

/// Time until a fibre laser is ready, in units of 10 us.
const OPEN: u16 = 800;

/// Speeds of the card may be off by this share after rounding.
const SPEED_ERROR: f64 = 0.05;

/// The list of block `index`.
///
/// # Panics
/// If there is no such block, or the machine has no LMC card, as the table of targets makes sure.
pub fn block(checked: &Checked, machine: &Machine, index: usize) -> Vec<u8> {
    let program = checked.program();
    let strokes = program.strokes_of(&program.blocks[index]);
    let lmc = machine.lmc.expect("a job for a card has one");
    let marks =
        strokes.iter().map(|s| (s.len as usize + 2) * program.pens[s.pen.index()].passes as usize).sum::<usize>();
    let mut list = List { out: Vec::with_capacity((marks + 32) * 12 + PACKET), at: [CENTRE; 2], set: Vec::new() };
    list.command(READY_MARK, [0; 2]);
    if lmc.laser == LmcLaser::Fiber {
        list.command(DELAY_TIME, [OPEN, 0]);
    }
    // Output 0 is the laser's enable.
    list.command(WRITE_PORT, [1, 0]);
    let mark_wait = tens_of_us(machine.delays.mark);
    let mut set = None;
    for stroke in strokes {
        let pen = &program.pens[stroke.pen.index()];
        if set.replace(stroke.pen) != Some(stroke.pen) {
            settings(&lmc, machine, pen).into_iter().for_each(|(command, values)| list.set(command, values));
        }
        for _ in 0..pen.passes {
            let mut points = program.points_of(stroke).iter().map(|&p| units(&lmc, machine, p));
            let first = points.next().expect("a stroke has points");
            list.go(JUMP_TO, first);
            if stroke.is_dot() {
                let dwell = pen.dwell.and_then(cards::dwell).expect("the faults of the card were looked for");
                list.command(LASER_ON_POINT, [dwell, 0]);
            }
            for point in points {
                if point != list.at {
                    list.go(MARK_TO, point);
                }
            }
            if mark_wait > 0 {
                list.command(DELAY_TIME, [mark_wait, 0]);
            }
        }
    }
    list.command(END_OF_LIST, [0; 2]);
    while !list.out.len().is_multiple_of(PACKET) {
        list.command(END_OF_LIST, [0; 2]);
    }
    list.out
}

/// What of pens and machine the card cannot take.
pub(super) fn known_faults(job: &JobPens<'_>) -> Vec<KnownFault> {
    let machine = job.machine;
    let Some(lmc) = machine.lmc else {
        let text = "emit.formats has \"lmc\", but the machine file has no [lmc]";
        let hint = "state lmc.units_per_mm of the card, such as 500, and lmc.laser";
        return vec![(Key::Format, Diag::input("emit-lmc", text).hint(hint))];
    };
    let mut faults = Vec::new();
    for (i, pen) in job.pens.iter().enumerate() {
        faults.extend(pen_fault(&lmc, pen).map(|(key, fault)| (Key::Pen(i, key), fault)));
    }
    if let Some((i, text)) = cards::dwell_fault(job.pens) {
        faults.push((Key::Pen(i, "dwell"), Diag::limit("lmc-dwell", text).hint(cards::DWELL_HINT)));
    }
    if speed(&lmc, machine.scanner.jump_speed.as_mm_s()).is_none() {
        let text = format!("the card cannot jump at {}", machine.scanner.jump_speed);
        let fault = Diag::limit("lmc-speed", text).hint("change scanner.jump_speed");
        faults.push((Key::Machine("scanner.jump_speed"), fault));
    }
    let delays = &machine.delays;
    for (key, delay) in [
        ("delays.laser_on", delays.laser_on),
        ("delays.laser_off", delays.laser_off),
        ("delays.jump", delays.jump),
        ("delays.polygon", delays.polygon),
    ] {
        if delay.as_us().abs().round() > f64::from(u16::MAX) {
            let text = format!("{key} of {delay} is more than the 65535 us that the card counts");
            faults.push((Key::Machine(key), Diag::limit("lmc-delay", text)));
        }
    }
    faults
}

/// What of a program the card would clip or lose.
pub(super) fn faults(program: &Program, machine: &Machine) -> Vec<Diag> {
    let Some(lmc) = machine.lmc else { return Vec::new() };
    let mut faults = Vec::new();
    let beyond = |p: &&FieldPoint| units(&lmc, machine, **p).iter().any(|u| !(0..=0xFFFF).contains(u));
    if let Some(p) = program.points.iter().find(beyond) {
        let [x, y] = units(&lmc, machine, *p);
        let text = format!("a mark lies at ({x}, {y}) units of the card, which has 0 to 65535");
        let hint = "check lmc.units_per_mm; a smaller partition.section keeps marks near the centre";
        faults.push(Diag::limit("lmc-field", text).hint(hint));
    }
    if let Some((blocks, place)) = cards::lost(program, |p| units(&lmc, machine, p)) {
        let um = 1000.0 / lmc.units_per_mm;
        let text = format!("marks in {blocks} blocks are shorter than a unit of the card, {um} um, and would be lost");
        faults.push(Diag::limit("lmc-short", text).at(place).hint(cards::min_mark(um)));
    }
    faults
}

/// What of a pen the card cannot take, and the pen's key that says so.
fn pen_fault(lmc: &Lmc, pen: &Pen) -> Option<(&'static str, Diag)> {
    if speed(lmc, pen.speed.as_mm_s()).is_none() {
        let text = format!(
            "pen {:?} marks at {}: the card counts whole units of {} mm/s up to 65535, which miss that by more than 5 %",
            pen.name,
            pen.speed,
            1000.0 / lmc.units_per_mm
        );
        return Some(("speed", Diag::limit("lmc-speed", text).hint("choose a multiple of that")));
    }
    let period = period(lmc, pen);
    (!(1.0..=65535.0).contains(&period)).then(|| {
        let text = format!(
            "pen {:?} has {}: the card counts a period of {period} units, 1 to 65535 are possible",
            pen.name, pen.frequency
        );
        ("frequency", Diag::limit("lmc-frequency", text))
    })
}

/// A speed in units per ms; None where the card cannot keep it.
fn speed(lmc: &Lmc, mm_s: f64) -> Option<u16> {
    let exact = mm_s * lmc.units_per_mm / 1000.0;
    let whole = exact.round();
    let is_kept = (1.0..=65535.0).contains(&whole) && (whole - exact).abs() <= SPEED_ERROR * exact;
    is_kept.then_some(whole as u16)
}

/// The period of a pen's pulses: in 50 ns for a fibre laser, in 100 ns for a CO2 laser.
fn period(lmc: &Lmc, pen: &Pen) -> f64 {
    let base = if lmc.laser == LmcLaser::Fiber { 20_000.0 } else { 10_000.0 };
    (base / pen.frequency.as_khz()).round()
}

fn tens_of_us(time: Time) -> u16 {
    (time.as_us() / 10.0).ceil().clamp(0.0, 65535.0) as u16
}

/// A point of the field in units of the card.
fn units(lmc: &Lmc, machine: &Machine, point: FieldPoint) -> [i64; 2] {
    let ControllerPoint { x, y } = machine.scanner.controller_from_field(point);
    [x, y].map(|nm| CENTRE + cards::rounded(f64::from(nm) * lmc.units_per_mm / NM_PER_MM))
}

/// All settings that a pen is marked with.
fn settings(lmc: &Lmc, machine: &Machine, pen: &Pen) -> Vec<(u16, [u16; 2])> {
    let speed = |mm_s: f64| [speed(lmc, mm_s).unwrap_or(u16::MAX), 0];
    let delay = |time: Time| {
        let us = time.as_us().round();
        [us.abs() as u16, if us < 0.0 { 0x8000 } else { 0 }]
    };
    let percent = 100.0 * pen.power.share(machine.laser.max_power);
    let khz = pen.frequency.as_khz();
    let period = [period(lmc, pen) as u16, 0];
    let delays = &machine.delays;
    let [first, second] = match lmc.laser {
        LmcLaser::Fiber => [(MARK_CURRENT, [(percent * 4095.0 / 100.0).round() as u16, 0]), (Q_SWITCH_PERIOD, period)],
        LmcLaser::Co2 => [(MARK_FREQUENCY, period), (MARK_POWER_RATIO, [(200.0 * percent / khz).round() as u16, 0])],
    };
    vec![
        (JUMP_SPEED, speed(machine.scanner.jump_speed.as_mm_s())),
        first,
        second,
        (MARK_SPEED, speed(pen.speed.as_mm_s())),
        (LASER_ON_DELAY, delay(delays.laser_on)),
        (LASER_OFF_DELAY, delay(delays.laser_off)),
        (POLYGON_DELAY, delay(delays.polygon)),
        (JUMP_DELAY, delay(delays.jump)),
    ]
}

/// A list as it grows.
struct List {
    out: Vec<u8>,
    /// Where the beam is, in units.
    at: [i64; 2],
    /// Settings that were sent.
    set: Vec<(u16, [u16; 2])>,
}

impl List {
    fn command(&mut self, command: u16, [a, b]: [u16; 2]) {
        self.words([command, a, b, 0, 0, 0]);
    }

    fn words(&mut self, words: [u16; 6]) {
        let mut bytes = [0; 12];
        bytes.as_chunks_mut().0.iter_mut().zip(words).for_each(|(pair, word)| *pair = word.to_le_bytes());
        self.out.extend_from_slice(&bytes);
    }

    /// Sends a setting unless the card has it.
    fn set(&mut self, command: u16, values: [u16; 2]) {
        match self.set.iter_mut().find(|s| s.0 == command) {
            Some(known) if known.1 == values => return,
            Some(known) => known.1 = values,
            None => self.set.push((command, values)),
        }
        self.command(command, values);
    }

    /// Goes to a point with the beam on or off; the last value is the way, whole units.
    fn go(&mut self, command: u16, to: [i64; 2]) {
        // Squares of card units are exact, and so is their sum.
        let [dx, dy] = [0, 1].map(|k| (to[k] - self.at[k]) as f64);
        let way = (dx * dx + dy * dy).sqrt().min(65535.0) as u16;
        let [x, y] = to.map(|unit| unit.clamp(0, 0xFFFF) as u16);
        self.words([command, x, y, 0, way, 0]);
        self.at = to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emit;
    use terrace_core::format::Format;
    use terrace_core::program::sample;
    use terrace_core::units::{Frequency, Speed};

    fn sample() -> (Checked, Machine) {
        let (program, origin) = sample::program();
        let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
        machine.lmc = Some(Lmc { units_per_mm: 500.0, laser: LmcLaser::Fiber });
        (Checked::unchecked(program, origin), machine)
    }

    fn commands(bytes: &[u8]) -> Vec<[u16; 6]> {
        assert!(bytes.len().is_multiple_of(PACKET));
        let words: Vec<u16> = bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        words.as_chunks().0.to_vec()
    }

    #[test]
    fn list_holds_settings_and_strokes_of_the_block() {
        let (checked, machine) = sample();
        let list = commands(&block(&checked, &machine, 0));
        let wanted: [[u16; 6]; 17] = [
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
            [0x8001, 0x8000 - 2500, 0x8000, 0, 2500, 0],
            [0x8005, 0x8000 + 2500, 0x8000, 0, 5000, 0],
            [0x8004, 10, 0, 0, 0, 0],
            [0x8001, 0x8000 - 2500, 0x8000 - 250, 0, 5006, 0],
            [0x8005, 0x8000 + 2500, 0x8000 - 250, 0, 5000, 0],
            [0x8004, 10, 0, 0, 0, 0],
        ];
        assert_eq!(list[..17], wanted);
        assert!(list.len() == 256 && list[17..].iter().all(|c| *c == [0x8002, 0, 0, 0, 0, 0]));
    }

    #[test]
    fn dot_is_a_jump_and_a_dwell_for_every_pass() {
        let (checked, machine) = sample();
        let mut program = checked.program().clone();
        (program.pens[0].dwell, program.pens[0].passes) = (Some(Time::us(120.0)), 2);
        program.points.truncate(1);
        program.strokes.truncate(1);
        program.strokes[0].len = 1;
        program.blocks.truncate(1);
        program.blocks[0].strokes = 0..1;
        let list = commands(&block(&Checked::unchecked(program, checked.origin()), &machine, 0));
        let [jump, again] = [2500, 0].map(|way| [0x8001, 0x8000 - 2500, 0x8000, 0, way, 0]);
        let (dwell, wait) = ([0x8003, 12, 0, 0, 0, 0], [0x8004, 10, 0, 0, 0, 0]);
        assert_eq!(list[11..18], [jump, dwell, wait, again, dwell, wait, [0x8002, 0, 0, 0, 0, 0]]);
    }

    #[test]
    fn settings_are_sent_where_they_change_and_passes_repeat_the_stroke() {
        let (checked, machine) = sample();
        let list = commands(&block(&checked, &machine, 2));
        let count = |command: u16| list.iter().filter(|c| c[0] == command).count();
        // Three passes of the square with one pen, a hatch with the other.
        assert_eq!((count(JUMP_TO), count(MARK_TO)), (4, 3 * 4 + 1));
        assert_eq!((count(MARK_SPEED), count(MARK_CURRENT), count(JUMP_SPEED), count(JUMP_DELAY)), (2, 2, 1, 1));
    }

    #[test]
    fn what_the_card_would_clip_or_lose_is_refused() {
        let code = |change: &dyn Fn(&mut Program, &mut Machine)| {
            let (checked, mut machine) = sample();
            let mut program = checked.program().clone();
            change(&mut program, &mut machine);
            emit::faults(&[Format::Lmc], &program, &machine).err().map(|e| e.diags()[0].code)
        };
        assert_eq!(code(&|_, _| {}), None);
        assert_eq!(code(&|_, m| m.lmc = None), Some("emit-lmc"));
        let coarse = |m: &mut Machine| m.lmc = Some(Lmc { units_per_mm: 2000.0, laser: LmcLaser::Fiber });
        assert_eq!(code(&|_, m| coarse(m)), Some("lmc-field"));
        assert_eq!(code(&|p, _| p.points[1].x = p.points[0].x + 900), Some("lmc-short"));
        assert_eq!(code(&|p, _| p.pens[0].speed = Speed::mm_s(1.0)), Some("lmc-speed"));
        assert_eq!(code(&|p, _| p.pens[0].speed = Speed::mm_s(140_000.0)), Some("lmc-speed"));
        assert_eq!(code(&|p, _| p.pens[1].frequency = Frequency::khz(0.1)), Some("lmc-frequency"));
        assert_eq!(code(&|_, m| m.delays.jump = Time::s(0.1)), Some("lmc-delay"));
        assert_eq!(code(&|p, _| p.pens[0].dwell = Some(Time::us(100.0))), None);
        for us in [4.0, 15.0, 1e6] {
            assert_eq!(code(&|p, _| p.pens[0].dwell = Some(Time::us(us))), Some("lmc-dwell"), "{us}");
        }
    }
}

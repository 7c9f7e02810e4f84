//! Reader of the lists for BJJCZ (LMC) cards: one `.lmc` file for every block.
//!
//! Consumes packets of 256 commands; hands over each stroke in file order, in units of the card, with the settings that
//! are in force. A stroke begins with a jump and is repeated for every pass. Whatever is not known, or comes before all
//! settings are set, is a fault with the number of its command.

use std::collections::BTreeMap;
use terrace_core::math;

use super::{BlockOf, Fault, FileStroke, Strokes};
use terrace_core::geom::{ControllerPoint, NM_PER_MM};
use terrace_core::machine::{LmcLaser, Machine};
use terrace_core::program::Pen;

// The commands of a list.
const JUMP_TO: u16 = 0x8001;
const END_OF_LIST: u16 = 0x8002;
const LASER_ON_POINT: u16 = 0x8003;
const WAIT: u16 = 0x8004;
const MARK_TO: u16 = 0x8005;
const JUMP_SPEED: u16 = 0x8006;
const LASER_ON_DELAY: u16 = 0x8007;
const LASER_OFF_DELAY: u16 = 0x8008;
const FREQUENCY: u16 = 0x800A;
const POWER_RATIO: u16 = 0x800B;
const MARK_SPEED: u16 = 0x800C;
const JUMP_DELAY: u16 = 0x800D;
const POLYGON_DELAY: u16 = 0x800F;
const WRITE_PORT: u16 = 0x8011;
const CURRENT: u16 = 0x8012;
const Q_SWITCH_PERIOD: u16 = 0x801B;
const READY_MARK: u16 = 0x8051;

/// Commands that set a value, in the order in which settings are handed over: of a fibre laser, and of a CO2 laser.
/// They differ in power and frequency.
const SET: [[u16; 2]; 8] = [
    [JUMP_SPEED, JUMP_SPEED],
    [CURRENT, POWER_RATIO],
    [Q_SWITCH_PERIOD, FREQUENCY],
    [MARK_SPEED, MARK_SPEED],
    [LASER_ON_DELAY, LASER_ON_DELAY],
    [LASER_OFF_DELAY, LASER_OFF_DELAY],
    [POLYGON_DELAY, POLYGON_DELAY],
    [JUMP_DELAY, JUMP_DELAY],
];

/// The places in [`SET`] of power and frequency, and those of the delays, which may be negative.
const OF_LASER: [usize; 2] = [1, 2];
const DELAYS: std::ops::Range<usize> = 4..8;

/// The wait until a fibre laser has opened, in 10 us.
const OPEN: i64 = 800;

/// A point in units of the card, of which 0x8000 is the optical axis.
pub(super) fn units(machine: &Machine, ControllerPoint { x, y }: ControllerPoint) -> [i64; 2] {
    let scale = machine.lmc.map_or(0.0, |lmc| lmc.units_per_mm);
    [x, y].map(|nm| 0x8000 + (f64::from(nm) * scale / NM_PER_MM).round() as i64)
}

/// The settings that a stroke with this pen should have.
pub(super) fn settings(of: &BlockOf<'_>, pen: &Pen) -> Vec<i64> {
    let (machine, scanner) = (of.machine, &of.machine.scanner);
    let Some(lmc) = machine.lmc else { return Vec::new() };
    let whole = |v: f64| v.round() as i64;
    let per_ms = |mm_s: f64| whole(mm_s * lmc.units_per_mm / 1e3);
    let share = pen.power.share(machine.laser.max_power);
    let khz = pen.frequency.as_khz();
    let (power, period, is_co2) = match lmc.laser {
        LmcLaser::Fiber => (whole(100.0 * share * 4095.0 / 100.0), whole(2e4 / khz), 0),
        LmcLaser::Co2 => (whole(200.0 * (100.0 * share) / khz), whole(1e4 / khz), 1),
    };
    let d = &machine.delays;
    let [on, off, polygon, jump] = [d.laser_on, d.laser_off, d.polygon, d.jump].map(|t| whole(t.as_us()));
    let wait = (d.mark.as_us() / 10.0).ceil() as i64;
    let speeds = [scanner.jump_speed, pen.speed].map(|v| per_ms(v.as_mm_s()));
    vec![speeds[0], power, period, speeds[1], on, off, polygon, jump, wait, is_co2]
}

/// Reads the list of a block. Settings are jump speed, power, period, mark speed, the delays of laser on, laser off,
/// polygon and jump, the wait after a stroke, 1 for a CO2 laser, and the dwell of a dot in 10 us.
pub(super) fn strokes(bytes: &[u8], visit: &mut Strokes<'_>) -> Result<(), Fault> {
    if bytes.is_empty() || !bytes.len().is_multiple_of(3072) {
        return Err(Fault::new(0, "is not made of packets of 3072 bytes"));
    }
    let mut reader = Reader { set: BTreeMap::new(), points: Vec::new(), dwell: None, wait: 0, visit };
    let (mut at, mut ended, mut opened) = ([0x8000; 2], false, 0);
    for (number, words) in (1..).zip(bytes.as_chunks::<12>().0) {
        let fault = |what: &str| Fault::new(number, what);
        let w: Vec<i64> = words.as_chunks().0.iter().map(|&pair| i64::from(u16::from_le_bytes(pair))).collect();
        let &[command, a, b, c, d, e] = w.as_slice() else { return Err(fault("is cut")) };
        if ended && command != i64::from(END_OF_LIST) {
            return Err(fault("something follows the end of the list"));
        }
        match command as u16 {
            // The last packet is filled with ends.
            END_OF_LIST if w[1..] == [0; 5] => {
                if !ended {
                    reader.finish(number)?;
                }
                ended = true;
            }
            READY_MARK if number == 1 && w[1..] == [0; 5] => {}
            WAIT if [b, c, d, e] == [0; 4] && number == 2 => opened = a,
            WRITE_PORT if number <= 3 && w[1..] == [1, 0, 0, 0, 0] => {}
            WAIT if [b, c, d, e] == [0; 4] && reader.is_whole() && reader.wait == 0 => reader.wait = a,
            LASER_ON_POINT if [b, c, d, e] == [0; 4] && reader.points.len() == 1 && reader.dwell.is_none() && a > 0 => {
                reader.dwell = Some(a);
            }
            JUMP_TO | MARK_TO => {
                let way = math::hypot((a - at[0]) as f64, (b - at[1]) as f64).floor().min(65535.0) as i64;
                if [c, e] != [0, 0] || d != way {
                    return Err(fault("the way or the angle of a move is not its own"));
                }
                at = [a, b];
                if command == i64::from(JUMP_TO) {
                    reader.finish(number)?;
                } else if reader.points.is_empty() || reader.wait > 0 || reader.dwell.is_some() {
                    return Err(fault("a mark follows no jump"));
                }
                reader.points.push(at);
            }
            code => {
                let place = SET.iter().position(|pair| pair.contains(&code)).filter(|_| [c, d, e] == [0; 3]);
                let place = place.ok_or_else(|| fault("is not a command that is expected here"))?;
                // A negative delay has its size first, and its sign second.
                let signed = DELAYS.contains(&place) && b == 0x8000;
                if b != 0 && !signed {
                    return Err(fault("a setting has a second value"));
                }
                reader.finish(number)?;
                reader.set.insert(place, (code, if signed { -a } else { a }));
            }
        }
    }
    let is_co2 = reader.set.get(&2).is_some_and(|s| s.0 == FREQUENCY);
    if !ended || (opened == OPEN) == is_co2 {
        return Err(Fault::new(0, "the list does not end, or does not wait for its laser to open"));
    }
    Ok(())
}

struct Reader<'a, 'v> {
    /// By place, the command and its value.
    set: BTreeMap<usize, (u16, i64)>,
    points: Vec<[i64; 2]>,
    dwell: Option<i64>,
    wait: i64,
    visit: &'a mut Strokes<'v>,
}

impl Reader<'_, '_> {
    /// Whether a line or a dot has been marked.
    fn is_whole(&self) -> bool {
        self.points.len() > 1 || self.dwell.is_some()
    }

    /// Hands over a stroke that has ended.
    fn finish(&mut self, number: usize) -> Result<(), Fault> {
        if self.points.is_empty() {
            return Ok(());
        }
        let mut settings: Vec<i64> = self.set.values().map(|s| s.1).collect();
        let lasers = OF_LASER.map(|place| self.set.get(&place).map(|s| s.0 == SET[place][1]));
        if settings.len() != SET.len() || lasers[0] != lasers[1] {
            return Err(Fault::new(number, "a stroke is marked before all settings of one laser are set"));
        }
        if !self.is_whole() {
            return Err(Fault::new(number, "a jump marks nothing"));
        }
        settings.extend([self.wait, i64::from(lasers[0] == Some(true))]);
        settings.extend(self.dwell.take());
        (self.visit)(FileStroke { pen: None, points: &self.points, settings: &settings });
        self.points.clear();
        self.wait = 0;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A list with a stroke of two marks, and its commands changed.
    fn list(change: impl FnOnce(&mut Vec<[u16; 6]>)) -> Vec<u8> {
        let set = [0x8006u16, 0x8012, 0x801B, 0x800C, 0x8007, 0x8008, 0x800F, 0x800D];
        let mut all = vec![[0x8051, 0, 0, 0, 0, 0], [0x8004, 800, 0, 0, 0, 0], [0x8011, 1, 0, 0, 0, 0]];
        all.extend(set.iter().zip(10..).map(|(&command, value)| [command, value, 0, 0, 0, 0]));
        all.push([0x8001, 0x8000, 0x8003, 0, 3, 0]);
        all.push([0x8005, 0x8004, 0x8000, 0, 5, 0]);
        all.push([0x8005, 0x8004, 0x8001, 0, 1, 0]);
        all.push([0x8004, 7, 0, 0, 0, 0]);
        change(&mut all);
        all.resize(256, [0x8002, 0, 0, 0, 0, 0]);
        all.iter().flatten().flat_map(|word| word.to_le_bytes()).collect()
    }

    type Change = &'static dyn Fn(&mut Vec<[u16; 6]>);
    type ReadStroke = (Vec<[i64; 2]>, Vec<i64>);

    fn read(bytes: &[u8]) -> Result<Vec<ReadStroke>, Fault> {
        let mut out = Vec::new();
        strokes(bytes, &mut |s| out.push((s.points.to_vec(), s.settings.to_vec())))?;
        Ok(out)
    }

    #[test]
    fn strokes_come_with_the_settings_in_force() {
        let points = vec![[0x8000, 0x8003], [0x8004, 0x8000], [0x8004, 0x8001]];
        let settings = vec![10, 11, 12, 13, 14, 15, 16, 17, 7, 0];
        assert_eq!(read(&list(|_| {})), Ok(vec![(points, settings)]));
        let found = read(&list(|all| all[7][2] = 0x8000)).expect("a negative delay");
        assert_eq!(found[0].1[4], -14);
    }

    #[test]
    fn malformed_lists_are_faults() {
        let changes: [Change; 13] = [
            &|all| all[12][4] = 6,
            &|all| all[12][3] = 1,
            &|all| _ = all.remove(11),
            &|all| _ = all.remove(5),
            &|all| all[4] = [0x800B, 1, 0, 0, 0, 0],
            &|all| all[3][2] = 1,
            &|all| all[3][0] = 0x8029,
            &|all| all[1][1] = 0,
            &|all| all.insert(12, [0x8002, 0, 0, 0, 0, 0]),
            &|all| all.truncate(12),
            &|all| all.push([0x8005, 0x8004, 0x8000, 0, 1, 0]),
            &|all| all[2][1] = 0,
            &|all| all.push([0x8003, 100, 0, 0, 0, 0]),
        ];
        for (i, change) in changes.iter().enumerate() {
            assert!(read(&list(change)).is_err(), "change {i}");
        }
        let bytes = list(|_| {});
        assert!(read(&bytes[..3000]).is_err() && read(&[]).is_err());
        let full = bytes.len() / 12;
        let endless: Vec<u8> =
            bytes[..14 * 12].iter().copied().chain(bytes[11 * 12..14 * 12].repeat(full)).take(3072).collect();
        assert!(read(&endless).is_err(), "no end");
    }
}

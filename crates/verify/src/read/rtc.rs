//! Reader of the lists for RTC boards: one `.rtc` text for every block.
//!
//! Consumes the text line by line; hands over each stroke in file order, in bits, with the settings that the list has
//! set. Settings do not outlive their list. Anything that is not known is a fault with its line.

use std::collections::{BTreeMap, BTreeSet};

use super::comments::printable;
use super::number::{integer, millionths};
use super::{BlockOf, Fault, FileStroke, Strokes};
use terrace_core::geom::{ControllerPoint, NM_PER_MM};
use terrace_core::machine::{Machine, RtcBoard};
use terrace_core::program::Pen;
use terrace_core::units::Time;

/// Settings in the order in which they are handed over, and how many numbers each has.
const SET: [(&str, usize); 7] = [
    ("laser_delays", 2),
    ("scanner_delays", 3),
    ("jump_speed", 1),
    ("power", 1),
    ("half_period", 1),
    ("mark_speed", 1),
    ("focus", 1),
];

/// A point in bits from the optical axis.
pub(super) fn units(machine: &Machine, ControllerPoint { x, y }: ControllerPoint) -> [i64; 2] {
    let scale = machine.rtc.map_or(0.0, |rtc| rtc.bits_per_mm);
    [x, y].map(|nm| (f64::from(nm) * scale / NM_PER_MM).round() as i64)
}

/// The settings that a stroke with this pen should have.
pub(super) fn settings(of: &BlockOf<'_>, pen: &Pen) -> Vec<i64> {
    let machine = of.machine;
    let Some(rtc) = machine.rtc else { return Vec::new() };
    // Units of laser delays and of pulse periods in one us.
    let (delay, period) = match rtc.board {
        RtcBoard::Rtc4 => (1.0, 8.0),
        RtcBoard::Rtc5 => (2.0, 64.0),
        RtcBoard::Rtc6 => (64.0, 64.0),
    };
    let d = &machine.delays;
    let laser = |t: Time| (t.as_us() * delay).round() as i64;
    // Scanner delays are in 10 us: rounded up, none is shorter than asked.
    let scanner = |t: Time| (t.as_us() / 10.0).ceil() as i64;
    let speed = |mm_s: f64| (mm_s * rtc.bits_per_mm / 1000.0 * 1e6).round() as i64;
    let power = pen.power.share(machine.laser.max_power) * 4095.0;
    let half = 500.0 / pen.frequency.as_khz() * period;
    let mut out = vec![laser(d.laser_on), laser(d.laser_off), scanner(d.jump), scanner(d.mark), scanner(d.polygon)];
    out.extend([speed(machine.scanner.jump_speed.as_mm_s()), power.round() as i64, half.round() as i64]);
    out.push(speed(pen.speed.as_mm_s()));
    out.extend(rtc.focus_bits_per_mm.map(|scale| (of.block.focus_shift.mm() * scale).round() as i64));
    out
}

/// Reads the lists of a block. Settings are those of [`SET`], speeds in millionths; the focus last, if it is set.
pub(super) fn strokes(bytes: &[u8], of: &BlockOf<'_>, visit: &mut Strokes<'_>) -> Result<(), Fault> {
    let Some(rtc) = of.machine.rtc else { return Err(Fault::new(0, "the machine has no RTC board")) };
    let board = match rtc.board {
        RtcBoard::Rtc4 => "rtc4",
        RtcBoard::Rtc5 => "rtc5",
        RtcBoard::Rtc6 => "rtc6",
    };
    lists(bytes, of.id, board, rtc.list_memory, visit)
}

/// Reads the lists of block `id` for a board, none of which may have more commands than `memory`.
fn lists(bytes: &[u8], id: &str, board: &str, memory: usize, visit: &mut Strokes<'_>) -> Result<(), Fault> {
    let text = printable(bytes)?;
    let head = format!("terrace rtc 1\nboard {board}\nblock {id}\n");
    let Some(rest) = text.strip_prefix(head.as_str()).filter(|_| text.ends_with('\n')) else {
        return Err(Fault::new(1, format!("does not begin as lists of block {id} for {board}, or is cut")));
    };
    let mut reader = Reader {
        memory,
        visit,
        lists: 0,
        is_open: false,
        commands: 0,
        strokes: 0,
        set: BTreeMap::new(),
        fresh: BTreeSet::new(),
        points: Vec::new(),
        dwell: None,
    };
    // Three lines are the head.
    for (number, line) in (4..).zip(rest.lines()) {
        reader.line(line).map_err(|what| Fault::new(number, what))?;
    }
    if reader.is_open || reader.lists == 0 {
        Err(Fault::new(text.lines().count(), "the last list has no end"))
    } else {
        Ok(())
    }
}

/// Reads lists command by command.
struct Reader<'a, 'v> {
    /// Most commands of a list.
    memory: usize,
    visit: &'a mut Strokes<'v>,
    /// How many lists have begun.
    lists: usize,
    is_open: bool,
    /// Commands and strokes of the open list.
    commands: usize,
    strokes: usize,
    /// By place in [`SET`], the settings of the open list.
    set: BTreeMap<usize, Vec<i64>>,
    /// Those that were set since the last stroke.
    fresh: BTreeSet<usize>,
    /// The stroke that is still open: its points, and of a dot the dwell.
    points: Vec<[i64; 2]>,
    dwell: Option<i64>,
}

impl Reader<'_, '_> {
    /// Takes one command; returns what is wrong with it.
    fn line(&mut self, line: &str) -> Result<(), String> {
        let words: Vec<&str> = line.split(' ').collect();
        if words[0] == "laser_on" && self.points.len() == 1 && self.dwell.is_none() {
            self.dwell = words.get(1).filter(|_| words.len() == 2).and_then(|ticks| integer(ticks.as_bytes()));
            if self.dwell.is_none_or(|ticks| ticks <= 0) {
                return Err("laser_on does not say how long".into());
            }
            self.commands += 1;
            return Ok(());
        }
        // A stroke ends before what is not a mark; a dot before anything.
        if (words[0] != "mark" || self.dwell.is_some()) && !self.points.is_empty() {
            self.end_stroke()?;
        }
        self.commands += 1;
        if self.is_open && self.commands > self.memory {
            return Err(format!("the list has more than {} commands", self.memory));
        }
        match words[..] {
            ["list", n] if !self.is_open && n.parse() == Ok(self.lists + 1) => {
                self.lists += 1;
                (self.is_open, self.commands, self.strokes) = (true, 0, 0);
                Ok(())
            }
            ["end"] if self.is_open => self.end_list(),
            ["jump" | "mark", x, y] if self.is_open && (words[0] == "jump" || !self.points.is_empty()) => {
                let point = integer(x.as_bytes()).zip(integer(y.as_bytes()));
                let (x, y) = point.ok_or("a coordinate is not a whole number")?;
                self.points.push([x, y]);
                Ok(())
            }
            [name, ref values @ ..] if self.is_open => self.setting(name, values),
            _ => Err(format!("{line:?} is not expected here")),
        }
    }

    /// Hands over the open stroke with the settings that are in force.
    fn end_stroke(&mut self) -> Result<(), String> {
        let settings: Vec<i64> = self.set.values().flatten().copied().chain(self.dwell).collect();
        // The focus, the last of them, is not set on every machine.
        let has_all = (0..SET.len() - 1).all(|place| self.set.contains_key(&place));
        if self.points.len() < 2 && self.dwell.is_none() || !has_all {
            return Err("the stroke before has one point, or not all settings".into());
        }
        (self.visit)(FileStroke { pen: None, points: &self.points, settings: &settings });
        self.strokes += 1;
        self.fresh.clear();
        self.points.clear();
        self.dwell = None;
        Ok(())
    }

    fn end_list(&mut self) -> Result<(), String> {
        if self.strokes == 0 {
            return Err("the list marks nothing".into());
        }
        if !self.fresh.is_empty() {
            return Err("a setting is set and nothing marked with it".into());
        }
        self.is_open = false;
        // Settings do not outlive their list.
        self.set.clear();
        Ok(())
    }

    fn setting(&mut self, name: &str, values: &[&str]) -> Result<(), String> {
        let place = SET.iter().position(|s| *s == (name, values.len()));
        let place = place.ok_or_else(|| format!("{name:?} is not expected here"))?;
        let number = |v: &&str| if name.ends_with("speed") { millionths(v.as_bytes()) } else { integer(v.as_bytes()) };
        let values: Option<Vec<i64>> = values.iter().map(number).collect();
        if !self.fresh.insert(place) {
            return Err(format!("{name} is set twice before a stroke"));
        }
        self.set.insert(place, values.ok_or_else(|| format!("a value of {name} is not a number"))?);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "terrace rtc 1\nboard rtc5\nblock B0001\nlist 1\nlaser_delays 100 -160\nscanner_delays 20 10 3\n\
        jump_speed 100000.5\npower 2457\nhalf_period 533\nmark_speed 20000.000001\njump -1 0\nmark 2 -3\nmark 4 5\n\
        jump 7 7\nmark 8 8\nend\n";

    type ReadStroke = (Vec<[i64; 2]>, Vec<i64>);

    fn read(text: &str) -> Result<Vec<ReadStroke>, Fault> {
        let mut out = Vec::new();
        lists(text.as_bytes(), "B0001", "rtc5", 20, &mut |s| out.push((s.points.to_vec(), s.settings.to_vec())))?;
        Ok(out)
    }

    #[test]
    fn strokes_come_with_the_settings_of_their_list() {
        let found = read(TEXT).expect("lists");
        let settings = vec![100, -160, 20, 10, 3, 100_000_500_000, 2457, 533, 20_000_000_001];
        assert_eq!(found[0], (vec![[-1, 0], [2, -3], [4, 5]], settings.clone()));
        assert_eq!(found[1], (vec![[7, 7], [8, 8]], settings));
        let focused = read(&TEXT.replace("power", "focus -9\npower")).expect("lists");
        assert_eq!(focused[0].1.last(), Some(&-9));
    }

    #[test]
    fn malformed_lists_are_faults() {
        for (from, to) in [
            ("rtc5", "rtc6"),
            ("B0001", "B0002"),
            ("list 1", "list 2"),
            ("power 2457\n", ""),
            ("power 2457\n", "power 2457\npower 2457\n"),
            ("end\n", "power 2457\nend\n"),
            ("power 2457", "power 2457 1"),
            ("power 2457", "power 1e3"),
            ("jump_speed 100000.5", "jump_speed 1e5"),
            ("jump 7 7\n", "jump 7 7\njump 7 7\n"),
            ("mark 2 -3", "mark 2.5 -3"),
            ("jump -1 0\n", ""),
            ("jump 7 7", "arc 7 7"),
            ("end\n", ""),
            ("end\n", "end\nend\n"),
            ("end\n", "end\nlist 2\njump 0 0\nmark 1 1\nend\n"),
            ("end\n", "end\nlist 2\nend\n"),
            (
                "mark 4 5\n",
                "mark 4 5\nmark 4 6\nmark 4 7\nmark 4 8\nmark 4 9\nmark 4 10\nmark 4 11\nmark 4 12\nmark 4 13\nmark 4 14\nmark 4 15\n",
            ),
        ] {
            assert!(TEXT.contains(from), "{from}");
            assert!(read(&TEXT.replacen(from, to, 1)).is_err(), "{from} -> {to}");
        }
        for end in 0..TEXT.len() {
            assert!(read(&TEXT[..end]).is_err(), "cut at {end}");
        }
    }
}

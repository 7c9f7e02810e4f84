//! Logs of probes, as controllers write them.
//!
//! LinuxCNC appends one row of nine positions to the file of `(PROBEOPEN ...)` for each probe move; GRBL answers each
//! with `[PRB:x,y,z:1]`, or `:0` where nothing was touched, among whatever else it says. Both count in mm here: the
//! programs that terrace writes set G21. LinuxCNC counts from the zero of the program, GRBL from that of the machine,
//! whatever G54 says; where the zero of G54 lies stands in what `$#` answers. Status reports (WCO) do not say it alone: they
//! hold the offsets of G92 and of tools, which the programs switch off, and without which marks are made. `$#` also
//! repeats the last touch, which does not count twice.

use std::path::Path;

use super::MAX_POINTS;
use super::table::text_of;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::SpacePoint;

/// What a log holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MarkedLog {
    /// Positions of the axes at which the probe has touched, mm, each with its line.
    pub touched: Vec<(usize, SpacePoint)>,
    /// Lines of probe moves that touched nothing.
    pub missed: Vec<usize>,
    /// Where the zero of programs lies in these positions, mm.
    pub zero: LoggedZero,
}

/// What a log says of where the zero of programs lies.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum LoggedZero {
    /// Nothing.
    #[default]
    None,
    /// There, mm.
    At(SpacePoint),
    /// Several places, or one that holds other offsets: why it is not known.
    Unclear(String),
}

/// Positions of a row of LinuxCNC: x y z a b c u v w.
const LINUXCNC_NUMBERS: usize = 9;

/// Reads the log of a probe.
///
/// # Errors
/// `file-unreadable`; `probe-log` where a line is neither, or nothing was touched.
pub fn read_log(path: &Path) -> Result<MarkedLog, Error> {
    let shown = path.display().to_string();
    let text = text_of(path)?;
    let mut log = MarkedLog::default();
    // A log of GRBL holds all else that it says; one of LinuxCNC holds positions alone.
    let is_grbl = text.contains("[PRB:");
    if !is_grbl {
        log.zero = LoggedZero::At([0.0; 3]);
    }
    let mut zeros = Zeros::default();
    let mut is_repeated = false;
    for (line, row) in (1..).zip(text.lines()) {
        let row = row.trim();
        let fault = || {
            let start: String = row.chars().take(60).collect();
            let d = Diag::input("probe-log", format!("{start:?} is not the position of a probe"));
            Error::from(d.at(Place::line(&shown, line)).hint(HINT))
        };
        if is_grbl {
            zeros.take(row);
            // The answer of `$#` ends with the length of the tool and the last touch.
            let was_tool = std::mem::replace(&mut is_repeated, row.contains("[TLO:"));
            let Some(at) = row.find("[PRB:") else { continue };
            if was_tool {
                continue;
            }
            let answer =
                row[at + 5..].split_once(']').and_then(|(answer, _)| answer.split_once(':')).ok_or_else(fault)?;
            let position = numbers(answer.0.split(',')).filter(|n| n.len() >= 3).ok_or_else(fault)?;
            match answer.1 {
                "1" => log.touched.push((line, [position[0], position[1], position[2]])),
                "0" => log.missed.push(line),
                _ => return Err(fault()),
            }
        } else if !row.is_empty() {
            let position = numbers(row.split_whitespace()).filter(|n| n.len() == LINUXCNC_NUMBERS).ok_or_else(fault)?;
            log.touched.push((line, [position[0], position[1], position[2]]));
        }
        if log.touched.len() > MAX_POINTS {
            let d = Diag::limit("probe-log", format!("the log holds more than {MAX_POINTS} points"));
            return Err(d.at(Place::line(&shown, line)).into());
        }
    }
    if is_grbl {
        log.zero = zeros.found();
    }
    if log.touched.is_empty() {
        let text = if log.missed.is_empty() { "the log holds no point" } else { "the probe has touched nothing" };
        return Err(Diag::input("probe-log", text).at(Place::file(shown)).hint(HINT).into());
    }
    Ok(log)
}

/// What GRBL has said of the zero of programs.
#[derive(Default)]
struct Zeros {
    /// Whole offsets, of status reports.
    whole: Vec<SpacePoint>,
    /// Of G54, of G92 and of the tool, in what `$#` has answered.
    parts: [Vec<SpacePoint>; 3],
}

impl Zeros {
    fn take(&mut self, row: &str) {
        let after = |key: &str, end: [char; 2]| {
            let rest = &row[row.find(key)? + key.len()..];
            numbers(rest[..rest.find(end)?].split(','))
        };
        let point = |n: Vec<f64>| (n.len() >= 3).then(|| [n[0], n[1], n[2]]);
        self.whole.extend(after("|WCO:", ['|', '>']).and_then(point));
        self.parts[0].extend(after("[G54:", [']', ']']).and_then(point));
        self.parts[1].extend(after("[G92:", [']', ']']).and_then(point));
        self.parts[2].extend(after("[TLO:", [']', ']']).map(|n| match n[..] {
            [x, y, z, ..] => [x, y, z],
            _ => [0.0, 0.0, n[0]],
        }));
    }

    /// The one zero of G54 that it has said.
    fn found(&self) -> LoggedZero {
        let [g54, others @ ..] = &self.parts;
        let near = |a: &SpacePoint, b: &SpacePoint| (0..3).all(|k| (a[k] - b[k]).abs() < 1.5e-3);
        let is_one = |all: &[SpacePoint]| all.windows(2).all(|w| near(&w[0], &w[1]));
        let has_offset = others.iter().flatten().flatten().any(|v| *v != 0.0);
        let Some(zero) = g54.last() else {
            return match self.whole[..] {
                [] => LoggedZero::None,
                [..] => LoggedZero::Unclear(
                    "status reports (WCO) do not say where the zero of G54 lies: they hold offsets of G92 and of tools too"
                        .to_owned(),
                ),
            };
        };
        if !is_one(g54) {
            LoggedZero::Unclear("the zero of G54 changes in the log".to_owned())
        } else if !has_offset && !self.whole.iter().all(|whole| near(whole, zero)) {
            LoggedZero::Unclear("status reports (WCO) and $# do not have the same zero of G54".to_owned())
        } else {
            LoggedZero::At(*zero)
        }
    }
}

const HINT: &str = "give the file that LinuxCNC has written after (PROBEOPEN ...), or what GRBL has answered, with its \
                    [PRB:...] lines";

fn numbers<'a>(fields: impl Iterator<Item = &'a str>) -> Option<Vec<f64>> {
    fields.map(|field| field.trim().parse::<f64>().ok().filter(|v| v.is_finite() && v.abs() < 1e5)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<MarkedLog, String> {
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), text).expect("written");
        read_log(file.path()).map_err(|e| e.diags()[0].message.clone())
    }

    #[test]
    fn logs_of_both_controllers_are_read() {
        let linuxcnc = "1.5 2.25 -3 0 0 0 0 0 0\n2.5 2.25 -3.125000 0 0 0 0 0 0\n";
        assert_eq!(read(linuxcnc).expect("a log").touched, [(1, [1.5, 2.25, -3.0]), (2, [2.5, 2.25, -3.125])]);
        let grbl = "Grbl 1.1h ['$' for help]\nok\n[PRB:1.5,2.25,-3.000:1]\nok\n[PRB:0.000,0.000,-9.000:0]\nALARM:5\n";
        let log = read(grbl).expect("a log");
        assert_eq!((log.touched, log.missed, log.zero), (vec![(3, [1.5, 2.25, -3.0])], vec![5], LoggedZero::None));
    }

    #[test]
    fn the_zero_of_programs_is_read_from_what_grbl_says_of_it() {
        let touch = "[PRB:1.5,2.25,-3.000:1]\n";
        let zero = |text: &str| read(&format!("{text}{touch}")).expect("a log").zero;
        let at = LoggedZero::At;
        assert_eq!(
            zero("[G54:-10.000,5.000,0.000]\n[G92:0.000,0.000,0.000]\n[TLO:0.000]\nok\n"),
            at([-10.0, 5.0, 0.0])
        );
        // Touches are counted from the machine's zero, whatever other offsets are.
        assert_eq!(
            zero(
                "[G54:-10.000,5.000,0.000]\n[G92:0.000,0.000,1.000]\n[TLO:0.000]\nok\n<Idle|WCO:-10.000,5.000,1.000>\n"
            ),
            at([-10.0, 5.0, 0.0])
        );
        assert_eq!(zero("[TLO:0.000,0.000,2.000]\n[G54:1.000,2.000,3.000]\n"), at([1.0, 2.0, 3.0]));
        let is_unclear = |text: &str| matches!(zero(text), LoggedZero::Unclear(_));
        assert!(is_unclear("[G54:1.000,2.000,3.000]\n[G54:1.000,2.000,3.500]\n"));
        assert!(is_unclear("[G54:1.000,2.000,3.000]\n<Run|WCO:0.000,2.000,3.000>\n"));
        assert!(is_unclear("<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:-10.000,5.000,3.000>\n"));
        assert_eq!(read("1.5 2.25 -3 0 0 0 0 0 0\n").expect("a log").zero, at([0.0; 3]));
    }

    #[test]
    fn the_last_touch_that_grbl_repeats_counts_once() {
        let settings = "[G54:0.000,0.000,0.000]\n[G92:0.000,0.000,0.000]\n[TLO:0.000]\n";
        let text = format!(
            "{settings}[PRB:9.000,9.000,9.000:1]\nok\n[PRB:1.000,2.000,3.000:1]\nok\n[PRB:4.000,5.000,6.000:1]\nok\n\
             {settings}[PRB:4.000,5.000,6.000:1]\nok\n"
        );
        let log = read(&text).expect("a log");
        let touched: Vec<[f64; 3]> = log.touched.iter().map(|(_, at)| *at).collect();
        assert_eq!(touched, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        let missed = read(&format!("{settings}[PRB:0.000,0.000,0.000:0]\nok\n[PRB:1,2,3:1]\n")).expect("a log");
        assert!(missed.missed.is_empty());
    }

    #[test]
    fn what_is_no_log_is_refused() {
        assert_eq!(read(""), Err("the log holds no point".to_owned()));
        assert_eq!(read("[PRB:0,0,0:0]\n"), Err("the probe has touched nothing".to_owned()));
        assert_eq!(read("1 2 3\n"), Err("\"1 2 3\" is not the position of a probe".to_owned()));
        assert!(
            read("[PRB:1,2:1]\n").is_err() && read("[PRB:1,2,nan:1]\n").is_err() && read("[PRB:1,2,3:7]\n").is_err()
        );
    }
}

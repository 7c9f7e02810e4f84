//! What GRBL sends, line by line.

/// One line of GRBL.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Reply {
    /// The line was taken.
    Ok,
    /// The line was refused, with GRBL's number.
    Error(u8),
    /// GRBL has locked itself, with its number.
    Alarm(u8),
    /// GRBL has started anew.
    Banner,
    /// An answer to `?`.
    Report(Report),
    /// A setting of `$$`.
    Setting(u16, f64),
    /// The offset of G54, nm, from `$#`.
    G54([i64; 3]),
    /// Anything else: messages, `$I`.
    Other(String),
}

/// A status report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Report {
    pub(super) state: State,
    /// Position, nm.
    pub(super) position: [i64; 3],
    /// Whether the position is in work coordinates; in machine coordinates otherwise.
    pub(super) is_work: bool,
    /// Work offset, nm, where the report has it: machine minus work position.
    pub(super) offset: Option<[i64; 3]>,
    /// Whether it shows the spindle output on.
    pub(super) is_on: bool,
}

/// GRBL's state; holds and doors with whether the motion has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Idle,
    Run,
    Hold { has_ended: bool },
    Jog,
    Alarm,
    Door { has_ended: bool },
    Check,
    Home,
    Sleep,
}

impl State {
    fn parse(text: &str) -> Option<Self> {
        let (name, part) = text.split_once(':').unwrap_or((text, ""));
        Some(match name {
            "Idle" => Self::Idle,
            "Run" => Self::Run,
            "Hold" => Self::Hold { has_ended: part == "0" },
            "Jog" => Self::Jog,
            "Alarm" => Self::Alarm,
            "Door" => Self::Door { has_ended: part == "0" || part == "1" },
            "Check" => Self::Check,
            "Home" => Self::Home,
            "Sleep" => Self::Sleep,
            _ => return None,
        })
    }

    /// Whether axes may be in motion.
    pub(super) fn moves(self) -> bool {
        let rests = [Self::Idle, Self::Alarm, Self::Check, Self::Sleep];
        !rests.contains(&self) && !matches!(self, Self::Hold { has_ended: true } | Self::Door { has_ended: true })
    }

    /// The state in words.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Run => "running",
            Self::Hold { .. } => "held (feed hold)",
            Self::Jog => "jogging",
            Self::Alarm => "locked by an alarm",
            Self::Door { .. } => "stopped by the safety door",
            Self::Check => "in check mode ($C)",
            Self::Home => "homing",
            Self::Sleep => "asleep ($SLP)",
        }
    }
}

impl Reply {
    /// Reads one line; a line that is not whole or not known is [`Reply::Other`].
    pub(super) fn parse(line: &str) -> Self {
        Self::known(line).unwrap_or_else(|| Self::Other(line.to_owned()))
    }

    fn known(line: &str) -> Option<Self> {
        if line == "ok" {
            return Some(Self::Ok);
        }
        if let Some(number) = line.strip_prefix("error:") {
            return Some(Self::Error(number.parse().ok()?));
        }
        if let Some(number) = line.strip_prefix("ALARM:") {
            return Some(Self::Alarm(number.parse().ok()?));
        }
        if line.starts_with("Grbl") && line.ends_with(']') {
            return Some(Self::Banner);
        }
        if let Some(setting) = line.strip_prefix('$') {
            let (number, value) = setting.split_once('=')?;
            return Some(Self::Setting(number.parse().ok()?, value.parse().ok()?));
        }
        if let Some(offset) = line.strip_prefix("[G54:").and_then(|l| l.strip_suffix(']')) {
            return Some(Self::G54(triple(offset)?));
        }
        report(line.strip_prefix('<')?.strip_suffix('>')?).map(Self::Report)
    }
}

fn report(text: &str) -> Option<Report> {
    let mut fields = text.split('|');
    let state = State::parse(fields.next()?)?;
    let (kind, position) = fields.next()?.split_once(':')?;
    let is_work = match kind {
        "WPos" => true,
        "MPos" => false,
        _ => return None,
    };
    let mut report = Report { state, position: triple(position)?, is_work, offset: None, is_on: false };
    for (name, value) in fields.filter_map(|field| field.split_once(':')) {
        match name {
            "WCO" => report.offset = Some(triple(value)?),
            "A" => report.is_on = value.contains(['S', 'C']),
            _ => {}
        }
    }
    Some(report)
}

/// Three values in mm as nm.
fn triple(text: &str) -> Option<[i64; 3]> {
    let values: Vec<i64> = text.split(',').map(nm).collect::<Option<_>>()?;
    values.try_into().ok()
}

fn nm(text: &str) -> Option<i64> {
    let mm: f64 = text.parse().ok()?;
    (mm.abs() < 1e6).then(|| (mm * 1e6).round() as i64)
}

/// What an alarm means, in the words of GRBL's list.
pub(super) fn alarm(number: u8) -> &'static str {
    match number {
        1 => "a limit switch was hit",
        2 => "the target is beyond the soft limits",
        3 => "reset in motion",
        4 | 5 => "probing failed",
        6..=9 => "homing failed",
        _ => "not in the list of GRBL 1.1",
    }
}

/// What an error means, of those that a move can meet.
pub(super) fn error(number: u8) -> &'static str {
    match number {
        1 | 2 => "a word of the line is damaged",
        8 => "not idle",
        9 => "locked",
        11 => "the line is too long",
        20 => "a word that it does not know",
        _ => "see its list of error codes",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replies_of_the_documentation_are_read() {
        let report = |line| match Reply::parse(line) {
            Reply::Report(report) => report,
            other => panic!("{line}: {other:?}"),
        };
        let idle = report("<Idle|MPos:0.000,-10.000,5.001|FS:0,0|WCO:0.000,1.551,5.664>");
        assert_eq!((idle.state, idle.is_work, idle.position), (State::Idle, false, [0, -10_000_000, 5_001_000]));
        assert_eq!(idle.offset, Some([0, 1_551_000, 5_664_000]));
        let held = report("<Hold:1|WPos:-2.500,0.000,11.000|Bf:15,128|Ov:100,100,100|A:SF>");
        assert!(held.state == State::Hold { has_ended: false } && held.is_work && held.is_on && held.state.moves());
        assert!(!report("<Door:1|MPos:0.000,0.000,0.000|Pn:D>").state.moves());
        assert_eq!(Reply::parse("Grbl 1.1h ['$' for help]"), Reply::Banner);
        assert_eq!(Reply::parse("ALARM:3"), Reply::Alarm(3));
        assert_eq!(Reply::parse("$100=250.000"), Reply::Setting(100, 250.0));
        assert_eq!(Reply::parse("[G54:0.000,1.500,-2.000]"), Reply::G54([0, 1_500_000, -2_000_000]));
    }

    #[test]
    fn damaged_lines_are_not_taken_for_anything() {
        for line in [
            "<Idle|MPos:0.000,0.000,0.000",
            "<Idl|MPos:0,0,0>",
            "<Idle|MPos:0,0>",
            "<Idle|MPos:0,,0>",
            "error:",
            "k",
            "",
        ] {
            assert_eq!(Reply::parse(line), Reply::Other(line.into()));
        }
        assert_eq!(Reply::parse("<Idle|MPos:nan,0,0>"), Reply::Other("<Idle|MPos:nan,0,0>".into()));
    }
}

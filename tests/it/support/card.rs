//! A scan card with START and BUSY: its laser is on for a time after START, and BUSY says so, or does not.

use std::time::{Duration, Instant, SystemTime};

/// How a card answers to START.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Card {
    /// BUSY is high while the laser is on.
    Works,
    /// BUSY never rises.
    Dead,
    /// BUSY rises and never falls.
    Stuck,
    /// BUSY is high before START.
    Busy,
    /// BUSY is low while the laser is on.
    Inverted,
    /// BUSY is a contact: for 12 ms after each edge it opens and closes every 3 ms.
    Bouncing,
    /// BUSY drops for 20 ms in the middle of a mark.
    Dropout,
    /// BUSY rises so many s after the laser is on.
    Late(f64),
}

/// Seconds since 1970, and those that were skipped.
#[derive(Clone, Debug)]
pub struct Clock {
    begin: Instant,
    skipped: f64,
}

impl Clock {
    pub fn start() -> Self {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("after 1970");
        Self { begin: Instant::now(), skipped: since.as_secs_f64() }
    }
    pub fn now(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() + self.skipped
    }
    pub fn skip(&mut self, s: f64) {
        self.skipped += s;
    }
}

/// When the laser was on.
#[derive(Clone, Debug)]
pub struct Marks {
    /// From when to when, s.
    pub on: Vec<[f64; 2]>,
    /// How long after START it begins, and how long it lasts, s.
    pub times: [f64; 2],
}

impl Default for Marks {
    fn default() -> Self {
        Self { on: Vec::new(), times: [0.004, 0.02] }
    }
}

impl Marks {
    /// START rises. A card that marks already takes no notice.
    pub fn start(&mut self, now: f64) {
        let [delay, width] = self.times;
        if self.on.last().is_none_or(|mark| mark[1] <= now) {
            self.on.push([now + delay, now + delay + width]);
        }
    }
    pub fn is_on(&self, now: f64) -> bool {
        self.on.iter().any(|[from, to]| (*from..*to).contains(&now))
    }
}

impl Card {
    /// BUSY at a time.
    pub fn busy(self, marks: &Marks, now: f64) -> bool {
        let is_on = marks.is_on(now);
        let last = marks.on.iter().rfind(|[from, _]| *from <= now);
        match self {
            Self::Works => is_on,
            Self::Dead => false,
            Self::Stuck => last.is_some(),
            Self::Busy => true,
            Self::Inverted => !is_on,
            Self::Bouncing => {
                let since = last.map(|[from, to]| now - if now < *to { *from } else { *to });
                is_on != since.is_some_and(|s| s < 0.012 && (s / 0.003) as i64 % 2 == 1)
            }
            Self::Dropout => is_on && last.is_none_or(|[from, to]| ((from + to) / 2.0 - now).abs() > 0.01),
            Self::Late(s) => is_on && last.is_some_and(|[from, _]| now >= from + s),
        }
    }

    /// How long after `now` BUSY has a level; None where it has not within `longest`. To the ms, as a control sees it.
    pub fn reaches(self, marks: &Marks, wanted: bool, now: f64, longest: f64) -> Option<f64> {
        let ms = (longest * 1e3) as u32;
        (0..=ms).map(|ms| f64::from(ms) / 1e3).find(|s| self.busy(marks, now + s) == wanted)
    }
}

/// Whether two times have any of both in common.
pub fn overlap([a, b]: [f64; 2], [c, d]: [f64; 2]) -> bool {
    a < d && c < b
}

/// Waits until something is so; panics with `what` after so long.
#[track_caller]
pub fn until(what: &str, longest: Duration, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < longest, "{what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

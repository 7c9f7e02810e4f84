//! What a long command is doing: on a terminal a line that is drawn again and again, elsewhere a line every ten
//! seconds.

use std::io::IsTerminal;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use terrace_core::diag::escaped;

/// How often a run that is not watched on a terminal says what it is doing.
const EVERY: Duration = Duration::from_secs(10);

/// A step of the work, when it began, and how far it is.
#[derive(Clone, Debug)]
struct Step {
    text: String,
    begin: Instant,
    /// The percent shown last, and when; None where it is not known how far the step is.
    done: Option<(u8, Instant)>,
}

impl Step {
    /// How far a step is, which begins if it is another one than before.
    fn show(&mut self, text: &str, percent: u8) {
        let now = Instant::now();
        if self.text != text {
            (self.text, self.begin) = (text.to_owned(), now);
        }
        self.done = Some((percent, now));
    }

    /// "step 2 of 6: tracing the texture  45 %, 12 s, 15 s left".
    fn line(&self, now: Instant) -> String {
        let Self { text, begin, done } = self;
        let spent = seconds(now.duration_since(*begin));
        match done {
            None => format!("{text}, {spent}"),
            Some((percent @ (0 | 100..), _)) => format!("{text}  {percent} %, {spent}"),
            Some((percent, at)) => {
                let [spent_so_far, at_last_percent] = [now, *at].map(|time| time.duration_since(*begin));
                // As fast as until the last percent, of which some time has passed again.
                let as_before = at_last_percent.mul_f64(100.0 / f64::from(*percent)).saturating_sub(spent_so_far);
                // The next percent is not there yet, so the rest takes as long as this at least: a step that stands
                // still has more and more left, and never nothing.
                let next = f64::from(percent + 1);
                let at_least = spent_so_far.mul_f64((100.0 - next) / next);
                format!("{text}  {percent} %, {spent}, {} left", seconds(as_before.max(at_least)))
            }
        }
    }
}

/// A time in whole seconds, as a person reads it.
fn seconds(time: Duration) -> String {
    match time.as_secs_f64().round() as u64 {
        s @ 0..60 => format!("{s} s"),
        s @ 60..3600 => format!("{} min {} s", s / 60, s % 60),
        s => format!("{} h {} min", s / 3600, s / 60 % 60),
    }
}

/// The steps of a command as they are shown.
pub struct Steps {
    bar: ProgressBar,
    step: Arc<Mutex<Step>>,
    /// The thread that writes lines ends with this.
    _lines: Option<Sender<()>>,
}

impl Steps {
    pub fn new(quiet: bool) -> Self {
        let step = Arc::new(Mutex::new(Step { text: String::new(), begin: Instant::now(), done: None }));
        let is_watched = std::io::stderr().is_terminal();
        let bar = if quiet || !is_watched { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        if let Ok(style) = ProgressStyle::with_template("{spinner} {step}") {
            let shown = Arc::clone(&step);
            let line = move |_: &ProgressState, to: &mut dyn std::fmt::Write| {
                let _ = to.write_str(&locked(&shown).line(Instant::now()));
            };
            bar.set_style(style.with_key("step", line));
        }
        bar.enable_steady_tick(Duration::from_millis(120));
        let lines = (!quiet && !is_watched).then(|| {
            let ((end, ended), step) = (channel(), Arc::clone(&step));
            std::thread::spawn(move || say_every(EVERY, &step, &ended, &mut |line| super::eprintln_all(line)));
            end
        });
        Self { bar, step, _lines: lines }
    }

    /// Begins a step of which nobody knows how far it is.
    pub fn begin(&self, text: impl Into<String>) {
        *locked(&self.step) = Step { text: plain(text), begin: Instant::now(), done: None };
    }

    /// Says how far a step is, which begins if it is another one than before.
    pub fn show(&self, text: &str, percent: u8) {
        locked(&self.step).show(text, percent);
    }

    /// Changes what is being done within a step that continues.
    #[cfg(feature = "compare")]
    pub fn rename(&self, text: impl Into<String>) {
        locked(&self.step).text = plain(text);
    }

    /// Says how far the step is, whatever it is.
    #[cfg(feature = "compare")]
    pub fn percent(&self, percent: u8) {
        locked(&self.step).done = Some((percent, Instant::now()));
    }

    /// Says how far phases are, each with its number and what `name` says of it.
    pub fn numbered<'p, P: Copy + PartialEq>(
        &self,
        phases: &'p [P],
        name: fn(P) -> &'static str,
    ) -> impl Fn(P, u8) + use<'p, P> {
        let step = Arc::clone(&self.step);
        move |phase, percent| {
            let number = phases.iter().position(|&p| p == phase).map_or(0, |i| i + 1);
            locked(&step).show(&format!("step {number} of {}: {}", phases.len(), name(phase)), percent);
        }
    }

    /// Does what writes to stderr while nothing is drawn there.
    pub fn suspend(&self, write: impl FnOnce()) {
        self.bar.suspend(write);
    }

    /// Ends it: results and messages begin on a clean line.
    pub fn done(self) {}
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A text that a terminal shows and does not act on: it may hold names of files.
fn plain(text: impl Into<String>) -> String {
    escaped(&text.into()).into_owned()
}

fn locked(step: &Mutex<Step>) -> MutexGuard<'_, Step> {
    step.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Says what is being done, and how far it is, whenever `every` has passed.
fn say_every(every: Duration, step: &Mutex<Step>, ended: &Receiver<()>, say: &mut dyn FnMut(&str)) {
    let mut next = Instant::now() + every;
    while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(next.saturating_duration_since(Instant::now())) {
        let line = locked(step).line(Instant::now());
        say(&line);
        next += every;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(begin: Instant, s: f64) -> Instant {
        begin + Duration::from_secs_f64(s)
    }

    #[test]
    fn a_line_has_percent_time_so_far_and_time_left() {
        let begin = Instant::now();
        let text = "step 2 of 6: tracing the texture".to_owned();
        let step = |done| Step { text: text.clone(), begin, done };
        let at = |done, s| step(done).line(after(begin, s));
        assert_eq!(at(Some((45, after(begin, 12.0))), 12.0), format!("{text}  45 %, 12 s, 15 s left"));
        // What has passed since the percent was shown is not left any more, as long as the next one may come by then.
        assert_eq!(at(Some((45, after(begin, 12.0))), 12.2), format!("{text}  45 %, 12 s, 14 s left"));
        // It has not come: the rest takes 54 / 46 of the time so far at least.
        assert_eq!(at(Some((45, after(begin, 12.0))), 70.0), format!("{text}  45 %, 1 min 10 s, 1 min 22 s left"));
        assert_eq!(at(Some((9, after(begin, 9.0))), 209.0), format!("{text}  9 %, 3 min 29 s, 31 min 21 s left"));
        assert_eq!(at(Some((0, begin)), 3.0), format!("{text}  0 %, 3 s"), "nothing is known of what is left");
        assert_eq!(at(Some((100, after(begin, 9.0))), 9.0), format!("{text}  100 %, 9 s"));
        assert_eq!(at(None, 3.0), format!("{text}, 3 s"));
        assert_eq!(at(Some((1, after(begin, 60.0))), 60.0), format!("{text}  1 %, 1 min 0 s, 1 h 39 min left"));
    }

    #[test]
    fn a_step_begins_with_its_name() {
        let steps = Steps::new(true);
        let now = || locked(&steps.step).clone();
        steps.show("reading", 0);
        let begin = now().begin;
        steps.show("reading", 60);
        assert_eq!((now().begin, now().done.map(|d| d.0)), (begin, Some(60)));
        std::thread::sleep(Duration::from_millis(2));
        steps.numbered(&[1, 2], |_| "writing")(2, 0);
        assert_eq!((now().text.as_str(), now().done.map(|d| d.0)), ("step 2 of 2: writing", Some(0)));
        assert!(now().begin > begin);
        let begin = now().begin;
        steps.rename("comparing");
        steps.percent(70);
        assert_eq!((now().text.as_str(), now().begin, now().done.map(|d| d.0)), ("comparing", begin, Some(70)));
        steps.begin("waiting");
        assert!(now().done.is_none() && now().text == "waiting");
    }

    #[test]
    fn a_run_that_is_not_watched_says_one_line_whenever_time_has_passed() {
        let step = Mutex::new(Step { text: "cutting strokes".into(), begin: Instant::now(), done: None });
        let (end, ended) = channel();
        let mut lines = Vec::new();
        let mut end = Some(end);
        say_every(Duration::from_millis(5), &step, &ended, &mut |line| {
            lines.push(line.to_owned());
            locked(&step).done = Some((40, Instant::now()));
            if lines.len() == 3 {
                end.take();
            }
        });
        assert_eq!(lines[0], "cutting strokes, 0 s");
        assert!(lines[1..].iter().all(|line| line.starts_with("cutting strokes  40 %, 0 s, ")), "{lines:?}");
        // What ends before says nothing.
        let (end, ended) = channel::<()>();
        drop(end);
        say_every(Duration::from_secs(60), &step, &ended, &mut |line| panic!("{line}"));
    }
}
